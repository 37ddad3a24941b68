// A client of voxeld: layers, entities and frames, and a receipt for every commit.
//
//   auto session = Session::Open({.client_name = "hello"});
//   auto layer = (*session)->GetLayer("lines");
//   auto handle = layer.Put("edge", Segments{.vertices = {.positions = {0, 0, 0, 1, 1, 1}}});
//   auto frame = (*session)->Commit();
//   auto receipt = (*session)->WaitShown(*frame, std::chrono::seconds(5));
//
// Only calls that begin with Wait, and Close, block. Drawing calls stage operations, a commit moves
// the staged operations into a queue, and a thread of the session maintains the connection. A full
// queue rejects (ResourceExhausted) what it cannot hold. Retained operations in it are never
// dropped; Options::flow decides which immediate frames are.
//
// A lost connection is reopened after increasing pauses. The previous session is resumed if the
// server still has it; else the session's retained state is sent again. In both cases, commits that
// had no answer are sent again in their order.
//
// Thread-safe, except that a Frame is for one thread at a time. Errors are returned as statuses;
// nothing throws.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "voxeld/credentials.h"
#include "voxeld/drawing.h"
#include "voxeld/receipt.h"

namespace voxeld::client {

class RunningCore;
class SessionCore;
struct UpsertOperation;

using Duration = std::chrono::nanoseconds;

// Decides what the server does with the session's layers when its stream ends.
enum class OnDisconnect : uint8_t {
  kClear,   // they are removed at once
  kLinger,  // they are removed after Options::linger; a reconnect within it resumes
  kKeep,    // they stay until somebody clears them
};

// Which immediate frames are dropped while they wait here or in the server. Retained operations
// always wait, and a commit with a present_at is never dropped.
enum class Flow : uint8_t {
  kReliable,    // none; but see Options::buffer_bytes
  kLatest,      // all but the newest of each layer
  kDropOldest,  // all but the Options::drop_oldest_frames newest of each layer
};

struct ConnectionChange {
  enum class Kind : uint8_t {
    kOpened,    // opened for the first time
    kResumed,   // resumed: the server had kept the session and its layers
    kRestored,  // the server had not kept it: the retained state was sent again
    kLost,      // `status` says why; the session reconnects
    kEnded,     // ended for good
    // the server had not kept it and Options::restore is false: the former content is lost
    kReopened,
  };
  Kind kind = Kind::kOpened;
  absl::Status status;
  // kRestored, kReopened: accepted commits whose outcomes will not come.
  uint64_t lost_outcomes = 0;
};

struct Options {
  std::string address;  // HOST:PORT, tls:HOST:PORT or unix:PATH; empty: DefaultAddress()
  std::optional<Credentials> credentials;  // nothing: DefaultCredentials()
  std::string client_name;                 // a label for people
  OnDisconnect on_disconnect = OnDisconnect::kClear;
  Duration linger{0};
  bool strict = false;   // one refused operation refuses its whole commit
  bool outcomes = true;  // false: commits get only accepted or refused as an answer
  // Joins the owner whose ServerInfo gave this token; empty: a new owner. If that owner does not
  // exist, the session ends, but only before it was opened: later, for example after a restart of
  // the server, it continues as a new owner (server()).
  std::string owner_token;

  // Over a unix socket, if the server offers it: hand over content of at least 64 KiB in sealed
  // memory instead of sending it. If that fails, the content is sent.
  bool local_memory = true;

  Flow flow = Flow::kReliable;
  uint32_t drop_oldest_frames = 1;
  // Size limit of the commits that wait here. When it is reached: with kReliable and a connection,
  // the next commit is rejected; without a connection, and under the other policies, the oldest
  // frames of each layer that has newer ones are dropped and counted.
  size_t buffer_bytes = size_t{64} << 20;
  // Approximate size limit of what is staged for the next commit. Beyond it, staging is rejected
  // (ResourceExhausted), except for the first operation.
  size_t most_staged_bytes = size_t{256} << 20;
  // HasRoom: true while fewer commits than this lack some of their answers.
  uint64_t most_unsettled = 4;

  bool reconnect = true;
  bool restore = true;  // keep the retained state, to send it again after a reconnect
  Duration first_pause = std::chrono::milliseconds(100);
  Duration longest_pause = std::chrono::seconds(5);
  // how long to wait for the server's answer to one attempt
  Duration open_timeout = std::chrono::seconds(15);
  // Time between pings, which estimate the server's clock and detect a dead connection (four
  // unanswered pings in a row); 0: no pings.
  Duration ping_interval = std::chrono::seconds(1);

