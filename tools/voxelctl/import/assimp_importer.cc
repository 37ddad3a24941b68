// Meshes through assimp.
#include <assimp/Importer.hpp>

#include "tools/voxelctl/import/assimp_scene.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

class AssimpImporter final : public MeshImporter {
 public:
  bool Reads(const std::string& extension) const override { return AssimpReads(extension); }

  absl::StatusOr<Model> Import(const SourceFile& file) const override {
    Assimp::Importer importer;
    const absl::StatusOr<const aiScene*> scene = LoadScene(file, false, &importer);
    if (!scene.ok()) return scene.status();
    return ModelOf(file, **scene, nullptr);
  }
};

}  // namespace

std::unique_ptr<MeshImporter> NewMeshImporter() { return std::make_unique<AssimpImporter>(); }

}  // namespace voxeld::voxelctl
