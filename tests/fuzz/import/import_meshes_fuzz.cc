// Meshes: STL, and of other formats the checks that a file has to pass before a library reads it.

#include <cstdint>

#include "tests/fuzz/import/check_model.h"
#include "tools/import/mesh_checks.h"
#include "tools/voxelctl/import/stl_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static constexpr const char* kExtensions[] = {"obj", "stl", "gltf", "glb",
                                                "off", "3mf", "fbx",  "dae"};
  size_t which = 0;
  const voxeld::voxelctl::SourceFile file =
      voxeld::fuzz::FileOf(data, size, kExtensions, 8, &which);
  if (file.extension == "stl") {
    voxeld::fuzz::CheckModel(voxeld::voxelctl::ReadStlMesh(file));
  } else {
    voxeld::fuzz::ExpectSays(voxeld::voxelctl::CheckMeshFile(file));
  }
  return 0;
}