  // Called on the session's own thread, one at a time, after each change; several changes of a
  // receipt may be combined into one call. Callbacks may call anything but Wait… and Close. While a
  // callback runs, up to 65,536 issues wait for it, and Tally::untold_issues counts those beyond;
  // once 65,536 receipts wait, commits are rejected (ResourceExhausted).
  std::function<void(const Receipt&)> on_receipt;
  std::function<void(const Issue&)> on_issue;
  std::function<void(const ConnectionChange&)> on_connection;
};

// The server's limits that matter to code that fills messages; 0: unknown.
struct Limits {
  uint64_t max_message_bytes = 0;
  uint64_t max_vertices_per_entity = 0;
  uint64_t max_indices_per_entity = 0;
  uint64_t max_operations_per_commit = 0;
  uint64_t max_uncommitted_bytes = 0;
  uint64_t max_parts_per_object = 0;
  uint64_t max_timed_commits = 0;
  int64_t max_present_at_horizon_ns = 0;
  uint64_t max_asset_bytes = 0;  // of one asset; 0: the server accepts none
};

struct ServerInfo {
  uint64_t session = 0, owner = 0;
  std::string version;
  // pass it as Options::owner_token to sessions that should share this owner
  std::string owner_token;
  std::vector<std::string> displays;
  Limits limits;
};

// The server's monotonic clock minus this machine's, from the fastest of the last pings.
struct ClockEstimate {
  int64_t offset_ns = 0;
  int64_t round_trip_ns = 0;  // of that ping: the error is at most half of it
  uint64_t samples = 0;
};

struct CommitOptions {
  // Not 0: when to show the commit, by the server's monotonic clock (Session::ServerNow).
  int64_t present_at_ns = 0;
  // Later commits wait until every display has given its outcome of this one.
  bool must_show = false;
  // Asks the server to report when the commit is on its disk (Session::WaitDurable). Requires a
  // session that keeps its layers and a server that stores state; otherwise an Issue says why it
  // cannot.
  bool durable = false;
};

// An entity that stays until it is removed. Copies refer to the same entity. Calls after the
// session has ended return FailedPrecondition.
class Handle {
 public:
  Handle() = default;
  const std::string& layer() const { return layer_; }
  const std::string& id() const { return id_; }

  // Each call is staged for the next commit, and sends only what it changes.
  absl::Status SetTransform(const Affine& transform) const;
  absl::Status Set(Shape shape, Look look = {}) const;
  absl::Status Remove() const;

 private:
  friend class Layer;
  Handle(std::weak_ptr<SessionCore> core, std::string layer, std::string id)
      : core_(std::move(core)), layer_(std::move(layer)), id_(std::move(id)) {}
  std::weak_ptr<SessionCore> core_;
  std::string layer_, id_;
};

// Immediate mode: what is drawn into a frame replaces everything that its layer held. Nothing is
// sent before Commit or End; a frame without either leaves the layer untouched.
class Frame {
 public:
  Frame(Frame&&) noexcept;
  Frame& operator=(Frame&&) noexcept;
  ~Frame();

  // Commit or End reports the first error of a drawing call.
  Frame& Draw(Shape shape, Look look = {});
  Frame& Draw(std::string id, Shape shape, Look look = {});

  // Commits the frame with everything that is staged; returns the commit's number. After
  // ResourceExhausted it may be called again. InvalidArgument: as Session::Commit; a frame with an
  // operation that is too large is dropped whole.
  absl::StatusOr<uint64_t> Commit(const CommitOptions& options = {});
  // Stages the frame for the session's next commit.
  absl::Status End();

 private:
  friend class Layer;
  Frame(std::weak_ptr<SessionCore> core, std::string layer);
  std::weak_ptr<SessionCore> core_;
  std::string layer_;
  std::vector<UpsertOperation> upserts_;
  absl::Status error_;
  uint64_t drawn_ = 0;
};

// A layer by its name, created when first written. Copies refer to the same layer. All changes are
// staged.
class Layer {
 public:
  const std::string& name() const { return name_; }

