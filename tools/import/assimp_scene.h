// assimp's scenes as models. Only what reads through assimp includes this.
#pragma once

#include <array>
#include <assimp/Importer.hpp>
#include <functional>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

struct aiNode;
struct aiScene;

namespace voxeld::voxelctl {

// Row-major 3×4, in double precision: nodes nest.
using NodeMatrix = std::array<double, 12>;

// What moves in a frame, by the names of nodes.
struct Pose {
  std::unordered_map<std::string, NodeMatrix> nodes;  // maps in place of their own
  // How far their meshes go to each of the shapes that they can take.
  std::unordered_map<std::string, std::vector<double>> shapes;
};

// Whether assimp has a reader for files with this extension.
bool AssimpReads(const std::string& extension);

// Reads `file` and checks all indices and coordinates before later steps trust them. `skinned`: with bones and animations. The
// scene lives as long as the importer, and `file` outlives that. InvalidArgument says what the library says.
absl::StatusOr<const aiScene*> LoadScene(const SourceFile& file, bool skinned,
                                         Assimp::Importer* importer);

// Of a scene without meshes its bones, as thick lines. `pose` null: as the nodes stand, meshes without their bones' doing; else
// meshes follow their bones.
absl::StatusOr<Model> ModelOf(const SourceFile& file, const aiScene& scene, const Pose* pose);

}  // namespace voxeld::voxelctl
