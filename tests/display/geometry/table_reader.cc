#include "tests/display/geometry/table_reader.h"

#include <algorithm>

namespace voxeld::display {

Footprint ReadFootprint(const FootprintTable& table, int32_t slice, int32_t u, int32_t v) {
  Footprint footprint;
  for (const FootprintEntry& o : table.Outer(slice, u)) {
    for (const FootprintEntry& i : table.Inner(slice, v)) {
      footprint[{o.x + i.x, o.y + i.y, o.z + i.z}] = (o.weight * i.weight + 127) / 255;
    }
  }
  return footprint;
}

std::vector<int32_t> GreatestWeights(const FootprintTable& table, const VoxelGrid& grid) {
  const size_t nx = static_cast<size_t>(grid.nx), ny = static_cast<size_t>(grid.ny);
  std::vector<int32_t> greatest(nx * ny * static_cast<size_t>(grid.nz), 0);
  for (int32_t slice = 0; slice < table.slices; ++slice) {
    for (int32_t u = 0; u < table.width; ++u) {
      for (const FootprintEntry& o : table.Outer(slice, u)) {
        for (int32_t v = 0; v < table.height; ++v) {
          for (const FootprintEntry& i : table.Inner(slice, v)) {
            const size_t x = static_cast<size_t>(o.x + i.x), y = static_cast<size_t>(o.y + i.y);
            int32_t& weight = greatest.at((static_cast<size_t>(o.z + i.z) * ny + y) * nx + x);
            weight = std::max(weight, (o.weight * i.weight + 127) / 255);
          }
        }
      }
    }
  }
  return greatest;
}

}  // namespace voxeld::display
