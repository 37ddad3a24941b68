// One SceneService.Stream, independently of gRPC: what is read, pending and queued, and how it
// ends.
//
//   first message         must be Open, at most kOpenBytes and within open_limit_ns; answered by
//                         Opened
//   Ping                  answered at once
//   other messages        decoded and passed to the session's intake in order. Meanwhile up to
//                         kAheadBytes or kAheadMessages of further messages are read, if the intake
//                         has room and the client reads its answers
//   half-close            waits (at most drain_limit_ns) until every commit has its answer and its
//                         outcomes, closes the session, writes what is queued, ends with OK
//   End, invalid bytes    closes the session, writes what is queued (at most drain_limit_ns), ends
//                         with the status
//   client gone           closes the session, returns queued outcomes to the core, ends at once
//   client does not read  stops reading and applying when the queue is half full. If it still
//                         becomes full, closes the session and ends with RESOURCE_EXHAUSTED
//   resumed elsewhere     ends with ABORTED, as when an operator evicts its owner
//
// Thread-safe. Lock order: the intake's, then the session's; therefore the intake is not called
// with the session's lock held. The port's read events are sequential, and so are its write events,
// as in gRPC. A read event may arrive on another thread while the previous message is still being
// decoded.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "daemon/core/core.h"
#include "daemon/local/local_session.h"
#include "daemon/services/active_calls.h"
#include "daemon/services/answer_queue.h"
#include "daemon/services/context.h"
#include "daemon/wire/decode.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {

// One received message. Its slices are valid while the object exists.
class ReceivedMessage {
 public:
  virtual ~ReceivedMessage() = default;
  virtual std::span<const std::string_view> slices() const = 0;
};

// The transport of one stream. Its functions never call back before they return. They are called
// with the session's lock held, and never after OnPortDone.
class StreamPort {
 public:
  virtual ~StreamPort() = default;
  virtual void Read() = 0;  // then OnMessage or OnReadsDone; one at a time
  virtual void Write(const std::string& message) = 0;   // then OnWritten; one at a time
  virtual void Finish(const absl::Status& status) = 0;  // once, and last
  virtual void SetAlarm(sync::TimeNs delay) = 0;        // then OnAlarm; replaces the previous alarm
  virtual void Post() = 0;  // then OnTurn, soon, on another thread; one at a time
};

// Limits on reading ahead while a message is decoded: enough, for small and for large messages,
// that reading and decoding do not wait for each other.
inline constexpr uint64_t kOpenBytes = 48 << 10;
inline constexpr size_t kAheadMessages = 64;
inline constexpr uint64_t kAheadBytes = 256 << 10;

