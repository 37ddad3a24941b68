// One SceneService.Stream, apart from gRPC:
// what is read, what is owed, what is queued, how it ends.
//
//   first message         Open, of kOpenBytes at most and within open_limit_ns, answered by Opened
//   Ping                  answered at once
//   every other           decoded and handed to the session's intake, one after another; meanwhile the next
//                         are read, kAheadBytes or kAheadMessages of them, if that has room and the client
//                         reads its answers
//   half-close            waits (drain_limit_ns at most) until every commit has its answer and its
//                         outcomes, closes the session, writes what is queued, ends with OK
//   End, bad bytes        closes the session, writes what is queued (drain_limit_ns at most), ends
//                         with the status
//   client gone           closes the session, gives back the outcomes that wait, and ends at once
//   client does not read  nothing more is read or applied once the queue is half full; should it get
//                         full all the same, closes the session and ends with RESOURCE_EXHAUSTED
//   taken up by another   ends with ABORTED; likewise when an operator evicts its owner
//
// Thread-safe. Lock order: the intake's, then the session's; so the intake is not called with the session's lock
// held. The port's events come one after another for reads and for writes, as gRPC has it; that for the next read
// may come on another thread while this one's message is still being decoded.
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

// One message, as long as this lives.
class ReceivedMessage {
 public:
  virtual ~ReceivedMessage() = default;
  virtual std::span<const std::string_view> slices() const = 0;
};

// The transport of one stream. No call answers from within itself. Called with the session's lock
// held, and never after OnPortDone.
class StreamPort {
 public:
  virtual ~StreamPort() = default;
  virtual void Read() = 0;  // then OnMessage or OnReadsDone; one at a time
  virtual void Write(const std::string& message) = 0;   // then OnWritten; one at a time
  virtual void Finish(const absl::Status& status) = 0;  // once, and last
  virtual void SetAlarm(sync::TimeNs delay) = 0;  // then OnAlarm; replaces one that was set before
  virtual void Post() = 0;  // then OnTurn, soon, on a thread of its own; one at a time
};

// What is read of a stream while something else of it is decoded: enough that neither waits for the
// other, of small messages and of large ones.
inline constexpr uint64_t kOpenBytes = 48 << 10;
inline constexpr size_t kAheadMessages = 64;
inline constexpr uint64_t kAheadBytes = 256 << 10;

class StreamSession final : public SessionSink,
                            public ActiveCall,
                            public std::enable_shared_from_this<StreamSession> {
 public:
  // `context` outlives the session; `port` lives until OnPortDone.
  StreamSession(ServiceContext& context, StreamPort* port)
      : context_(context), core_(context.core), port_(port), answers_(core_.budget()) {}

  void Start();

  // ---- from the port
  void OnMessage(std::unique_ptr<const ReceivedMessage> message);
  void OnReadsDone();  // half-closed, or broken: then OnCancel comes too
  void OnWritten(bool ok);
  void OnCancel();
  void OnAlarm();
  void OnTurn();
  void OnPortDone();

  // ---- from the core
  void OnIssue(const Issue& issue) override;
  void OnReceipt(const Receipt& receipt) override;
  void OnCredit(uint64_t total_bytes) override;
  void OnRoom() override;
  void OnEnded(const absl::Status& why) override { End(why); }
  bool Crowded() const override;

  // ---- at shutdown
  void End(const absl::Status& status) override;

 private:
  enum class State : uint8_t {
    kNew,      // no Open yet
    kOpening,  // the core has been asked for a session
    kOpen,
    kDraining,  // half-closed, something is still owed
    kClosing,   // the core closes the session
    kFlushing,  // closed; what is queued goes out
    kFinished,  // Finish was called
  };

  // When and how large the message was.
  struct Arrival {
    uint64_t bytes = 0;
    sync::TimeNs received_ns = 0, decoded_ns = 0;
  };
  struct Arrived {
    std::unique_ptr<const ReceivedMessage> message;
    Arrival arrival;
  };

  // Decodes what has arrived, in order, until nothing is left or it must pause. On one thread at a time.
  void TakeArrived();
  // Whether what has arrived waits: for room in the intake, or for the client to read its answers.
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
  // Whether there is anybody to be told.
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

  ServiceContext& context_;  // there as long as the port is
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
  std::deque<Arrived> arrived_ VOXELD_GUARDED_BY(mutex_);  // read, not decoded
  uint64_t arrived_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool taking_ VOXELD_GUARDED_BY(mutex_) =
      false;                                 // a thread is in TakeArrived, or has been asked for
  int turns_ VOXELD_GUARDED_BY(mutex_) = 0;  // in OnTurn: the port is not finished meanwhile
  // How often the intake was filled and has not had room since; negative while it had sooner than it is known here
  // that it was filled.
  int full_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool reads_done_ VOXELD_GUARDED_BY(mutex_) = false;
  bool cancelled_ VOXELD_GUARDED_BY(mutex_) = false;
  uint64_t unanswered_ VOXELD_GUARDED_BY(mutex_) = 0;  // commits without Accepted or Refused
  uint64_t outcomes_owed_ VOXELD_GUARDED_BY(mutex_) = 0;
  // Outcomes of former streams that were queued here, and what they held: not what the client left unread.
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
