// The implementation of a session: staged operations, the queue, the stream and its successors.
// Does not depend on gRPC and owns no thread: Step does all that is due, so a test can drive it
// alone.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/src/clock_estimate.h"
#include "client/cpp/src/in_memory.h"
#include "client/cpp/src/memory_channel.h"
#include "client/cpp/src/outbox.h"
#include "client/cpp/src/receipt_book.h"
#include "client/cpp/src/retained_book.h"
#include "client/cpp/src/transport.h"
#include "display/sync/backoff.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "voxeld/client.h"

namespace voxeld::client {

// Thread-safe.
class SessionCore {
 public:
  static constexpr size_t kMostUntold =
      65536;  // receipts, and issues, that wait for their callbacks

  // `clock` must outlive it. Nothing starts before the first Step.
  SessionCore(Options options, std::unique_ptr<Transport> transport, sync::Clock& clock);
  // Requires: Stop was called.
  ~SessionCore();

  // Does what is due, runs the callbacks, and returns the latest time for the next call. Call it
  // from one thread at a time.
  sync::TimeNs Step() VOXELD_EXCLUDES(mutex_);
  // Calls Step until Stop.
  void Run() VOXELD_EXCLUDES(mutex_);
  // Cancels the stream and returns when it has ended. Then Run returns.
  void Stop() VOXELD_EXCLUDES(mutex_);

  absl::Status Stage(Operation operation) VOXELD_EXCLUDES(mutex_);
  absl::Status StageUpsert(std::string layer, std::string id, const Shape& shape, const Look& look)
      VOXELD_EXCLUDES(mutex_);
  // `frame` is consumed if it was committed.
  absl::StatusOr<uint64_t> Commit(FrameOperation* frame, const CommitOptions& options)
      VOXELD_EXCLUDES(mutex_);
  size_t staged_bytes() const VOXELD_EXCLUDES(mutex_);

