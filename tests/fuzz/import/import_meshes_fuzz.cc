// Meshes: STL, OBJ and glTF; and, for other formats, the checks that a file must pass before a
// library reads it.

#include <cstdint>

#include "tests/fuzz/import/check_model.h"
#include "tools/import/gltf_model.h"
#include "tools/import/mesh_beginning.h"
#include "tools/import/obj_model.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/stl_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static constexpr const char* kExtensions[] = {"obj", "stl", "gltf", "glb",
                                                "off", "3mf", "fbx",  "dae"};
  size_t which = 0;
  voxeld::voxelctl::SourceFile file = voxeld::fuzz::FileOf(data, size, kExtensions, 8, &which);
  file.other_files = voxeld::voxelctl::OtherFiles::kNone;
  if (file.extension == "stl") {
    voxeld::fuzz::CheckModel(voxeld::voxelctl::ReadStlMesh(file));
  } else if (which == 0 || file.extension == "gltf" || file.extension == "glb") {
    absl::StatusOr<voxeld::voxelctl::Model> model =
        which == 0 ? voxeld::voxelctl::ReadObjModel(file) : voxeld::voxelctl::ReadGltfModel(file);
    // This finds coordinates that are not finite.
    if (model.ok()) {
      if (absl::Status status = voxeld::voxelctl::CheckModel(file, *model); !status.ok())
        model = status;
    }
    voxeld::fuzz::CheckModel(model);
  } else {
    voxeld::fuzz::ExpectSays(voxeld::voxelctl::CheckMeshBeginning(file));
  }
  return 0;
}
