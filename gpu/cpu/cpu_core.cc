#include "gpu/cpu/cpu_core.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

template <typename Value>
absl::Status Wrong(const char* field, const Value& value, const std::string& right) {
  return absl::InvalidArgumentError(
      absl::StrCat("target: ", field, " is ", value, ", must be ", right));
}

absl::Status CheckLayout(const Target& target) {
  const display::FrameLayout& layout = target.layout;
  const int32_t slices = display::SliceCount(target.geometry);
  const auto [width, height] =
      std::visit([](const auto& shape) { return std::pair(shape.width_px, shape.height_px); },
                 target.geometry.shape);
  if (layout.slices != slices) {
    return Wrong("layout.slices", layout.slices, absl::StrCat(slices, " as the geometry has"));
  }
  if (layout.width != width) {
    return Wrong("layout.width", layout.width, absl::StrCat(width, " as the geometry has"));
  }
  if (layout.height != height) {
    return Wrong("layout.height", layout.height, absl::StrCat(height, " as the geometry has"));
  }
  if (layout.sub_frames < 1 || layout.sub_frames > 64) {
    return Wrong("layout.sub_frames", layout.sub_frames, "1 to 64");
  }
  if (layout.format > display::PixelFormat::kBitPlanes3) {
    return Wrong("layout.format", static_cast<int>(layout.format), "0 to 2");
  }
  return absl::OkStatus();
}

absl::Status CheckTarget(const Target& target, SlicePart part) {
  if (absl::Status status = display::ValidateGeometry(target.geometry); !status.ok()) return status;
  if (absl::Status status = CheckLayout(target); !status.ok()) return status;
  if (target.tone.lut[0] != 0) return Wrong("tone.lut[0]", target.tone.lut[0], "0");
  if (target.tone.dither > display::Dither::kOrdered) {
    return Wrong("tone.dither", static_cast<int>(target.tone.dither), "0 or 1");
  }
  if (target.tone.sampling > display::Sampling::kWeighted) {
    return Wrong("tone.sampling", static_cast<int>(target.tone.sampling), "0 or 1");
  }
  for (int i = 0; i < 12; ++i) {
    if (!std::isfinite(target.view.m[i])) {
      return Wrong(absl::StrCat("view[", i, "]").c_str(), target.view.m[i], "finite");
    }
  }
  const int32_t end = part.end == -1 ? target.layout.slices : part.end;
  if (part.begin < 0 || end > target.layout.slices || part.begin > end) {
    return Wrong("part", absl::StrCat("[", part.begin, ", ", part.end, ")"),
                 absl::StrCat("within [0, ", target.layout.slices, ")"));
  }
  return absl::OkStatus();
}

}  // namespace

CpuCore::CpuCore(std::unique_ptr<Executor> executor, SlicePart part)
    : executor_(std::move(executor)), part_(part), volume_(*executor_), pictures_(*executor_) {}

absl::Status CpuCore::SetTarget(Target target) {
  if (absl::Status status = CheckTarget(target, part_); !status.ok()) return status;
  const display::VoxelGrid& voxels = target.geometry.grid;
  display::FootprintTable table = display::BuildFootprints(target.geometry, target.tone.sampling);
  const TileGrid grid = TileGrid::Of(voxels.nx, voxels.ny, voxels.nz, Sampler::FastestAxis(table));
  display::TileToSlices tile_to_slices(table, voxels, kTileSize, kTileSize, kTileSize);
  absl::StatusOr<Sampler> sampler = Sampler::Create(std::move(table), grid, target.tone.sampling);
  if (!sampler.ok()) return sampler.status();

  const int32_t end = part_.end == -1 ? target.layout.slices : part_.end;
  std::vector<uint8_t> owned(grid.count());
  for (uint32_t tile = 0; tile < grid.count(); ++tile) {
    int32_t ijk[3];
    grid.Coordinates(tile, ijk);
    owned[tile] = tile_to_slices.Visible(ijk[0], ijk[1], ijk[2], part_.begin, end);
  }
  volume_.SetView(grid, target.view, std::move(owned));
  pictures_.SetPlan({target.layout, target.tone, part_.begin, end, *std::move(sampler),
                     std::move(tile_to_slices)});
  unsliced_ = {};
  layout_ = target.layout;
  return absl::OkStatus();
}

