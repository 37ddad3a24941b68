#include "tools/import/gltf_model.h"

// The library loads neither pictures nor files: this reader loads both.
#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#include <fstream>  // the header also writes files, which nothing here calls
//
#include <tiny_gltf.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <exception>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <type_traits>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/gltf_check.h"
#include "tools/import/mesh_parts.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint32_t kNone = UINT32_MAX;
// As a share of the total length of all bones.
constexpr double kBoneThickness = 0.004;
constexpr uint64_t kMostMorphWork = uint64_t{1} << 31;  // morph targets times vertices
constexpr uint64_t kMostVisited = uint64_t{1} << 30;    // vertices, over all primitives
constexpr uint64_t kMostAnimationValues = uint64_t{1} << 26;
constexpr size_t kMostKinds = 40;  // of extensions that are counted by name

// Thrown and caught within this file when a check fails deep inside a scene.
struct Failure {
  std::string found, expected;
};

// Checks a reference to one of `size` items; -1 means none.
void CheckReference(int index, size_t size, absl::string_view where) {
  if (index == -1 || (index >= 0 && static_cast<size_t>(index) < size)) return;
  throw Failure{absl::StrCat(where, " is ", index),
                absl::StrCat("there are ", size, ", counted from 0")};
}

// Checks the same for a required reference.
void Require(int index, size_t size, absl::string_view where) {
  if (index == -1) throw Failure{absl::StrCat(where, " is -1"), "a number from 0 is expected"};
  CheckReference(index, size, where);
}

void CheckLength(const std::vector<double>& numbers, size_t wanted, absl::string_view where) {
  if (numbers.empty() || numbers.size() == wanted) return;
  throw Failure{absl::StrCat(where, " has ", numbers.size(), " numbers"),
                absl::StrCat(wanted, " are expected")};
}

template <typename T, typename Visit>
void VisitElements(const GltfAccessor& accessor, Visit& visit) {
  std::array<double, 16> values{};
  const auto take = [&](uint64_t element, const char* at) {
    for (uint64_t c = 0; c < accessor.components; ++c) {
      T value;
      std::memcpy(&value, at + c * sizeof(T), sizeof(T));
      values[c] = static_cast<double>(value);
      if (std::is_integral_v<T> && accessor.normalized)
        values[c] = std::max(values[c] / std::numeric_limits<T>::max(), -1.0);
    }
    visit(element, values.data());
  };
  for (uint64_t i = 0; i < accessor.count; ++i) {
    if (accessor.bytes.empty()) {
      visit(i, values.data());
    } else {
      take(i, accessor.bytes.data() + i * accessor.stride);
    }
  }
  for (uint64_t s = 0; s < accessor.sparse_count; ++s) {
    uint32_t index = 0;
    std::memcpy(&index, accessor.sparse_indices.data() + s * accessor.sparse_index_size,
                accessor.sparse_index_size);
    take(index, accessor.sparse_values.data() + s * accessor.components * sizeof(T));
  }
}

// Calls visit(number, components) for each element, and again for an element that a sparse one
// replaces.
template <typename Visit>
void ForEachElement(const GltfAccessor& accessor, Visit visit) {
  switch (accessor.component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return VisitElements<int8_t>(accessor, visit);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return VisitElements<uint8_t>(accessor, visit);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return VisitElements<int16_t>(accessor, visit);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return VisitElements<uint16_t>(accessor, visit);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return VisitElements<uint32_t>(accessor, visit);
    default:
      return VisitElements<float>(accessor, visit);
  }
}

// Returns the accessor without normalisation.
GltfAccessor Plain(GltfAccessor accessor) {
  accessor.normalized = false;
  return accessor;
}

// Returns the accessor with integers as fractions of their maximum, for attributes whose integers
// the format always normalises.
GltfAccessor Normalized(GltfAccessor accessor) {
  accessor.normalized = true;
  return accessor;
}

Point3 PointOf(const double* v) { return {v[0], v[1], v[2]}; }

// ------------------------------------------------------------------------------- JSON of extensions

const tinygltf::Value* FindExtension(const tinygltf::ExtensionMap& extensions, const char* name) {
  const auto found = extensions.find(name);
  return found == extensions.end() || !found->second.IsObject() ? nullptr : &found->second;
}

double NumberOf(const tinygltf::Value& object, const char* key, double otherwise) {
  return object.Has(key) && object.Get(key).IsNumber() ? object.Get(key).GetNumberAsDouble()
                                                       : otherwise;
}

int IntegerOf(const tinygltf::Value& object, const char* key, int otherwise) {
  const double number = NumberOf(object, key, otherwise);
  return std::abs(number) < 1e9 ? static_cast<int>(number) : -2;
}

template <size_t kCount>
std::array<double, kCount> NumbersOf(const tinygltf::Value& object, const char* key,
                                     std::array<double, kCount> otherwise) {
  if (!object.Has(key) || object.Get(key).ArrayLen() != kCount) return otherwise;
  std::array<double, kCount> numbers;
  for (size_t i = 0; i < kCount; ++i) {
    const tinygltf::Value& number = object.Get(key).Get(static_cast<int>(i));
    if (!number.IsNumber()) return otherwise;
    numbers[i] = number.GetNumberAsDouble();
  }
  return numbers;
}

// ------------------------------------------------------------------------------------------ surfaces

// The texture that a material uses, and how it is applied.
struct TextureUse {
  int index = -1, set = 0;
  const tinygltf::Value* transform = nullptr;
};

TextureUse UseOf(const tinygltf::TextureInfo& info) {
  return {info.index, info.texCoord, FindExtension(info.extensions, "KHR_texture_transform")};
}

TextureUse UseOf(const tinygltf::Value& object, const char* key) {
  if (!object.Has(key) || !object.Get(key).IsObject()) return {};
  const tinygltf::Value& info = object.Get(key);
  TextureUse use{.index = IntegerOf(info, "index", -1), .set = IntegerOf(info, "texCoord", 0)};
  if (info.Has("extensions") && info.Get("extensions").IsObject()) {
    const tinygltf::Value& transform = info.Get("extensions").Get("KHR_texture_transform");
    if (transform.IsObject()) use.transform = &transform;
  }
  return use;
}

// A material as the display shows it.
struct Surface {
  std::array<double, 4> base = {1, 1, 1, 1};  // linear light
  std::array<double, 3> emission = {0, 0, 0};
  uint32_t picture = kNoPicture;
  int set = 0;  // of texture coordinates
  // Maps texture coordinates to coordinates on the picture; row-major 2×3.
  std::array<double, 6> transform = {1, 0, 0, 0, 1, 0};
  Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
  bool lit = true, visible = true;
  bool blended = false, masked = false;  // alphaMode
  double cutoff = 0;                     // of a masked one

  // Whether something can be seen where the material's alpha times the vertex's is `alpha`.
  bool IsSeenAt(double alpha) const {
    return masked ? alpha >= cutoff : blended ? alpha > 0 : true;
  }
};

// Rotates counter-clockwise as the picture is viewed; its v points down.
void ApplyTransform(const TextureUse& use, Surface* surface) {
  surface->set = use.set;
  if (use.transform == nullptr) return;
  const auto offset = NumbersOf<2>(*use.transform, "offset", {0, 0});
  const auto scale = NumbersOf<2>(*use.transform, "scale", {1, 1});
  const double angle = NumberOf(*use.transform, "rotation", 0);
  const double c = std::cos(angle), s = std::sin(angle);
  surface->transform = {c * scale[0],  s * scale[1], offset[0],
                        -s * scale[0], c * scale[1], offset[1]};
  surface->set = IntegerOf(*use.transform, "texCoord", use.set);
}

