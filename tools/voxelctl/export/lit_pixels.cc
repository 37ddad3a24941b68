#include "tools/voxelctl/export/lit_pixels.h"

#include "display/geometry/corrector.h"
#include "display/geometry/footprint.h"

namespace voxeld::voxelctl {

void ForEachLit(const Volume& volume,
                const std::function<void(const display::Vec3& at, const uint8_t* rgb)>& each) {
  const display::Corrector corrector(volume.geometry.correction);
  for (int32_t slice = 0; slice < volume.slices; ++slice) {
    for (int32_t v = 0; v < volume.height; ++v) {
      for (int32_t u = 0; u < volume.width; ++u) {
        const uint8_t* rgb = volume.pixel(slice, u, v);
        if ((rgb[0] | rgb[1] | rgb[2]) == 0) continue;
        each(display::PixelPosition(volume.geometry, corrector, slice, u, v), rgb);
      }
    }
  }
}

}  // namespace voxeld::voxelctl
