// What every engine refuses alike: calls whose arguments do not hold together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/engine.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// InvalidArgument with the field, its value and what would be right.
absl::Status CheckTarget(const Target& target, SlicePart part);

// The first `size` bytes of `block`, if it has them.
absl::StatusOr<std::span<std::byte>> CheckDelta(const StagingBlock& block, size_t size);

// Which tiles a part's slices, of so many in all, look at: a TileOwner each.
std::vector<uint8_t> OwnedTiles(const display::TileToSlices& tile_to_slices, const TileGrid& grid,
                                SlicePart part, int32_t slices);

// `layout` is the target's; none: FailedPrecondition.
absl::Status CheckFrame(const FrameRequest& request, const FrameBuffer& buffer,
                        const std::optional<display::FrameLayout>& layout, uint64_t last_frame);
absl::Status CheckBox(const VoxelBox& box, size_t out,
                      const std::optional<display::FrameLayout>& layout);

}  // namespace voxeld::gpu
