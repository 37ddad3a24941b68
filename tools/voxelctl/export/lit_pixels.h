// The lit pixels of a volume, and their positions.
#pragma once

#include <cstdint>
#include <functional>

#include "display/api/geometry.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Calls `each` with the position in millimetres (x is NaN if the pixel has none) and the three
// bytes of colour, in the volume's order: slice, then v, then u.
void ForEachLit(const Volume& volume,
                const std::function<void(const display::Vec3& at, const uint8_t* rgb)>& each);

}  // namespace voxeld::voxelctl
