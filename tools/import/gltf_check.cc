#include <cstdint>
#include <cstring>
#include <deque>
#include <filesystem>
#include <optional>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/json_text.h"
#include "tools/import/mesh_checks.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;

constexpr uint32_t kGlbHeader = 20;          // of the file and of its first chunk
constexpr uint32_t kChunkJson = 0x4e4f534a;  // "JSON"

// Thrown and caught within this file: a check that fails deep in a document.
struct Failure {
  std::string found, expected;
};

uint32_t ReadU32(absl::string_view bytes, size_t at) {
  uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// A member that must be an unsigned integer, or `otherwise` if it is not there.
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

// An array of objects, or an empty one if it is not there.
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

// "a%20b" as "a b"; a % that is not followed by two digits stays.
std::string PercentDecode(absl::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && absl::ascii_isxdigit(text[i + 1]) &&
        absl::ascii_isxdigit(text[i + 2])) {
      out += absl::HexStringToBytes(text.substr(i + 1, 2));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

// The bytes of a buffer that is not the binary chunk.
std::string LoadBuffer(const SourceFile& file, const std::string& uri, absl::string_view where) {
  if (absl::StartsWith(uri, "data:")) {
    const absl::string_view data =
        absl::string_view(uri).substr(std::min(uri.find(','), uri.size() - 1) + 1);
    std::string bytes;
    if (!absl::Base64Unescape(data, &bytes))
      throw Failure{absl::StrCat(where, ".uri is not base64"), "data in base64 is expected"};
    return bytes;
  }
  const std::string name = PercentDecode(uri);
  absl::StatusOr<SourceFile> part = ReadOtherFile(file, name);
  if (!part.ok()) {
    throw Failure{absl::StrCat(where, " is in the file \"", EscapeForTerminal(name),
                               "\", which cannot be read"),
                  std::string(part.status().message())};
  }
  return std::move(part->bytes);
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
  Document(const SourceFile& file, const json& document, absl::string_view binary_chunk)
      : file_(file), document_(document), binary_chunk_(binary_chunk) {}

  void Check();

 private:
  struct Accessor {
    uint64_t count = 0, component = 0, stride = 0;
    absl::string_view bytes;  // empty where it has no view
    bool sparse = false;
  };

  void LoadBuffers();
  void CheckViews();
  void CheckAccessors();
  void CheckPrimitive(const json& primitive, const std::string& where) const;
  void CheckIndices(const Accessor& indices, uint64_t vertices, absl::string_view where) const;

  const SourceFile& file_;
  const json& document_;
  absl::string_view binary_chunk_;
  std::deque<std::string> loaded_;
  std::vector<absl::string_view> buffers_, views_;
  std::vector<Accessor> accessors_;
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
      loaded_.push_back(LoadBuffer(file_, uri->get_ref<const std::string&>(), where));
      bytes = loaded_.back();
    }
    if (bytes.size() < length) {
      throw Failure{absl::StrCat(where, " has ", bytes.size(), " bytes"),
                    absl::StrCat(length, " are announced: the file is truncated or damaged")};
    }
    buffers_.push_back(bytes.substr(0, length));
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

void Document::CheckAccessors() {
  const json& views = Array(document_, "bufferViews");
  const json& items = Array(document_, "accessors");
  uint64_t total = 0;
  for (size_t i = 0; i < items.size(); ++i) {
    const json& item = items[i];
    const std::string where = absl::StrCat("accessors[", i, "]");
    Accessor accessor;
    accessor.count = Unsigned(item, "count", where, std::nullopt);
    accessor.component = ComponentSize(Unsigned(item, "componentType", where, std::nullopt), where);
    const uint64_t element = accessor.component * ComponentCount(item, where);
    accessor.stride = element;
    accessor.sparse = item.contains("sparse");
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
      if (accessor.stride > uint64_t{1} << 16 ||
          offset + accessor.stride * (accessor.count - 1) + element > views_[view].size()) {
        throw Failure{absl::StrCat(where, " announces ", accessor.count,
                                   accessor.count == 1 ? " element of " : " elements of ",
                                   accessor.stride, " bytes from byte ", offset),
                      absl::StrCat("bufferViews[", view, "] has ", views_[view].size(), " bytes")};
      }
      accessor.bytes = views_[view].substr(offset);
    }
    accessors_.push_back(accessor);
  }
}

void Document::CheckIndices(const Accessor& indices, uint64_t vertices,
                            absl::string_view where) const {
  if (indices.bytes.empty() || indices.sparse) return;
  for (uint64_t i = 0; i < indices.count; ++i) {
    uint32_t index = 0;
    std::memcpy(&index, indices.bytes.data() + i * indices.stride, indices.component);
    if (index >= vertices) {
      throw Failure{absl::StrCat(where, ": index ", i, " refers to vertex ", index),
                    absl::StrCat("there are ", vertices, " vertices, counted from 0")};
    }
  }
}

void Document::CheckPrimitive(const json& primitive, const std::string& where) const {
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object()) {
    throw Failure{absl::StrCat(where, " has no attributes"), "an object is expected"};
  }
  uint64_t vertices = 0;
  for (const auto& [name, value] : attributes->items()) {
    const uint64_t accessor =
        Unsigned(*attributes, name.c_str(), absl::StrCat(where, ".attributes"), std::nullopt);
    CheckIndex(accessor, accessors_.size(),
               absl::StrCat(where, ".attributes.", EscapeForTerminal(name)));
    if (name == "POSITION") vertices = accessors_[accessor].count;
  }
  if (!primitive.contains("indices")) return;
  const uint64_t indices = Unsigned(primitive, "indices", where, std::nullopt);
  CheckIndex(indices, accessors_.size(), absl::StrCat(where, ".indices"));
  CheckIndices(accessors_[indices], vertices, where);
}

// Every node has at most one parent, and none is its own ancestor: then a walk visits each once.
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
  static constexpr absl::string_view kReadable[] = {
      "KHR_materials_unlit",   "KHR_materials_pbrSpecularGlossiness",
      "KHR_texture_transform", "KHR_materials_clearcoat",
      "KHR_materials_sheen",   "KHR_materials_transmission",
      "KHR_lights_punctual",   "KHR_materials_common",
      "KHR_binary_glTF",       "KHR_techniques_webgl"};
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
      CheckPrimitive(primitives[p], absl::StrCat("meshes[", m, "].primitives[", p, "]"));
    }
  }
  CheckNodes(document_);
}

}  // namespace

absl::Status CheckGltf(const SourceFile& file) {
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
  const absl::StatusOr<json> document = ParseJson(file, text);
  if (!document.ok()) return document.status();
  try {
    Document(file, *document, binary_chunk).Check();
  } catch (const Failure& failure) {
    return FileError(file, failure.found, failure.expected);
  } catch (const json::exception& error) {
    return FileError(
        file, absl::StrCat("is not laid out as glTF (", EscapeForTerminal(error.what()), ")"),
        "a glTF document is expected");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
