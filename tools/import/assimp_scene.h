// assimp's scenes as models: FBX, COLLADA, 3MF, OFF, Blender, IFC, BVH and what else it reads. Only what reads through assimp includes this.
//
// assimp is the one library in Debian that reads these formats. It keeps single precision: a note says so where that moves vertices by
// over half a voxel. It does not tell what it passes over: cameras, lights, maps, morph targets at rest, NURBS, splines and frames of BVH beyond
// the announced number are counted here. Colours of 3MF come from three_mf_colors.h.
#pragma once

#include <assimp/Importer.hpp>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

struct aiNode;
struct aiScene;

namespace voxeld::voxelctl {

// What moves in a frame, by the names of nodes.
struct Pose {
  std::unordered_map<std::string, NodeMatrix> nodes;  // maps in place of their own
  // How far their meshes go to each of the shapes that they can take.
  std::unordered_map<std::string, std::vector<double>> shapes;
};

// Whether assimp has a reader for files with this extension.
bool AssimpReads(const std::string& extension);

// Reads `file` and checks all indices and coordinates before later steps trust them. The
// scene lives as long as the importer, and `file` outlives that. InvalidArgument says what the library says.
absl::StatusOr<const aiScene*> LoadScene(const SourceFile& file, Assimp::Importer* importer);

// Of a scene without meshes its bones, as thick lines. `pose` null: as the nodes stand in the file. Meshes follow
// their bones.
absl::StatusOr<Model> ModelOf(const SourceFile& file, const aiScene& scene, const Pose* pose);

// Animation `number`, from 1 on, in frames of `fps` a second. InvalidArgument if there is no such animation.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenAssimpAnimation(SourceFile file, size_t number,
                                                                 double fps);

}  // namespace voxeld::voxelctl
