// A client of voxeld: layers, entities, frames; receipts for all that is committed.
//
//   auto session = Session::Open({.client_name = "hello"});
//   auto layer = (*session)->GetLayer("lines");
//   auto handle = layer.Put("edge", Segments{.vertices = {.positions = {0, 0, 0, 1, 1, 1}}});
//   auto frame = (*session)->Commit();
//   auto receipt = (*session)->WaitShown(*frame, std::chrono::seconds(5));
//
// No call blocks but those that begin with Wait, and Close: whatever is put up is staged, a commit
// puts what is staged into a queue, and a thread of the session's own keeps the connection. A queue
// that is full refuses (ResourceExhausted) what it cannot hold; retained operations in it are never
// given up, immediate frames as Options::flow says.
//
// A lost connection is opened again with growing pauses. The session that was is resumed if the
// server still has it; else the session's retained state is sent again. Commits that had no answer
// are sent again in their order either way.
//
// Thread-safe, but for one Frame, which is for one thread at a time. Errors are statuses; nothing
// throws.
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

// What becomes of the session's layers when its stream ends.
enum class OnDisconnect : uint8_t {
  kClear,   // they go at once
  kLinger,  // they go after Options::linger; a reconnect within it resumes
  kKeep,    // they stay until somebody clears them
};

// Which immediate frames are given up while they wait here or in the server. What is retained always
// waits, and a commit with a present_at is never given up.
enum class Flow : uint8_t {
  kReliable,    // none; but see Options::buffer_bytes
  kLatest,      // all but the newest of each layer
  kDropOldest,  // all but the Options::drop_oldest_frames newest of each layer
};

struct ConnectionChange {
  enum class Kind : uint8_t {
    kOpened,    // for the first time
    kResumed,   // the server had kept the session and its layers
    kRestored,  // it had not: the retained state was sent again
    kLost,      // `status` says why; it is tried again
    kEnded,     // for good
    kReopened,  // the server had not kept it, and Options::restore is false: what was up is gone
  };
  Kind kind = Kind::kOpened;
  absl::Status status;
  // kRestored, kReopened: commits that had been accepted and whose outcomes will not come.
  uint64_t lost_outcomes = 0;
};

struct Options {
  std::string address;  // HOST:PORT, tls:HOST:PORT or unix:PATH; empty: DefaultAddress()
  std::optional<Credentials> credentials;  // nothing: DefaultCredentials()
  std::string client_name;                 // a label for people
  OnDisconnect on_disconnect = OnDisconnect::kClear;
  Duration linger{0};
  bool strict = false;   // a refused operation refuses its whole commit
  bool outcomes = true;  // false: a commit is answered by accepted or refused alone
  // Joins the owner whose ServerInfo gave it; empty: a new owner. One that is not there ends the session, but only
  // before it was opened: later, as after the server's restart, it goes on as a new owner (server()).
  std::string owner_token;

  // Over a unix socket, to a server that offers it: content of at least 64 KiB is handed over in sealed memory
  // instead of being sent. Where that fails it is sent.
  bool local_memory = true;

  Flow flow = Flow::kReliable;
  uint32_t drop_oldest_frames = 1;
  // Of commits that wait here. When it is full: while there is a connection, kReliable refuses the
  // next commit; without one, and under the other policies, the oldest frames of each layer that has
  // newer ones go, and are counted.
  size_t buffer_bytes = size_t{64} << 20;
  // Of what is staged for the next commit, about. Beyond, staging is refused (ResourceExhausted), but for the
  // first operation.
  size_t most_staged_bytes = size_t{256} << 20;
  // HasRoom: fewer commits than this are without all their answers.
  uint64_t most_unsettled = 4;

  bool reconnect = true;
  bool restore = true;  // keep what is retained, to send it again
  Duration first_pause = std::chrono::milliseconds(100);
  Duration longest_pause = std::chrono::seconds(5);
  Duration open_timeout = std::chrono::seconds(15);  // for the server to answer an attempt
  // Between pings, which estimate the server's clock and notice a dead connection (four unanswered in
  // a row); 0: none.
  Duration ping_interval = std::chrono::seconds(1);

  // Called on the session's own thread, one at a time, after each change: of a receipt that changed several times
  // meanwhile, once. They may call anything but Wait… and Close. While one does not return, 65,536 issues wait for
  // it, and Tally::untold_issues counts those beyond; once 65,536 receipts do, commits are refused
  // (ResourceExhausted).
  std::function<void(const Receipt&)> on_receipt;
  std::function<void(const Issue&)> on_issue;
  std::function<void(const ConnectionChange&)> on_connection;
};

// The limits in force that matter to who fills messages; 0: not told.
struct Limits {
  uint64_t max_message_bytes = 0;
  uint64_t max_vertices_per_entity = 0;
  uint64_t max_indices_per_entity = 0;
  uint64_t max_operations_per_commit = 0;
  uint64_t max_uncommitted_bytes = 0;
  uint64_t max_parts_per_object = 0;
  uint64_t max_timed_commits = 0;
  int64_t max_present_at_horizon_ns = 0;
  uint64_t max_asset_bytes = 0;  // of one; 0: the server takes none
};

struct ServerInfo {
  uint64_t session = 0, owner = 0;
  std::string version;
  std::string owner_token;  // for Options::owner_token of sessions that are to share this owner
  std::vector<std::string> displays;
  Limits limits;
};

