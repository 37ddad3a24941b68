#include "gpu/cuda/cuda_core.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "gpu/checks.h"
#include "gpu/cuda/kernels.h"
#include "gpu/slice/sampler.h"

namespace voxeld::gpu::cuda {

CudaCore::CudaCore(std::unique_ptr<Device> device, SlicePart part, const Tuning& tuning)
    : device_(std::move(device)),
      part_(part),
      tuning_(tuning),
      uploader_(*device_),
      stopwatch_(*device_),
      volume_(*device_, uploader_, tuning_) {}

absl::Status CudaCore::SetTarget(const Target& target) {
  if (absl::Status status = CheckTarget(target, part_); !status.ok()) return status;
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  const display::VoxelGrid& voxels = target.geometry.grid;
  const display::FootprintTable table =
      display::BuildFootprints(target.geometry, target.tone.sampling);
  const TileGrid grid = TileGrid::Of(voxels.nx, voxels.ny, voxels.nz, Sampler::FastestAxis(table));
  const display::TileToSlices tile_to_slices(table, voxels, kTileSize, kTileSize, kTileSize);
  const auto [begin, end] = part_.Within(target.layout.slices);
  const uint64_t bytes = static_cast<uint64_t>(end - begin) *
                         static_cast<uint64_t>(target.layout.sub_frames) *
                         target.layout.bytes_per_slice();
  std::optional<PackedPlan> packed;
  const std::shared_ptr<const LightPlan> light =
      lights_.Of(table, target.geometry, target.layout, target.tone);
  if (tuning_.pack_as_drawn && light->plain(target.layout)) {
    const auto groups =
        std::clamp<uint64_t>(bytes / tuning_.group_bytes, 2, PackedPlan::kMostGroups);
    packed = PackedPlan::Of(table, voxels, target.layout, target.tone, begin, end,
                            static_cast<int32_t>(groups));
  }
  absl::StatusOr<std::unique_ptr<CudaPictures>> pictures =
      CudaPictures::Make(*device_, {target.layout, target.tone, begin, end}, *light, table,
                         tile_to_slices, packed, pictures_.get());
  if (!pictures.ok()) return pictures.status();
  absl::StatusOr<DeviceTiles> tiles = DeviceTiles::Make(
      *device_, grid, OwnedTiles(tile_to_slices, grid, part_, target.layout.slices),
      !packed.has_value());
  if (!tiles.ok()) return tiles.status();
  // The tables have been copied from memory that is about to be freed.
  if (absl::Status status = device_->Wait(); !status.ok()) return status;
  const bool all_dirty = packed.has_value() && (*pictures)->inherited();
  if (absl::Status status = volume_.SetView(*std::move(tiles), target.view, all_dirty);
      !status.ok()) {
    return status;
  }
  pictures_ = *std::move(pictures);
  layout_ = target.layout;
  return absl::OkStatus();
}

absl::Status CudaCore::Apply(const StagingBlock& block, size_t size) {
  const absl::StatusOr<std::span<std::byte>> delta = CheckDelta(block, size);
  if (!delta.ok()) return delta.status();
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  BlockSource referred(block.referred());
  return volume_.Apply(*delta, block.bulk() != nullptr ? block.bulk() : &referred);
}

absl::StatusOr<FrameResult> CudaCore::SubmitFrame(const FrameRequest& request, FrameBuffer buffer) {
  if (absl::Status status = CheckFrame(request, buffer, layout_, last_frame_); !status.ok()) {
    return status;
  }
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  FrameResult result;
  result.frame = request.frame;
  const sync::SystemClock clock;
  const sync::TimeNs start = clock.Now();
  using Mark = Stopwatch::Mark;
  if (absl::Status status = stopwatch_.Set(Mark::kBegun); !status.ok()) return status;
  absl::Status status = volume_.TakeIn();
  if (!status.ok()) return status;
  const bool together = volume_.ItemsToDraw() < tuning_.few_items;
  status = volume_.ListDirty(pictures_->GroupsOfRegions(together));
  if (!status.ok()) return status;
  const PackedView* const packed = pictures_->packed();
  status = pictures_->Draw(volume_.view(), request.frame, buffer, request.buffer_holds, together,
                           {[&](uint32_t group, cudaStream_t stream) {
                              return volume_.DrawGroup(group, pictures_->index(), packed, stream);
                            },
                            volume_.DrawsApart()},
                           stopwatch_, result);
  if (!status.ok()) return status;
  volume_.CountersAreClear();
  const Mark assembled = packed != nullptr ? Mark::kPacked : Mark::kAssembled;
  const absl::StatusOr<int64_t> assemble = stopwatch_.Between(Mark::kBegun, assembled);
  if (!assemble.ok()) return assemble.status();
  const absl::StatusOr<int64_t> slice = stopwatch_.Between(assembled, Mark::kPacked);
  if (!slice.ok()) return slice.status();
  result.singular_drawables = volume_.singular_drawables();
  device_->pool().TrimAfterPeak();
  result.memory_bytes = device_->pool().held() + volume_.host_bytes();
  result.assemble_ns = *assemble;
  result.slice_ns = *slice;
  result.copy_ns = std::max<int64_t>(0, clock.Now() - start - *assemble - *slice);
  last_frame_ = request.frame;
  return result;
}

absl::Status CudaCore::ReadVoxels(VoxelBox box, std::span<uint32_t> out) {
  if (absl::Status status = CheckBox(box, out.size(), layout_); !status.ok()) return status;
  if (absl::Status status = device_->api().Enter(); !status.ok()) return status;
  absl::Status status = volume_.TakeIn();
  if (status.ok()) status = volume_.ListDirty({});
  if (status.ok())
    status = volume_.DrawGroup(0, pictures_->index(), pictures_->packed(), device_->stream());
  if (!status.ok()) return status;
  if (out.empty()) return device_->Wait();
  // Voxels outside the volume are 0.
  absl::StatusOr<Block> voxels = device_->Zeros(out.size() * sizeof(uint32_t));
  if (!voxels.ok()) return voxels.status();
  status =
      volume_.Read({{box.x0, box.y0, box.z0}, {box.x1, box.y1, box.z1}}, voxels->as<uint32_t>());
  if (status.ok()) {
    status = device_->ToHost(out.data(), voxels->as<uint32_t>(), out.size() * sizeof(uint32_t));
  }
  return status.ok() ? device_->Wait() : status;
}

}  // namespace voxeld::gpu::cuda
