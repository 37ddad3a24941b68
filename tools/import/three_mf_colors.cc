#include "tools/import/three_mf_colors.h"

#include <libxml/xmlreader.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "tools/import/inflate.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint32_t kNoNumber = UINT32_MAX;

constexpr uint64_t kMostEntryBytes = uint64_t{512} << 20;

// The entries of a ZIP archive, by its central directory. assimp has a reader for archives but does
// not export it.
class Archive {
 public:
  explicit Archive(const SourceFile& file) : file_(file) {
    const absl::string_view bytes = file.bytes;
    const size_t end = bytes.rfind("PK\x05\x06");
    if (end == absl::string_view::npos || bytes.size() - end < 22) return;
    size_t at = Get<uint32_t>(end + 16);
    for (uint32_t left = Get<uint16_t>(end + 10);
         left > 0 && at <= bytes.size() && absl::StartsWith(bytes.substr(at), "PK\x01\x02") &&
         bytes.size() - at >= 46;
         --left) {
      const size_t name = Get<uint16_t>(at + 28);
      entries_[std::string(bytes.substr(at + 46, name))] = at;
      at += 46 + name + Get<uint16_t>(at + 30) + Get<uint16_t>(at + 32);
    }
  }

  const std::map<std::string, size_t>& entries() const { return entries_; }

  // Returns an empty string if the entry is missing or damaged.
  std::string Read(const std::string& name) const {
    const auto entry = entries_.find(name);
    if (entry == entries_.end()) return {};
    const absl::string_view bytes = file_.bytes;
    const size_t at = entry->second, local = Get<uint32_t>(at + 42);
    if (local > bytes.size() || bytes.size() - local < 30) return {};
    const size_t begin = local + 30 + Get<uint16_t>(local + 26) + Get<uint16_t>(local + 28);
    if (begin > bytes.size()) return {};
    const absl::string_view packed = bytes.substr(begin, Get<uint32_t>(at + 20));
    const uint16_t method = Get<uint16_t>(at + 10);
    if (method == 0) return std::string(packed);
    if (method != 8) return {};
    const uint64_t size = std::min<uint64_t>(Get<uint32_t>(at + 24), kMostEntryBytes);
    absl::StatusOr<std::string> unpacked = Inflate(file_, packed, size, Deflated::kRaw);
    return unpacked.ok() ? *std::move(unpacked) : std::string();
  }

 private:
  template <typename T>
  T Get(size_t at) const {
    T value;
    std::memcpy(&value, file_.bytes.data() + at, sizeof(T));
    return value;
  }

  const SourceFile& file_;
  std::map<std::string, size_t> entries_;  // offset in the directory
};

// Attributes of a reader's current element.
class Attributes {
 public:
  explicit Attributes(xmlTextReader* reader) : reader_(reader) {}

  std::string Text(const char* name) const {
    xmlChar* const value =
        xmlTextReaderGetAttribute(reader_, reinterpret_cast<const xmlChar*>(name));
    if (value == nullptr) return {};
    std::string text(reinterpret_cast<const char*>(value));
    xmlFree(value);
    return text;
  }
  // Returns kNoNumber if it is missing or not a number.
  uint32_t Number(const char* name) const {
    uint32_t number = 0;
    return absl::SimpleAtoi(Text(name), &number) ? number : kNoNumber;
  }
  float Real(const char* name) const {
    float number = 0;
    return absl::SimpleAtof(Text(name), &number) && std::isfinite(number) ? number : 0;
  }

 private:
  xmlTextReader* const reader_;
};

// Parses "#RRGGBB" or "#RRGGBBAA"; returns white for anything else.
Rgb ColorOf(absl::string_view text, bool* transparent) {
  uint32_t value = 0;
  if (!absl::ConsumePrefix(&text, "#") || (text.size() != 6 && text.size() != 8) ||
      !absl::SimpleHexAtoi(text, &value))
    return {255, 255, 255};
  if (text.size() == 8) {
    *transparent |= (value & 0xff) != 0xff;
    value >>= 8;
  }
  return {static_cast<uint8_t>(value >> 16), static_cast<uint8_t>(value >> 8),
          static_cast<uint8_t>(value)};
}

// Parses numbers separated by blanks; kNoNumber replaces invalid ones.
std::vector<uint32_t> Numbers(absl::string_view text) {
  std::vector<uint32_t> numbers;
  for (const absl::string_view word :
       absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty())) {
    uint32_t number = 0;
    numbers.push_back(absl::SimpleAtoi(word, &number) ? number : kNoNumber);
  }
  return numbers;
}

