#include "tools/import/gltf_check.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/json_text.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;

constexpr uint32_t kGlbHeader = 20;          // of the file and of its first chunk
constexpr uint32_t kChunkJson = 0x4e4f534a;  // "JSON"
constexpr uint64_t kMostStride = 252;        // the format's limit

// Thrown and caught within this file when a check fails deep inside a document.
struct Failure {
  std::string found, expected;
};

uint32_t ReadU32(absl::string_view bytes, size_t at) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// Returns a member that must be an unsigned integer, or `otherwise` if it is missing.
uint64_t Unsigned(const json& object, const char* key, absl::string_view where,
                  std::optional<uint64_t> otherwise) {
  const auto it = object.find(key);
  if (it == object.end()) {
    if (otherwise) return *otherwise;
    throw Failure{absl::StrCat(where, " has no ", key), "a whole number is expected"};
  }
  if (!it->is_number_unsigned() || it->get<uint64_t>() > uint64_t{1} << 40) {
    throw Failure{absl::StrCat(where, ".", key, " is ",
                               EscapeForTerminal(it->dump(-1, ' ', true).substr(0, 40))),
                  "a whole number from 0 is expected"};
  }
  return it->get<uint64_t>();
}

// Returns an array of objects, or an empty one if it is missing.
const json& Array(const json& document, const char* key) {
  static const json kEmpty = json::array();
  const auto it = document.find(key);
  if (it == document.end()) return kEmpty;
  if (!it->is_array()) throw Failure{absl::StrCat(key, " is no array"), "an array is expected"};
  for (const json& item : *it) {
    if (!item.is_object())
      throw Failure{absl::StrCat(key, " holds something else than objects"),
                    "objects are expected"};
  }
  return *it;
}

void CheckIndex(uint64_t index, size_t size, absl::string_view where) {
  if (index >= size) {
    throw Failure{absl::StrCat(where, " is ", index),
                  absl::StrCat("there are ", size, ", counted from 0")};
  }
}

// Returns the bytes of a buffer that is not the binary chunk.
std::string LoadBuffer(const SourceFile& file, const std::string& uri, absl::string_view where) {
  absl::StatusOr<std::string> bytes = LoadGltfUri(file, uri);
  if (bytes.ok()) return *std::move(bytes);
  if (absl::StartsWith(uri, "data:")) {
    throw Failure{absl::StrCat(where, ".uri is not base64"), "data in base64 is expected"};
  }
  throw Failure{absl::StrCat(where, " is in the file \"", EscapeForTerminal(PercentDecode(uri)),
                             "\", which cannot be read"),
                std::string(bytes.status().message())};
}

uint64_t ComponentSize(uint64_t type, absl::string_view where) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
  }
  throw Failure{absl::StrCat(where, ".componentType is ", type),
                "5120 to 5123, 5125 or 5126 is expected"};
}

bool IsUnsigned(uint64_t type) { return type == 5121 || type == 5123 || type == 5125; }

uint64_t ComponentCount(const json& accessor, absl::string_view where) {
  static constexpr std::pair<absl::string_view, uint64_t> kTypes[] = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  const auto it = accessor.find("type");
  if (it != accessor.end() && it->is_string()) {
    for (const auto& [name, count] : kTypes) {
      if (it->get_ref<const std::string&>() == name) return count;
    }
  }
  throw Failure{absl::StrCat(where, " has no known type"), "SCALAR, VEC2, … or MAT4 is expected"};
}

class Document {
 public:
  // `binary_chunk` must outlive it.
  Document(const SourceFile& file, GltfDocument& result, absl::string_view binary_chunk)
      : file_(file),
        result_(result),
        document_(result.json),
        binary_chunk_(binary_chunk),
        views_(result.views),
        accessors_(result.accessors) {}

  void Check();

 private:
  void LoadBuffers();
  void CheckViews();
  void CheckAccessors();
  void CheckSparse(const json& sparse, const std::string& where, GltfAccessor* accessor) const;
  void CheckPrimitive(const json& primitive, const std::string& where);
  absl::string_view ViewOf(const json& object, absl::string_view where) const;
  uint64_t GreatestIndex(size_t accessor);

  const SourceFile& file_;
  GltfDocument& result_;
  const json& document_;
  absl::string_view binary_chunk_;
  std::vector<absl::string_view> buffers_;
  uint64_t buffer_bytes_ = 0;
  std::vector<absl::string_view>& views_;
  std::vector<GltfAccessor>& accessors_;
  std::vector<std::optional<uint64_t>> greatest_;  // of the accessors that are used as indices
};

void Document::LoadBuffers() {
  const json& items = Array(document_, "buffers");
  for (size_t i = 0; i < items.size(); ++i) {
    const std::string where = absl::StrCat("buffers[", i, "]");
    const uint64_t length = Unsigned(items[i], "byteLength", where, std::nullopt);
    const auto uri = items[i].find("uri");
    absl::string_view bytes = i == 0 ? binary_chunk_ : absl::string_view();
    if (uri != items[i].end()) {
      if (!uri->is_string())
        throw Failure{absl::StrCat(where, ".uri is no string"), "a string is expected"};
      result_.loaded.push_back(LoadBuffer(file_, uri->get_ref<const std::string&>(), where));
      bytes = result_.loaded.back();
    }
    if (bytes.size() < length) {
      throw Failure{absl::StrCat(where, " has ", bytes.size(), " bytes"),
                    absl::StrCat(length, " are announced: the file is truncated or damaged")};
    }
    buffers_.push_back(bytes.substr(0, length));
    buffer_bytes_ += length;
  }
}

void Document::CheckViews() {
  const json& items = Array(document_, "bufferViews");
  for (size_t i = 0; i < items.size(); ++i) {
    const std::string where = absl::StrCat("bufferViews[", i, "]");
    const uint64_t buffer = Unsigned(items[i], "buffer", where, std::nullopt);
    CheckIndex(buffer, buffers_.size(), absl::StrCat(where, ".buffer"));
    const uint64_t offset = Unsigned(items[i], "byteOffset", where, 0);
    const uint64_t length = Unsigned(items[i], "byteLength", where, std::nullopt);
    if (offset + length > buffers_[buffer].size()) {
      throw Failure{absl::StrCat(where, " ends at byte ", offset + length),
                    absl::StrCat("buffers[", buffer, "] has ", buffers_[buffer].size())};
    }
    views_.push_back(buffers_[buffer].substr(offset, length));
  }
}

// Returns the bytes of the view that a member "bufferView" names, starting at "byteOffset".
absl::string_view Document::ViewOf(const json& object, absl::string_view where) const {
  const uint64_t view = Unsigned(object, "bufferView", where, std::nullopt);
  CheckIndex(view, views_.size(), absl::StrCat(where, ".bufferView"));
  const uint64_t offset = Unsigned(object, "byteOffset", where, 0);
  if (offset > views_[view].size()) {
    throw Failure{absl::StrCat(where, ".byteOffset is ", offset),
                  absl::StrCat("bufferViews[", view, "] has ", views_[view].size(), " bytes")};
  }
  return views_[view].substr(offset);
}

void Document::CheckSparse(const json& sparse, const std::string& where,
                           GltfAccessor* accessor) const {
  const auto indices = sparse.find("indices"), values = sparse.find("values");
  if (!sparse.is_object() || indices == sparse.end() || !indices->is_object() ||
      values == sparse.end() || !values->is_object()) {
    throw Failure{absl::StrCat(where, " has no indices or no values"), "objects are expected"};
  }
  const uint64_t count = Unsigned(sparse, "count", where, std::nullopt);
  const uint64_t type = Unsigned(*indices, "componentType", where + ".indices", std::nullopt);
  const uint64_t size = ComponentSize(type, where + ".indices");
  const absl::string_view at = ViewOf(*indices, where + ".indices");
  const absl::string_view with = ViewOf(*values, where + ".values");
  const uint64_t element = accessor->component_size * accessor->components;
  if (!IsUnsigned(type)) {
    throw Failure{absl::StrCat(where, ".indices.componentType is ", type),
                  "5121, 5123 or 5125 is expected"};
  }
  if (count > accessor->count || count * size > at.size() || count * element > with.size()) {
    throw Failure{absl::StrCat(where, ".count is ", count),
                  absl::StrCat("the accessor has ", accessor->count, " elements, and there are ",
                               at.size(), " bytes of indices and ", with.size(), " of values")};
  }
  for (uint64_t i = 0; i < count; ++i) {
    uint32_t index = 0;
    std::memcpy(&index, at.data() + i * size, size);
    CheckIndex(index, accessor->count, absl::StrCat(where, ".indices, number ", i, ","));
  }
  accessor->sparse_count = count;
  accessor->sparse_index_size = size;
  accessor->sparse_indices = at;
  accessor->sparse_values = with;
}