class StreamSession final : public SessionSink,
                            public ActiveCall,
                            public std::enable_shared_from_this<StreamSession> {
 public:
  // `context` must outlive the session; `port` must live until OnPortDone.
  StreamSession(ServiceContext& context, StreamPort* port)
      : context_(context), core_(context.core), port_(port), answers_(core_.budget()) {}

  void Start();

  // ---- called by the port
  void OnMessage(std::unique_ptr<const ReceivedMessage> message);
  void OnReadsDone();  // half-closed, or broken: OnCancel follows then
  void OnWritten(bool ok);
  void OnCancel();
  void OnAlarm();
  void OnTurn();
  void OnPortDone();

  // ---- called by the core
  void OnIssue(const Issue& issue) override;
  void OnReceipt(const Receipt& receipt) override;
  void OnCredit(uint64_t total_bytes) override;
  void OnRoom() override;
  void OnEnded(const absl::Status& why) override { End(why); }
  bool Crowded() const override;

  // ---- called at shutdown
  void End(const absl::Status& status) override;

 private:
  enum class State : uint8_t {
    kNew,      // no Open yet
    kOpening,  // the core is creating a session
    kOpen,
    kDraining,  // half-closed, with answers or outcomes pending
    kClosing,   // the core closes the session
    kFlushing,  // closed; queued messages are being sent
    kFinished,  // Finish was called
  };

  // Time and size of a message.
  struct Arrival {
    uint64_t bytes = 0;
    sync::TimeNs received_ns = 0, decoded_ns = 0;
  };
  struct Arrived {
    std::unique_ptr<const ReceivedMessage> message;
    Arrival arrival;
  };

  // Decodes the received messages in order, until none is left or it must pause. Runs on one thread
  // at a time.
  void TakeArrived();
  // Returns: whether decoding waits for room in the intake, or for the client to read its answers.
  bool MustPause() const VOXELD_REQUIRES(mutex_);
  void Resume() VOXELD_REQUIRES(mutex_);
  void TakeMessage(std::span<const std::string_view> slices, Arrival arrival);
  void TakeOpen(OpenOptions open, wire::Decoded decoded, const Arrival& arrival);
  void TakeOperations(wire::Decoded decoded, const Arrival& arrival);
  void OnOpened(const absl::StatusOr<SessionInfo>& info);
  void Read() VOXELD_REQUIRES(mutex_);
  bool FarAhead() const VOXELD_REQUIRES(mutex_);
  bool HalfFull() const VOXELD_REQUIRES(mutex_);
  void SetAlarm(sync::TimeNs StreamLimits::*limit) VOXELD_REQUIRES(mutex_);
  // Returns: whether messages can still be sent to the client.
  bool Listening() const VOXELD_REQUIRES(mutex_);
  void WriteNext() VOXELD_REQUIRES(mutex_);
  template <typename Answer>
  void Tell(const Answer& answer);
  // These return whether the caller must call CloseSession() once it has released the lock.
  [[nodiscard]] bool EndOfReads() VOXELD_REQUIRES(mutex_);
  [[nodiscard]] bool Overrun(bool added) VOXELD_REQUIRES(mutex_);
  [[nodiscard]] bool Drained() VOXELD_REQUIRES(mutex_);
  [[nodiscard]] bool Close(const absl::Status& status) VOXELD_REQUIRES(mutex_);
  void CloseSession();
  void OnClosed();
  void FinishIfFlushed() VOXELD_REQUIRES(mutex_);
  void Finish() VOXELD_REQUIRES(mutex_);

  ServiceContext& context_;  // valid as long as the port
  Core& core_;
  mutable sync::Mutex mutex_;
  StreamPort* port_ VOXELD_GUARDED_BY(mutex_);
  State state_ VOXELD_GUARDED_BY(mutex_) = State::kNew;
  SessionId session_ VOXELD_GUARDED_BY(mutex_) = 0;  // 0: none
  uint64_t incarnation_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::shared_ptr<Intake> intake_ VOXELD_GUARDED_BY(mutex_);  // from kOpen on
  std::string client_name_ VOXELD_GUARDED_BY(mutex_);
  local::LocalSession local_ VOXELD_GUARDED_BY(mutex_);  // from Opened until CloseSession
  bool no_outcomes_ VOXELD_GUARDED_BY(mutex_) = false;
  bool reading_ VOXELD_GUARDED_BY(mutex_) = false;         // a read is pending
  std::deque<Arrived> arrived_ VOXELD_GUARDED_BY(mutex_);  // read, but not decoded
  uint64_t arrived_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  // A thread runs TakeArrived, or has been requested to.
  bool taking_ VOXELD_GUARDED_BY(mutex_) = false;
  // Running OnTurn calls; the port is not finished meanwhile.
  int turns_ VOXELD_GUARDED_BY(mutex_) = 0;
  // How often the intake became full minus how often it had room again. Negative if the news of
  // room arrives before the news that it was full.
  int full_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool reads_done_ VOXELD_GUARDED_BY(mutex_) = false;
  bool cancelled_ VOXELD_GUARDED_BY(mutex_) = false;
  uint64_t unanswered_ VOXELD_GUARDED_BY(mutex_) = 0;  // commits without Accepted or Refused
  uint64_t outcomes_owed_ VOXELD_GUARDED_BY(mutex_) = 0;
  // Outcomes of earlier streams that were queued here, and their size: not due to this client's
  // reading.
  size_t inherited_ VOXELD_GUARDED_BY(mutex_) = 0;
  size_t inherited_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t sequence_ VOXELD_GUARDED_BY(mutex_) = 0;  // of the last request
  AnswerQueue answers_ VOXELD_GUARDED_BY(mutex_);
  bool writing_ VOXELD_GUARDED_BY(mutex_) = false;
  sync::TimeNs alarm_ns_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  bool ending_ VOXELD_GUARDED_BY(mutex_) = false;  // from kClosing on, with:
  absl::Status end_ VOXELD_GUARDED_BY(mutex_);
  bool logged_end_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon::services