// Returns a unit of length in metres.
double UnitOf(absl::string_view name) {
  return name == "micron"       ? 1e-6
         : name == "centimeter" ? 0.01
         : name == "inch"       ? 0.0254
         : name == "foot"       ? 0.3048
         : name == "meter"      ? 1
                                : 0.001;
}

Wrap WrapOfStyle(absl::string_view style) {
  return style == "mirror"                     ? Wrap::kMirror
         : style == "clamp" || style == "none" ? Wrap::kClamp
                                               : Wrap::kRepeat;
}

}  // namespace

ThreeMfColors::ThreeMfColors(const SourceFile& file, Model* model) {
  const Archive archive(file);
  // The model that the relations name, or the only one.
  std::string root;
  const std::string relations = archive.Read("_rels/.rels");
  for (const auto& [name, at] : archive.entries()) {
    if (!absl::EndsWithIgnoreCase(name, ".model")) continue;
    if (root.empty() || absl::StrContains(relations, name)) root = name;
  }
  ReadModel(
      archive.Read(root),
      [&archive](const std::string& path) {
        return archive.Read(std::string(absl::StripPrefix(path, "/")));
      },
      model);
}

void ThreeMfColors::ReadModel(const std::string& text,
                              const std::function<std::string(const std::string&)>& read_entry,
                              Model* model) {
  const std::unique_ptr<xmlTextReader, decltype(&xmlFreeTextReader)> reader(
      xmlReaderForMemory(text.data(), static_cast<int>(text.size()), nullptr, nullptr,
                         XML_PARSE_NONET | XML_PARSE_NOERROR | XML_PARSE_NOWARNING),
      &xmlFreeTextReader);
  if (reader == nullptr) return;
  const Attributes at(reader.get());
  Group* group = nullptr;
  Object* object = nullptr;
  bool transparent = false;
  std::map<std::string, uint32_t> pictures;
  while (xmlTextReaderRead(reader.get()) == 1) {
    if (xmlTextReaderNodeType(reader.get()) != XML_READER_TYPE_ELEMENT) continue;
    const absl::string_view name =
        reinterpret_cast<const char*>(xmlTextReaderConstLocalName(reader.get()));
    if (name == "model") {
      model->unit = UnitOf(at.Text("unit"));
    } else if (name == "triangle") {
      if (object == nullptr) continue;
      Property property = object->common;
      const uint32_t pid = at.Number("pid"), first = at.Number("p1");
      if (pid != kNoNumber) property.group = pid;
      if (first != kNoNumber) {
        const uint32_t second = at.Number("p2"), third = at.Number("p3");
        property.entries = {first, second == kNoNumber ? first : second,
                            third == kNoNumber ? first : third};
      }
      if (object->triangles.size() < kMaxModelIndices / 3) object->triangles.push_back(property);
    } else if (name == "object") {
      object = &objects_[at.Text("id")];
      const uint32_t index = at.Number("pindex");
      object->common = {at.Number("pid"), {index, index, index}};
    } else if (name == "basematerials" || name == "colorgroup" || name == "texture2dgroup") {
      group = &groups_[at.Number("id")];
      group->one_a_triangle = name == "basematerials";
      const auto texture = textures_.find(at.Number("texid"));
      if (texture != textures_.end()) *group = texture->second;
    } else if (name == "base" || name == "color") {
      if (group != nullptr)
        group->colors.push_back(
            ColorOf(at.Text(name == "base" ? "displaycolor" : "color"), &transparent));
    } else if (name == "tex2coord") {
      // v points up in 3MF, and down in a model.
      if (group != nullptr) group->coordinates.push_back({at.Real("u"), 1 - at.Real("v")});
    } else if (name == "texture2d") {
      Group& texture = textures_[at.Number("id")];
      texture.wrap_u = WrapOfStyle(at.Text("tilestyleu"));
      texture.wrap_v = WrapOfStyle(at.Text("tilestylev"));
      const std::string path = at.Text("path");
      const auto [known, is_new] = pictures.try_emplace(path, kNoPicture);
      if (is_new) {
        std::string bytes = read_entry(path);
        if (bytes.empty()) {
          AddLeftOut("textures that cannot be read", 1, model);
        } else if (!IsPicture(bytes)) {
          AddLeftOut("textures that are neither PNG nor JPEG", 1, model);
        } else {
          known->second = static_cast<uint32_t>(model->pictures.size());
          model->pictures.push_back(std::move(bytes));
        }
      }
      texture.picture = known->second;
    } else if (name == "compositematerials") {
      AddLeftOut("composite materials", 1, model);
    } else if (name == "multiproperties") {
      group = &groups_[at.Number("id")];
      group->layers = Numbers(at.Text("pids"));
      if (group->layers.size() > 1)
        AddLeftOut("lower layers of properties", group->layers.size() - 1, model);
    } else if (name == "multi") {
      if (group != nullptr) group->entries.push_back(Numbers(at.Text("pindices")));
    } else if (name == "beam") {
      AddLeftOut("beams", 1, model);
    } else if (name == "slicestack") {
      AddLeftOut("stacks of slices", 1, model);
    } else if (name == "item" || name == "component") {
      if (!at.Text("path").empty() || !at.Text("p:path").empty())
        AddLeftOut("objects in other models of the archive", 1, model);
    }
  }
  AddLeftOut("transparency of materials", transparent ? 1 : 0, model);
}

