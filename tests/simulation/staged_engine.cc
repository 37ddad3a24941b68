#include "tests/simulation/staged_engine.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "gpu/cpu/cpu_engine.h"

namespace voxeld::simulation {
namespace {

class StagedEngine final : public gpu::Engine {
 public:
  explicit StagedEngine(std::shared_ptr<EngineStage> stage) : stage_(std::move(stage)) {
    gpu::EngineOptions options;
    options.threads = 1;
    options.inline_execution = true;
    engine_ = gpu::CreateCpuEngine(options, "a simulation");
  }
  ~StagedEngine() override {
    std::deque<EngineStage::Call>& calls = stage_->calls;
    std::vector<EngineStage::Call> mine;
    for (EngineStage::Call& call : calls) {
      if (call.engine == this) mine.push_back(call);
    }
    std::erase_if(calls, [this](const EngineStage::Call& call) { return call.engine == this; });
    for (const EngineStage::Call& call : mine) call.run(true);
  }

  const gpu::EngineInfo& info() const override { return engine_->info(); }

  void SetTarget(gpu::Target target, Done done) override {
    Queue([this, target = std::move(target), done = std::move(done)](bool cancelled) {
      if (cancelled || gone_) return done(Over(cancelled));
      engine_->SetTarget(target, [&](const absl::Status& status) { Answer(0, status, done); });
    });
  }

  absl::StatusOr<gpu::StagingBlock> AcquireStaging(size_t size) override {
    if (std::exchange(stage_->fail_staging, false)) {
      return absl::ResourceExhaustedError("no staging memory, as planned");
    }
    return engine_->AcquireStaging(size);
  }

  void Apply(gpu::StagingBlock block, size_t size, Done done) override {
    Queue([this, block = std::move(block), size, done = std::move(done)](bool cancelled) {
      if (cancelled || gone_) return done(Over(cancelled));
      const absl::Status status = scene_.Apply(block.bytes().first(size), block.referred());
      if (!status.ok()) return done(status);
      engine_->Apply(block, size, [&](const absl::Status& applied) { Answer(0, applied, done); });
    });
  }

  void SubmitFrame(const gpu::FrameRequest& request, gpu::FrameBuffer buffer,
                   FrameDone done) override {
    if (stage_->on_submit) stage_->on_submit(request.frame);
    Queue([this, request, buffer, done = std::move(done)](bool cancelled) {
      if (cancelled || gone_) return done(Over(cancelled));
      if (stage_->fail.has_value()) {
        const absl::Status status = *std::exchange(stage_->fail, std::nullopt);
        gone_ = absl::IsDataLoss(status);
        if (stage_->on_failed) stage_->on_failed(request.frame, status);
        return done(status);
      }
      engine_->SubmitFrame(request, buffer, [&](const absl::StatusOr<gpu::FrameResult>& result) {
        if (result.ok() && stage_->on_frame) stage_->on_frame(request.frame, scene_, buffer.bytes);
        if (!result.ok()) return Answer(request.frame, result.status(), done);
        // How long drawing took is not determined by the seed.
        gpu::FrameResult same = *result;
        same.assemble_ns = same.slice_ns = same.copy_ns = 1000;
        done(same);
      });
    });
  }

  void ReadVoxels(gpu::VoxelBox box, std::span<uint32_t> out, Done done) override {
    engine_->ReadVoxels(box, out, std::move(done));
  }

 private:
  // The call failed by itself: it was out of memory (tests/simulation/allocations_test.cc).
  template <typename DoneFunction>
  void Answer(uint64_t volume, const absl::Status& status, const DoneFunction& done) {
    gone_ = gone_ || absl::IsDataLoss(status);
    if (!status.ok() && stage_->on_failed) stage_->on_failed(volume, status);
    done(status);
  }
  static absl::Status Over(bool cancelled) {
    return cancelled ? absl::CancelledError("the engine was let go")
                     : absl::DataLossError("the engine is gone");
  }
  void Queue(std::function<void(bool)> run) {
    const sync::TimeNs takes = stage_->takes ? stage_->takes() : 0;
    const sync::TimeNs from =
        stage_->calls.empty() ? stage_->clock->Now() : stage_->calls.back().due;
    stage_->calls.push_back({std::max(from, stage_->clock->Now()) + takes, this, std::move(run)});
  }

  const std::shared_ptr<EngineStage> stage_;
  std::unique_ptr<gpu::Engine> engine_;
  daemon::testing::SceneModel scene_;
  bool gone_ = false;
};

}  // namespace

namespace {
constinit thread_local bool running = false;
}

void EngineStage::Run() {
  const Call call = std::move(calls.front());
  calls.pop_front();
  running = true;
  call.run(false);
  running = false;
}

bool EngineStage::IsRunning() { return running; }

std::unique_ptr<gpu::Engine> MakeStagedEngine(std::shared_ptr<EngineStage> stage) {
  return std::make_unique<StagedEngine>(std::move(stage));
}

}  // namespace voxeld::simulation
