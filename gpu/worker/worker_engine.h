// An engine in a process of its own, as its owner uses it: the usual interface, with calls sent as
// messages and bulk data in shared memory. A fault in that process, for example of the GPU, ends in
// DataLoss here.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "gpu/rank_link.h"
#include "gpu/worker/worker_staging.h"

namespace voxeld::gpu {

// Starts the program, unless options.workers has a process for that GPU, and waits until its engine
// is ready, for at most options.worker_deadline_ns (for the first CUDA context, ten times that).
// `reason`: for EngineInfo. Errors: FailedPrecondition if the program or the engine is not
// available.
//
// Contract, beyond gpu/engine.h's: a call whose answer does not come within worker_deadline_ns (and
// 4 ns for each byte that is sent with it), and every call after the process has ended, ends in
// DataLoss; the process is killed, and nothing waits for it. Answers come on one of the engine's
// threads.
absl::StatusOr<std::unique_ptr<Engine>> CreateWorkerEngine(const EngineOptions& options,
                                                           std::string reason);

// One of several engines that drive a display together (gpu/ranks).
class RankWorker : public Engine {
 public:
  // The worker's RankLink. Joining may take as long as a first answer.
  virtual void Invite(const std::string& library,
                      std::function<void(absl::StatusOr<RankLink::Invitation>)> done) = 0;
  virtual void Join(const std::string& library, const RankLink::Invitation& invitation, int rank,
                    int ranks, Done done) = 0;
  // Ends the process soon: all pending calls, and every later call, end in `why`, a DataLoss.
  virtual void GiveUp(const absl::Status& why) = 0;
  // Ends the connection: before it returns, all pending calls are answered with Cancelled, and so
  // is every later call. Must not be called from the engine's own thread.
  virtual void Close() = 0;
};

// The same as a rank: with a process of its own, and staging memory that it shares with the other
// ranks. Does not wait: `opened` is called once with the result of starting its engine; after an
// error all calls end in DataLoss. Ignores options.inline_execution.
absl::StatusOr<std::unique_ptr<RankWorker>> CreateRankWorker(
    const EngineOptions& options, std::shared_ptr<WorkerStaging> staging,
    std::function<void(const absl::Status&)> opened);

// Returns whether a DataLoss says that no answer came in time: the engine may have been slow, not
// faulty.
bool IsLate(const absl::Status& status);

}  // namespace voxeld::gpu