ThreeMfColors::Property ThreeMfColors::UppermostOf(const Property& property) const {
  const auto found = groups_.find(property.group);
  if (found == groups_.end() || found->second.layers.empty()) return property;
  const Group& group = found->second;
  for (size_t l = group.layers.size(); l-- > 0;) {
    const auto layer = groups_.find(group.layers[l]);
    if (layer == groups_.end() ||
        (layer->second.colors.empty() && layer->second.coordinates.empty()))
      continue;
    Property upper{group.layers[l], {}};
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t entry = property.entries[c];
      if (entry >= group.entries.size()) return property;
      const std::vector<uint32_t>& each = group.entries[entry];
      upper.entries[c] = l < each.size() ? each[l] : 0;
    }
    return upper;
  }
  return property;
}

std::vector<Part> ThreeMfColors::Paint(const std::string& name, Part part, Model* model) const {
  const auto found = objects_.find(name);
  std::vector<Part> parts;
  if (found == objects_.end() || found->second.triangles.size() != part.indices.size() / 3) {
    parts.push_back(std::move(part));
    return parts;
  }
  const Object& object = found->second;
  // Keyed by the group whose picture they have; without a picture, by whether they have colours.
  struct Painted {
    Part part;
    const Group* group = nullptr;
    absl::flat_hash_map<std::array<uint32_t, 3>, uint32_t> vertices;
  };
  std::map<uint64_t, Painted> all;
  for (size_t t = 0; t < object.triangles.size(); ++t) {
    const Property property = UppermostOf(object.triangles[t]);
    const auto of = groups_.find(property.group);
    const Group* const group = of == groups_.end() ? nullptr : &of->second;
    const auto fits = [&](size_t size) {
      return std::all_of(property.entries.begin(), property.entries.end(),
                         [size](uint32_t entry) { return entry < size; });
    };
    const bool has_picture =
        group != nullptr && group->picture != kNoPicture && fits(group->coordinates.size());
    const bool has_colors =
        group != nullptr && (group->one_a_triangle ? property.entries[0] < group->colors.size()
                                                   : fits(group->colors.size()));
    Painted& painted = all[has_picture ? uint64_t{property.group} + 2 : has_colors ? 1 : 0];
    painted.group = group;
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t vertex = part.indices[3 * t + c];
      const uint32_t entry = has_picture || has_colors
                                 ? property.entries[group->one_a_triangle && !has_picture ? 0 : c]
                                 : 0;
      // One part may have colours of several groups.
      const Rgb color = has_colors && !has_picture ? group->colors[entry] : Rgb{255, 255, 255};
      const uint32_t packed =
          has_picture ? entry
                      : uint32_t{color.r} << 16 | uint32_t{color.g} << 8 | uint32_t{color.b};
      const auto [at, is_new] = painted.vertices.try_emplace(
          {vertex, packed, 0}, static_cast<uint32_t>(painted.part.positions.size()));
      if (is_new) {
        painted.part.positions.push_back(part.positions[vertex]);
        if (has_picture || has_colors) painted.part.colors.push_back(color);
        if (has_picture) painted.part.texture_coordinates.push_back(group->coordinates[entry]);
      }
      painted.part.indices.push_back(at->second);
    }
    if (has_picture) painted.part.picture = group->picture;
  }
  for (auto& [key, painted] : all) {
    if (painted.part.picture != kNoPicture) {
      AddLeftOut("triangles across the edge of a picture that does not repeat",
                 ApplyWrap(painted.group->wrap_u, painted.group->wrap_v, &painted.part), model);
    }
    parts.push_back(std::move(painted.part));
  }
  return parts;
}

}  // namespace voxeld::voxelctl
