#include "daemon/viewer/comparer.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>
#include <utility>

#include "daemon/scene/engine_delta.h"
#include "daemon/viewer/volume_message.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::daemon::viewer {
namespace {

constexpr int kNice = 10;
constexpr uint64_t kIndexBytes = uint64_t{256} << 20;

// Returns: the target of a display whose pixels are the voxels.
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

// The reference drawing of one display's scene.
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

  // Draws the scene. After an error the object is unusable.
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

  // Returns: the places of the display's pixels, computed on the first call.
  PixelPlaces& PlacesOf(const display::Geometry& geometry) {
    if (places_ == nullptr) places_ = std::make_unique<PixelPlaces>(geometry);
    return *places_;
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
  std::unique_ptr<PixelPlaces> places_;
};

namespace {

// A charge against the budget for answers, released by the destructor.
class Charge {
 public:
  Charge(Budget* budget, uint64_t bytes) : budget_(budget), bytes_(bytes) {
    if (budget_ != nullptr && !budget_->Charge(Budget::Use::kAnswers, bytes_)) {
      budget_ = nullptr;
      refused_ = true;
    }
  }
  ~Charge() {
    if (budget_ != nullptr) budget_->Release(Budget::Use::kAnswers, bytes_);
  }
  Charge(const Charge&) = delete;
  Charge& operator=(const Charge&) = delete;
  bool refused() const { return refused_; }

 private:
  Budget* budget_;
  const uint64_t bytes_;
  bool refused_ = false;
};

constexpr uint64_t kBytesPerPoint = 9;

// Collects lit pixels until there are too many.
absl::StatusOr<Points> LitOf(const display::DecodedVolume& volume, const display::VoxelGrid& grid,
                             PixelPlaces& places) {
  constexpr int32_t kAtOnce = 16;
  Points points;
  for (int32_t slice = 0; slice < volume.layout.slices; slice += kAtOnce) {
    std::vector<int32_t> some;
    for (int32_t i = slice; i < std::min(slice + kAtOnce, volume.layout.slices); ++i) {
      some.push_back(i);
    }
    AppendLit(volume, some, places, &points);
    if (absl::Status may = CheckComparable(grid, points.size()); !may.ok()) return may;
  }
  return points;
}

}  // namespace

Comparer::Comparer(sync::Clock& clock, std::shared_ptr<Budget> budget)
    : clock_(clock), budget_(std::move(budget)) {}

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
  absl::Status refused =
      absl::ResourceExhaustedError("too many are compared now; it is asked for again");
  {
    sync::MutexLock lock(mutex_);
    try {
      if (!thread_.joinable()) thread_ = std::thread([this] { Run(); });
      if (tasks_.size() < kMostTasks) {
        tasks_.push_back(std::move(task));
        wake_.NotifyOne();
        return;
      }
    } catch (const std::system_error&) {
      refused = absl::ResourceExhaustedError("there is no thread to be had for it now");
    }
  }
  task.done(refused);
}

void Comparer::Run() {
  // On Linux this affects the current thread only. Displays have priority.
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  References references;
  sync::TimeNs rests_until = 0;
  for (;;) {
    Task task;
    {
      sync::MutexLock lock(mutex_);
      while (!ends_) {
        const sync::TimeNs now = clock_.Now();
        sync::TimeNs next = sync::kNever;
        for (const auto& [name, reference] : references) {
          next = std::min(next, reference.used + kLinger);
        }
        if (!tasks_.empty()) next = std::min(next, rests_until);
        if (next <= now || (!tasks_.empty() && rests_until <= now)) break;
        clock_.WaitUntil(mutex_, wake_, next);
      }
      if (ends_) return;
      if (!tasks_.empty() && rests_until <= clock_.Now()) {
        task = std::move(tasks_.front());
        tasks_.pop_front();
      }
    }
    const sync::TimeNs began = clock_.Now();
    if (task.done) task.done(Serve(task, references));
    const sync::TimeNs now = clock_.Now();
    if (task.done) rests_until = now + std::min(now - began, kMostRest);
    std::erase_if(references, [&](const auto& each) { return each.second.used + kLinger <= now; });
  }
}

absl::StatusOr<Comparison> Comparer::Serve(const Task& task, References& references) const {
  if (absl::Status may = CheckComparable(task.info->geometry.grid); !may.ok()) return may;
  Reference& reference = references[task.display];
  absl::StatusOr<Comparison> comparison = Hold(task, reference);
  reference.used = clock_.Now();
  if (!comparison.ok()) references.erase(task.display);
  return comparison;
}

absl::StatusOr<Comparison> Comparer::Hold(const Task& task, Reference& reference) const {
  const display::Geometry& geometry = task.info->geometry;
  const DrawnFrom& from = task.shown.from;
  PixelPlaces& places = reference.PlacesOf(geometry);
  const absl::StatusOr<Points> lit = LitOf(task.shown.volume, geometry.grid, places);
  if (!lit.ok()) return lit.status();
  const Charge charge(budget_.get(), lit->size() * (kBytesPerPoint + sizeof(PixelCell)) +
                                         2 * Comparison::kMostPoints * kBytesPerPoint);
  if (charge.refused()) {
    return absl::ResourceExhaustedError("max_memory_bytes leaves no room for it now");
  }
  const absl::Status drawn =
      reference.Draw(geometry.grid, from.scene_to_voxel,
                     task.hidden.empty() ? from.scene : Without(from.scene, task.hidden));
  if (!drawn.ok()) return drawn;
  return Compare(geometry.grid, task.shown.volume.layout, from.tone,
                 ReachOf(geometry, from.tone.sampling), places.box(), *lit,
                 [&](int32_t z0, int32_t z1, std::span<uint32_t> out) -> absl::Status {
                   if (ends_) return absl::CancelledError("the daemon is shutting down");
                   return reference.Read(z0, z1, out);
                 });
}

}  // namespace voxeld::daemon::viewer
