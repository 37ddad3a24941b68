// Converts assimp's scenes to models: FBX, COLLADA, 3MF, OFF, Blender, IFC, BVH, 3DS, X, LWO and
// AMF. Only readers that use assimp include this header.
//
// assimp is the only library in Debian that reads these formats. It uses single precision: a note
// is added if that moves vertices by more than half a voxel. It does not report what it ignores, so
// cameras, lights, maps, morph targets at rest, NURBS, splines and frames of BVH beyond the
// announced number are counted here. Colours of 3MF come from three_mf_colors.h.
#pragma once

#include <assimp/Importer.hpp>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

struct aiNode;
struct aiScene;

namespace voxeld::voxelctl {

// The parts that move in a frame, by names of nodes.
struct Pose {
  std::unordered_map<std::string, NodeMatrix> nodes;  // maps that replace the nodes' own
  // The weights of the shapes that the nodes' meshes can take.
  std::unordered_map<std::string, std::vector<double>> shapes;
};

// Returns whether assimp reads files with this extension. Its readers of other formats are never
// registered.
bool AssimpReads(absl::string_view extension);

// Reads `file` and checks all indices and coordinates before later steps trust them. The scene
// lives as long as the importer, and `file` must outlive that. Errors: InvalidArgument with the
// library's message.
absl::StatusOr<const aiScene*> LoadScene(const SourceFile& file, Assimp::Importer* importer);

// Returns the scene as a model; for a scene without meshes, its bones as thick lines. If `pose` is
// null, the nodes are placed as in the file. Meshes follow their bones.
absl::StatusOr<Model> ModelOf(const SourceFile& file, const aiScene& scene, const Pose* pose);

// Opens animation `number`, from 1, with frames at `fps` per second. Errors: InvalidArgument if
// the animation does not exist.
absl::StatusOr<std::unique_ptr<FrameSource>> OpenAssimpAnimation(SourceFile file, size_t number,
                                                                 double fps);

}  // namespace voxeld::voxelctl