absl::Status CpuCore::Apply(const StagingBlock& block, size_t size) {
  const std::span<std::byte> bytes = block.bytes();
  if (size > bytes.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("delta: its size is ", size, ", must be at most the block's ", bytes.size()));
  }
  return volume_.Apply(bytes.first(size), block.memory());
}

absl::Status CpuCore::CheckFrame(const FrameRequest& request, const FrameBuffer& buffer) const {
  if (!layout_) return absl::FailedPreconditionError("frame: no target has been set");
  if (request.frame <= last_frame_) {
    return absl::InvalidArgumentError(absl::StrCat("frame: its number is ", request.frame,
                                                   ", must be greater than ", last_frame_));
  }
  if (request.buffer_holds >= request.frame) {
    return absl::InvalidArgumentError(absl::StrCat("frame: buffer_holds is ", request.buffer_holds,
                                                   ", must be less than ", request.frame));
  }
  if (buffer.bytes.size() != layout_->bytes() || buffer.changed_in.size() != layout_->pictures()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "frame: the buffer has ", buffer.bytes.size(), " bytes and ", buffer.changed_in.size(),
        " numbers, must have ", layout_->bytes(), " and ", layout_->pictures()));
  }
  return absl::OkStatus();
}

void CpuCore::UpdateVolume() {
  Volume::Changes now = volume_.Update();
  unsliced_.tiles_drawn += now.tiles_drawn;
  unsliced_.tiles.insert(unsliced_.tiles.end(), now.tiles.begin(), now.tiles.end());
  unsliced_.was_lit.insert(unsliced_.was_lit.end(), now.was_lit.begin(), now.was_lit.end());
}

absl::StatusOr<FrameResult> CpuCore::SubmitFrame(const FrameRequest& request, FrameBuffer buffer) {
  if (absl::Status status = CheckFrame(request, buffer); !status.ok()) return status;
  FrameResult result;
  result.frame = request.frame;
  const sync::SystemClock clock;
  const sync::TimeNs start = clock.Now();
  UpdateVolume();
  const sync::TimeNs assembled = clock.Now();
  result.tiles_drawn = unsliced_.tiles_drawn;
  const Volume::Changes changes = std::exchange(unsliced_, {});
  const Pictures::Result drawn = pictures_.Update(volume_.tiles(), changes, request.frame);
  pictures_.CopyTo(buffer, request.buffer_holds);
  result.changed = drawn.changed;
  result.pictures_drawn = drawn.pictures_drawn;
  result.lit_voxels = volume_.lit_voxels();
  result.singular_drawables = volume_.singular_drawables();
  result.assemble_ns = assembled - start;
  result.slice_ns = clock.Now() - assembled;
  last_frame_ = request.frame;
  return result;
}

absl::Status CpuCore::ReadVoxels(VoxelBox box, std::span<uint32_t> out) {
  if (!layout_) return absl::FailedPreconditionError("voxels: no target has been set");
  const int64_t nx = int64_t{box.x1} - box.x0, ny = int64_t{box.y1} - box.y0,
                nz = int64_t{box.z1} - box.z0;
  constexpr int64_t kMost = int64_t{1} << 20;  // along an axis: products fit 64 bits
  if (nx < 0 || ny < 0 || nz < 0 || nx > kMost || ny > kMost || nz > kMost ||
      static_cast<uint64_t>(nx * ny * nz) != out.size()) {
    return absl::InvalidArgumentError(absl::StrCat("voxels: a box of ", nx, " x ", ny, " x ", nz,
                                                   " voxels does not match an output of ",
                                                   out.size()));
  }
  UpdateVolume();
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
