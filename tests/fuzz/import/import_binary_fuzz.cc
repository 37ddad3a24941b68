// Points and voxels: PCD, LAS, PLY, and MagicaVoxel's format.

#include <cstdint>

#include "tests/fuzz/import/check_model.h"
#include "tools/import/clouds.h"
#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/ply_mesh.h"
#include "tools/voxelctl/import/ply_points.h"
#include "tools/voxelctl/import/ply_realign.h"
#include "tools/voxelctl/import/vox_model.h"

namespace voxeld::fuzz {
namespace {

using namespace voxelctl;  // NOLINT(google-build-using-namespace)

void ReadPly(const SourceFile& file) {
  const absl::StatusOr<PlyHeader> header = ParsePlyHeader(file);
  if (header.ok()) {
    return CheckModel(HasPlySurfaces(*header) ? ReadPlyMesh(file, *header)
                                              : ReadPlyPoints(file, *header));
  }
  ExpectSays(header.status());
  const absl::StatusOr<PlyHeader> unchecked = ParsePlyHeader(file, PlyCounts::kUnchecked);
  if (!unchecked.ok()) return;
  if (const auto mended = RealignPly(file, *unchecked)) {
    CheckModel(ReadPlyPoints(mended->file, *unchecked));
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld::voxelctl;  // NOLINT(google-build-using-namespace)
  static constexpr const char* kExtensions[] = {"pcd", "las", "ply", "vox"};
  size_t which = 0;
  const SourceFile file = voxeld::fuzz::FileOf(data, size, kExtensions, 4, &which);
  switch (which) {
    case 0:
      voxeld::fuzz::CheckModel(ReadPcdPoints(file));
      break;
    case 1:
      voxeld::fuzz::CheckModel(ReadLasPoints(file));
      break;
    case 2:
      voxeld::fuzz::ReadPly(file);
      break;
    default:
      voxeld::fuzz::CheckModel(ReadVoxModel(file));
      break;
  }
  return 0;
}
