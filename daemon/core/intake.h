// What one session has sent and the core has not applied: operations staged for a commit that has not come, and whole
// commits that wait for their turn. Gives credit, charges memory, and gives up immediate frames by the session's
// policy.
//
//   reading thread                       core's thread
//   Take(message)  ── schedule ────────▶ while ((commit = Pop(&more))) { apply; Done(*commit); }
//   filled?        ◀─ sink: OnRoom ─────
//
// Credit. Each message's bytes are outstanding until what it brought is applied, given up or refused, or, if no commit
// of the session waits, until it is staged: what is staged for a commit that has not come waits for the client, and
// max_uncommitted_bytes is its limit.
//
// Local memory and assets that messages name cost their client nothing to send, and so no credit; what was copied of it is
// outstanding in the same way, and nothing is read on while that is as much as kNamedMessages of the greatest messages
// could have brought themselves.
//
// Threads: Take belongs to one thread at a time, Pop and Done to the core's; all are thread-safe
// against each other. `schedule` and the sink are called with the intake's lock held.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/budget.h"
#include "daemon/core/session_sink.h"
#include "daemon/scene/operation.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

// One message of a client's, decoded. Sequences ascend from message to message.
struct IncomingMessage {
  std::vector<Operation> operations;
  Refusals refused;  // what decoding refused
  uint64_t bytes = 0;
  sync::TimeNs received_ns = 0, decoded_ns = 0;
  uint64_t named_bytes = 0;  // copied from local memory, beside its own bytes
};

// A commit's refusals so far, and how many Issues its session was told one by one. Single-threaded.
class RefusalTally {
 public:
  uint64_t refused() const { return refused_; }
  const std::string& first() const { return first_; }  // as Describe has it

  // "layer/id, field: message", without what the issue has not.
  static std::string Describe(const Issue& issue);

  // Counts one, if it is a refusal; does not tell it.
  void Count(const Issue& issue);
  // Counts so many that are not told; `first` may be the commit's first refusal.
  void CountMore(uint64_t more, const std::optional<Issue>& first);
  // Tells `sink` (null: nobody), unless it has been told `most`.
  void Tell(const Issue& issue, SessionSink* sink, uint64_t most);
  void LeaveOut(uint64_t more) { left_out_ += more; }
  // Says how many were left out, if any were.
  void TellOfThoseLeftOut(uint64_t sequence, SessionSink* sink, uint64_t most);

 private:
  uint64_t refused_ = 0;
  std::string first_;
  uint64_t told_ = 0, left_out_ = 0;
};

struct WaitingCommit {
  uint64_t sequence = 0;
  Commit commit;
  std::vector<Operation> operations;
  RefusalTally refusals;
  uint64_t dropped_frames = 0;
  sync::TimeNs received_ns = 0, decoded_ns = 0;
  uint64_t bytes = 0;  // charged to kWaiting
  // Of its messages, not given back yet.
  uint64_t credit = 0, named_bytes = 0;
  bool detached = false;
  bool late = false;  // its time had passed when it came

  struct Cost {
    uint64_t bytes = 0, credit = 0;
  };
  std::vector<Cost> costs;  // of each operation
};

class Intake {
 public:
  static constexpr uint64_t kNamedMessages = 4;

  // `open_bytes`: of the Open, which counts against the credit.
  // `bytes_in` counts what all sessions have sent.
  Intake(const Limits& limits, std::shared_ptr<Budget> budget,
         std::shared_ptr<std::atomic<uint64_t>> bytes_in, const OpenOptions& options,
         uint64_t open_bytes, std::shared_ptr<SessionSink> sink, std::function<void()> schedule);
  ~Intake();
  Intake(const Intake&) = delete;
  Intake& operator=(const Intake&) = delete;

  uint64_t first_credit() const;

  // Stages the operations, and queues a commit for each Commit among them. Refusals are told at once. Whether
  // this filled it: then nothing more should be read until the sink gets OnRoom, which comes once for each time;
  // what has been read may still be handed over.
  bool Take(IncomingMessage message);
  bool HasRoom() const;
  // Asks for a turn: the sink is not crowded any more.
  void Wake();

  // The next commit in its turn, and whether more wait. Once none does, the next Take schedules again.
  std::optional<WaitingCommit> Pop(bool* more);
  bool empty() const;
  // What it held is given back. Each commit that was popped comes here, and to no further use.
  void Done(WaitingCommit commit);
  // It waits elsewhere, for its time: its credit is given back, its memory stays charged until Done.
  void Detach(WaitingCommit& commit);
  // From now on messages are dropped, nothing is told, and what is staged goes. Commits that wait stay.
  void Close();

 private:
  struct FrameRef {
    uint64_t commit = 0;  // its place in the queue, counted from the session's first
    uint64_t begin_sequence = 0;
  };

  void Stage(Operation operation, uint64_t credit) VOXELD_REQUIRES(mutex_);
  void Seal(const Operation& operation, const IncomingMessage& message) VOXELD_REQUIRES(mutex_);
  void GiveUpFrames(uint64_t commit) VOXELD_REQUIRES(mutex_);
  void DropFrame(const std::string& layer, const FrameRef& frame) VOXELD_REQUIRES(mutex_);
  void ReturnStaged() VOXELD_REQUIRES(mutex_);
  void Return(uint64_t credit, uint64_t named_bytes) VOXELD_REQUIRES(mutex_);
  bool Room() const VOXELD_REQUIRES(mutex_);

  const Limits& limits_;
  const std::shared_ptr<Budget> budget_;
  const std::shared_ptr<std::atomic<uint64_t>> bytes_in_;
  const size_t frames_kept_;  // of a layer; 0: all
  mutable sync::Mutex mutex_;
  std::shared_ptr<SessionSink> sink_ VOXELD_GUARDED_BY(mutex_);  // null: closed
  std::function<void()> schedule_ VOXELD_GUARDED_BY(mutex_);
  bool scheduled_ VOXELD_GUARDED_BY(mutex_) = false;
  bool asked_for_room_ VOXELD_GUARDED_BY(mutex_) = false;

  WaitingCommit staged_ VOXELD_GUARDED_BY(mutex_);
  size_t staged_returned_ VOXELD_GUARDED_BY(mutex_) = 0;  // operations whose credit went back
  uint64_t detached_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::deque<WaitingCommit> queue_ VOXELD_GUARDED_BY(mutex_);
  uint64_t popped_ VOXELD_GUARDED_BY(mutex_) = 0;     // commits, ever
  uint64_t under_way_ VOXELD_GUARDED_BY(mutex_) = 0;  // popped, not done
  std::map<std::string, std::deque<FrameRef>> frames_ VOXELD_GUARDED_BY(mutex_);

  uint64_t received_ VOXELD_GUARDED_BY(mutex_);
  uint64_t returned_ VOXELD_GUARDED_BY(mutex_);
  uint64_t told_credit_ VOXELD_GUARDED_BY(mutex_);
  uint64_t named_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;  // outstanding
};

}  // namespace voxeld::daemon