void Document::CheckAccessors() {
  const json& views = Array(document_, "bufferViews");
  const json& items = Array(document_, "accessors");
  uint64_t total = 0;
  for (size_t i = 0; i < items.size(); ++i) {
    const json& item = items[i];
    const std::string where = absl::StrCat("accessors[", i, "]");
    GltfAccessor accessor;
    accessor.count = Unsigned(item, "count", where, std::nullopt);
    const uint64_t type = Unsigned(item, "componentType", where, std::nullopt);
    accessor.component_size = ComponentSize(type, where);
    accessor.component_type = static_cast<int>(type);
    accessor.components = ComponentCount(item, where);
    const auto normalized = item.find("normalized");
    accessor.normalized =
        normalized != item.end() && normalized->is_boolean() && normalized->get<bool>();
    const uint64_t element = accessor.component_size * accessor.components;
    accessor.stride = element;
    total += accessor.count;
    if (total > kMaxModelIndices) {
      throw Failure{absl::StrCat(where, ".count is ", accessor.count),
                    "so much data in all is not read"};
    }
    if (accessor.count == 0)
      throw Failure{absl::StrCat(where, ".count is 0"), "at least 1 is expected"};
    if (item.contains("bufferView")) {
      const uint64_t view = Unsigned(item, "bufferView", where, std::nullopt);
      CheckIndex(view, views_.size(), absl::StrCat(where, ".bufferView"));
      const uint64_t stride =
          Unsigned(views[view], "byteStride", absl::StrCat("bufferViews[", view, "]"), 0);
      if (stride != 0) accessor.stride = stride;
      const uint64_t offset = Unsigned(item, "byteOffset", where, 0);
      if (accessor.stride > kMostStride ||
          offset + accessor.stride * (accessor.count - 1) + element > views_[view].size()) {
        throw Failure{absl::StrCat(where, " announces ", accessor.count,
                                   accessor.count == 1 ? " element of " : " elements of ",
                                   accessor.stride, " bytes from byte ", offset),
                      absl::StrCat("bufferViews[", view, "] has ", views_[view].size(), " bytes")};
      }
      accessor.bytes = views_[view].substr(offset);
    }
    // An accessor without a view consists of zeros, which take memory that is not in the file. A
    // mesh's morph target has as many elements as its positions, which are in a buffer.
    if (accessor.bytes.empty() && accessor.count > buffer_bytes_) {
      throw Failure{absl::StrCat(where, " announces ", accessor.count, " elements without a view"),
                    absl::StrCat("the buffers have ", buffer_bytes_, " bytes")};
    }
    if (item.contains("sparse")) CheckSparse(item["sparse"], where + ".sparse", &accessor);
    accessors_.push_back(accessor);
  }
  greatest_.resize(accessors_.size());
}

uint64_t Document::GreatestIndex(size_t accessor) {
  if (greatest_[accessor]) return *greatest_[accessor];
  const GltfAccessor& indices = accessors_[accessor];
  uint32_t greatest = 0;
  const auto take = [&](const char* at) {
    uint32_t index = 0;
    std::memcpy(&index, at, indices.component_size);
    greatest = std::max(greatest, index);
  };
  for (uint64_t i = 0; i < indices.count && !indices.bytes.empty(); ++i)
    take(indices.bytes.data() + i * indices.stride);
  for (uint64_t i = 0; i < indices.sparse_count; ++i)
    take(indices.sparse_values.data() + i * indices.component_size);
  greatest_[accessor] = greatest;
  return greatest;
}

void Document::CheckPrimitive(const json& primitive, const std::string& where) {
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object()) {
    throw Failure{absl::StrCat(where, " has no attributes"), "an object is expected"};
  }
  const auto accessor_of = [&](const json& object, const std::string& name,
                               const std::string& in) -> uint64_t {
    const uint64_t accessor = Unsigned(object, name.c_str(), in, std::nullopt);
    CheckIndex(accessor, accessors_.size(), absl::StrCat(in, ".", EscapeForTerminal(name)));
    return accessor;
  };
  const bool has_positions = attributes->contains("POSITION");
  const uint64_t vertices =
      has_positions
          ? accessors_[accessor_of(*attributes, "POSITION", absl::StrCat(where, ".attributes"))]
                .count
          : 0;
  const auto check = [&](const json& object, const std::string& in) {
    for (const auto& [name, value] : object.items()) {
      const uint64_t count = accessors_[accessor_of(object, name, in)].count;
      if (has_positions && count != vertices) {
        throw Failure{absl::StrCat(in, ".", EscapeForTerminal(name), " has ", count, " elements"),
                      absl::StrCat("there are ", vertices, " positions")};
      }
    }
  };
  check(*attributes, absl::StrCat(where, ".attributes"));
  const json& targets = Array(primitive, "targets");
  for (size_t t = 0; t < targets.size(); ++t)
    check(targets[t], absl::StrCat(where, ".targets[", t, "]"));
  if (!primitive.contains("indices")) return;
  const uint64_t indices = accessor_of(primitive, "indices", where);
  if (accessors_[indices].components != 1 ||
      !IsUnsigned(static_cast<uint64_t>(accessors_[indices].component_type))) {
    throw Failure{absl::StrCat(where, ".indices are not whole numbers"),
                  "SCALAR of 5121, 5123 or 5125 is expected"};
  }
  const uint64_t greatest = GreatestIndex(indices);
  if (has_positions && greatest >= vertices) {
    throw Failure{absl::StrCat(where, ": an index refers to vertex ", greatest),
                  absl::StrCat("there are ", vertices, " vertices, counted from 0")};
  }
}

enum class Shape { kNumber, kIndex, kNumbers, kObject };

bool HasShape(const json& value, Shape shape) {
  switch (shape) {
    case Shape::kNumber:
      return value.is_number();
    case Shape::kIndex:
      return value.is_number_unsigned();
    case Shape::kObject:
      return value.is_object();
    case Shape::kNumbers:
      return value.is_array() && std::all_of(value.begin(), value.end(),
                                             [](const json& number) { return number.is_number(); });
  }
  return false;
}

struct Member {
  const char* name;
  Shape shape;
};

// The library ignores members of a wrong type.
void CheckMembers(const json& object, std::initializer_list<Member> members,
                  const std::string& where) {
  static constexpr const char* kExpected[] = {"a number", "a whole number from 0", "numbers",
                                              "an object"};
  for (const Member& member : members) {
    const auto it = object.find(member.name);
    if (it == object.end() || HasShape(*it, member.shape)) continue;
    throw Failure{absl::StrCat(where, ".", member.name, " is ",
                               EscapeForTerminal(it->dump(-1, ' ', true).substr(0, 40))),
                  absl::StrCat(kExpected[static_cast<size_t>(member.shape)], " is expected")};
  }
}

void CheckShapes(const json& document) {
  const auto check = [&](const char* section, std::initializer_list<Member> members) {
    const json& items = Array(document, section);
    for (size_t i = 0; i < items.size(); ++i)
      CheckMembers(items[i], members, absl::StrCat(section, "[", i, "]"));
  };
  check("scenes", {{"nodes", Shape::kNumbers}});
  check("nodes", {{"mesh", Shape::kIndex},
                  {"skin", Shape::kIndex},
                  {"matrix", Shape::kNumbers},
                  {"translation", Shape::kNumbers},
                  {"rotation", Shape::kNumbers},
                  {"scale", Shape::kNumbers},
                  {"weights", Shape::kNumbers}});
  check("meshes", {{"weights", Shape::kNumbers}});
  check("skins", {{"joints", Shape::kNumbers}, {"inverseBindMatrices", Shape::kIndex}});
  check("textures", {{"source", Shape::kIndex}, {"sampler", Shape::kIndex}});
  check("samplers", {{"wrapS", Shape::kIndex}, {"wrapT", Shape::kIndex}});
  check("materials", {{"pbrMetallicRoughness", Shape::kObject},
                      {"emissiveFactor", Shape::kNumbers},
                      {"emissiveTexture", Shape::kObject},
                      {"alphaCutoff", Shape::kNumber}});
  CheckMembers(document, {{"scene", Shape::kIndex}}, "glTF");
  const json& materials = Array(document, "materials");
  for (size_t i = 0; i < materials.size(); ++i) {
    const auto metal = materials[i].find("pbrMetallicRoughness");
    if (metal == materials[i].end()) continue;
    const std::string where = absl::StrCat("materials[", i, "].pbrMetallicRoughness");
    CheckMembers(*metal,
                 {{"baseColorFactor", Shape::kNumbers}, {"baseColorTexture", Shape::kObject}},
                 where);
    const auto texture = metal->find("baseColorTexture");
    if (texture == metal->end()) continue;
    CheckMembers(*texture, {{"index", Shape::kIndex}, {"texCoord", Shape::kIndex}},
                 where + ".baseColorTexture");
  }
}