// The server's monotonic clock less this machine's, by the fastest of the last pings.
struct ClockEstimate {
  int64_t offset_ns = 0;
  int64_t round_trip_ns = 0;  // of that ping: the error is at most half of it
  uint64_t samples = 0;
};

struct CommitOptions {
  // Not 0: when it is to be shown, by the server's monotonic clock (Session::ServerNow).
  int64_t present_at_ns = 0;
  // Later commits wait until every display has given its outcome of this one.
  bool must_show = false;
  // The server is to say when it is on its disk (Session::WaitDurable): for layers of a session that keeps
  // them, in a server that keeps state; an Issue says if it cannot.
  bool durable = false;
};

// An entity that stays until it is removed. Copies mean the same one. What is called on it after its
// session is gone is FailedPrecondition.
class Handle {
 public:
  Handle() = default;
  const std::string& layer() const { return layer_; }
  const std::string& id() const { return id_; }

  // Each is staged for the next commit, and sends what it says alone.
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

// Immediate mode: what is drawn into a frame replaces everything that its layer held. Nothing is sent
// before Commit or End; a frame that has neither leaves the layer untouched.
class Frame {
 public:
  Frame(Frame&&) noexcept;
  Frame& operator=(Frame&&) noexcept;
  ~Frame();

  // The first error of a drawing is told by Commit or End.
  Frame& Draw(Shape shape, Look look = {});
  Frame& Draw(std::string id, Shape shape, Look look = {});

  // Commits it with all that is staged; the commit's number. After ResourceExhausted it may be tried
  // again. InvalidArgument: as Session::Commit; a frame with something that is too large is given up whole.
  absl::StatusOr<uint64_t> Commit(const CommitOptions& options = {});
  // Stages it for the session's next commit.
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

// A layer by its name, made when it is first written. Copies mean the same one. All of it is staged.
class Layer {
 public:
  const std::string& name() const { return name_; }

  // Puts up an entity, or replaces that of the same id whole.
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
  // Begins to connect and returns at once; what is put up before the server has answered waits.
  // InvalidArgument if the options cannot be.
  static absl::StatusOr<std::unique_ptr<Session>> Open(Options options);
  // Drops the connection without waiting for what is queued: Close first, if that matters. Not from
  // within a callback.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  Layer GetLayer(std::string name) const;

  // Staged like all the rest.
  absl::Status DefineObject(std::string name, std::vector<Part> parts);
  absl::Status RemoveObject(const std::string& name, bool cascade = false);
  // Deletes everything in the layers that this session last wrote.
  absl::Status RemoveAll();

  // Commits what is staged: it takes effect together. The commit's number, from 1.
  // ResourceExhausted if it does not fit into the buffer, or if on_receipt is far behind; then all stays staged.
  // InvalidArgument if something takes a message of more than Limits::max_message_bytes: that is given up, all else
  // stays staged. (Where the limit is told only later, by the server's first answer, the commit is refused then.)
  absl::StatusOr<uint64_t> Commit(const CommitOptions& options = {});
  // Bytes of what is staged, about as they will be on the wire.
  size_t staged_bytes() const;

  // Whether a commit would go out now: there is a connection, nothing waits here, there is credit,
  // and fewer than Options::most_unsettled commits are unsettled.
  bool HasRoom() const;

  // Each waits at most `timeout` (DeadlineExceeded); ends with the session's status if that ends first,
  // with Cancelled after Interrupt.
  absl::Status WaitOpened(Duration timeout) const;
  absl::Status WaitForRoom(Duration timeout) const;
  // The receipt when the commit is accepted. FailedPrecondition with the server's words and the first
  // issues if it is refused, Aborted if it was dropped or lost, NotFound if it is too old or none.
  absl::StatusOr<Receipt> WaitAccepted(uint64_t frame, Duration timeout) const;
  // When every display has given its outcome.
  absl::StatusOr<Receipt> WaitShown(uint64_t frame, Duration timeout) const;
  // Until the commit, made with CommitOptions::durable, is on the server's disk. FailedPrecondition with the
  // server's word if it will not be.
  absl::StatusOr<Receipt> WaitDurable(uint64_t frame, Duration timeout) const;
  // Until every commit is settled; Interrupt does not end it.
  absl::Status WaitSettled(Duration timeout) const;
  // All waits but WaitSettled and Close, now and later, return Cancelled. For signal handlers' threads.
  void Interrupt();

  // What is known of a commit: of the 1024 newest that are settled and of all that are not.
  std::optional<Receipt> FindReceipt(uint64_t frame) const;
  Tally GetTally() const;
  // From sending a commit to hearing that it is presented, of the last 65,536, in no order.
  std::vector<int64_t> latencies_ns() const;

  std::optional<ServerInfo> server() const;
  std::optional<ClockEstimate> clock() const;
  // Now by the server's monotonic clock; nothing before the first pong.
  std::optional<int64_t> ServerNow() const;

  // Sends what is queued, ends the session, and waits for the server to end it too. What is staged
  // and was not committed is given up.
  absl::Status Close(Duration timeout = std::chrono::seconds(8));

 private:
  explicit Session(std::shared_ptr<RunningCore> running);
  std::shared_ptr<RunningCore> running_;
  SessionCore* core_;  // of it
};

// "layer/id, field: what was wrong". The words are the server's, as they came.
std::string DescribeIssue(const Issue& issue);

}  // namespace voxeld::client
