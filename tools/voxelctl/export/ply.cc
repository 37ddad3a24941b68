#include <cmath>
#include <cstdint>
#include <string>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/export/export_files.h"
#include "tools/voxelctl/export/lit_pixels.h"
#include "tools/voxelctl/export/little_endian.h"
#include "tools/voxelctl/files/whole_file.h"

namespace voxeld::voxelctl {

absl::Status WritePly(const std::string& path, const Volume& volume, ExportSummary* summary) {
  *summary = {};
  std::string points;
  ForEachLit(volume, [&](const display::Vec3& at, const uint8_t* rgb) {
    if (std::isnan(at.x)) {
      ++summary->left_out;
      return;
    }
    ++summary->items;
    for (const double value : {at.x, at.y, at.z}) PutF32(&points, static_cast<float>(value));
    points.append(reinterpret_cast<const char*>(rgb), 3);
  });
  const std::string header =
      absl::StrCat("ply\nformat binary_little_endian 1.0\ncomment volume ", volume.number,
                   " of a volumetric display, millimetres, z up\nelement vertex ", summary->items,
                   "\nproperty float x\nproperty float y\nproperty float z\n"
                   "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n");
  summary->bytes = header.size() + points.size();
  return WriteWholeFile(path, header + points);
}

}  // namespace voxeld::voxelctl