Wrap WrapOf(int mode) {
  return mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE     ? Wrap::kClamp
         : mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::kMirror
                                                         : Wrap::kRepeat;
}

// Returns whether this reader shows the extension, counts it in another way, or can ignore it
// because it changes nothing visible.
bool IsHandled(absl::string_view extension) {
  static constexpr absl::string_view kHandled[] = {"KHR_materials_unlit",
                                                   "KHR_materials_pbrSpecularGlossiness",
                                                   "KHR_materials_emissive_strength",
                                                   "KHR_texture_transform",
                                                   "KHR_mesh_quantization",
                                                   "KHR_node_visibility",
                                                   "EXT_mesh_gpu_instancing",
                                                   "KHR_lights_punctual",
                                                   "KHR_animation_pointer",
                                                   "KHR_materials_variants",
                                                   "KHR_draco_mesh_compression",
                                                   "EXT_meshopt_compression",
                                                   "EXT_texture_webp",
                                                   "KHR_texture_basisu",
                                                   "MSFT_texture_dds",
                                                   "KHR_xmp",
                                                   "KHR_xmp_json_ld"};
  return std::find(std::begin(kHandled), std::end(kHandled), extension) != std::end(kHandled);
}

// Returns how often each extension that is not handled is used.
std::map<std::string, uint64_t> CountExtensions(const nlohmann::json& document) {
  std::map<std::string, uint64_t> counts;
  std::vector<const nlohmann::json*> stack = {&document};
  while (!stack.empty()) {
    const nlohmann::json& at = *stack.back();
    stack.pop_back();
    for (const auto& [key, value] : at.items()) {
      if (at.is_object() && key == "extras") continue;
      if (at.is_object() && key == "extensions" && value.is_object()) {
        for (const auto& [name, content] : value.items()) {
          if (!IsHandled(name) && (counts.contains(name) || counts.size() < kMostKinds))
            ++counts[name];
        }
      }
      if (value.is_structured()) stack.push_back(&value);
    }
  }
  return counts;
}

// ---------------------------------------------------------------------------------------------- nodes

NodeMatrix FromColumns(const double* m) {
  return {m[0], m[4], m[8], m[12], m[1], m[5], m[9], m[13], m[2], m[6], m[10], m[14]};
}

NodeMatrix FromParts(const std::array<double, 3>& move, const std::array<double, 4>& turn,
                     const std::array<double, 3>& scale) {
  double x = turn[0], y = turn[1], z = turn[2], w = turn[3];
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  if (length > 0) x /= length, y /= length, z /= length, w /= length;
  return {(1 - 2 * (y * y + z * z)) * scale[0], 2 * (x * y - z * w) * scale[1],
          2 * (x * z + y * w) * scale[2],       move[0],
          2 * (x * y + z * w) * scale[0],       (1 - 2 * (x * x + z * z)) * scale[1],
          2 * (y * z - x * w) * scale[2],       move[1],
          2 * (x * z - y * w) * scale[0],       2 * (y * z + x * w) * scale[1],
          (1 - 2 * (x * x + y * y)) * scale[2], move[2]};
}

template <size_t kCount>
std::array<double, kCount> ValueOf(const std::vector<double>& own,
                                   const std::unordered_map<int, std::array<double, kCount>>* posed,
                                   int node, std::array<double, kCount> otherwise) {
  if (posed != nullptr) {
    const auto found = posed->find(node);
    if (found != posed->end()) return found->second;
  }
  if (own.size() == kCount) std::copy(own.begin(), own.end(), otherwise.begin());
  return otherwise;
}

NodeMatrix LocalOf(const tinygltf::Node& node, int number, const GltfPose* pose) {
  const bool moved =
      pose != nullptr && (pose->translations.contains(number) || pose->rotations.contains(number) ||
                          pose->scales.contains(number));
  if (!moved && node.matrix.size() == 16) return FromColumns(node.matrix.data());
  return FromParts(
      ValueOf<3>(node.translation, pose ? &pose->translations : nullptr, number, {0, 0, 0}),
      ValueOf<4>(node.rotation, pose ? &pose->rotations : nullptr, number, {0, 0, 0, 1}),
      ValueOf<3>(node.scale, pose ? &pose->scales : nullptr, number, {1, 1, 1}));
}

// --------------------------------------------------------------------------------------------- scene

// The kind of a primitive's elements, and which vertices they use.
struct Elements {
  Kind kind = Kind::kTriangles;
  std::vector<uint32_t> indices;  // into the kept vertices
  std::vector<uint32_t>
      kept;  // by the file's number: kNone, or the number of the kept vertex; empty: all are kept
  size_t vertices = 0;  // the number of kept vertices
  // Elements whose vertices are all fully transparent are dropped; others have some such vertices.
  uint64_t transparent = 0, partly_transparent = 0;
};

class Scene final : public GltfScene {
 public:
  explicit Scene(const SourceFile& file) : file_(file) {}

  // Throws Failure.
  absl::Status Open();

  std::vector<std::string> AnimationNames() const override {
    std::vector<std::string> names;
    names.reserve(gltf_.animations.size());
    for (const tinygltf::Animation& animation : gltf_.animations) names.push_back(animation.name);
    return names;
  }
  absl::StatusOr<std::vector<GltfChannel>> ChannelsOf(size_t number, Model* left_out) override {
    try {
      return Channels(number, left_out);
    } catch (const Failure& failure) {
      return FileError(file_, failure.found, failure.expected);
    }
  }
  absl::StatusOr<Model> ModelAt(const GltfPose* pose, bool attributes) override {
    try {
      return Build(pose, attributes);
    } catch (const Failure& failure) {
      return FileError(file_, failure.found, failure.expected);
    }
  }

 private:
  // The state while one model is built.
  struct Building {
    const GltfPose* pose;
    bool attributes;
    Model model;
    uint64_t vertices = 0, indices = 0, visited = 0, morph_work = 0;
    std::map<int, Surface> surfaces;   // by material; -1 is the default
    std::map<int, uint32_t> pictures;  // by image
    std::map<int, std::vector<NodeMatrix>> skins;
    std::vector<NodeMatrix> globals;  // by node
  };

  void CheckReferences() const;
  void CheckMaterials() const;
  void CheckSkins() const;
  void FindRoots();
  std::vector<NodeMatrix> GlobalsOf(const GltfPose* pose) const;
  std::vector<GltfChannel> Channels(size_t number, Model* left_out) const;
  GltfChannel ChannelOf(const tinygltf::AnimationSampler& sampler, int node, GltfPath path) const;

  Model Build(const GltfPose* pose, bool attributes);
  const Surface& SurfaceOf(int material, Building* building);
  void UsePicture(const TextureUse& use, Surface* surface, Building* building);
  uint32_t PictureOf(int texture, Building* building);
  std::optional<std::string> ImageBytes(int image) const;
  const std::vector<NodeMatrix>& JointsOf(int skin, Building* building) const;
  std::vector<NodeMatrix> InstancesOf(const tinygltf::Node& node, const NodeMatrix& map) const;
  void AddMesh(int node, Building* building);
  void AddPrimitive(const tinygltf::Primitive& primitive, int node,
                    std::span<const NodeMatrix> maps, Building* building);
  std::vector<bool> SeenVertices(const tinygltf::Primitive& primitive, const Surface& surface,
                                 uint64_t vertices) const;
  Elements ElementsOf(const tinygltf::Primitive& primitive, uint64_t vertices,
                      const std::vector<bool>& seen) const;
  void AddVectors(const tinygltf::Primitive& primitive, const char* name,
                  const std::vector<double>& weights, const Elements& elements,
                  std::vector<Point3>* out, Building* building) const;
  void AddColors(const tinygltf::Primitive& primitive, const Surface& surface,
                 const Elements& elements, Part* part) const;
  bool AddCoordinates(const tinygltf::Primitive& primitive, const Surface& surface,
                      const Elements& elements, Part* part) const;
  std::vector<NodeMatrix> SkinOf(const tinygltf::Primitive& primitive, int skin,
                                 const Elements& elements, Building* building) const;
  std::vector<double> WeightsOf(int node, const GltfPose* pose) const;
  Part Bones(const std::vector<NodeMatrix>& globals) const;
  uint64_t CountOutside() const;
  void CountLeftOut(Building* building) const;

