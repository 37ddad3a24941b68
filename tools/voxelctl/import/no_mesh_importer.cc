// Stands in where the build has no library for meshes.
#include "absl/strings/str_cat.h"
#include "tools/voxelctl/import/animation.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

class NoMeshImporter final : public MeshImporter {
 public:
  bool Reads(const std::string&) const override { return false; }

  absl::StatusOr<Model> Import(const SourceFile& file) const override {
    return absl::UnimplementedError(
        absl::StrCat(file.path,
                     ": this voxelctl is built without mesh importers (VOXELD_IMPORTERS=OFF); "
                     "it reads point clouds (.ply, .pcd, .las, .xyz), voxels (.vox), maps "
                     "(.geojson, .topojson), volumes (.nii, .nrrd, .raw), molecules (.pdb) and "
                     "drawings (.svg)"));
  }
};

}  // namespace

std::unique_ptr<MeshImporter> NewMeshImporter() { return std::make_unique<NoMeshImporter>(); }

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimation(const std::string& path, size_t,
                                                           double) {
  return FileError({.path = path, .extension = {}, .bytes = {}},
                   "is to be animated, which this build does not do",
                   "build with -DVOXELD_IMPORTERS=ON (libassimp-dev)");
}

}  // namespace voxeld::voxelctl
