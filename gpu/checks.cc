#include "gpu/checks.h"

#include <cmath>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "display/geometry/footprint.h"

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
  absl::Status format = display::ValidateFormat(layout);
  return format.ok() ? format
                     : absl::InvalidArgumentError(absl::StrCat("target: ", format.message()));
}

}  // namespace

absl::Status CheckTarget(const Target& target, SlicePart part) {
  if (absl::Status status = display::ValidateGeometry(target.geometry); !status.ok()) return status;
  if (absl::Status status = CheckLayout(target); !status.ok()) return status;
  for (size_t c = 0; c < target.tone.lut.size(); ++c) {
    if (target.tone.lut[c][0] == 0) continue;
    return Wrong(absl::StrCat("tone.lut[", c, "][0]").c_str(), target.tone.lut[c][0], "0");
  }
  if (target.tone.dither > display::Dither::kBlueNoise) {
    return Wrong("tone.dither", static_cast<int>(target.tone.dither), "0 to 2");
  }
  if (target.tone.density > display::Density::kEven) {
    return Wrong("tone.density", static_cast<int>(target.tone.density), "0 or 1");
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
  if (part.ranks < 1 || part.rank < 0 || part.rank >= part.ranks) {
    return Wrong("part", absl::StrCat("rank ", part.rank, " of ", part.ranks),
                 "one of the ranks, from 0");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::span<std::byte>> CheckDelta(const StagingBlock& block, size_t size) {
  const std::span<std::byte> bytes = block.bytes();
  if (size > bytes.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("delta: its size is ", size, ", must be at most the block's ", bytes.size()));
  }
  return bytes.first(size);
}

std::vector<uint8_t> OwnedTiles(const display::TileToSlices& tile_to_slices, const TileGrid& grid,
                                SlicePart part, int32_t slices) {
  const auto [begin, end] = part.Within(slices);
  std::vector<uint8_t> owned(grid.count());
  for (uint32_t tile = 0; tile < grid.count(); ++tile) {
    int32_t ijk[3];
    grid.Coordinates(tile, ijk);
    if (!tile_to_slices.Visible(ijk[0], ijk[1], ijk[2], begin, end)) continue;
    owned[tile] = tile_to_slices.Visible(ijk[0], ijk[1], ijk[2], part.begin, begin)
                      ? kOwnedAndCountedElsewhere
                      : kOwned;
  }
  return owned;
}

absl::Status CheckFrame(const FrameRequest& request, const FrameBuffer& buffer,
                        const std::optional<display::FrameLayout>& layout, uint64_t last_frame) {
  if (!layout) return absl::FailedPreconditionError("frame: no target has been set");
  if (request.frame <= last_frame) {
    return absl::InvalidArgumentError(absl::StrCat("frame: its number is ", request.frame,
                                                   ", must be greater than ", last_frame));
  }
  if (request.buffer_holds >= request.frame) {
    return absl::InvalidArgumentError(absl::StrCat("frame: buffer_holds is ", request.buffer_holds,
                                                   ", must be less than ", request.frame));
  }
  if (buffer.bytes.size() != layout->bytes() || buffer.changed_in.size() != layout->pictures()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "frame: the buffer has ", buffer.bytes.size(), " bytes and ", buffer.changed_in.size(),
        " numbers, must have ", layout->bytes(), " and ", layout->pictures()));
  }
  return absl::OkStatus();
}

absl::Status CheckBox(const VoxelBox& box, size_t out,
                      const std::optional<display::FrameLayout>& layout) {
  if (!layout) return absl::FailedPreconditionError("voxels: no target has been set");
  const int64_t nx = int64_t{box.x1} - box.x0, ny = int64_t{box.y1} - box.y0,
                nz = int64_t{box.z1} - box.z0;
  constexpr int64_t kMost = int64_t{1} << 20;  // along an axis: products fit 64 bits
  if (nx < 0 || ny < 0 || nz < 0 || nx > kMost || ny > kMost || nz > kMost ||
      static_cast<uint64_t>(nx * ny * nz) != out) {
    return absl::InvalidArgumentError(absl::StrCat("voxels: a box of ", nx, " x ", ny, " x ", nz,
                                                   " voxels does not match an output of ", out));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu
