#include "tools/import/assimp_scene.h"

#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/assimp_files.h"

namespace voxeld::voxelctl {
namespace {

// Sharper edges stay edges when a file has no normals of its own.
constexpr float kSmoothingDegrees = 50;
constexpr double kBoneThickness = 0.004;  // of all bones' lengths together

NodeMatrix FromAssimp(const aiMatrix4x4& m) {
  return {m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4};
}

NodeMatrix Compose(const NodeMatrix& outer, const NodeMatrix& inner) {
  NodeMatrix r{};
  for (size_t row = 0; row < 12; row += 4) {
    for (size_t col = 0; col < 4; ++col) {
      r[row + col] = outer[row] * inner[col] + outer[row + 1] * inner[4 + col] +
                     outer[row + 2] * inner[8 + col] + (col == 3 ? outer[row + 3] : 0);
    }
  }
  return r;
}

Point3 Map(const NodeMatrix& m, const aiVector3D& v) {
  const double x = v.x, y = v.y, z = v.z;
  return {m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7],
          m[8] * x + m[9] * y + m[10] * z + m[11]};
}

// The inverse transpose up to a positive factor, so that normals stay outside under a mirror too.
NodeMatrix NormalMatrix(const NodeMatrix& m) {
  const std::array<double, 9> cofactors = {
      m[5] * m[10] - m[6] * m[9], m[6] * m[8] - m[4] * m[10], m[4] * m[9] - m[5] * m[8],
      m[2] * m[9] - m[1] * m[10], m[0] * m[10] - m[2] * m[8], m[1] * m[8] - m[0] * m[9],
      m[1] * m[6] - m[2] * m[5],  m[2] * m[4] - m[0] * m[6],  m[0] * m[5] - m[1] * m[4]};
  const double determinant = m[0] * cofactors[0] + m[1] * cofactors[1] + m[2] * cofactors[2];
  const double sign = determinant < 0 ? -1 : 1;
  NodeMatrix r{};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t col = 0; col < 3; ++col) r[row * 4 + col] = sign * cofactors[row * 3 + col];
  }
  return r;
}

Point3 Unit(const Point3& p) {
  const double length = std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
  if (!(length > 1e-30) || !std::isfinite(length)) return {};
  return {p.x / length, p.y / length, p.z / length};
}

uint8_t Channel(double value, bool linear) {
  if (!(value > 0)) return 0;
  value = std::min(value, 1.0);
  if (linear) value = value <= 0.0031308 ? 12.92 * value : 1.055 * std::pow(value, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(value * 255));
}

Rgb ToRgb(const aiColor4D& c, bool linear) {
  return {Channel(c.r, linear), Channel(c.g, linear), Channel(c.b, linear)};
}

// The base colour that a material states itself; none for a texture's place-holder or the
// importer's own default.
std::optional<aiColor4D> BaseColor(const aiMaterial& material, bool linear) {
  // A glTF material with KHR_materials_pbrSpecularGlossiness has a diffuse colour; its base colour is the library's default.
  float glossiness = 0;
  const bool glossy =
      linear && material.Get(AI_MATKEY_GLOSSINESS_FACTOR, glossiness) == aiReturn_SUCCESS;
  aiColor4D color;
  if ((glossy || material.Get(AI_MATKEY_BASE_COLOR, color) != aiReturn_SUCCESS) &&
      material.Get(AI_MATKEY_COLOR_DIFFUSE, color) != aiReturn_SUCCESS) {
    return std::nullopt;
  }
  const auto is_grey = [&color](float grey) {
    return color.r == grey && color.g == grey && color.b == grey;
  };
  // What the OBJ reader gives to a material that it was told nothing about.
  if (!linear && is_grey(0.6f)) return std::nullopt;
  // The library's own material for meshes without one. A material of the file may have its name but not its colour. In glTF both
  // are white.
  aiString name;
  material.Get(AI_MATKEY_NAME, name);
  if (!linear && is_grey(1) && absl::string_view(name.C_Str()) == AI_DEFAULT_MATERIAL_NAME) {
    return std::nullopt;
  }
  const bool textured = material.GetTextureCount(aiTextureType_DIFFUSE) > 0 ||
                        material.GetTextureCount(aiTextureType_BASE_COLOR) > 0;
  if (textured && is_grey(1)) return std::nullopt;
  return color;
}

struct Context {
  const SourceFile& file;
  const aiScene& scene;
  bool linear;         // colours are linear light
  bool has_materials;  // of its own; some readers make one up
  const Pose* pose;
  uint64_t vertices = 0, indices = 0;
  Model* model;
  std::unordered_map<std::string, NodeMatrix> globals =
      {};  // where each node is, by its name; only with a pose
};

// For each vertex the sum of its bones' maps by their weights; empty if the mesh has no bones, or they do nothing.
std::vector<NodeMatrix> SkinOf(const aiMesh& mesh, const Context& context) {
  if (context.pose == nullptr || mesh.mNumBones == 0) return {};
  std::vector<NodeMatrix> skin(mesh.mNumVertices, NodeMatrix{});
  std::vector<double> weights(mesh.mNumVertices);
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const auto global = context.globals.find(bone.mName.C_Str());
    if (global == context.globals.end()) continue;
    const NodeMatrix map = Compose(global->second, FromAssimp(bone.mOffsetMatrix));
    for (unsigned w = 0; w < bone.mNumWeights; ++w) {
      const aiVertexWeight& weight = bone.mWeights[w];
      if (weight.mVertexId >= mesh.mNumVertices || !(weight.mWeight > 0)) continue;
      for (size_t i = 0; i < 12; ++i) skin[weight.mVertexId][i] += weight.mWeight * map[i];
      weights[weight.mVertexId] += weight.mWeight;
    }
  }
  // What hangs on no bone stays where the first one puts the mesh.
  const auto root = context.globals.find(mesh.mBones[0]->mName.C_Str());
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    if (weights[v] > 0) {
      for (double& entry : skin[v]) entry /= weights[v];
    } else if (root != context.globals.end()) {
      skin[v] = Compose(root->second, FromAssimp(mesh.mBones[0]->mOffsetMatrix));
    }
  }
  return skin;
}

absl::Status CheckMesh(const SourceFile& file, const aiMesh& mesh) {
  if (mesh.mNumVertices > 0 && mesh.mVertices == nullptr) {
    return FileError(file, "holds a mesh without positions", "every vertex has one");
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    for (unsigned i = 0; i < face.mNumIndices; ++i) {
      if (face.mIndices[i] >= mesh.mNumVertices) {
        return FileError(
            file, absl::StrCat("face ", f, " refers to vertex ", face.mIndices[i]),
            absl::StrCat("its mesh has ", mesh.mNumVertices, " vertices, counted from 0"));
      }
    }
  }
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D& p = mesh.mVertices[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
      return FileError(file, absl::StrCat("vertex ", v, " is (", p.x, ", ", p.y, ", ", p.z, ")"),
                       "coordinates must be finite");
    }
  }
  return absl::OkStatus();
}

// Where a vertex is, or a normal, before the mesh is put anywhere: between the shapes that the mesh can take.
class Shaped {
 public:
  Shaped(const aiMesh& mesh, const std::string& node, const Context& context) : mesh_(mesh) {
    if (context.pose == nullptr) return;
    const auto& all = context.pose->shapes;
    auto found = all.find(node);
    if (found == all.end()) found = all.find(mesh.mName.C_Str());
    if (found != all.end()) weights_ = &found->second;
  }
  aiVector3D Position(unsigned v) const {
    return Mix(v, mesh_.mVertices[v], &aiAnimMesh::mVertices);
  }
  aiVector3D Normal(unsigned v) const { return Mix(v, mesh_.mNormals[v], &aiAnimMesh::mNormals); }

 private:
  aiVector3D Mix(unsigned v, const aiVector3D& own, aiVector3D* aiAnimMesh::*of) const {
    if (weights_ == nullptr) return own;
    aiVector3D mixed = own;
    for (unsigned i = 0; i < std::min<size_t>(mesh_.mNumAnimMeshes, weights_->size()); ++i) {
      const aiAnimMesh& shape = *mesh_.mAnimMeshes[i];
      if (shape.*of == nullptr || v >= shape.mNumVertices) continue;
      mixed += ((shape.*of)[v] - own) * static_cast<ai_real>((*weights_)[i]);
    }
    return mixed;
  }

  const aiMesh& mesh_;
  const std::vector<double>* weights_ = nullptr;
};

