#include "gpu/cpu/cpu_core.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "gpu/checks.h"
#include "gpu/word.h"

namespace voxeld::gpu {
CpuCore::CpuCore(std::unique_ptr<Executor> executor, SlicePart part, uint64_t index_bytes)
    : executor_(std::move(executor)),
      part_(part),
      volume_(*executor_, index_bytes),
      pictures_(*executor_) {}

absl::Status CpuCore::SetTarget(Target target) {
  if (absl::Status status = CheckTarget(target, part_); !status.ok()) return status;
  const display::VoxelGrid& voxels = target.geometry.grid;
  display::FootprintTable table = display::BuildFootprints(target.geometry, target.tone.sampling);
  const TileGrid grid = TileGrid::Of(voxels.nx, voxels.ny, voxels.nz, Sampler::FastestAxis(table));
  display::TileToSlices tile_to_slices(table, voxels, kTileSize, kTileSize, kTileSize);
  std::shared_ptr<const LightPlan> light =
      lights_.Of(table, target.geometry, target.layout, target.tone);
  absl::StatusOr<Sampler> sampler = Sampler::Create(std::move(table), grid, target.tone.sampling);
  if (!sampler.ok()) return sampler.status();

  const auto [begin, end] = part_.Within(target.layout.slices);
  volume_.SetView(grid, target.view, OwnedTiles(tile_to_slices, grid, part_, target.layout.slices));
  pictures_.SetPlan({target.layout, target.tone, begin, end, std::move(light), *std::move(sampler),
                     std::move(tile_to_slices)});
  unsliced_ = {};
  unobserved_.clear();
  layout_ = target.layout;
  return absl::OkStatus();
}

absl::Status CpuCore::Apply(const StagingBlock& block, size_t size) {
  const absl::StatusOr<std::span<std::byte>> delta = CheckDelta(block, size);
  if (!delta.ok()) return delta.status();
  BlockSource referred(block.referred());
  return volume_.Apply(*delta, block.bulk() != nullptr ? block.bulk() : &referred);
}

void CpuCore::UpdateVolume(TileObserver* observer) {
  Volume::Changes now = volume_.Update(observer);
  unsliced_.tiles_drawn += now.tiles_drawn;
  unsliced_.tiles.insert(unsliced_.tiles.end(), now.tiles.begin(), now.tiles.end());
  if (observer == nullptr) {
    unobserved_.insert(unobserved_.end(), now.tiles.begin(), now.tiles.end());
  }
  unsliced_.was_lit.insert(unsliced_.was_lit.end(), now.was_lit.begin(), now.was_lit.end());
}

absl::StatusOr<FrameResult> CpuCore::SubmitFrame(const FrameRequest& request, FrameBuffer buffer) {
  if (absl::Status status = CheckFrame(request, buffer, layout_, last_frame_); !status.ok()) {
    return status;
  }
  FrameResult result;
  result.frame = request.frame;
  const sync::SystemClock clock;
  const sync::TimeNs start = clock.Now();
  UpdateVolume(pictures_.observer());
  const sync::TimeNs assembled = clock.Now();
  result.tiles_drawn = unsliced_.tiles_drawn;
  const Volume::Changes changes = std::exchange(unsliced_, {});
  const std::vector<uint32_t> unobserved = std::exchange(unobserved_, {});
  const Pictures::Result drawn =
      pictures_.Update(volume_.tiles(), changes, unobserved, request.frame);
  pictures_.CopyTo(buffer, request.buffer_holds);
  result.changed = drawn.changed;
  result.packed_as_drawn = pictures_.observer() != nullptr;
  result.pictures_drawn = drawn.pictures_drawn;
  result.lit_voxels = volume_.lit_voxels();
  result.singular_drawables = volume_.singular_drawables();
  result.memory_bytes = volume_.memory_bytes() + pictures_.memory_bytes();
  result.assemble_ns = assembled - start;
  result.slice_ns = clock.Now() - assembled;
  last_frame_ = request.frame;
  return result;
}

absl::Status CpuCore::ReadVoxels(VoxelBox box, std::span<uint32_t> out) {
  if (absl::Status status = CheckBox(box, out.size(), layout_); !status.ok()) return status;
  UpdateVolume(nullptr);
  const TileStore& tiles = volume_.tiles();
  const TileGrid& grid = tiles.grid();
  const Box3 volume{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
  size_t i = 0;
  for (int32_t z = box.z0; z < box.z1; ++z) {
    for (int32_t y = box.y0; y < box.y1; ++y) {
      for (int32_t x = box.x0; x < box.x1; ++x, ++i) {
        out[i] = 0;
        if (!Contains(volume, x, y, z)) continue;
        const uint32_t* colors = tiles.colors(grid.TileOf(x, y, z));
        if (colors != nullptr) out[i] = Deinterleave(colors[grid.IndexInTile(x, y, z)]);
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu
