// Checks that every engine shares: they reject calls whose arguments are inconsistent.
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

// Errors: InvalidArgument with the field, its value and the values that are valid.
absl::Status CheckTarget(const Target& target, SlicePart part);

// Returns the first `size` bytes of `block`, or an error if the block is smaller.
absl::StatusOr<std::span<std::byte>> CheckDelta(const StagingBlock& block, size_t size);

// Returns, as a TileOwner for each tile, which tiles the slices of `part` look at. `slices` is the
// number of all slices.
std::vector<uint8_t> OwnedTiles(const display::TileToSlices& tile_to_slices, const TileGrid& grid,
                                SlicePart part, int32_t slices);

// `layout` is the target's layout. Errors: FailedPrecondition if it is empty.
absl::Status CheckFrame(const FrameRequest& request, const FrameBuffer& buffer,
                        const std::optional<display::FrameLayout>& layout, uint64_t last_frame);
absl::Status CheckBox(const VoxelBox& box, size_t out,
                      const std::optional<display::FrameLayout>& layout);

}  // namespace voxeld::gpu