// Parts by kind: after sorting a mesh has faces of one kind, or of points only.
absl::Status AddMesh(const aiMesh& mesh, const std::string& node, const NodeMatrix& to_model,
                     Context* context) {
  const Shaped shaped(mesh, node, *context);
  const std::vector<NodeMatrix> skin = SkinOf(mesh, *context);
  const auto map_of = [&](unsigned v) -> const NodeMatrix& {
    return skin.empty() ? to_model : skin[v];
  };
  const unsigned corners = mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE ? 3
                           : mesh.mPrimitiveTypes & aiPrimitiveType_LINE   ? 2
                                                                           : 1;
  if (mesh.mNumVertices == 0) return absl::OkStatus();
  context->vertices += mesh.mNumVertices;
  context->indices += uint64_t{corners} * mesh.mNumFaces;
  if (context->vertices > kMaxModelVertices || context->indices > kMaxModelIndices) {
    return FileError(context->file,
                     absl::StrCat("has over ", kMaxModelVertices, " vertices or ", kMaxModelIndices,
                                  " indices, its instances included"),
                     "so large a model is not read");
  }
  Part part;
  part.kind = corners == 3 ? Kind::kTriangles : corners == 2 ? Kind::kSegments : Kind::kPoints;
  part.positions.reserve(mesh.mNumVertices);
  for (unsigned v = 0; v < mesh.mNumVertices; ++v)
    part.positions.push_back(Map(map_of(v), shaped.Position(v)));
  if (mesh.HasNormals()) {
    const NodeMatrix normal_matrix = NormalMatrix(to_model);
    part.normals.reserve(mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      part.normals.push_back(
          Unit(Map(skin.empty() ? normal_matrix : NormalMatrix(skin[v]), shaped.Normal(v))));
  }
  std::optional<aiColor4D> base;
  if (context->has_materials && mesh.mMaterialIndex < context->scene.mNumMaterials) {
    base = BaseColor(*context->scene.mMaterials[mesh.mMaterialIndex], context->linear);
  }
  if (mesh.HasVertexColors(0)) {
    // In glTF the material's colour is a factor of them; in other formats they replace it.
    const aiColor4D by = context->linear && base ? *base : aiColor4D(1, 1, 1, 1);
    part.colors.reserve(mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v)
      part.colors.push_back(ToRgb(mesh.mColors[0][v] * by, context->linear));
  } else if (base) {
    part.colors.assign(mesh.mNumVertices, ToRgb(*base, context->linear));
  }
  if (corners > 1) {
    part.indices.reserve(size_t{corners} * mesh.mNumFaces);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != corners) continue;
      part.indices.insert(part.indices.end(), face.mIndices, face.mIndices + corners);
    }
    if (part.indices.empty()) return absl::OkStatus();
  }
  context->model->parts.push_back(std::move(part));
  return absl::OkStatus();
}

NodeMatrix LocalOf(const aiNode& node, const Pose* pose) {
  if (pose != nullptr) {
    const auto moved = pose->nodes.find(node.mName.C_Str());
    if (moved != pose->nodes.end()) return moved->second;
  }
  return FromAssimp(node.mTransformation);
}

// Calls `visit(node, its map, its parent's map or null)` for each.
template <typename Visit>
absl::Status ForEachNode(const aiNode& root, const Pose* pose, Visit visit) {
  struct Step {
    const aiNode* node;
    NodeMatrix to_model, parent;
    bool has_parent;
  };
  std::vector<Step> stack = {{&root, LocalOf(root, pose), {}, false}};
  while (!stack.empty()) {
    const Step step = stack.back();
    stack.pop_back();
    absl::Status status =
        visit(*step.node, step.to_model, step.has_parent ? &step.parent : nullptr);
    if (!status.ok()) return status;
    for (unsigned c = step.node->mNumChildren; c-- > 0;) {
      const aiNode* child = step.node->mChildren[c];
      stack.push_back({child, Compose(step.to_model, LocalOf(*child, pose)), step.to_model, true});
    }
  }
  return absl::OkStatus();
}

absl::Status AddNodes(Context* context) {
  const aiNode& root = *context->scene.mRootNode;
  if (context->pose != nullptr) {
    const absl::Status status =
        ForEachNode(root, context->pose,
                    [context](const aiNode& node, const NodeMatrix& map, const NodeMatrix*) {
                      context->globals.emplace(node.mName.C_Str(), map);
                      return absl::OkStatus();
                    });
    if (!status.ok()) return status;
  }
  return ForEachNode(
      root, context->pose, [context](const aiNode& node, const NodeMatrix& map, const NodeMatrix*) {
        for (unsigned m = 0; m < node.mNumMeshes; ++m) {
          absl::Status status =
              AddMesh(*context->scene.mMeshes[node.mMeshes[m]], node.mName.C_Str(), map, context);
          if (!status.ok()) return status;
        }
        return absl::OkStatus();
      });
}

Part Bones(const aiNode& root, const Pose* pose) {
  Part part{.kind = Kind::kSegments};
  ForEachNode(root, pose, [&part](const aiNode&, const NodeMatrix& map, const NodeMatrix* parent) {
    if (parent == nullptr || part.positions.size() + 2 > kMaxModelVertices) return absl::OkStatus();
    for (const NodeMatrix& end : {*parent, map}) {
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back({end[3], end[7], end[11]});
    }
    return absl::OkStatus();
  }).IgnoreError();
  return part;
}

// How long the bones are together, whatever their pose.
double LengthOf(const Part& bones) {
  double length = 0;
  for (size_t i = 0; i + 1 < bones.positions.size(); i += 2) {
    const Point3 &a = bones.positions[i], &b = bones.positions[i + 1];
    length += std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  }
  return length;
}

