#include "daemon/viewer/comparer.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "daemon/scene/engine_delta.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::daemon::viewer {
namespace {

constexpr int kNice = 10;
constexpr uint64_t kIndexBytes = uint64_t{256} << 20;

// Of a display whose pixels are the voxels.
gpu::Target TargetOf(const display::VoxelGrid& grid, const gpu::Affine& view) {
  display::PlanarStack stack;
  stack.width_px = grid.nx, stack.height_px = grid.ny;
  stack.pitch_u_mm = grid.pitch_mm.x, stack.pitch_v_mm = grid.pitch_mm.y;
  stack.thickness_mm = grid.pitch_mm.z;
  const double middle = grid.origin_mm.z + grid.nz * grid.pitch_mm.z / 2;
  for (int32_t k = 0; k < grid.nz; ++k) {
    stack.positions_mm.push_back(grid.origin_mm.z + (k + 0.5) * grid.pitch_mm.z - middle);
  }
  gpu::Target target;
  target.geometry.shape = std::move(stack);
  target.geometry.grid = grid;
  target.geometry.grid.origin_mm = {-grid.nx * grid.pitch_mm.x / 2, -grid.ny * grid.pitch_mm.y / 2,
                                    -grid.nz * grid.pitch_mm.z / 2};
  target.layout = {.slices = grid.nz, .width = grid.nx, .height = grid.ny};
  target.tone.SetCurve(display::Tone::Linear());
  target.view = view;
  return target;
}

SnapshotPtr Without(const SnapshotPtr& scene, const std::vector<OwnedName>& hidden) {
  auto without = std::make_shared<Snapshot>(*scene);
  for (const OwnedName& name : hidden) {
    const Layer* const layer = scene->FindLayer(name);
    if (layer == nullptr) continue;
    auto dark = std::make_shared<Layer>(*layer);
    dark->visible = false;
    without->layers.Put(name, std::move(dark));
  }
  return without;
}

}  // namespace

// The scene of one display.
class Comparer::Reference {
 public:
  Reference() {
    auto engine = gpu::CreateEngine({.kind = gpu::EngineKind::kCpu,
                                     .threads = 1,
                                     .inline_execution = true,
                                     .index_bytes = kIndexBytes});
    status_ = engine.status();
    if (engine.ok()) engine_ = *std::move(engine);
  }

  // An error is the end of it.
  absl::Status Draw(const display::VoxelGrid& grid, const gpu::Affine& view, SnapshotPtr scene) {
    if (!status_.ok()) return status_;
    const auto take = [this](const absl::Status& status) { status_.Update(status); };
    if (!drawn_ || grid != grid_ || view != view_) {
      engine_->SetTarget(TargetOf(grid, view), take);
      grid_ = grid, view_ = view, drawn_ = true;
    }
    const size_t size = scene_.Plan(std::move(scene));
    if (size == 0 || !status_.ok()) return status_;
    absl::StatusOr<gpu::StagingBlock> block = engine_->AcquireStaging(size);
    if (!block.ok()) return status_ = block.status();
    gpu::DeltaWriter writer(block->bytes());
    scene_.Write(writer);
    block->Refer(writer.TakeReferred());
    engine_->Apply(*std::move(block), size, take);
    return status_;
  }

  absl::Status Read(int32_t z0, int32_t z1, std::span<uint32_t> out) {
    engine_->ReadVoxels({0, 0, z0, grid_.nx, grid_.ny, z1}, out,
                        [this](const absl::Status& status) { status_.Update(status); });
    return status_;
  }

  sync::TimeNs used = 0;

 private:
  std::unique_ptr<gpu::Engine> engine_;
  EngineScene scene_;
  absl::Status status_;
  display::VoxelGrid grid_;
  gpu::Affine view_;
  bool drawn_ = false;
};

Comparer::Comparer(sync::Clock& clock) : clock_(clock) {}

Comparer::~Comparer() {
  std::deque<Task> left;
  {
    sync::MutexLock lock(mutex_);
    ends_ = true;
    left.swap(tasks_);
  }
  wake_.NotifyAll();
  if (thread_.joinable()) thread_.join();
  for (const Task& task : left) task.done(absl::CancelledError("the daemon is shutting down"));
}

void Comparer::Post(Task task) {
  {
    sync::MutexLock lock(mutex_);
    try {
      if (!thread_.joinable()) thread_ = std::thread([this] { Run(); });
      tasks_.push_back(std::move(task));
      wake_.NotifyOne();
      return;
    } catch (const std::system_error&) {
    }
  }
  task.done(absl::ResourceExhaustedError("there is no thread to be had for it now"));
}

void Comparer::Run() {
  // On Linux this is the thread's alone. Displays come first.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  References references;
  for (;;) {
    Task task;
    {
      sync::MutexLock lock(mutex_);
      while (tasks_.empty() && !ends_) {
        sync::TimeNs next = sync::kNever;
        for (const auto& [name, reference] : references) {
          next = std::min(next, reference.used + kLinger);
        }
        if (next <= clock_.Now()) break;
        clock_.WaitUntil(mutex_, wake_, next);
      }
      if (ends_) return;
      if (!tasks_.empty()) {
        task = std::move(tasks_.front());
        tasks_.pop_front();
      }
    }
    if (task.done) task.done(Serve(task, references));
    const sync::TimeNs now = clock_.Now();
    std::erase_if(references, [&](const auto& each) { return each.second.used + kLinger <= now; });
  }
}

absl::StatusOr<Comparison> Comparer::Serve(const Task& task, References& references) const {
  if (absl::Status may = CheckComparable(task.grid); !may.ok()) return may;
  Reference& reference = references[task.display];
  const absl::Status status =
      reference.Draw(task.grid, task.from.scene_to_voxel,
                     task.hidden.empty() ? task.from.scene : Without(task.from.scene, task.hidden));
  if (!status.ok()) {
    references.erase(task.display);
    return status;
  }
  absl::StatusOr<Comparison> comparison = Compare(
      task.grid, task.layout, task.from.tone, task.reach, task.box, task.shown,
      [&](int32_t z0, int32_t z1, std::span<uint32_t> out) { return reference.Read(z0, z1, out); });
  reference.used = clock_.Now();
  return comparison;
}

}  // namespace voxeld::daemon::viewer