// Checks that every node has at most one parent and none is its own ancestor, so a walk visits each
// node once.
void CheckNodes(const json& document) {
  const json& nodes = Array(document, "nodes");
  std::vector<int64_t> parents(nodes.size(), -1);
  for (size_t n = 0; n < nodes.size(); ++n) {
    const std::string where = absl::StrCat("nodes[", n, "].children");
    const auto children = nodes[n].find("children");
    if (children == nodes[n].end()) continue;
    if (!children->is_array())
      throw Failure{absl::StrCat(where, " is no array"), "an array is expected"};
    for (const json& child : *children) {
      if (!child.is_number_unsigned())
        throw Failure{absl::StrCat(where, " holds no number"), "node numbers are expected"};
      CheckIndex(child.get<uint64_t>(), nodes.size(), where);
      int64_t& parent = parents[child.get<uint64_t>()];
      if (parent >= 0) {
        throw Failure{absl::StrCat("node ", child.get<uint64_t>(), " has two parents"),
                      "a node has one parent at most"};
      }
      parent = static_cast<int64_t>(n);
    }
  }
  for (size_t n = 0; n < nodes.size(); ++n) {
    size_t depth = 0;
    for (int64_t at = static_cast<int64_t>(n); at >= 0; at = parents[static_cast<size_t>(at)]) {
      if (++depth > 256) {
        throw Failure{absl::StrCat("node ", n, " lies in a cycle of nodes, or over 256 deep"),
                      "nodes form a tree"};
      }
    }
  }
}

void CheckExtensions(const json& document) {
  // Without these extensions, such as a clear coat, a surface still has its place and colour; they
  // are counted as left out.
  static constexpr absl::string_view kReadable[] = {"KHR_materials_unlit",
                                                    "KHR_materials_pbrSpecularGlossiness",
                                                    "KHR_materials_emissive_strength",
                                                    "KHR_texture_transform",
                                                    "KHR_mesh_quantization",
                                                    "EXT_mesh_gpu_instancing",
                                                    "KHR_node_visibility",
                                                    "KHR_lights_punctual",
                                                    "KHR_animation_pointer",
                                                    "KHR_materials_variants",
                                                    "KHR_materials_clearcoat",
                                                    "KHR_materials_sheen",
                                                    "KHR_materials_transmission",
                                                    "KHR_materials_volume",
                                                    "KHR_materials_ior",
                                                    "KHR_materials_specular",
                                                    "KHR_materials_iridescence",
                                                    "KHR_materials_anisotropy",
                                                    "KHR_materials_dispersion"};
  const auto required = document.find("extensionsRequired");
  if (required == document.end() || !required->is_array()) return;
  for (const json& name : *required) {
    if (!name.is_string()) continue;
    const std::string& text = name.get_ref<const std::string&>();
    bool readable = false;
    for (const absl::string_view known : kReadable) readable |= known == text;
    if (!readable) {
      throw Failure{absl::StrCat("requires the extension ", EscapeForTerminal(text)),
                    "it cannot be read; export the model without it"};
    }
  }
}

void Document::Check() {
  const auto asset = document_.find("asset");
  if (!document_.is_object() || asset == document_.end() || !asset->is_object()) {
    throw Failure{"is JSON without \"asset\"", "a glTF document has one"};
  }
  const auto version = asset->find("version");
  if (version == asset->end() || !version->is_string() ||
      !absl::StartsWith(version->get_ref<const std::string&>(), "2.")) {
    throw Failure{absl::StrCat("is glTF of version ",
                               version == asset->end()
                                   ? "1"
                                   : EscapeForTerminal(version->dump(-1, ' ', true).substr(0, 40))),
                  "2.0 is read; convert it"};
  }
  CheckExtensions(document_);
  LoadBuffers();
  CheckViews();
  CheckAccessors();
  const json& meshes = Array(document_, "meshes");
  for (size_t m = 0; m < meshes.size(); ++m) {
    const json& primitives = Array(meshes[m], "primitives");
    for (size_t p = 0; p < primitives.size(); ++p) {
      const std::string where = absl::StrCat("meshes[", m, "].primitives[", p, "]");
      CheckPrimitive(primitives[p], where);
      CheckMembers(primitives[p], {{"material", Shape::kIndex}, {"mode", Shape::kIndex}}, where);
    }
  }
  CheckNodes(document_);
  CheckShapes(document_);
}

}  // namespace

absl::StatusOr<std::string> LoadGltfUri(const SourceFile& file, const std::string& uri) {
  if (absl::StartsWith(uri, "data:")) {
    const absl::string_view data =
        absl::string_view(uri).substr(std::min(uri.find(','), uri.size() - 1) + 1);
    std::string bytes;
    if (!absl::Base64Unescape(data, &bytes))
      return absl::InvalidArgumentError("data in base64 is expected");
    return bytes;
  }
  absl::StatusOr<SourceFile> part = ReadOtherFile(file, PercentDecode(uri));
  if (!part.ok()) return part.status();
  return std::move(part->bytes);
}

absl::StatusOr<std::unique_ptr<GltfDocument>> LoadGltfDocument(const SourceFile& file) {
  absl::string_view text = file.bytes;
  absl::string_view binary_chunk;
  if (file.extension == "glb") {
    const bool is_glb = absl::StartsWith(text, "glTF");
    if (is_glb && text.size() < kGlbHeader) {
      return FileError(file, absl::StrCat("ends early: it has ", text.size(), " bytes"),
                       absl::StrCat("a GLB's headers alone have ", kGlbHeader));
    }
    if (!is_glb) {
      return FileError(file, absl::StrCat("is ", DescribeContents(text)),
                       "a GLB begins with \"glTF\"");
    }
    const uint32_t version = ReadU32(text, 4), length = ReadU32(text, 8), chunk = ReadU32(text, 12);
    if (version != 2)
      return FileError(file, absl::StrCat("is GLB of version ", version), "2 is read; convert it");
    if (length > text.size()) {
      return FileError(file, absl::StrCat("ends early: it has ", text.size(), " bytes"),
                       absl::StrCat("its header announces ", length));
    }
    if (length < kGlbHeader || chunk > length - kGlbHeader || ReadU32(text, 16) != kChunkJson) {
      return FileError(file, absl::StrCat("its first chunk announces ", chunk, " bytes"),
                       absl::StrCat("JSON is expected, within the ", length, " bytes of the file"));
    }
    const absl::string_view rest = text.substr(0, length).substr(kGlbHeader + chunk);
    if (rest.size() >= 8) {
      const uint32_t size = ReadU32(rest, 0);
      if (size > rest.size() - 8) {
        return FileError(file, absl::StrCat("its binary chunk announces ", size, " bytes"),
                         absl::StrCat(rest.size() - 8, " are there: the file is damaged"));
      }
      binary_chunk = rest.substr(8, size);
    }
    text = text.substr(kGlbHeader, chunk);
  } else if (absl::StartsWith(text, "glTF")) {
    return FileError(file, "is glTF binary", "name it .glb");
  }
  if (absl::StartsWith(text, "\xef\xbb\xbf")) {
    return FileError(file, "begins with a byte order mark",
                     "glTF forbids it; save the JSON as UTF-8 without one");
  }
  absl::StatusOr<json> document = ParseJson(file, text);
  if (!document.ok()) return document.status();
  auto result = std::make_unique<GltfDocument>();
  result->json = *std::move(document);
  try {
    Document(file, *result, binary_chunk).Check();
    result->json.erase("buffers");  // base64 data takes memory
  } catch (const Failure& failure) {
    return FileError(file, failure.found, failure.expected);
  } catch (const json::exception& error) {
    return FileError(
        file, absl::StrCat("is not laid out as glTF (", EscapeForTerminal(error.what()), ")"),
        "a glTF document is expected");
  }
  return result;
}

}  // namespace voxeld::voxelctl
