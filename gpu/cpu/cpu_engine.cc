#include "gpu/cpu/cpu_engine.h"

#include <algorithm>
#include <exception>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cpu/call_queue.h"
#include "gpu/cpu/cpu_core.h"
#include "gpu/cpu/staging.h"

namespace voxeld::gpu {
namespace {

int ThreadCount(const EngineOptions& options) {
  if (options.threads > 0) return options.threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

EngineInfo InfoOf(int threads, std::string reason) {
  return {EngineKind::kCpu, absl::StrCat("CPU, ", threads, threads == 1 ? " thread" : " threads"),
          std::move(reason)};
}

class CpuEngine final : public Engine {
 public:
  CpuEngine(const EngineOptions& options, int threads, std::string reason)
      : info_(InfoOf(threads, std::move(reason))),
        staging_(options.staging_limit_bytes),
        core_(MakeExecutor(threads), options.part),
        calls_(options.inline_execution) {}

  const EngineInfo& info() const override { return info_; }

  void SetTarget(Target target, Done done) override {
    Post(std::move(done), [this, target = std::move(target)]() mutable {
      return core_.SetTarget(std::move(target));
    });
  }

  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return staging_.Acquire(size);
  }

  void Apply(StagingBlock block, size_t size, Done done) override {
    Post(std::move(done), [this, block = std::move(block), size]() mutable {
      const StagingBlock mine = std::move(block);  // given back, if not retained, before the answer
      return core_.Apply(mine, size);
    });
  }

  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    Post(std::move(done), [this, request, buffer] { return core_.SubmitFrame(request, buffer); });
  }

  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    Post(std::move(done), [this, box, out] { return core_.ReadVoxels(box, out); });
  }

 private:
  // Runs `work` in its turn and answers with what it returns.
  template <typename DoneFunction, typename Work>
  void Post(DoneFunction done, Work work) {
    calls_.Post([this, done = std::move(done), work = std::move(work)](bool cancelled) mutable {
      if (cancelled) return done(absl::CancelledError("engine: it is being destroyed"));
      if (!lost_.ok()) return done(lost_);
      done(Guarded(work));
    });
  }

  // Memory that runs out in the middle of a call leaves an engine that cannot be trusted.
  template <typename Work>
  auto Guarded(Work& work) -> decltype(work()) {
    try {
      return work();
    } catch (const std::exception& e) {
      lost_ = absl::DataLossError(absl::StrCat("engine: lost in the middle of a call: ", e.what()));
      return lost_;
    }
  }

  const EngineInfo info_;
  StagingPool staging_;
  CpuCore core_;
  absl::Status lost_;  // not OK: DataLoss, after a failure in the middle of a call
  CallQueue calls_;    // last: its thread uses the others
};

}  // namespace

std::unique_ptr<Engine> CreateCpuEngine(const EngineOptions& options, std::string reason) {
  return std::make_unique<CpuEngine>(options, ThreadCount(options), std::move(reason));
}

}  // namespace voxeld::gpu