struct AssimpFormat {
  absl::string_view extension, name;
  Up up = Up::kY;
};
constexpr AssimpFormat kAssimpFormats[] = {{"glb", "glTF binary"},   {"gltf", "glTF"},
                                           {"obj", "Wavefront OBJ"}, {"off", "OFF"},
                                           {"fbx", "FBX"},           {"3mf", "3MF", Up::kZ},
                                           {"dae", "COLLADA"},       {"blend", "Blender", Up::kZ},
                                           {"ifc", "IFC"},           {"bvh", "BVH"},
                                           {"amf", "AMF", Up::kZ},   {"dxf", "DXF"}};

AssimpFormat FormatOf(const SourceFile& file) {
  for (const AssimpFormat& format : kAssimpFormats) {
    if (format.extension == file.extension) return format;
  }
  return {file.extension, file.extension};
}

absl::Status Failed(const SourceFile& file, absl::string_view reason) {
  return FileError(file,
                   absl::StrCat("could not be read as ", EscapeForTerminal(FormatOf(file).name),
                                " (", EscapeForTerminal(reason.substr(0, 300)), ")"),
                   "the file is damaged or uses what is not supported");
}

absl::StatusOr<const aiScene*> Load(const SourceFile& file, bool skinned,
                                    Assimp::Importer* importer) {
  int removed = aiComponent_TEXCOORDS | aiComponent_TANGENTS_AND_BITANGENTS | aiComponent_TEXTURES |
                aiComponent_LIGHTS | aiComponent_CAMERAS;
  if (!skinned) removed |= aiComponent_BONEWEIGHTS | aiComponent_ANIMATIONS;
  importer->SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, removed);
  importer->SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, kSmoothingDegrees);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  importer->SetIOHandler(new AssimpFiles(file));  // which it deletes
  // Steps after reading trust the indices; so they come after a check of our own.
  const aiScene* scene = importer->ReadFile(file.path, 0);
  if (scene == nullptr) return Failed(file, importer->GetErrorString());
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const absl::Status status = CheckMesh(file, *scene->mMeshes[m]);
    if (!status.ok()) return status;
  }
  if (scene->mRootNode == nullptr || (scene->mNumMeshes == 0 && scene->mNumAnimations == 0)) {
    return FileError(file, "holds no mesh", "at least one is expected");
  }
  // A cloud has no faces to work on, and some steps refuse such meshes.
  const auto has_faces = [](const aiMesh* mesh) { return mesh->mNumFaces > 0; };
  if (scene->mNumMeshes > 0 &&
      std::all_of(scene->mMeshes, scene->mMeshes + scene->mNumMeshes, has_faces)) {
    scene = importer->ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate |
                                          aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                          aiProcess_JoinIdenticalVertices);
    if (scene == nullptr) return Failed(file, importer->GetErrorString());
  }
  return scene;
}

// Some formats say it themselves: 0 is x, 1 y, 2 z.
Up UpOf(const aiScene& scene, Up otherwise) {
  int32_t axis = -1;
  if (scene.mMetaData == nullptr || !scene.mMetaData->Get("UpAxis", axis)) return otherwise;
  return axis == 0 ? Up::kX : axis == 1 ? Up::kY : axis == 2 ? Up::kZ : otherwise;
}

}  // namespace

bool AssimpReads(const std::string& extension) {
  return !extension.empty() &&
         Assimp::Importer().IsExtensionSupported(absl::StrCat(".", extension));
}

absl::StatusOr<const aiScene*> LoadScene(const SourceFile& file, bool skinned,
                                         Assimp::Importer* importer) {
  try {
    return Load(file, skinned, importer);
  } catch (const std::exception& error) {
    return Failed(file, error.what());
  }
}

absl::StatusOr<Model> ModelOf(const SourceFile& file, const aiScene& scene, const Pose* pose) {
  Model model;
  const AssimpFormat format = FormatOf(file);
  model.path = file.path;
  model.format = std::string(format.name);
  model.up = UpOf(scene, format.up);
  if (scene.mNumMeshes == 0) {
    Part bones = Bones(*scene.mRootNode, pose);
    if (bones.positions.empty())
      return FileError(file, "holds no mesh and no bone", "one is expected");
    // Of the bones as they stand in the file, so that it is the same in every pose.
    bones.thickness = kBoneThickness * LengthOf(Bones(*scene.mRootNode, nullptr));
    model.parts.push_back(std::move(bones));
    return model;
  }
  const bool bare = file.extension == "off";
  Context context{.file = file,
                  .scene = scene,
                  .linear = absl::StartsWith(file.extension, "gl"),
                  .has_materials = !bare,
                  .pose = pose,
                  .model = &model};
  const absl::Status status = AddNodes(&context);
  if (!status.ok()) return status;
  return model;
}

}  // namespace voxeld::voxelctl