  const GltfAccessor* Find(const std::map<std::string, int>& attributes, const char* name) const {
    const auto found = attributes.find(name);
    return found == attributes.end() ? nullptr
                                     : &document_->accessors[static_cast<size_t>(found->second)];
  }

  const SourceFile& file_;
  std::unique_ptr<GltfDocument> document_;
  nlohmann::json images_;
  tinygltf::Model gltf_;
  std::vector<int> parents_;
  std::vector<int> roots_;               // of the scene that is shown
  std::vector<int> shown_;               // nodes of that scene, parents first
  uint64_t hidden_ = 0;                  // nodes of the scene that are invisible
  std::vector<uint64_t> lost_channels_;  // per animation, channels that the library drops
  std::map<std::string, uint64_t> extensions_;
  uint64_t variants_ = 0;
  double rest_length_ = 0;  // total length of all bones
};

absl::Status Scene::Open() {
  absl::StatusOr<std::unique_ptr<GltfDocument>> document = LoadGltfDocument(file_);
  if (!document.ok()) return document.status();
  document_ = *std::move(document);
  nlohmann::json& json = document_->json;
  extensions_ = CountExtensions(json);
  for (const nlohmann::json& animation : json.value("animations", nlohmann::json::array())) {
    uint64_t lost = 0;
    for (const nlohmann::json& channel : animation.value("channels", nlohmann::json::array())) {
      if (!channel.is_object() || !channel.contains("target") || !channel["target"].is_object() ||
          !channel["target"].contains("node"))
        ++lost;
    }
    lost_channels_.push_back(lost);
  }
  const auto variants = nlohmann::json::json_pointer("/extensions/KHR_materials_variants/variants");
  if (json.contains(variants) && json[variants].is_array()) variants_ = json[variants].size();
  if (json.contains("images") && json["images"].is_array()) images_ = std::move(json["images"]);
  json.erase("images");
  const std::string text = json.dump();
  json = {};
  std::string error, warning;
  tinygltf::TinyGLTF reader;
  if (!reader.LoadASCIIFromString(&gltf_, &error, &warning, text.data(),
                                  static_cast<unsigned>(text.size()), "")) {
    return FileError(
        file_,
        absl::StrCat("could not be read as glTF (", EscapeForTerminal(error.substr(0, 300)), ")"),
        "the file is damaged or uses what is not supported");
  }
  CheckReferences();
  CheckMaterials();
  CheckSkins();
  FindRoots();
  return absl::OkStatus();
}

void Scene::CheckReferences() const {
  for (size_t n = 0; n < gltf_.nodes.size(); ++n) {
    const tinygltf::Node& node = gltf_.nodes[n];
    const std::string where = absl::StrCat("nodes[", n, "]");
    CheckReference(node.mesh, gltf_.meshes.size(), where + ".mesh");
    CheckReference(node.skin, gltf_.skins.size(), where + ".skin");
    CheckLength(node.matrix, 16, where + ".matrix");
    CheckLength(node.translation, 3, where + ".translation");
    CheckLength(node.rotation, 4, where + ".rotation");
    CheckLength(node.scale, 3, where + ".scale");
  }
  for (size_t m = 0; m < gltf_.meshes.size(); ++m) {
    for (size_t p = 0; p < gltf_.meshes[m].primitives.size(); ++p) {
      const tinygltf::Primitive& primitive = gltf_.meshes[m].primitives[p];
      const std::string where = absl::StrCat("meshes[", m, "].primitives[", p, "]");
      CheckReference(primitive.material, gltf_.materials.size(), where + ".material");
      if (primitive.mode < TINYGLTF_MODE_POINTS || primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        throw Failure{absl::StrCat(where, ".mode is ", primitive.mode), "0 to 6 is expected"};
      }
      const auto check = [&](const std::map<std::string, int>& attributes) {
        for (const auto& [name, accessor] : attributes) {
          const uint64_t components =
              document_->accessors[static_cast<size_t>(accessor)].components;
          const bool is_vector = name == "POSITION" || name == "NORMAL";
          if (is_vector && components != 3) {
            throw Failure{absl::StrCat(where, ".", name, " has ", components, " components"),
                          "VEC3 is expected"};
          }
        }
      };
      check(primitive.attributes);
      for (const auto& target : primitive.targets) check(target);
    }
  }
  for (size_t t = 0; t < gltf_.textures.size(); ++t) {
    const std::string where = absl::StrCat("textures[", t, "]");
    CheckReference(gltf_.textures[t].source, images_.size(), where + ".source");
    CheckReference(gltf_.textures[t].sampler, gltf_.samplers.size(), where + ".sampler");
  }
}

void Scene::CheckMaterials() const {
  for (size_t m = 0; m < gltf_.materials.size(); ++m) {
    const tinygltf::Material& material = gltf_.materials[m];
    const std::string where = absl::StrCat("materials[", m, "]");
    CheckReference(material.pbrMetallicRoughness.baseColorTexture.index, gltf_.textures.size(),
                   where + ".pbrMetallicRoughness.baseColorTexture.index");
    CheckReference(material.emissiveTexture.index, gltf_.textures.size(),
                   where + ".emissiveTexture.index");
    const tinygltf::Value* glossy =
        FindExtension(material.extensions, "KHR_materials_pbrSpecularGlossiness");
    if (glossy != nullptr) {
      CheckReference(UseOf(*glossy, "diffuseTexture").index, gltf_.textures.size(),
                     where + ".diffuseTexture.index");
    }
  }
}

void Scene::CheckSkins() const {
  for (size_t s = 0; s < gltf_.skins.size(); ++s) {
    const tinygltf::Skin& skin = gltf_.skins[s];
    const std::string where = absl::StrCat("skins[", s, "]");
    for (const int joint : skin.joints) Require(joint, gltf_.nodes.size(), "a node in " + where);
    CheckReference(skin.inverseBindMatrices, document_->accessors.size(),
                   where + ".inverseBindMatrices");
    if (skin.inverseBindMatrices < 0) continue;
    const GltfAccessor& matrices =
        document_->accessors[static_cast<size_t>(skin.inverseBindMatrices)];
    if (matrices.components != 16 || matrices.count < skin.joints.size()) {
      throw Failure{absl::StrCat(where, ".inverseBindMatrices has ", matrices.count,
                                 " elements of ", matrices.components, " components"),
                    absl::StrCat("a MAT4 for each of ", skin.joints.size(), " joints is expected")};
    }
  }
}

// The check of the document has verified that nodes form a forest.
void Scene::FindRoots() {
  parents_.assign(gltf_.nodes.size(), -1);
  for (size_t n = 0; n < gltf_.nodes.size(); ++n) {
    for (const int child : gltf_.nodes[n].children)
      parents_[static_cast<size_t>(child)] = static_cast<int>(n);
  }
  CheckReference(gltf_.defaultScene, gltf_.scenes.size(), "scene");
  if (gltf_.scenes.empty()) {
    for (size_t n = 0; n < parents_.size(); ++n) {
      if (parents_[n] < 0) roots_.push_back(static_cast<int>(n));
    }
  } else {
    roots_ = gltf_.scenes[static_cast<size_t>(std::max(gltf_.defaultScene, 0))].nodes;
    std::sort(roots_.begin(), roots_.end());
    roots_.erase(std::unique(roots_.begin(), roots_.end()), roots_.end());
    for (const int root : roots_) {
      Require(root, gltf_.nodes.size(), "a node of the scene");
      if (parents_[static_cast<size_t>(root)] >= 0) {
        throw Failure{absl::StrCat("the scene holds node ", root, ", which has a parent"),
                      "a scene lists its root nodes"};
      }
    }
  }
  std::vector<int> stack(roots_.rbegin(), roots_.rend());
  while (!stack.empty()) {
    const int n = stack.back();
    stack.pop_back();
    const tinygltf::Node& node = gltf_.nodes[static_cast<size_t>(n)];
    const tinygltf::Value* visibility = FindExtension(node.extensions, "KHR_node_visibility");
    if (visibility != nullptr && visibility->Has("visible") &&
        visibility->Get("visible").IsBool() && !visibility->Get("visible").Get<bool>()) {
      ++hidden_;
      continue;
    }
    shown_.push_back(n);
    stack.insert(stack.end(), node.children.rbegin(), node.children.rend());
  }
  for (const Part bones = Bones(GlobalsOf(nullptr)); const uint32_t i : bones.indices) {
    if (i % 2 == 1) continue;
    const Point3 &a = bones.positions[i], &b = bones.positions[i + 1];
    rest_length_ += std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
  }
}

// Includes all nodes, because joints need not be in the scene.
std::vector<NodeMatrix> Scene::GlobalsOf(const GltfPose* pose) const {
  std::vector<NodeMatrix> globals(gltf_.nodes.size(), kIdentity);
  std::vector<int> stack;
  for (size_t n = 0; n < parents_.size(); ++n) {
    if (parents_[n] < 0) stack.push_back(static_cast<int>(n));
  }
  while (!stack.empty()) {
    const int n = stack.back();
    stack.pop_back();
    const auto at = static_cast<size_t>(n);
    const NodeMatrix local = LocalOf(gltf_.nodes[at], n, pose);
    globals[at] =
        parents_[at] < 0 ? local : Compose(globals[static_cast<size_t>(parents_[at])], local);
    stack.insert(stack.end(), gltf_.nodes[at].children.begin(), gltf_.nodes[at].children.end());
  }
  return globals;
}

// ------------------------------------------------------------------------------------------ animations

GltfChannel Scene::ChannelOf(const tinygltf::AnimationSampler& sampler, int node,
                             GltfPath path) const {
  GltfChannel channel{.node = node, .path = path};
  channel.interpolation = sampler.interpolation == "STEP"          ? GltfInterpolation::kStep
                          : sampler.interpolation == "CUBICSPLINE" ? GltfInterpolation::kCubicSpline
                                                                   : GltfInterpolation::kLinear;
  for (const int accessor : {sampler.input, sampler.output})
    Require(accessor, document_->accessors.size(), "an animation's accessor");
  const GltfAccessor& times = document_->accessors[static_cast<size_t>(sampler.input)];
  const GltfAccessor& values = document_->accessors[static_cast<size_t>(sampler.output)];
  const uint64_t each = channel.interpolation == GltfInterpolation::kCubicSpline ? 3 : 1;
  const uint64_t components = path == GltfPath::kRotation ? 4 : path == GltfPath::kWeights ? 1 : 3;
  const uint64_t wanted = times.count * each;
  if (times.components != 1 || values.components != components || values.count < wanted ||
      (path != GltfPath::kWeights && values.count != wanted) || values.count % wanted != 0) {
    throw Failure{absl::StrCat("an animation has ", times.count, " times and ", values.count,
                               " values of ", values.components, " components"),
                  absl::StrCat(wanted, " values of ", components, " are expected")};
  }
  channel.width = components * (values.count / wanted);
  if (times.count + values.count * components > kMostAnimationValues) {
    throw Failure{absl::StrCat("an animation has ", values.count, " values"),
                  absl::StrCat("at most ", kMostAnimationValues, " are read")};
  }
  channel.times.resize(times.count);
  ForEachElement(times, [&](uint64_t i, const double* v) { channel.times[i] = v[0]; });
  channel.values.resize(values.count * components);
  ForEachElement(values, [&](uint64_t i, const double* v) {
    std::copy(v, v + components, channel.values.begin() + static_cast<ptrdiff_t>(i * components));
  });
  for (size_t i = 0; i < channel.times.size(); ++i) {
    if (std::isfinite(channel.times[i]) && (i == 0 || channel.times[i] >= channel.times[i - 1]))
      continue;
    throw Failure{absl::StrCat("an animation has the time ", channel.times[i], " as number ", i),
                  "times must be finite and ascend"};
  }
  return channel;
}

std::vector<GltfChannel> Scene::Channels(size_t number, Model* left_out) const {
  const tinygltf::Animation& animation = gltf_.animations[number];
  std::vector<GltfChannel> channels;
  uint64_t lost = lost_channels_[number], values = 0;
  for (const tinygltf::AnimationChannel& channel : animation.channels) {
    static constexpr std::pair<absl::string_view, GltfPath> kPaths[] = {
        {"translation", GltfPath::kTranslation},
        {"rotation", GltfPath::kRotation},
        {"scale", GltfPath::kScale},
        {"weights", GltfPath::kWeights}};
    const auto path = std::find_if(std::begin(kPaths), std::end(kPaths), [&](const auto& one) {
      return one.first == channel.target_path;
    });
    if (path == std::end(kPaths) || channel.target_node == -1) {
      ++lost;
      continue;
    }
    CheckReference(channel.target_node, gltf_.nodes.size(), "an animation's node");
    Require(channel.sampler, animation.samplers.size(), "an animation's sampler");
    channels.push_back(ChannelOf(animation.samplers[static_cast<size_t>(channel.sampler)],
                                 channel.target_node, path->second));
    values += channels.back().values.size() + channels.back().times.size();
    if (values > kMostAnimationValues) {
      throw Failure{absl::StrCat("an animation has ", values, " values"),
                    absl::StrCat("at most ", kMostAnimationValues, " are read")};
    }
  }
  AddLeftOut("animation channels of other properties", lost, left_out);
  return channels;
}

// ------------------------------------------------------------------------------------------- pictures

std::optional<std::string> Scene::ImageBytes(int image) const {
  const nlohmann::json& one = images_[static_cast<size_t>(image)];
  if (!one.is_object()) return std::nullopt;
  if (one.contains("bufferView")) {
    const nlohmann::json& view = one["bufferView"];
    if (!view.is_number_unsigned() || view.get<uint64_t>() >= document_->views.size())
      return std::nullopt;
    return std::string(document_->views[view.get<uint64_t>()]);
  }
  if (!one.contains("uri") || !one["uri"].is_string()) return std::nullopt;
  absl::StatusOr<std::string> bytes = LoadGltfUri(file_, one["uri"].get<std::string>());
  if (!bytes.ok()) return std::nullopt;
  return *std::move(bytes);
}

uint32_t Scene::PictureOf(int texture, Building* building) {
  const int image = gltf_.textures[static_cast<size_t>(texture)].source;
  if (image < 0) {
    AddLeftOut("textures that are neither PNG nor JPEG", 1, &building->model);
    return kNoPicture;
  }
  const auto [at, is_new] = building->pictures.emplace(image, kNoPicture);
  if (!is_new) return at->second;
  std::optional<std::string> bytes = ImageBytes(image);
  if (!bytes) {
    AddLeftOut("textures that cannot be read", 1, &building->model);
  } else if (!IsPicture(*bytes)) {
    AddLeftOut("textures that are neither PNG nor JPEG", 1, &building->model);
  } else {
    at->second = static_cast<uint32_t>(building->model.pictures.size());
    building->model.pictures.push_back(*std::move(bytes));
  }
  return at->second;
}

void Scene::UsePicture(const TextureUse& use, Surface* surface, Building* building) {
  surface->picture = PictureOf(use.index, building);
  ApplyTransform(use, surface);
  const int sampler = gltf_.textures[static_cast<size_t>(use.index)].sampler;
  if (sampler < 0) return;
  surface->wrap_u = WrapOf(gltf_.samplers[static_cast<size_t>(sampler)].wrapS);
  surface->wrap_v = WrapOf(gltf_.samplers[static_cast<size_t>(sampler)].wrapT);
}

const Surface& Scene::SurfaceOf(int number, Building* building) {
  const auto [at, is_new] = building->surfaces.emplace(number, Surface{});
  Surface& surface = at->second;
  if (!is_new || number < 0) return surface;
  Model* const model = &building->model;
  const tinygltf::Material& material = gltf_.materials[static_cast<size_t>(number)];
  const tinygltf::PbrMetallicRoughness& metal = material.pbrMetallicRoughness;
  TextureUse base = UseOf(metal.baseColorTexture);
  if (metal.baseColorFactor.size() == 4)
    std::copy(metal.baseColorFactor.begin(), metal.baseColorFactor.end(), surface.base.begin());
  const tinygltf::Value* glossy =
      FindExtension(material.extensions, "KHR_materials_pbrSpecularGlossiness");
  if (glossy != nullptr) {
    surface.base = NumbersOf<4>(*glossy, "diffuseFactor", {1, 1, 1, 1});
    base = UseOf(*glossy, "diffuseTexture");
    AddLeftOut("maps of metal and roughness", glossy->Has("specularGlossinessTexture") ? 1 : 0,
               model);
  } else {
    AddLeftOut("maps of metal and roughness", metal.metallicRoughnessTexture.index >= 0 ? 1 : 0,
               model);
  }
  surface.lit = !material.extensions.contains("KHR_materials_unlit");
  AddLeftOut("normal maps", material.normalTexture.index >= 0 ? 1 : 0, model);
  AddLeftOut("occlusion maps", material.occlusionTexture.index >= 0 ? 1 : 0, model);

  // A material that is always invisible is not drawn. Others are drawn opaque.
  surface.blended = material.alphaMode == "BLEND";
  surface.masked = material.alphaMode == "MASK";
  surface.cutoff = material.alphaCutoff;
  surface.visible = surface.IsSeenAt(surface.base[3]);
  if (surface.visible && (surface.blended || (surface.masked && base.index >= 0)))
    AddLeftOut("transparency of materials", 1, model);

  if (base.index >= 0) UsePicture(base, &surface, building);
  std::array<double, 3> emission = {0, 0, 0};
  if (material.emissiveFactor.size() == 3) {
    std::copy(material.emissiveFactor.begin(), material.emissiveFactor.end(), emission.begin());
    const tinygltf::Value* strength =
        FindExtension(material.extensions, "KHR_materials_emissive_strength");
    for (double& light : emission)
      light *= strength != nullptr ? NumberOf(*strength, "emissiveStrength", 1) : 1;
  }
  if (!IsLit(emission)) return surface;
  const bool is_black = surface.base[0] <= 0 && surface.base[1] <= 0 && surface.base[2] <= 0;
  if (material.emissiveTexture.index >= 0) {
    // If the surface has no other colour, the picture of the emitted light is used.
    if (is_black) {
      surface.base = {emission[0], emission[1], emission[2], surface.base[3]};
      UsePicture(UseOf(material.emissiveTexture), &surface, building);
    } else {
      AddLeftOut("emission maps", 1, model);
    }
  } else if (surface.picture == kNoPicture) {
    surface.emission = emission;
  } else {
    AddLeftOut("emission over pictures", 1, model);
  }
  return surface;
}

// --------------------------------------------------------------------------------------------- meshes

const std::vector<NodeMatrix>& Scene::JointsOf(int number, Building* building) const {
  const auto [at, is_new] = building->skins.try_emplace(number);
  if (!is_new) return at->second;
  const tinygltf::Skin& skin = gltf_.skins[static_cast<size_t>(number)];
  std::vector<NodeMatrix>& joints = at->second;
  for (const int joint : skin.joints)
    joints.push_back(building->globals[static_cast<size_t>(joint)]);
  if (skin.inverseBindMatrices >= 0) {
    ForEachElement(document_->accessors[static_cast<size_t>(skin.inverseBindMatrices)],
                   [&](uint64_t i, const double* m) {
                     if (i >= joints.size()) return;
                     joints[i] = Compose(building->globals[static_cast<size_t>(skin.joints[i])],
                                         FromColumns(m));
                   });
  }
  return joints;
}

// Returns the instances of the extension EXT_mesh_gpu_instancing, or one.
std::vector<NodeMatrix> Scene::InstancesOf(const tinygltf::Node& node,
                                           const NodeMatrix& map) const {
  const tinygltf::Value* extension = FindExtension(node.extensions, "EXT_mesh_gpu_instancing");
  if (extension == nullptr || !extension->Has("attributes") ||
      !extension->Get("attributes").IsObject()) {
    return {map};
  }
  const tinygltf::Value& attributes = extension->Get("attributes");
  uint64_t count = 0;
  const auto accessor_of = [&](const char* name, uint64_t components) -> const GltfAccessor* {
    if (!attributes.Has(name)) return nullptr;
    const int index = IntegerOf(attributes, name, -2);
    Require(index, document_->accessors.size(), name);
    const GltfAccessor& accessor = document_->accessors[static_cast<size_t>(index)];
    if (accessor.components != components || (count != 0 && accessor.count != count) ||
        accessor.count > kMaxModelVertices) {
      throw Failure{absl::StrCat(name, " of instances has ", accessor.count, " elements of ",
                                 accessor.components, " components"),
                    absl::StrCat(components, " components are expected, and one count for all")};
    }
    count = accessor.count;
    return &accessor;
  };
  const GltfAccessor* const moves = accessor_of("TRANSLATION", 3);
  const GltfAccessor* const turns = accessor_of("ROTATION", 4);
  const GltfAccessor* const scales = accessor_of("SCALE", 3);
  if (count == 0) return {map};
  struct Placed {
    std::array<double, 3> move = {0, 0, 0}, scale = {1, 1, 1};
    std::array<double, 4> turn = {0, 0, 0, 1};
  };
  std::vector<Placed> placed(count);
  if (moves != nullptr)
    ForEachElement(
        *moves, [&](uint64_t i, const double* v) { std::copy(v, v + 3, placed[i].move.begin()); });
  if (turns != nullptr)
    ForEachElement(
        *turns, [&](uint64_t i, const double* v) { std::copy(v, v + 4, placed[i].turn.begin()); });
  if (scales != nullptr)
    ForEachElement(*scales, [&](uint64_t i, const double* v) {
      std::copy(v, v + 3, placed[i].scale.begin());
    });
  std::vector<NodeMatrix> maps;
  maps.reserve(count);
  for (const Placed& one : placed)
    maps.push_back(Compose(map, FromParts(one.move, one.turn, one.scale)));
  return maps;
}

std::vector<double> Scene::WeightsOf(int node, const GltfPose* pose) const {
  if (pose != nullptr) {
    const auto found = pose->weights.find(node);
    if (found != pose->weights.end()) return found->second;
  }
  const tinygltf::Node& own = gltf_.nodes[static_cast<size_t>(node)];
  return own.weights.empty() ? gltf_.meshes[static_cast<size_t>(own.mesh)].weights : own.weights;
}

// Returns for each vertex whether its own alpha leaves it visible; empty if all are.
std::vector<bool> Scene::SeenVertices(const tinygltf::Primitive& primitive, const Surface& surface,
                                      uint64_t vertices) const {
  const GltfAccessor* const own = Find(primitive.attributes, "COLOR_0");
  if (own == nullptr || own->components < 4 || !(surface.blended || surface.masked)) return {};
  std::vector<bool> seen(vertices, true);
  bool all = true;
  ForEachElement(Normalized(*own), [&](uint64_t i, const double* v) {
    if (i >= vertices || surface.IsSeenAt(surface.base[3] * v[3])) return;
    seen[i] = all = false;
  });
  return all ? std::vector<bool>() : seen;
}

// Drops the elements whose vertices are all invisible.
void DropTransparent(const std::vector<bool>& seen, Elements* elements) {
  const size_t each = elements->kind == Kind::kPoints     ? 1
                      : elements->kind == Kind::kSegments ? 2
                                                          : 3;
  std::vector<uint32_t>& all = elements->indices;
  size_t to = 0;
  for (size_t from = 0; from + each <= all.size(); from += each) {
    size_t corners = 0;
    for (size_t c = 0; c < each; ++c) corners += seen[all[from + c]] ? 1 : 0;
    if (corners == 0) {
      ++elements->transparent;
      continue;
    }
    elements->partly_transparent += corners < each ? 1 : 0;
    std::copy_n(all.begin() + static_cast<ptrdiff_t>(from), each,
                all.begin() + static_cast<ptrdiff_t>(to));
    to += each;
  }
  all.resize(to);
}

Elements Scene::ElementsOf(const tinygltf::Primitive& primitive, uint64_t vertices,
                           const std::vector<bool>& seen) const {
  std::vector<uint32_t> order;  // vertices in the order in which they are drawn
  if (primitive.indices >= 0) {
    const GltfAccessor& indices = document_->accessors[static_cast<size_t>(primitive.indices)];
    order.resize(indices.count);
    ForEachElement(Plain(indices),
                   [&](uint64_t i, const double* v) { order[i] = static_cast<uint32_t>(v[0]); });
  } else {
    order.resize(vertices);
    for (uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  }
  Elements elements;
  std::vector<uint32_t>& out = elements.indices;
  const size_t count = order.size();
  switch (primitive.mode) {
    case TINYGLTF_MODE_POINTS:
      elements.kind = Kind::kPoints;
      out = std::move(order);
      break;
    case TINYGLTF_MODE_LINE:
      elements.kind = Kind::kSegments;
      out = std::move(order);
      out.resize(count / 2 * 2);
      break;
    case TINYGLTF_MODE_LINE_LOOP:
    case TINYGLTF_MODE_LINE_STRIP:
      elements.kind = Kind::kSegments;
      for (size_t i = 1; i < count; ++i) out.insert(out.end(), {order[i - 1], order[i]});
      if (primitive.mode == TINYGLTF_MODE_LINE_LOOP && count > 2)
        out.insert(out.end(), {order.back(), order.front()});
      break;
    case TINYGLTF_MODE_TRIANGLE_STRIP:
      for (size_t i = 2; i < count; ++i)
        out.insert(out.end(), {order[i - 2], order[i - (i % 2 == 0 ? 1 : 0)],
                               order[i - (i % 2 == 0 ? 0 : 1)]});
      break;
    case TINYGLTF_MODE_TRIANGLE_FAN:
      for (size_t i = 2; i < count; ++i) out.insert(out.end(), {order[0], order[i - 1], order[i]});
      break;
    default:
      out = std::move(order);
      out.resize(count / 3 * 3);
  }
  if (!seen.empty()) DropTransparent(seen, &elements);
  // Vertices that nothing refers to are dropped, because they would affect the model's size.
  std::vector<uint32_t> kept(vertices, kNone);
  for (const uint32_t index : out) kept[index] = 0;
  uint32_t next = 0;
  for (uint32_t& one : kept) {
    if (one != kNone) one = next++;
  }
  elements.vertices = next;
  if (next < vertices) {
    for (uint32_t& index : out) index = kept[index];
    elements.kept = std::move(kept);
  }
  if (elements.kind == Kind::kPoints) out.clear();
  return elements;
}

uint32_t KeptOf(const Elements& elements, uint64_t vertex) {
  return elements.kept.empty() ? static_cast<uint32_t>(vertex) : elements.kept[vertex];
}

// Adds the attribute and its weighted morph targets.
void Scene::AddVectors(const tinygltf::Primitive& primitive, const char* name,
                       const std::vector<double>& weights, const Elements& elements,
                       std::vector<Point3>* out, Building* building) const {
  const GltfAccessor* const own = Find(primitive.attributes, name);
  if (own == nullptr) return;
  out->resize(elements.vertices);
  ForEachElement(*own, [&](uint64_t i, const double* v) {
    const uint32_t to = KeptOf(elements, i);
    if (to != kNone) (*out)[to] = PointOf(v);
  });
  for (size_t t = 0; t < std::min(weights.size(), primitive.targets.size()); ++t) {
    const GltfAccessor* const target = Find(primitive.targets[t], name);
    const double weight = weights[t];
    if (target == nullptr || weight == 0) continue;
    building->morph_work += target->count;
    if (building->morph_work > kMostMorphWork) {
      throw Failure{absl::StrCat("morphs ", building->morph_work, " vertices"),
                    absl::StrCat("at most ", kMostMorphWork, " are morphed")};
    }
    // A sparse element replaces an earlier value, so the values cannot be added immediately.
    std::vector<Point3> shape(target->sparse_count > 0 ? elements.vertices : 0);
    ForEachElement(*target, [&](uint64_t i, const double* v) {
      const uint32_t to = KeptOf(elements, i);
      if (to == kNone) return;
      Point3& p = shape.empty() ? (*out)[to] : shape[to];
      p = shape.empty() ? Point3{p.x + weight * v[0], p.y + weight * v[1], p.z + weight * v[2]}
                        : PointOf(v);
    });
    for (size_t i = 0; i < shape.size(); ++i) {
      Point3& p = (*out)[i];
      p = {p.x + weight * shape[i].x, p.y + weight * shape[i].y, p.z + weight * shape[i].z};
    }
  }
}

void Scene::AddColors(const tinygltf::Primitive& primitive, const Surface& surface,
                      const Elements& elements, Part* part) const {
  const auto color_of = [&surface](const double* factor) {
    std::array<uint8_t, 3> bytes;
    for (size_t c = 0; c < 3; ++c)
      bytes[c] = ColorByte(surface.base[c] * factor[c] + surface.emission[c], true);
    return Rgb{bytes[0], bytes[1], bytes[2]};
  };
  static constexpr std::array<double, 3> kWhite = {1, 1, 1};
  part->colors.assign(elements.vertices, color_of(kWhite.data()));
  const GltfAccessor* const own = Find(primitive.attributes, "COLOR_0");
  if (own == nullptr || own->components < 3) return;
  std::array<double, 3> last = kWhite;
  Rgb color = color_of(kWhite.data());
  ForEachElement(Normalized(*own), [&](uint64_t i, const double* v) {
    const uint32_t to = KeptOf(elements, i);
    if (to == kNone) return;
    if (v[0] != last[0] || v[1] != last[1] || v[2] != last[2]) {
      last = {v[0], v[1], v[2]};
      color = color_of(v);
    }
    part->colors[to] = color;
  });
}

// Returns: false if the primitive has no coordinates for the surface's picture.
bool Scene::AddCoordinates(const tinygltf::Primitive& primitive, const Surface& surface,
                           const Elements& elements, Part* part) const {
  const GltfAccessor* const own =
      Find(primitive.attributes, absl::StrCat("TEXCOORD_", surface.set).c_str());
  if (own == nullptr || own->components < 2) return false;
  part->texture_coordinates.resize(elements.vertices);
  const std::array<double, 6>& m = surface.transform;
  ForEachElement(*own, [&](uint64_t i, const double* v) {
    const uint32_t to = KeptOf(elements, i);
    if (to == kNone) return;
    part->texture_coordinates[to] = {static_cast<float>(m[0] * v[0] + m[1] * v[1] + m[2]),
                                     static_cast<float>(m[3] * v[0] + m[4] * v[1] + m[5])};
  });
  for (const auto& [u, v] : part->texture_coordinates) {
    if (!std::isfinite(u) || !std::isfinite(v)) {
      throw Failure{absl::StrCat("holds the texture coordinates (", u, ", ", v, ")"),
                    "they must be finite"};
    }
  }
  part->picture = surface.picture;
  return true;
}

// Returns for each vertex the sum of its joints' maps, weighted; empty if it has no joints.
std::vector<NodeMatrix> Scene::SkinOf(const tinygltf::Primitive& primitive, int skin,
                                      const Elements& elements, Building* building) const {
  if (skin < 0 || !primitive.attributes.contains("JOINTS_0")) return {};
  const std::vector<NodeMatrix>& joints = JointsOf(skin, building);
  if (joints.empty()) return {};
  std::vector<NodeMatrix> maps(elements.vertices, NodeMatrix{});
  std::vector<double> sums(elements.vertices);
  for (int set = 0;; ++set) {
    const GltfAccessor* const numbers =
        Find(primitive.attributes, absl::StrCat("JOINTS_", set).c_str());
    const GltfAccessor* const weights =
        Find(primitive.attributes, absl::StrCat("WEIGHTS_", set).c_str());
    if (numbers == nullptr || weights == nullptr) break;
    if (numbers->components != 4 || weights->components != 4) {
      throw Failure{absl::StrCat("JOINTS_", set, " or WEIGHTS_", set, " is not VEC4"),
                    "VEC4 is expected"};
    }
    std::vector<std::array<uint32_t, 4>> of(elements.vertices);
    ForEachElement(Plain(*numbers), [&](uint64_t i, const double* v) {
      const uint32_t to = KeptOf(elements, i);
      if (to == kNone) return;
      for (size_t c = 0; c < 4; ++c)
        of[to][c] = v[c] >= 0 && v[c] < 65536 ? static_cast<uint32_t>(v[c]) : kNone;
    });
    std::vector<std::array<float, 4>> by(elements.vertices);
    ForEachElement(Normalized(*weights), [&](uint64_t i, const double* v) {
      const uint32_t to = KeptOf(elements, i);
      if (to == kNone) return;
      for (size_t c = 0; c < 4; ++c) by[to][c] = static_cast<float>(v[c]);
    });
    for (size_t v = 0; v < maps.size(); ++v) {
      for (size_t c = 0; c < 4; ++c) {
        const double weight = by[v][c];
        if (!(weight > 0)) continue;
        if (of[v][c] >= joints.size()) {
          throw Failure{absl::StrCat("a vertex hangs on joint ", of[v][c]),
                        absl::StrCat("its skin has ", joints.size(), " joints, counted from 0")};
        }
        for (size_t i = 0; i < 12; ++i) maps[v][i] += weight * joints[of[v][c]][i];
        sums[v] += weight;
      }
    }
  }
  // Vertices without joints follow the first joint.
  for (size_t v = 0; v < maps.size(); ++v) {
    if (!(sums[v] > 0)) {
      maps[v] = joints[0];
      continue;
    }
    for (double& entry : maps[v]) entry /= sums[v];
  }
  return maps;
}

// Puts a copy of the part at each place.
void Place(std::span<const NodeMatrix> maps, Part* part) {
  const std::vector<Point3> own = maps.size() > 1 ? part->positions : std::vector<Point3>();
  const std::vector<Point3> own_normals = maps.size() > 1 ? part->normals : std::vector<Point3>();
  const size_t vertices = part->positions.size(), indices = part->indices.size();
  for (size_t m = 0; m < maps.size(); ++m) {
    if (m > 0) {
      part->positions.insert(part->positions.end(), own.begin(), own.end());
      part->normals.insert(part->normals.end(), own_normals.begin(), own_normals.end());
      const auto again = [vertices](auto* values) {
        for (size_t v = 0; v < vertices && !values->empty(); ++v) {
          const auto value = (*values)[v];
          values->push_back(value);
        }
      };
      again(&part->colors);
      again(&part->texture_coordinates);
      for (Attribute& one : part->attributes) again(&one.values);
      for (size_t i = 0; i < indices; ++i)
        part->indices.push_back(part->indices[i] + static_cast<uint32_t>(m * vertices));
    }
    const NodeMatrix normal_matrix = NormalMatrix(maps[m]);
    for (size_t v = m * vertices; v < (m + 1) * vertices; ++v) {
      part->positions[v] = MapPoint(maps[m], part->positions[v]);
      if (!part->normals.empty())
        part->normals[v] = Direction(MapPoint(normal_matrix, part->normals[v]));
    }
  }
  // A mirror reverses the winding.
  for (size_t m = 0; m < maps.size() && part->kind == Kind::kTriangles; ++m) {
    if (!IsMirror(maps[m])) continue;
    for (size_t i = m * indices; i < (m + 1) * indices; i += 3)
      std::swap(part->indices[i + 1], part->indices[i + 2]);
  }
}

void Scene::AddPrimitive(const tinygltf::Primitive& primitive, int node,
                         std::span<const NodeMatrix> maps, Building* building) {
  Model& model = building->model;
  const GltfAccessor* const positions = Find(primitive.attributes, "POSITION");
  if (positions == nullptr) return AddLeftOut("primitives without positions", 1, &model);
  const Surface& surface = SurfaceOf(primitive.material, building);
  if (!surface.visible) return AddLeftOut("fully transparent surfaces", 1, &model);
  if (positions->count > kMaxModelVertices) {
    throw Failure{absl::StrCat("has ", positions->count, " vertices in a mesh"),
                  absl::StrCat("at most ", kMaxModelVertices, " are read")};
  }
  building->visited += positions->count;
  if (building->visited > kMostVisited) {
    throw Failure{absl::StrCat("refers to ", building->visited, " vertices, again and again"),
                  absl::StrCat("at most ", kMostVisited, " are visited")};
  }
  const Elements elements =
      ElementsOf(primitive, positions->count, SeenVertices(primitive, surface, positions->count));
  if (elements.vertices == 0)
    return AddLeftOut("fully transparent surfaces", elements.transparent > 0 ? 1 : 0, &model);
  AddLeftOut("fully transparent elements of surfaces", elements.transparent, &model);
  if (surface.masked) {
    AddLeftOut("partly transparent elements of surfaces, drawn opaque", elements.partly_transparent,
               &model);
  }
  building->vertices += elements.vertices * maps.size();
  building->indices += elements.indices.size() * maps.size();
  if (building->vertices > kMaxModelVertices || building->indices > kMaxModelIndices) {
    throw Failure{absl::StrCat("has over ", kMaxModelVertices, " vertices or ", kMaxModelIndices,
                               " indices, its instances included"),
                  "so large a model is not read"};
  }

  Part part{.kind = elements.kind};
  const std::vector<double> weights = WeightsOf(node, building->pose);
  AddVectors(primitive, "POSITION", weights, elements, &part.positions, building);
  if (surface.lit) AddVectors(primitive, "NORMAL", weights, elements, &part.normals, building);
  AddColors(primitive, surface, elements, &part);
  if (surface.picture != kNoPicture) {
    if (part.kind != Kind::kTriangles) {
      AddLeftOut("textures of points and lines", 1, &model);
    } else if (!AddCoordinates(primitive, surface, elements, &part)) {
      AddLeftOut("textures without coordinates", 1, &model);
    }
  }
  for (const auto& [name, accessor] : primitive.attributes) {
    if (absl::StartsWith(name, "COLOR_") && name != "COLOR_0")
      AddLeftOut("further colours of vertices", 1, &model);
    if (!building->attributes || !absl::StartsWith(name, "_")) continue;
    const GltfAccessor& numbers = document_->accessors[static_cast<size_t>(accessor)];
    if (numbers.components != 1) {
      AddLeftOut("attributes of several numbers", 1, &model);
      continue;
    }
    Attribute attribute{.name = name, .values = {}};
    attribute.values.resize(elements.vertices);
    ForEachElement(numbers, [&](uint64_t i, const double* v) {
      const uint32_t to = KeptOf(elements, i);
      if (to != kNone) attribute.values[to] = v[0];
    });
    part.attributes.push_back(std::move(attribute));
  }
  for (const auto& target : primitive.targets) {
    for (const auto& [name, accessor] : target) {
      if (absl::StartsWith(name, "COLOR_") || absl::StartsWith(name, "TEXCOORD_"))
        AddLeftOut("morphs of colours or texture coordinates", 1, &model);
    }
  }
  part.indices = elements.indices;

  const int skin = gltf_.nodes[static_cast<size_t>(node)].skin;
  const std::vector<NodeMatrix> skinned = SkinOf(primitive, skin, elements, building);
  if (skinned.empty()) {
    Place(maps, &part);
  } else {
    for (size_t v = 0; v < skinned.size(); ++v) {
      part.positions[v] = MapPoint(skinned[v], part.positions[v]);
      if (!part.normals.empty())
        part.normals[v] = Direction(MapPoint(NormalMatrix(skinned[v]), part.normals[v]));
    }
  }
  if (part.kind == Kind::kTriangles) {
    AddLeftOut("triangles without an area", DropEmptyTriangles(&part), &model);
    if (part.indices.empty()) return;
    if (part.normals.empty() && surface.lit) AddNormals(0, &part);
  }
  if (part.picture != kNoPicture) {
    AddLeftOut("triangles across the edge of a picture that does not repeat",
               ApplyWrap(surface.wrap_u, surface.wrap_v, &part), &model);
  }
  model.parts.push_back(std::move(part));
}

void Scene::AddMesh(int number, Building* building) {
  const tinygltf::Node& node = gltf_.nodes[static_cast<size_t>(number)];
  const std::vector<NodeMatrix> maps =
      InstancesOf(node, building->globals[static_cast<size_t>(number)]);
  for (const tinygltf::Primitive& primitive :
       gltf_.meshes[static_cast<size_t>(node.mesh)].primitives)
    AddPrimitive(primitive, number, maps, building);
}

// Returns a line from each node of the scene to its parent.
Part Scene::Bones(const std::vector<NodeMatrix>& globals) const {
  Part part{.kind = Kind::kSegments};
  for (const int n : shown_) {
    const int parent = parents_[static_cast<size_t>(n)];
    if (parent < 0 || part.positions.size() + 2 > kMaxModelVertices) continue;
    for (const int end : {parent, n}) {
      const NodeMatrix& map = globals[static_cast<size_t>(end)];
      part.indices.push_back(static_cast<uint32_t>(part.positions.size()));
      part.positions.push_back({map[3], map[7], map[11]});
    }
  }
  return part;
}

// Nodes with a mesh that no scene holds, and meshes that no node has.
uint64_t Scene::CountOutside() const {
  if (gltf_.scenes.empty()) return 0;
  std::vector<bool> inside(gltf_.nodes.size());
  std::vector<int> stack;
  for (const tinygltf::Scene& scene : gltf_.scenes)
    stack.insert(stack.end(), scene.nodes.begin(), scene.nodes.end());
  while (!stack.empty()) {
    const auto n = static_cast<size_t>(stack.back());
    stack.pop_back();
    if (n >= inside.size() || inside[n]) continue;
    inside[n] = true;
    stack.insert(stack.end(), gltf_.nodes[n].children.begin(), gltf_.nodes[n].children.end());
  }
  std::vector<bool> used(gltf_.meshes.size());
  uint64_t outside = 0;
  for (size_t n = 0; n < inside.size(); ++n) {
    if (gltf_.nodes[n].mesh < 0) continue;
    used[static_cast<size_t>(gltf_.nodes[n].mesh)] = true;
    outside += inside[n] ? 0 : 1;
  }
  return outside + static_cast<uint64_t>(std::count(used.begin(), used.end(), false));
}

void Scene::CountLeftOut(Building* building) const {
  Model* const model = &building->model;
  if (gltf_.scenes.size() > 1) AddLeftOut("other scenes", gltf_.scenes.size() - 1, model);
  if (building->pose == nullptr) AddLeftOut("animations", gltf_.animations.size(), model);
  AddLeftOut("cameras", gltf_.cameras.size(), model);
  AddLeftOut("lights", gltf_.lights.size(), model);
  AddLeftOut("hidden nodes", hidden_, model);
  AddLeftOut("material variants", variants_, model);
  AddLeftOut("meshes outside the scenes", CountOutside(), model);
  for (const auto& [name, count] : extensions_) {
    AddLeftOut(absl::StrCat(EscapeForTerminal(name.substr(0, 60)), " extensions"), count, model);
  }
}

Model Scene::Build(const GltfPose* pose, bool attributes) {
  Building building{.pose = pose, .attributes = attributes};
  building.model.path = file_.path;
  building.model.format = file_.extension == "glb" ? "glTF binary" : "glTF";
  building.model.up = Up::kY;
  building.model.unit = 1;
  building.globals = GlobalsOf(pose);
  for (const int node : shown_) {
    if (gltf_.nodes[static_cast<size_t>(node)].mesh >= 0) AddMesh(node, &building);
  }
  if (gltf_.meshes.empty() && !(gltf_.skins.empty() && gltf_.animations.empty())) {
    Part bones = Bones(building.globals);
    bones.thickness = kBoneThickness * rest_length_;
    if (!bones.positions.empty() && std::isfinite(bones.thickness))
      building.model.parts.push_back(std::move(bones));
  }
  if (building.model.parts.empty()) {
    throw Failure{gltf_.meshes.empty() ? "holds no mesh" : "its scene shows no mesh",
                  "at least one is expected"};
  }
  CountLeftOut(&building);
  return std::move(building.model);
}

}  // namespace

absl::StatusOr<std::unique_ptr<GltfScene>> GltfScene::Load(const SourceFile& file) {
  auto scene = std::make_unique<Scene>(file);
  try {
    if (absl::Status status = scene->Open(); !status.ok()) return status;
  } catch (const Failure& failure) {
    return FileError(file, failure.found, failure.expected);
  } catch (const std::exception& error) {
    return FileError(file,
                     absl::StrCat("could not be read as glTF (",
                                  EscapeForTerminal(std::string(error.what()).substr(0, 300)), ")"),
                     "the file is damaged");
  }
  return scene;
}

absl::StatusOr<Model> ReadGltfModel(const SourceFile& file, bool attributes) {
  const absl::StatusOr<std::unique_ptr<GltfScene>> scene = GltfScene::Load(file);
  if (!scene.ok()) return scene.status();
  return (*scene)->ModelAt(nullptr, attributes);
}

}  // namespace voxeld::voxelctl
