#include "daemon/explain/stage.h"

#include <utility>

namespace voxeld::daemon {
namespace {

// The result of a call that completes before it returns.
class Answered {
 public:
  gpu::Engine::Done done() {
    return [this](absl::Status status) { status_ = std::move(status); };
  }
  gpu::Engine::FrameDone frame_done() {
    return [this](const absl::StatusOr<gpu::FrameResult>& frame) { status_ = frame.status(); };
  }
  const absl::Status& status() const { return status_; }

 private:
  absl::Status status_ = absl::InternalError("the engine has not answered");
};

}  // namespace

gpu::Target VoxelsOf(const gpu::Target& target) {
  const display::VoxelGrid& grid = target.geometry.grid;
  display::PlanarStack stack;
  stack.width_px = grid.nx;
  stack.height_px = grid.ny;
  for (int32_t z = 0; z < grid.nz; ++z) stack.positions_mm.push_back(z);
  gpu::Target voxels;
  voxels.geometry.shape = std::move(stack);
  voxels.geometry.grid = {
      grid.nx, grid.ny, grid.nz, {1, 1, 1}, {-grid.nx / 2.0, -grid.ny / 2.0, -0.5}};
  voxels.layout = {.slices = grid.nz, .width = grid.nx, .height = grid.ny};
  voxels.tone.SetCurve(display::Tone::Linear());
  voxels.view = target.view;
  return voxels;
}

Stage::Stage(std::unique_ptr<gpu::Engine> engine, const gpu::Target& target,
             std::function<bool()> cancelled)
    : cancelled_(std::move(cancelled)),
      engine_(std::move(engine)),
      pictures_(target.layout.bytes()),
      changed_in_(target.layout.pictures()) {}

absl::StatusOr<std::unique_ptr<Stage>> Stage::Make(const gpu::Target& target,
                                                   std::function<bool()> cancelled) {
  auto engine = gpu::CreateEngine({.kind = gpu::EngineKind::kCpu,
                                   .inline_execution = true,
                                   .index_bytes = uint64_t{256} << 20});
  if (!engine.ok()) return engine.status();
  std::unique_ptr<Stage> stage(new Stage(*std::move(engine), target, std::move(cancelled)));
  Answered answered;
  stage->engine_->SetTarget(target, answered.done());
  if (!answered.status().ok()) return answered.status();
  return stage;
}

absl::Status Stage::Draw(SnapshotPtr scene) {
  if (cancelled_ && cancelled_()) return absl::CancelledError("nobody waits for it any more");
  if (const size_t size = held_.Plan(std::move(scene)); size > 0) {
    absl::StatusOr<gpu::StagingBlock> block = engine_->AcquireStaging(size);
    if (!block.ok()) return block.status();
    gpu::DeltaWriter writer(block->bytes());
    held_.Write(writer);
    block->Refer(writer.TakeReferred());
    Answered applied;
    engine_->Apply(*std::move(block), size, applied.done());
    if (!applied.status().ok()) return applied.status();
  }
  Answered drawn;
  const uint64_t before = frame_++;
  engine_->SubmitFrame({.frame = frame_, .buffer_holds = before}, {pictures_, changed_in_},
                       drawn.frame_done());
  return drawn.status();
}

}  // namespace voxeld::daemon
