#include "tools/import/assimp_scene.h"

#include <assimp/BaseImporter.h>
#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <filesystem>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/assimp_files.h"
#include "tools/import/collada_contents.h"
#include "tools/import/mesh_beginning.h"
#include "tools/import/three_mf_colors.h"

namespace voxeld::voxelctl {
namespace {

// Sharper edges stay edges if a file has no normals of its own.
constexpr float kSmoothingDegrees = 50;
constexpr double kCreaseDegrees = 25;
constexpr double kBoneThickness = 0.004;  // as a share of the total length of all bones

NodeMatrix FromAssimp(const aiMatrix4x4& m) {
  return {m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4};
}

Point3 Map(const NodeMatrix& m, const aiVector3D& v) {
  const double x = v.x, y = v.y, z = v.z;
  return {m[0] * x + m[1] * y + m[2] * z + m[3], m[4] * x + m[5] * y + m[6] * z + m[7],
          m[8] * x + m[9] * y + m[10] * z + m[11]};
}

// Returns whether the file contains `name` as ASCII or UTF-16.
bool HasText(const SourceFile& file, absl::string_view name) {
  std::string wide;
  for (const char c : name) absl::StrAppend(&wide, absl::string_view(&c, 1), std::string(1, '\0'));
  wide.pop_back();
  return absl::StrContains(file.bytes, name) || absl::StrContains(file.bytes, wide);
}

// Returns for each material whether the library made it up for meshes without one. Such a material
// has one of these names, which does not occur in the file, or only its name and a colour.
std::vector<bool> FindMadeUp(const SourceFile& file, const aiScene& scene) {
  std::vector<bool> made_up(scene.mNumMaterials);
  for (unsigned m = 0; m < scene.mNumMaterials; ++m) {
    aiString name;
    scene.mMaterials[m]->Get(AI_MATKEY_NAME, name);
    for (const absl::string_view known :
         {AI_DEFAULT_MATERIAL_NAME, "%%%DEFAULT", "<IFCDefault>", "LWODefaultSurface"}) {
      if (absl::string_view(name.C_Str()) == known)
        made_up[m] = scene.mMaterials[m]->mNumProperties <= 2 || !HasText(file, known);
    }
    // The one of X has no name. A compressed file is not searched.
    if (file.extension == "x" && name.length == 0 &&
        !absl::StrContains(absl::string_view(file.bytes).substr(0, 16), "zip"))
      made_up[m] = !HasText(file, "Material");
  }
  return made_up;
}

// Returns the type of the texture that gives a material its colours.
std::optional<aiTextureType> ColorTextureOf(const aiMaterial& material) {
  for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
    if (material.GetTextureCount(type) > 0) return type;
  }
  return std::nullopt;
}

// Counts properties of a material, other than its colour, that are not shown.
void CountMaterial(const aiMaterial& material, bool has_picture, Model* model) {
  static constexpr std::pair<aiTextureType, const char*> kMaps[] = {
      {aiTextureType_NORMALS, "normal maps"},
      {aiTextureType_HEIGHT, "normal maps"},
      {aiTextureType_NORMAL_CAMERA, "normal maps"},
      {aiTextureType_DISPLACEMENT, "normal maps"},
      {aiTextureType_SPECULAR, "maps of gloss and reflection"},
      {aiTextureType_SHININESS, "maps of gloss and reflection"},
      {aiTextureType_REFLECTION, "maps of gloss and reflection"},
      {aiTextureType_METALNESS, "maps of gloss and reflection"},
      {aiTextureType_DIFFUSE_ROUGHNESS, "maps of gloss and reflection"},
      {aiTextureType_AMBIENT, "occlusion maps"},
      {aiTextureType_LIGHTMAP, "occlusion maps"},
      {aiTextureType_AMBIENT_OCCLUSION, "occlusion maps"},
      {aiTextureType_EMISSIVE, "emission maps"},
      {aiTextureType_EMISSION_COLOR, "emission maps"},
      {aiTextureType_OPACITY, "opacity maps"},
      {aiTextureType_UNKNOWN, "textures of an unknown kind"}};
  for (const auto& [type, kind] : kMaps) AddLeftOut(kind, material.GetTextureCount(type), model);
  const std::optional<aiTextureType> shown = ColorTextureOf(material);
  if (shown) AddLeftOut("further layers of textures", material.GetTextureCount(*shown) - 1, model);
  float opacity = 1;
  material.Get(AI_MATKEY_OPACITY, opacity);
  AddLeftOut("transparency of materials", opacity < 1 ? 1 : 0, model);
  aiColor4D emission;
  if (has_picture && material.Get(AI_MATKEY_COLOR_EMISSIVE, emission) == aiReturn_SUCCESS &&
      !emission.IsBlack())
    AddLeftOut("emission over pictures", 1, model);
}

struct Context {
  const SourceFile& file;
  const aiScene& scene;
  bool has_materials;         // of the file itself; some readers make one up
  std::vector<bool> made_up;  // by material; see FindMadeUp
  // By the name of a COLLADA material: whether it has a diffuse colour or texture.
  const std::map<std::string, bool>& has_diffuse;
  const ThreeMfColors* three_mf;  // null for other formats
  const Pose* pose;
  bool at_rest;  // the pose is the file's own
  uint64_t vertices = 0, indices = 0;
  Model* model;
  std::unordered_map<std::string, NodeMatrix> globals =
      {};  // map of each node, by its name; only with a pose
  std::unordered_map<std::string, uint32_t> pictures = {};  // by their name
  std::set<unsigned> materials = {};                        // already counted
  double rounding = 0;  // how far single precision may have moved a vertex
};

// Returns the colour that the file gives to a material; nothing if it gives none.
std::optional<std::array<double, 3>> ColorOf(const aiMaterial& material, bool has_picture,
                                             const Context& context) {
  aiString name;
  material.Get(AI_MATKEY_NAME, name);
  const auto diffuse = context.has_diffuse.find(name.C_Str());
  // In FBX, COLLADA and Blender a texture replaces the colour.
  if (has_picture) return std::array<double, 3>{1, 1, 1};
  if (diffuse != context.has_diffuse.end() && !diffuse->second) return std::nullopt;
  // COLLADA has either a texture or a colour; the library adds a grey.
  if (ColorTextureOf(material) && context.file.extension == "dae") return std::nullopt;
  aiColor4D color;
  if (material.Get(AI_MATKEY_BASE_COLOR, color) != aiReturn_SUCCESS &&
      material.Get(AI_MATKEY_COLOR_DIFFUSE, color) != aiReturn_SUCCESS) {
    return std::nullopt;
  }
  return std::array<double, 3>{color.r, color.g, color.b};
}

// Returns for each vertex the sum of its bones' maps, weighted; empty if the mesh has no bones or
// they have no effect.
std::vector<NodeMatrix> SkinOf(const aiMesh& mesh, const Context& context) {
  if (context.pose == nullptr || mesh.mNumBones == 0) return {};
  const auto has_place = [&context](const aiBone* bone) {
    return context.globals.contains(bone->mName.C_Str());
  };
  if (std::none_of(mesh.mBones, mesh.mBones + mesh.mNumBones, has_place)) return {};
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
  // Vertices without a bone stay where the first bone puts the mesh.
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

// Computes where a vertex or normal is before its mesh is placed, by blending the shapes that the
// mesh can take.
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

// Returns the bytes of a picture that the file contains or names; empty if there are none.
std::string PictureBytes(const Context& context, const std::string& name) {
  if (const aiTexture* const own = context.scene.GetEmbeddedTexture(name.c_str())) {
    // A texture with a height consists of raw texels.
    if (own->mHeight != 0) return "texels";
    return {reinterpret_cast<const char*>(own->pcData), own->mWidth};
  }
  std::string slashes = absl::StrReplaceAll(name, {{"\\", "/"}});
  if (absl::StartsWith(slashes, "file://")) slashes.erase(0, 7);
  // The name may also be a path on the computer that wrote the file.
  for (const std::string& one :
       {name, slashes, PercentDecode(slashes),
        std::filesystem::path(PercentDecode(slashes)).filename().string()}) {
    absl::StatusOr<SourceFile> other = ReadOtherFile(context.file, one);
    if (other.ok()) return std::move(other->bytes);
  }
  return {};
}

uint32_t PictureOf(const std::string& name, Context* context) {
  const auto [at, is_new] = context->pictures.try_emplace(name, kNoPicture);
  if (!is_new) return at->second;
  std::string bytes = PictureBytes(*context, name);
  if (bytes.empty()) {
    AddLeftOut("textures that cannot be read", 1, context->model);
  } else if (!IsPicture(bytes)) {
    AddLeftOut("textures that are neither PNG nor JPEG", 1, context->model);
  } else {
    at->second = static_cast<uint32_t>(context->model->pictures.size());
    context->model->pictures.push_back(std::move(bytes));
  }
  return at->second;
}

Wrap WrapOfMode(aiTextureMapMode mode) {
  return mode == aiTextureMapMode_Wrap     ? Wrap::kRepeat
         : mode == aiTextureMapMode_Mirror ? Wrap::kMirror
                                           : Wrap::kClamp;
}

void AddPicture(const aiMaterial& material, const aiMesh& mesh, Part* part, Context* context) {
  const std::optional<aiTextureType> type = ColorTextureOf(material);
  if (!type) return;
  aiString name;
  aiTextureMapping mapping = aiTextureMapping_UV;
  unsigned channel = 0;
  std::array<aiTextureMapMode, 3> modes = {};
  if (material.GetTexture(*type, 0, &name, &mapping, &channel, nullptr, nullptr, modes.data()) !=
      aiReturn_SUCCESS)
    return;
  if (mapping != aiTextureMapping_UV || !mesh.HasTextureCoords(channel))
    return AddLeftOut("textures without coordinates", 1, context->model);
  part->picture = PictureOf(name.C_Str(), context);
  if (part->picture == kNoPicture) return;
  aiUVTransform transform;
  material.Get(AI_MATKEY_UVTRANSFORM(*type, 0), transform);
  AddLeftOut("turned textures", transform.mRotation != 0 ? 1 : 0, context->model);
  const aiVector3D* const uv = mesh.mTextureCoords[channel];
  part->texture_coordinates.reserve(mesh.mNumVertices);
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const float u = uv[v].x * transform.mScaling.x + transform.mTranslation.x;
    // v points up in the library, and down in a model.
    const float down = 1 - (uv[v].y * transform.mScaling.y + transform.mTranslation.y);
    part->texture_coordinates.push_back({std::isfinite(u) ? u : 0, std::isfinite(down) ? down : 0});
  }
  AddLeftOut("triangles across the edge of a picture that does not repeat",
             ApplyWrap(WrapOfMode(modes[0]), WrapOfMode(modes[1]), part), context->model);
}

// The library has 24 bits for each coordinate, both of the mesh and of its node's position.
void NoteRounding(const aiMesh& mesh, const NodeMatrix& map, Context* context) {
  double largest = 0, factor = 0, move = 0;
  for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
    const aiVector3D& p = mesh.mVertices[v];
    largest =
        std::max({largest, std::abs(double{p.x}), std::abs(double{p.y}), std::abs(double{p.z})});
  }
  for (size_t row = 0; row < 12; row += 4) {
    for (size_t col = 0; col < 3; ++col) factor = std::max(factor, std::abs(map[row + col]));
    move = std::max(move, std::abs(map[row + 3]));
  }
  context->rounding = std::max(context->rounding, std::ldexp(largest * factor + move, -24));
}

// Adds parts by kind: after sorting, a mesh has faces of one kind only, or only points.
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
          Direction(Map(skin.empty() ? normal_matrix : NormalMatrix(skin[v]), shaped.Normal(v))));
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
  if (context->three_mf != nullptr && corners == 3) {
    NoteRounding(mesh, to_model, context);
    // A mirror reverses the winding.
    for (size_t i = 0; IsMirror(to_model) && i < part.indices.size(); i += 3)
      std::swap(part.indices[i + 1], part.indices[i + 2]);
    for (Part& painted :
         context->three_mf->Paint(mesh.mName.C_Str(), std::move(part), context->model)) {
      AddNormals(kCreaseDegrees, &painted);
      context->model->parts.push_back(std::move(painted));
    }
    return absl::OkStatus();
  }
  std::optional<std::array<double, 3>> own;
  std::array<double, 3> light = {0, 0, 0};
  if (context->has_materials && mesh.mMaterialIndex < context->scene.mNumMaterials &&
      !context->made_up[mesh.mMaterialIndex]) {
    const aiMaterial& material = *context->scene.mMaterials[mesh.mMaterialIndex];
    if (corners == 3) AddPicture(material, mesh, &part, context);
    own = ColorOf(material, part.picture != kNoPicture, *context);
    aiColor4D emission(0, 0, 0, 0);
    if (part.picture == kNoPicture) material.Get(AI_MATKEY_COLOR_EMISSIVE, emission);
    light = {emission.r, emission.g, emission.b};
    if (context->materials.insert(mesh.mMaterialIndex).second)
      CountMaterial(material, part.picture != kNoPicture, context->model);
  }
  const bool has_colors = mesh.HasVertexColors(0);
  if (const auto base = BaseColor(own, IsLit(light), has_colors)) {
    part.colors.reserve(mesh.mNumVertices);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
      const aiColor4D by = has_colors ? mesh.mColors[0][v] : aiColor4D(1, 1, 1, 1);
      part.colors.push_back({ColorByte((*base)[0] * by.r + light[0], false),
                             ColorByte((*base)[1] * by.g + light[1], false),
                             ColorByte((*base)[2] * by.b + light[2], false)});
    }
  }
  AddLeftOut("further colours of vertices", mesh.HasVertexColors(1) ? 1 : 0, context->model);
  AddLeftOut("morph targets", context->at_rest ? mesh.mNumAnimMeshes : 0, context->model);
  NoteRounding(mesh, to_model, context);
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

// Calls `visit(node, its map, its parent's map or null)` for each node.
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

// Returns the total length of the bones, which does not depend on the pose.
double LengthOf(const Part& bones) {
  double length = 0;
  for (size_t i = 0; i + 1 < bones.positions.size(); i += 2) {
    const Point3 &a = bones.positions[i], &b = bones.positions[i + 1];
    length += std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  }
  return length;
}

// The formats that assimp reads here. Its readers of other formats are untested here, so they are
// never registered.
struct AssimpFormat {
  absl::string_view extension, name;
  Up up = Up::kY;
  double unit = 0;            // in metres; 0: not known, or the file says it
  bool has_materials = true;  // that assimp reads
};
constexpr AssimpFormat kAssimpReaders[] = {
    {"off", "OFF", Up::kY, 0, false},
    {"fbx", "FBX"},
    {"3mf", "3MF", Up::kZ, 0, false},
    {"dae", "COLLADA", Up::kY, 1},  // assimp scales it to metres
    {"blend", "Blender", Up::kZ},
    {"ifc", "IFC", Up::kY, 1},  // likewise
    {"bvh", "BVH", Up::kY, 0, false},
    {"3ds", "3DS"},
    {"x", "DirectX X"},
    {"lwo", "LightWave", Up::kY, 1},
    {"amf", "AMF", Up::kZ}};

const AssimpFormat* FindFormat(absl::string_view extension) {
  const auto* const found =
      std::find_if(std::begin(kAssimpReaders), std::end(kAssimpReaders),
                   [extension](const AssimpFormat& one) { return one.extension == extension; });
  return found == std::end(kAssimpReaders) ? nullptr : found;
}

AssimpFormat FormatOf(const SourceFile& file) {
  const AssimpFormat* const format = FindFormat(file.extension);
  return format != nullptr ? *format : AssimpFormat{file.extension, file.extension};
}

// Returns the unit of the library's positions in metres; 0 if it is unknown.
double UnitOf(const SourceFile& file, const aiScene& scene) {
  if (file.extension == "fbx") {
    // The factor is in centimetres.
    float factor = 1;
    if (scene.mMetaData != nullptr) scene.mMetaData->Get("UnitScaleFactor", factor);
    return std::isfinite(factor) && factor > 0 ? factor * 0.01 : 0.01;
  }
  if (file.extension == "amf") {
    absl::string_view tag = absl::string_view(file.bytes).substr(0, 4096);
    tag.remove_prefix(std::min(tag.find("<amf"), tag.size()));
    tag = tag.substr(0, tag.find('>'));
    static constexpr std::pair<absl::string_view, double> kUnits[] = {
        {"inch", 0.0254}, {"feet", 0.3048}, {"meter", 1}, {"micron", 1e-6}};
    for (const auto& [name, unit] : kUnits) {
      for (const absl::string_view quote : {"\"", "'"}) {
        if (absl::StrContains(tag, absl::StrCat(quote, name, quote))) return unit;
      }
    }
    return 0.001;
  }
  return FormatOf(file).unit;
}

absl::Status Failed(const SourceFile& file, absl::string_view reason) {
  return FileError(file,
                   absl::StrCat("could not be read as ", EscapeForTerminal(FormatOf(file).name),
                                " (", EscapeForTerminal(reason.substr(0, 300)), ")"),
                   "the file is damaged or uses what is not supported");
}

absl::StatusOr<const aiScene*> Load(const SourceFile& file, Assimp::Importer* importer) {
  importer->SetPropertyInteger(AI_CONFIG_PP_RVC_FLAGS, aiComponent_TANGENTS_AND_BITANGENTS);
  importer->SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, kSmoothingDegrees);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  // The library detects the format from the contents, whatever the file's name is, so only the
  // reader for the file's own format stays registered.
  const Assimp::BaseImporter* const own = importer->GetImporter(file.extension.c_str());
  for (size_t i = importer->GetImporterCount(); i-- > 0;) {
    Assimp::BaseImporter* const reader = importer->GetImporter(i);
    if (reader == own || importer->UnregisterLoader(reader) != aiReturn_SUCCESS) continue;
    delete reader;
  }
  // The importer deletes it.
  importer->SetIOHandler(
      new AssimpFiles(file, file.extension == "dae" ? WithoutColladaHoles(file) : ""));
  // Post-processing trusts the indices, so it runs after our own check.
  const aiScene* scene = importer->ReadFile(file.path, 0);
  if (scene == nullptr) return Failed(file, importer->GetErrorString());
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const absl::Status status = CheckMesh(file, *scene->mMeshes[m]);
    if (!status.ok()) return status;
  }
  if (scene->mRootNode == nullptr || (scene->mNumMeshes == 0 && scene->mNumAnimations == 0)) {
    return FileError(file, "holds no mesh", "at least one is expected");
  }
  // A cloud has no faces to process, and some steps refuse such meshes.
  const auto has_faces = [](const aiMesh* mesh) { return mesh->mNumFaces > 0; };
  // Colours of 3MF are assigned by the file's order of triangles.
  if (scene->mNumMeshes > 0 && file.extension != "3mf" &&
      std::all_of(scene->mMeshes, scene->mMeshes + scene->mNumMeshes, has_faces)) {
    scene = importer->ApplyPostProcessing(aiProcess_RemoveComponent | aiProcess_Triangulate |
                                          aiProcess_SortByPType | aiProcess_GenSmoothNormals |
                                          aiProcess_JoinIdenticalVertices);
    if (scene == nullptr) return Failed(file, importer->GetErrorString());
  }
  return scene;
}

// Some formats give the axis themselves: 0 is x, 1 y, 2 z.
Up UpOf(const aiScene& scene, Up otherwise) {
  int32_t axis = -1;
  if (scene.mMetaData == nullptr || !scene.mMetaData->Get("UpAxis", axis)) return otherwise;
  return axis == 0 ? Up::kX : axis == 1 ? Up::kY : axis == 2 ? Up::kZ : otherwise;
}

// FBX may say that its up axis points down: then it is first turned by 180° about another axis.
void TurnUpsideDown(const aiScene& scene, Model* model) {
  int32_t sign = 1;
  if (scene.mMetaData == nullptr || !scene.mMetaData->Get("UpAxisSign", sign) || sign != -1) return;
  const auto turn = [about_z = model->up == Up::kX](Point3& p) {
    p.y = -p.y;
    (about_z ? p.x : p.z) *= -1;
  };
  for (Part& part : model->parts) {
    std::for_each(part.positions.begin(), part.positions.end(), turn);
    std::for_each(part.normals.begin(), part.normals.end(), turn);
  }
}

// Counts what the library ignores silently, by the names that the file uses.
void CountUnread(const SourceFile& file, Model* model) {
  static constexpr std::array<std::string_view, 3> kUnread[] = {
      {"fbx", "\"NurbsCurve\" {", "NURBS curves"},
      {"fbx", "\"NurbsSurface\" {", "NURBS surfaces"},
      {"fbx", {"S\12\0\0\0NurbsCurve", 15}, "NURBS curves"},
      {"fbx", {"S\14\0\0\0NurbsSurface", 17}, "NURBS surfaces"}};
  for (const auto& [extension, mark, kind] : kUnread) {
    if (extension != file.extension) continue;
    uint64_t count = 0;
    for (size_t at = file.bytes.find(mark); at != std::string::npos;
         at = file.bytes.find(mark, at + mark.size()))
      ++count;
    AddLeftOut(kind, count, model);
  }
  if (file.extension == "off") {
    const OffColors colors = CountOffColors(file);
    AddLeftOut("colours of faces", colors.faces, model);
    AddLeftOut("colours of vertices that the header does not announce", colors.vertices, model);
  }
  if (file.extension != "bvh") return;
  // The announced number of frames is followed by a line for each frame.
  absl::string_view text = file.bytes;
  const auto take_after = [&text](absl::string_view mark) {
    const size_t at = text.find(mark);
    if (at == absl::string_view::npos) return absl::string_view();
    text.remove_prefix(at + mark.size());
    return absl::StripAsciiWhitespace(TakeLine(&text));
  };
  uint64_t announced = 0, found = 0;
  if (!absl::SimpleAtoi(take_after("Frames:"), &announced)) return;
  take_after("Frame Time:");
  while (!text.empty()) found += absl::StripAsciiWhitespace(TakeLine(&text)).empty() ? 0 : 1;
  AddLeftOut("frames beyond the announced number", found > announced ? found - announced : 0,
             model);
}

// The library shows the available part of a truncated file. Adds a note if the end is missing.
void NoteMissingEnd(const SourceFile& file, Model* model) {
  constexpr size_t kTail = 4096;
  constexpr absl::string_view kEnd = "END-ISO-10303-21";
  const absl::string_view text = file.bytes;
  if (file.extension != "ifc" ||
      absl::StrContains(text.substr(text.size() - std::min(kTail, text.size())), kEnd))
    return;
  AddNote(absl::StrCat("it ends without ", kEnd, ", so some of it may be missing"), model);
}

// Adds a note if rounding exceeds half a voxel when the model fills 256 voxels.
void NoteSinglePrecision(double rounding, Model* model) {
  Point3 least = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, most = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  for (const Part& part : model->parts) {
    for (const Point3& p : part.positions) {
      least = {std::min(least.x, p.x), std::min(least.y, p.y), std::min(least.z, p.z)};
      most = {std::max(most.x, p.x), std::max(most.y, p.y), std::max(most.z, p.z)};
    }
  }
  const double size = std::max({most.x - least.x, most.y - least.y, most.z - least.z});
  if (!(rounding > size / 512)) return;
  AddNote(absl::StrCat("its coordinates are so large that single precision, in which files of this "
                       "format are read, "
                       "moves them by up to ",
                       absl::StrFormat("%.2g", rounding),
                       " of its units, over half a voxel of 256; move the model "
                       "to its origin, or export it as glTF or OBJ"),
          model);
}

}  // namespace

bool AssimpReads(absl::string_view extension) { return FindFormat(extension) != nullptr; }

absl::StatusOr<const aiScene*> LoadScene(const SourceFile& file, Assimp::Importer* importer) {
  try {
    return Load(file, importer);
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
  model.unit = UnitOf(file, scene);
  AddLeftOut("cameras", scene.mNumCameras, &model);
  AddLeftOut("lights", scene.mNumLights, &model);
  if (pose == nullptr) AddLeftOut("animations", scene.mNumAnimations, &model);
  CountUnread(file, &model);
  NoteMissingEnd(file, &model);
  if (scene.mNumMeshes == 0) {
    Part bones = Bones(*scene.mRootNode, pose);
    if (bones.positions.empty())
      return FileError(file, "holds no mesh and no bone", "one is expected");
    // The thickness is computed from the bones at rest, so that it is the same in every pose.
    bones.thickness = kBoneThickness * LengthOf(Bones(*scene.mRootNode, nullptr));
    model.parts.push_back(std::move(bones));
    TurnUpsideDown(scene, &model);
    return model;
  }
  static const Pose kRest;
  std::optional<ThreeMfColors> three_mf;
  if (file.extension == "3mf") three_mf.emplace(file, &model);
  ColladaContents collada;
  if (file.extension == "dae") collada = ScanCollada(file, &model);
  Context context{.file = file,
                  .scene = scene,
                  .has_materials = format.has_materials,
                  .made_up = FindMadeUp(file, scene),
                  .has_diffuse = collada.has_diffuse,
                  .three_mf = three_mf ? &*three_mf : nullptr,
                  .pose = pose == nullptr ? &kRest : pose,
                  .at_rest = pose == nullptr,
                  .model = &model};
  const absl::Status status = AddNodes(&context);
  if (!status.ok()) return status;
  for (Part& part : model.parts) {
    if (part.kind == Kind::kTriangles)
      AddLeftOut("triangles without an area", DropEmptyTriangles(&part), &model);
  }
  std::erase_if(model.parts, [](const Part& part) {
    return part.kind == Kind::kTriangles && part.indices.empty();
  });
  NoteSinglePrecision(context.rounding, &model);
  TurnUpsideDown(scene, &model);
  return model;
}

}  // namespace voxeld::voxelctl