  bool HasRoom() const VOXELD_EXCLUDES(mutex_);
  absl::Status WaitOpened(Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::Status WaitForRoom(Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::StatusOr<Receipt> WaitAccepted(uint64_t frame, Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::StatusOr<Receipt> WaitShown(uint64_t frame, Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::StatusOr<Receipt> WaitDurable(uint64_t frame, Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::Status WaitSettled(Duration timeout) VOXELD_EXCLUDES(mutex_);
  absl::Status Close(Duration timeout) VOXELD_EXCLUDES(mutex_);
  void Interrupt() VOXELD_EXCLUDES(mutex_);

  std::optional<Receipt> FindReceipt(uint64_t frame) const VOXELD_EXCLUDES(mutex_);
  Tally GetTally() const VOXELD_EXCLUDES(mutex_);
  std::vector<int64_t> latencies_ns() const VOXELD_EXCLUDES(mutex_);
  std::optional<ServerInfo> server() const VOXELD_EXCLUDES(mutex_);
  std::optional<ClockEstimate> clock_estimate() const VOXELD_EXCLUDES(mutex_);
  std::optional<int64_t> ServerNow() const VOXELD_EXCLUDES(mutex_);

 private:
  enum class State : uint8_t { kPausing, kConnecting, kOpen, kEnded };
  // The session or owner that our Open asks to resume or join.
  enum class Take : uint8_t { kNothing, kSession, kOwner };

  // One stream and its events.
  class Link final : public Stream::Events, public MemoryChannel::Events {
   public:
    Link(SessionCore* core, Take take) : core_(core), take_(take) {}
    void OnRead(const v1::StreamResponse& response) override { core_->Read(this, response); }
    void OnWritten() override { core_->Written(this); }
    void OnEnd(const absl::Status& status) override { core_->End(this, status); }
    void OnHold(uint64_t, MemoryChannel::Answer answer) override { core_->Held(this, answer); }
    Take take() const { return take_; }

    std::unique_ptr<Stream> stream;
    bool opened = false;
    bool writing = true;  // the Open message is being written
    uint64_t open_bytes = 0;
    absl::Status cancelled_for;  // not ok: the client ended the stream, for this reason

    // A request whose content is being handed over; it is sent when the answer comes.
    struct Handing {
      Rope whole;
      InMemory moved;
      uint64_t frame_id = 0;
    };
    std::optional<Handing> handing;
    uint64_t memories = 0;                             // handed over so far; the last one's id
    uint64_t memories_refused = 0;                     // consecutive refusals
    std::map<uint64_t, std::vector<uint64_t>> in_use;  // memory ids, by unanswered commits
    std::unique_ptr<MemoryChannel>
        memory;  // null: all content goes over the stream. Destroyed first

   private:
    SessionCore* const core_;
    const Take take_;
  };
  using Event = std::variant<Issue, ConnectionChange>;

  // Streams, implemented in session_link.cc.
  void Connect() VOXELD_REQUIRES(mutex_);
  void Read(Link* link, const v1::StreamResponse& response) VOXELD_EXCLUDES(mutex_);
  void Written(Link* link) VOXELD_EXCLUDES(mutex_);
  void Held(Link* link, MemoryChannel::Answer answer) VOXELD_EXCLUDES(mutex_);
  void End(Link* link, const absl::Status& status) VOXELD_EXCLUDES(mutex_);
  void TakeOpened(const v1::Opened& opened) VOXELD_REQUIRES(mutex_);
  void TakeIssue(const v1::Issue& issue) VOXELD_REQUIRES(mutex_);
  void TakeReceipt(const v1::Receipt& receipt) VOXELD_REQUIRES(mutex_);
  // Handles the unanswered commits of the previous stream after the session was resumed.
  void TakeUnheard(uint64_t last_sequence) VOXELD_REQUIRES(mutex_);
  void SendRetained() VOXELD_REQUIRES(mutex_);
  void TellNotRestored(const std::string& why) VOXELD_REQUIRES(mutex_);
  void Lose(const absl::Status& why) VOXELD_REQUIRES(mutex_);
  void EndSession(const absl::Status& status) VOXELD_REQUIRES(mutex_);
  void CancelLink(const absl::Status& why) VOXELD_REQUIRES(mutex_);
  void Pump() VOXELD_REQUIRES(mutex_);
  void Write(const Rope& message) VOXELD_REQUIRES(mutex_);
  // Returns false if the request must be sent as it is.
  bool HandOver(const Outbox::Outgoing& next) VOXELD_REQUIRES(mutex_);
  void ReleaseMemory(uint64_t frame_id) VOXELD_REQUIRES(mutex_);
  sync::TimeNs DoDue(sync::TimeNs now) VOXELD_REQUIRES(mutex_);
  std::string OpenBytes(Take take) VOXELD_REQUIRES(mutex_);

  absl::Status GiveUpOversized(std::vector<Operation> operations, FrameOperation* frame)
      VOXELD_REQUIRES(mutex_);
  // 0: unknown.
  size_t most_message_bytes() const VOXELD_REQUIRES(mutex_);
  // on_receipt is too far behind.
  bool Behind() const VOXELD_REQUIRES(mutex_);
  bool Room() const VOXELD_REQUIRES(mutex_);
  bool HasEvents() const VOXELD_REQUIRES(mutex_);
  void NoteDrops() VOXELD_REQUIRES(mutex_);
  // Queues events for the callbacks and wakes all waiting threads.
  void Changed() VOXELD_REQUIRES(mutex_);
  bool TakesEvents() const;

  template <typename Done>
  absl::Status Wait(Duration timeout, bool interruptible, const char* what, Done done)
      VOXELD_EXCLUDES(mutex_);
  absl::StatusOr<Receipt> AnswerOf(uint64_t frame) const VOXELD_REQUIRES(mutex_);
  std::string Where() const;

  const Options options_;
  const std::unique_ptr<Transport> transport_;
  sync::Clock& clock_;

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;  // for waiting callers
  sync::CondVar work_;     // for Run
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  bool interrupted_ VOXELD_GUARDED_BY(mutex_) = false;
  bool closing_ VOXELD_GUARDED_BY(mutex_) = false;
  bool half_closed_ VOXELD_GUARDED_BY(mutex_) = false;
  State state_ VOXELD_GUARDED_BY(mutex_) = State::kPausing;
  absl::Status ended_ VOXELD_GUARDED_BY(mutex_);
  absl::Status last_loss_ VOXELD_GUARDED_BY(mutex_);
  std::unique_ptr<Link> link_ VOXELD_GUARDED_BY(mutex_);
  std::vector<std::unique_ptr<Link>> ended_links_ VOXELD_GUARDED_BY(mutex_);

  std::vector<Operation> staged_ VOXELD_GUARDED_BY(mutex_);
  size_t staged_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t next_frame_ VOXELD_GUARDED_BY(mutex_) = 1;
  Outbox outbox_ VOXELD_GUARDED_BY(mutex_);
  ReceiptBook receipts_ VOXELD_GUARDED_BY(mutex_);
  RetainedBook retained_ VOXELD_GUARDED_BY(mutex_);
  ClockEstimator estimator_ VOXELD_GUARDED_BY(mutex_);
  std::deque<Event> events_ VOXELD_GUARDED_BY(mutex_);

  std::optional<ServerInfo> server_ VOXELD_GUARDED_BY(mutex_);
  std::string resume_token_ VOXELD_GUARDED_BY(mutex_);
  std::string own_token_ VOXELD_GUARDED_BY(mutex_);  // our owner's token, from the last Opened
  sync::Backoff backoff_ VOXELD_GUARDED_BY(mutex_);
  sync::TimeNs opened_at_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs retry_at_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs open_deadline_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  sync::TimeNs last_heard_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs ping_at_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  bool ping_due_ VOXELD_GUARDED_BY(mutex_) = false;
  uint64_t pings_ VOXELD_GUARDED_BY(mutex_) = 0;  // on this stream
  bool pong_seen_ VOXELD_GUARDED_BY(mutex_) = false;
  uint64_t unanswered_pings_ VOXELD_GUARDED_BY(mutex_) = 0;
  // Outcomes of commits accepted before the resume may come until then.
  sync::TimeNs outcomes_until_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  sync::TimeNs resumed_at_ VOXELD_GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld::client
