// The engine's interface around a core that does the work of its calls. It adds the queue, the
// staging memory, and the handling of calls that fail midway.
#pragma once

#include <exception>
#include <memory>
#include <span>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "gpu/call_queue.h"
#include "gpu/engine.h"
#include "gpu/staging.h"

namespace voxeld::gpu {

// `Core` is used by one thread at a time. It has SetTarget, Apply, SubmitFrame and ReadVoxels, as
// CpuCore has them, and link if it has one.
template <typename Core>
class CoreEngine final : public Engine {
 public:
  CoreEngine(const EngineOptions& options, EngineInfo info, std::unique_ptr<Core> core)
      : info_(std::move(info)),
        staging_(options.staging_limit_bytes),
        core_(std::move(core)),
        calls_(options.inline_execution) {}

  const EngineInfo& info() const override { return info_; }

  void SetTarget(Target target, Done done) override {
    Post(std::move(done), [this, target = std::move(target)]() mutable {
      return core_->SetTarget(std::move(target));
    });
  }

  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return staging_.Acquire(size);
  }

  void Apply(StagingBlock block, size_t size, Done done) override {
    Post(std::move(done), [this, block = std::move(block), size]() mutable {
      const StagingBlock mine = std::move(block);  // released before the answer
      return core_->Apply(mine, size);
    });
  }

  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    Post(std::move(done), [this, request, buffer] { return core_->SubmitFrame(request, buffer); });
  }

  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    Post(std::move(done), [this, box, out] { return core_->ReadVoxels(box, out); });
  }

  RankLink* link() override {
    if constexpr (requires { core_->link(); }) {
      return core_->link();
    } else {
      return nullptr;
    }
  }

 private:
  // Runs `work` when its turn comes and answers with the value that it returns.
  template <typename DoneFunction, typename Work>
  void Post(DoneFunction done, Work work) {
    calls_.Post([this, done = std::move(done), work = std::move(work)](bool cancelled) mutable {
      if (cancelled) return done(absl::CancelledError("engine: it is being destroyed"));
      if (!lost_.ok()) return done(lost_);
      done(Guarded(work));
    });
  }

  // If memory runs out in the middle of a call, the state of the engine can no longer be trusted.
  template <typename Work>
  auto Guarded(Work& work) -> decltype(work()) {
    try {
      auto result = work();
      if (absl::IsDataLoss(StatusOf(result))) lost_ = StatusOf(result);
      return result;
    } catch (const std::exception& e) {
      lost_ = absl::DataLossError(absl::StrCat("engine: lost in the middle of a call: ", e.what()));
      return lost_;
    }
  }

  static const absl::Status& StatusOf(const absl::Status& status) { return status; }
  template <typename T>
  static const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
    return result.status();
  }

  const EngineInfo info_;
  StagingPool staging_;
  const std::unique_ptr<Core> core_;
  absl::Status lost_;  // if not OK: DataLoss, after a failure in the middle of a call
  CallQueue calls_;    // last, because its thread uses the other members
};

}  // namespace voxeld::gpu
