// The file formats of VOXELD_IMPORTERS where it is off.
#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/animation.h"
#include "tools/voxelctl/import/more_formats.h"
#include "tools/voxelctl/text/not_built.h"

namespace voxeld::voxelctl {
namespace {

absl::Status NoImporter(absl::string_view path, absl::string_view wanted) {
  return NotBuilt(path, "reads STL, PLY, VOX, GeoJSON, TopoJSON and point clouds as text", wanted,
                  "VOXELD_IMPORTERS");
}

// The extensions that docs/files.md names.
constexpr absl::string_view kMoreFormats[] = {
    "3ds", "3mf",  "amf", "blend", "bvh", "dae", "dcm", "dxf", "ent", "fbx",
    "glb", "gltf", "gz",  "hdr",   "ifc", "img", "las", "laz", "lwo", "nhdr",
    "nii", "nrrd", "obj", "off",   "pcd", "pdb", "raw", "svg", "x"};

}  // namespace

absl::Status CheckImporters(absl::string_view subject) {
  return NotBuilt(subject, "has no file importers", "them", "VOXELD_IMPORTERS");
}

absl::StatusOr<Model> ReadMoreFormats(const SourceFile& file, const ImportOptions&) {
  const std::string& extension = file.extension;
  if (std::find(std::begin(kMoreFormats), std::end(kMoreFormats), extension) !=
      std::end(kMoreFormats)) {
    return NoImporter(file.path, absl::StrCat(".", extension));
  }
  return FileError(
      file,
      extension.empty()
          ? "its name has no extension"
          : absl::StrCat("files of type .", EscapeForTerminal(extension), " are not read"),
      "this build reads meshes and points (.stl, .ply), voxels (.vox), points as text (.xyz, "
      ".txt, .asc, .pts, .csv) and maps (.geojson, .topojson, .json); a build with "
      "-DVOXELD_IMPORTERS=ON reads more formats");
}

absl::StatusOr<Model> ReadFolder(const std::string& path) {
  return NoImporter(path, "folders of DICOM slices");
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenAnimation(const std::string& path, size_t, double,
                                                           OtherFiles, Interrupt*) {
  return NoImporter(path, "--animate");
}

}  // namespace voxeld::voxelctl
