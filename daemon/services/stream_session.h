// One SceneService.Stream, apart from gRPC:
// what is read, what is owed, what is queued, how it ends.
//
//   first message         Open, answered by Opened
//   every other           decoded and posted to the core; at most kMaxUnprocessed
//                         of them unprocessed
//   half-close            waits (drain_limit_ns at most) until every commit has its answer and its
//                         outcomes, closes the session, writes what is queued, ends with OK
//   End, bad bytes        closes the session, writes what is queued (drain_limit_ns at most), ends
//                         with the status
//   client gone           closes the session and ends at once
//   client does not read  closes the session and ends with RESOURCE_EXHAUSTED
//                         once the queue is full
//
// Thread-safe. The port's events come one after another for reads and for writes, as gRPC has it.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "daemon/core/core.h"
#include "daemon/local/local_session.h"
#include "daemon/services/active_calls.h"
#include "daemon/services/context.h"
#include "daemon/wire/decode.h"
#include "display/sync/mutex.h"

namespace voxeld::v1 {
class StreamResponse;
}

namespace voxeld::daemon::services {

// The transport of one stream. No call answers from within itself. Called with the session's lock
// held, and never after OnPortDone.
class StreamPort {
 public:
  virtual ~StreamPort() = default;
  virtual void Read() = 0;  // then OnMessage, OnReadsDone or OnCancel; one at a time
  virtual void Write(const std::string& message) = 0;   // then OnWritten; one at a time
  virtual void Finish(const absl::Status& status) = 0;  // once, and last
  virtual void SetAlarm(sync::TimeNs delay) = 0;  // then OnAlarm; replaces one that was set before
};

class StreamSession final : public SessionSink,
                            public ActiveCall,
                            public std::enable_shared_from_this<StreamSession> {
 public:
  static constexpr int kMaxUnprocessed = 4;

  // `context` outlives the session; `port` lives until OnPortDone.
  StreamSession(ServiceContext& context, StreamPort* port)
      : context_(context), core_(context.core), port_(port) {}

  void Start();

  // ---- from the port
  void OnMessage(std::span<const std::string_view> slices);
  void OnReadsDone();  // half-closed, or broken: then OnCancel comes too
  void OnWritten(bool ok);
  void OnCancel();
  void OnAlarm();
  void OnPortDone();

  // ---- from the core
  void OnIssue(const Issue& issue) override;
  void OnReceipt(const Receipt& receipt) override;

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

  void TakeOpen(OpenOptions open, wire::Decoded decoded, uint64_t bytes);
  void TakeOperations(wire::Decoded decoded, uint64_t bytes);
  void OnOpened(const absl::StatusOr<SessionInfo>& info);
  void OnProcessed(uint64_t local_bytes);
  void Read() VOXELD_REQUIRES(mutex_);
  void Queue(const v1::StreamResponse& response) VOXELD_REQUIRES(mutex_);
  void WriteNext() VOXELD_REQUIRES(mutex_);
  // These return whether the caller must call CloseSession() once it has released the lock.
  [[nodiscard]] bool Overrun() VOXELD_REQUIRES(mutex_);
  [[nodiscard]] bool Drained() VOXELD_REQUIRES(mutex_);
  [[nodiscard]] bool Close(const absl::Status& status) VOXELD_REQUIRES(mutex_);
  void CloseSession();
  void OnClosed();
  void FinishIfFlushed() VOXELD_REQUIRES(mutex_);
  void Finish() VOXELD_REQUIRES(mutex_);

  ServiceContext& context_;  // there as long as the port is
  Core& core_;
  sync::Mutex mutex_;
  StreamPort* port_ VOXELD_GUARDED_BY(mutex_);
  State state_ VOXELD_GUARDED_BY(mutex_) = State::kNew;
  SessionId session_ VOXELD_GUARDED_BY(mutex_) = 0;  // 0: none
  std::string client_name_ VOXELD_GUARDED_BY(mutex_);
  local::LocalSession local_ VOXELD_GUARDED_BY(mutex_);  // from Opened until the session is closed
  bool no_outcomes_ VOXELD_GUARDED_BY(mutex_) = false;
  // A read is pending, or what it brought has not been handed to the core yet.
  bool reading_ VOXELD_GUARDED_BY(mutex_) = false;
  bool reads_done_ VOXELD_GUARDED_BY(mutex_) = false;
  bool cancelled_ VOXELD_GUARDED_BY(mutex_) = false;
  int unprocessed_ VOXELD_GUARDED_BY(mutex_) = 0;  // messages that the core has not taken in
  // And what they copied from local memory. It is not read on while that is as much as as many
  // messages could have brought themselves.
  uint64_t unprocessed_local_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t unanswered_ VOXELD_GUARDED_BY(mutex_) = 0;  // commits without Accepted or Refused
  uint64_t outcomes_owed_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t sequence_ VOXELD_GUARDED_BY(mutex_) = 0;  // of the last request
  std::deque<std::string> queue_ VOXELD_GUARDED_BY(mutex_);
  size_t queued_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool writing_ VOXELD_GUARDED_BY(mutex_) = false;
  bool ending_ VOXELD_GUARDED_BY(mutex_) = false;  // from kClosing on, with:
  absl::Status end_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::services