  // Adds an entity, or completely replaces the one with the same id.
  absl::StatusOr<Handle> Put(std::string id, Shape shape, Look look = {}) const;
  absl::Status SetTransform(const std::string& id, const Affine& transform) const;
  absl::Status Remove(const std::string& id) const;
  absl::Status RemovePrefix(const std::string& prefix) const;
  absl::Status Clear() const;
  absl::Status Set(const LayerLook& look) const;

  Frame BeginFrame() const { return Frame(core_, name_); }

 private:
  friend class Session;
  Layer(std::weak_ptr<SessionCore> core, std::string name)
      : core_(std::move(core)), name_(std::move(name)) {}
  std::weak_ptr<SessionCore> core_;
  std::string name_;
};

class Session {
 public:
  // Starts to connect and returns at once; what is drawn before the server has answered waits.
  // Errors: InvalidArgument if the options are invalid.
  static absl::StatusOr<std::unique_ptr<Session>> Open(Options options);
  // Drops the connection without waiting for queued commits: call Close first if they matter. Do
  // not call it from a callback.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  Layer GetLayer(std::string name) const;

  // Staged like all other changes.
  absl::Status DefineObject(std::string name, std::vector<Part> parts);
  absl::Status RemoveObject(const std::string& name, bool cascade = false);
  // Deletes everything in the layers that this session last wrote.
  absl::Status RemoveAll();

  // Commits what is staged, which takes effect together. Returns the commit's number, from 1.
  // Errors: ResourceExhausted if it does not fit into the buffer, or if on_receipt is far behind;
  // all stays staged. InvalidArgument if an operation needs a message of more than
  // Limits::max_message_bytes: that operation is dropped, all others stay staged. (Where the limit
  // is known only later, from the server's first answer, the commit is refused then.)
  absl::StatusOr<uint64_t> Commit(const CommitOptions& options = {});
  // Approximate wire size of what is staged, in bytes.
  size_t staged_bytes() const;

  // Returns whether a commit would be sent now: there is a connection, nothing waits here, there is
  // credit, and fewer than Options::most_unsettled commits are unsettled.
  bool HasRoom() const;

  // Each call waits at most `timeout` (DeadlineExceeded). It returns the session's status if the
  // session ends first, and Cancelled after Interrupt.
  absl::Status WaitOpened(Duration timeout) const;
  absl::Status WaitForRoom(Duration timeout) const;
  // Returns the receipt when the commit is accepted. Errors: FailedPrecondition with the server's
  // message and the first issues if it is refused, Aborted if it was dropped or lost, NotFound if
  // it is unknown or too old.
  absl::StatusOr<Receipt> WaitAccepted(uint64_t frame, Duration timeout) const;
  // Waits until every display has given its outcome.
  absl::StatusOr<Receipt> WaitShown(uint64_t frame, Duration timeout) const;
  // Waits until the commit, made with CommitOptions::durable, is on the server's disk. Errors:
  // FailedPrecondition with the server's message if it will not be.
  absl::StatusOr<Receipt> WaitDurable(uint64_t frame, Duration timeout) const;
  // Waits until every commit is settled; Interrupt does not end it.
  absl::Status WaitSettled(Duration timeout) const;
  // All waits but WaitSettled and Close, now and later, return Cancelled. For use by signal
  // handlers' threads.
  void Interrupt();

  // Returns what is known of a commit: of the 1024 newest settled ones and of all unsettled ones.
  std::optional<Receipt> FindReceipt(uint64_t frame) const;
  Tally GetTally() const;
  // Times from sending a commit to learning that it is presented, for the last 65,536, in no order.
  std::vector<int64_t> latencies_ns() const;

  std::optional<ServerInfo> server() const;
  std::optional<ClockEstimate> clock() const;
  // The current time by the server's monotonic clock; empty before the first pong.
  std::optional<int64_t> ServerNow() const;

  // Sends what is queued, ends the session, and waits for the server to end it too. Operations that
  // are staged but not committed are discarded.
  absl::Status Close(Duration timeout = std::chrono::seconds(8));

 private:
  explicit Session(std::shared_ptr<RunningCore> running);
  std::shared_ptr<RunningCore> running_;
  SessionCore* core_;  // owned by running_
};

// Returns "layer/id, field: what was wrong". The message is the server's, unchanged.
std::string DescribeIssue(const Issue& issue);

}  // namespace voxeld::client
