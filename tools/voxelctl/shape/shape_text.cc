#include "tools/voxelctl/shape/shape_text.h"

#include <cmath>
#include <cstring>
#include <fstream>
#include <numbers>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "daemon/suggest/suggest.h"
#include "gpu/affine.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

struct Setting {
  std::string name, value;
};

absl::Status Wrong(absl::string_view name, absl::string_view value, absl::string_view right) {
  return absl::InvalidArgumentError(absl::StrCat(EscapeForTerminal(std::string(name)), " is \"",
                                                 EscapeForTerminal(std::string(value)), "\"; ",
                                                 right));
}

// Words, those with spaces in quotes.
absl::StatusOr<std::vector<std::string>> Words(absl::string_view text) {
  std::vector<std::string> words;
  std::string word;
  char quote = 0;
  bool any = false;
  for (const char c : text) {
    if (quote != 0) {
      if (c == quote) {
        quote = 0;
      } else {
        word += c;
      }
    } else if (c == '"' || c == '\'') {
      quote = c;
      any = true;
    } else if (absl::ascii_isspace(static_cast<unsigned char>(c))) {
      if (any || !word.empty()) words.push_back(std::exchange(word, ""));
      any = false;
    } else {
      word += c;
    }
  }
  if (quote != 0) {
    return absl::InvalidArgumentError(absl::StrCat("a ", std::string(1, quote), " is not closed"));
  }
  if (any || !word.empty()) words.push_back(word);
  return words;
}

absl::StatusOr<std::vector<double>> Numbers(absl::string_view name, absl::string_view text) {
  std::vector<double> numbers;
  for (const absl::string_view part :
       absl::StrSplit(text, absl::ByAnyChar(", ;:"), absl::SkipEmpty())) {
    double number = 0;
    if (!absl::SimpleAtod(part, &number))
      return Wrong(name, text, "numbers with , between would be right");
    numbers.push_back(number);
  }
  return numbers;
}

absl::Status SetVec3(absl::string_view name, absl::string_view text, v1::Vec3* out) {
  const absl::StatusOr<std::vector<double>> numbers = Numbers(name, text);
  if (!numbers.ok()) return numbers.status();
  if (numbers->size() != 3 && numbers->size() != 1) {
    return Wrong(name, text, "x,y,z would be right, or one number for all");
  }
  out->set_x(numbers->front());
  out->set_y((*numbers)[numbers->size() == 1 ? 0 : 1]);
  out->set_z(numbers->back());
  return absl::OkStatus();
}

absl::Status SetBox(absl::string_view name, absl::string_view text, v1::Box3* out) {
  const std::vector<absl::string_view> corners = absl::StrSplit(text, ':');
  if (corners.size() != 2) return Wrong(name, text, "two corners, x,y,z:x,y,z, would be right");
  const absl::Status status = SetVec3(name, corners[0], out->mutable_min());
  return status.ok() ? SetVec3(name, corners[1], out->mutable_max()) : status;
}

absl::Status SetThickness(absl::string_view name, absl::string_view text, v1::Thickness* out) {
  absl::string_view number = text;
  const bool units = absl::ConsumeSuffix(&number, "u");
  float value = 0;
  if (!absl::SimpleAtof(number, &value)) {
    return Wrong(name, text,
                 "a number of voxels would be right, or one of units with a u, as 0.1u");
  }
  out->set_value(value);
  out->set_unit(units ? v1::Thickness::UNITS : v1::Thickness::VOXELS);
  return absl::OkStatus();
}

absl::Status SetColor(absl::string_view name, absl::string_view text, v1::Color* out) {
  constexpr std::pair<absl::string_view, uint32_t> kNames[] = {
      {"black", 0x000000},   {"blue", 0x0000FF},    {"brown", 0xA52A2A}, {"cyan", 0x00FFFF},
      {"gold", 0xFFD700},    {"gray", 0x808080},    {"green", 0x00C000}, {"lime", 0x00FF00},
      {"magenta", 0xFF00FF}, {"orange", 0xFF8000},  {"pink", 0xFFA0C0},  {"purple", 0xA020F0},
      {"red", 0xFF0000},     {"skyblue", 0x40C0FF}, {"teal", 0x008080},  {"violet", 0xC060FF},
      {"white", 0xFFFFFF},   {"yellow", 0xFFFF00}};
  for (const auto& [known, rgb] : kNames) {
    if (known == text) {
      out->set_rgb(rgb);
      return absl::OkStatus();
    }
  }
  absl::string_view digits = text;
  uint32_t rgb = 0;
  if (absl::ConsumePrefix(&digits, "#") && digits.size() == 6 &&
      absl::SimpleHexAtoi(digits, &rgb)) {
    out->set_rgb(rgb);
    return absl::OkStatus();
  }
  std::vector<std::string> names;
  for (const auto& known : kNames) names.emplace_back(known.first);
  return Wrong(name, text,
               absl::StrCat("#rrggbb would be right, or one of ", absl::StrJoin(names, ", ")));
}

absl::Status SetVertices(absl::string_view name, absl::string_view text, v1::Vertices* out) {
  const absl::StatusOr<std::vector<double>> numbers = Numbers(name, text);
  if (!numbers.ok()) return numbers.status();
  if (numbers->empty() || numbers->size() % 3 != 0) {
    return Wrong(name, text,
                 absl::StrCat("x,y,z of each vertex would be right; these are ", numbers->size(),
                              " numbers"));
  }
  out->set_count(static_cast<uint32_t>(numbers->size() / 3));
  std::string* const positions = out->mutable_positions();
  for (const double number : *numbers) {
    const float value = static_cast<float>(number);
    positions->append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  return absl::OkStatus();
}

// "solid" for FILL_SOLID: what is left of the value without the words that the enumeration has in common.
std::string ShortName(const EnumValueDescriptor& value) {
  std::string name = value.name();
  const std::string zero = value.type()->value(0)->name();
  const std::string prefix = zero.substr(0, zero.find("UNSPECIFIED"));
  if (absl::StartsWith(name, prefix)) name = name.substr(prefix.size());
  return absl::AsciiStrToLower(name);
}

absl::Status SetEnum(const FieldDescriptor& field, absl::string_view text, Message* out) {
  std::vector<std::string> names;
  for (int i = 1; i < field.enum_type()->value_count(); ++i) {
    const EnumValueDescriptor& value = *field.enum_type()->value(i);
    names.push_back(ShortName(value));
    if (names.back() != text) continue;
    out->GetReflection()->SetEnum(out, &field, &value);
    return absl::OkStatus();
  }
  return Wrong(field.name(), text,
               absl::StrCat("one of ", absl::StrJoin(names, ", "), " would be right"));
}

absl::Status SetMessage(const FieldDescriptor& field, absl::string_view text, Message* out) {
  Message* const to = out->GetReflection()->MutableMessage(out, &field);
  const std::string& name = field.name();
  if (auto* vec = dynamic_cast<v1::Vec3*>(to)) return SetVec3(name, text, vec);
  if (auto* box = dynamic_cast<v1::Box3*>(to)) return SetBox(name, text, box);
  if (auto* thickness = dynamic_cast<v1::Thickness*>(to))
    return SetThickness(name, text, thickness);
  if (auto* color = dynamic_cast<v1::Color*>(to)) return SetColor(name, text, color);
  if (auto* vertices = dynamic_cast<v1::Vertices*>(to)) return SetVertices(name, text, vertices);
  if (auto* expression = dynamic_cast<v1::Expression*>(to)) {
    expression->set_text(std::string(text));
    return absl::OkStatus();
  }
  if (auto* boundary = dynamic_cast<v1::Boundary*>(to)) {
    const absl::StatusOr<std::vector<double>> numbers = Numbers(name, text);
    if (!numbers.ok()) return numbers.status();
    boundary->mutable_points()->Assign(numbers->begin(), numbers->end());
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(name, " is nothing that can be typed here"));
}

// A file by its path, or its bytes.
absl::Status SetPicture(const FieldDescriptor& field, absl::string_view text, Message* out) {
  std::string bytes;
  absl::string_view code = text;
  if (absl::ConsumePrefix(&code, "base64:")) {
    if (!absl::Base64Unescape(code, &bytes)) {
      return Wrong(field.name(), text, "base64 would be right, or a file's path");
    }
  } else {
    std::ifstream file{std::string(text), std::ios::binary};
    std::ostringstream whole;
    if (!file || !(whole << file.rdbuf())) {
      return Wrong(field.name(), text,
                   "the path of a PNG or JPEG file would be right, one that can be read");
    }
    bytes = std::move(whole).str();
  }
  out->GetReflection()->SetString(out, &field, std::move(bytes));
  return absl::OkStatus();
}

// Packed arrays: colours, or numbers in single precision.
absl::Status SetBytes(const FieldDescriptor& field, absl::string_view text, Message* out) {
  if (field.name() == "picture") return SetPicture(field, text, out);
  std::string bytes;
  if (field.name() == "colors") {
    for (const absl::string_view part : absl::StrSplit(text, ' ', absl::SkipEmpty())) {
      v1::Color color;
      if (absl::Status status = SetColor(field.name(), part, &color); !status.ok()) return status;
      for (const uint32_t shift : {16u, 8u, 0u})
        bytes += static_cast<char>(color.rgb() >> shift & 0xFF);
    }
  } else {
    const absl::StatusOr<std::vector<double>> numbers = Numbers(field.name(), text);
    if (!numbers.ok()) return numbers.status();
    for (const double number : *numbers) {
      const float value = static_cast<float>(number);
      bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
    }
  }
  out->GetReflection()->SetString(out, &field, std::move(bytes));
  return absl::OkStatus();
}

absl::Status SetField(const FieldDescriptor& field, absl::string_view text, Message* out) {
  const Reflection& reflection = *out->GetReflection();
  if (field.is_repeated() && field.type() == FieldDescriptor::TYPE_FIXED32) {
    for (const absl::string_view part : absl::StrSplit(text, ' ', absl::SkipEmpty())) {
      v1::Color color;
      if (absl::Status status = SetColor(field.name(), part, &color); !status.ok()) return status;
      reflection.AddUInt32(out, &field, color.rgb());
    }
    return absl::OkStatus();
  }
  if (field.is_repeated()) {
    if (field.cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE) {
      return absl::InvalidArgumentError(
          absl::StrCat(field.name(), " is nothing that can be typed here"));
    }
    const absl::StatusOr<std::vector<double>> numbers = Numbers(field.name(), text);
    if (!numbers.ok()) return numbers.status();
    for (const double number : *numbers) reflection.AddDouble(out, &field, number);
    return absl::OkStatus();
  }
  double number = 0;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return SetMessage(field, text, out);
    case FieldDescriptor::CPPTYPE_ENUM:
      return SetEnum(field, text, out);
    case FieldDescriptor::CPPTYPE_STRING:
      if (field.type() == FieldDescriptor::TYPE_BYTES) return SetBytes(field, text, out);
      // A text's lines; a shell leaves \n as it is.
      reflection.SetString(
          out, &field,
          field.name() == "text" ? absl::StrReplaceAll(text, {{"\\n", "\n"}}) : std::string(text));
      return absl::OkStatus();
    case FieldDescriptor::CPPTYPE_BOOL:
      if (text != "true" && text != "false")
        return Wrong(field.name(), text, "true or false would be right");
      reflection.SetBool(out, &field, text == "true");
      return absl::OkStatus();
    default:
      break;
  }
  if (!absl::SimpleAtod(text, &number)) return Wrong(field.name(), text, "a number would be right");
  const bool whole = number == std::floor(number) && std::fabs(number) < 1e9;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      reflection.SetDouble(out, &field, number);
      return absl::OkStatus();
    case FieldDescriptor::CPPTYPE_FLOAT:
      reflection.SetFloat(out, &field, static_cast<float>(number));
      return absl::OkStatus();
    case FieldDescriptor::CPPTYPE_UINT32:
      if (!whole || number < 0)
        return Wrong(field.name(), text, "a whole number from 0 would be right");
      reflection.SetUInt32(out, &field, static_cast<uint32_t>(number));
      return absl::OkStatus();
    case FieldDescriptor::CPPTYPE_INT32:
      if (!whole) return Wrong(field.name(), text, "a whole number would be right");
      reflection.SetInt32(out, &field, static_cast<int32_t>(number));
      return absl::OkStatus();
    default:
      return absl::InvalidArgumentError(
          absl::StrCat(field.name(), " is nothing that can be typed here"));
  }
}

// Where a shape is put: scaled, then turned about x, y and z, then moved.
struct Placement {
  v1::Vec3 at, scale, turn;

  Placement() {
    scale.set_x(1);
    scale.set_y(1);
    scale.set_z(1);
  }

  void Write(v1::Affine* out) const {
    gpu::Affine map;
    map.m[0] = scale.x();
    map.m[5] = scale.y();
    map.m[10] = scale.z();
    const double degrees[3] = {turn.x(), turn.y(), turn.z()};
    for (int axis = 0; axis < 3; ++axis) {
      const double radians = degrees[axis] * std::numbers::pi / 180;
      const int b = (axis + 1) % 3, c = (axis + 2) % 3;
      gpu::Affine turned;
      turned.m[b * 4 + b] = turned.m[c * 4 + c] = std::cos(radians);
      turned.m[c * 4 + b] = std::sin(radians);
      turned.m[b * 4 + c] = -std::sin(radians);
      map = gpu::Compose(turned, map);
    }
    map.m[3] = at.x();
    map.m[7] = at.y();
    map.m[11] = at.z();
    out->mutable_m()->Assign(std::begin(map.m), std::end(map.m));
  }
};

// A field by its name, or by those of the messages that it is in with points between, which are made: "grid.size_a".
// Null: there is none.
const FieldDescriptor* FindField(absl::string_view name, Message** within) {
  for (;;) {
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(name, absl::MaxSplits('.', 1));
    const FieldDescriptor* const field =
        (*within)->GetDescriptor()->FindFieldByName(std::string(parts.first));
    if (field == nullptr || !absl::StrContains(name, '.')) return field;
    if (field->message_type() == nullptr || field->is_repeated()) return nullptr;
    *within = (*within)->GetReflection()->MutableMessage(*within, field);
    name = parts.second;
  }
}

// Of what every shape has; false if `setting` is none of it.
absl::StatusOr<bool> SetCommon(const Setting& setting, Placement* placement, v1::Entity* out) {
  const auto& [name, value] = setting;
  absl::Status status;
  double number = 0;
  if (absl::StartsWith(name, "color_scale.")) {
    Message* within = out->mutable_primitive();
    const FieldDescriptor* const field = FindField(name, &within);
    if (field == nullptr) return false;
    status = SetField(*field, value, within);
  } else if (name == "color") {
    status = SetColor(name, value, out->mutable_primitive()->mutable_color());
  } else if (name == "at") {
    status = SetVec3(name, value, &placement->at);
  } else if (name == "scale") {
    status = SetVec3(name, value, &placement->scale);
  } else if (name == "turn") {
    status = SetVec3(name, value, &placement->turn);
  } else if (name == "label") {
    out->set_label(value);
  } else if (name == "erase") {
    if (value != "true" && value != "false")
      return Wrong(name, value, "true or false would be right");
    out->set_erase(value == "true");
  } else if (name == "priority" || name == "lifetime") {
    if (!absl::SimpleAtod(value, &number) || !(number >= 0) || number > 1e9) {
      return Wrong(name, value, "a number from 0 would be right");
    }
    if (name == "priority") out->set_priority(static_cast<uint32_t>(number));
    if (name == "lifetime") out->set_lifetime_ns(std::llround(number * 1e9));
  } else {
    return false;
  }
  if (!status.ok()) return status;
  return true;
}

absl::Status SetShape(const FieldDescriptor& kind, const std::vector<Setting>& settings,
                      Placement* placement, v1::Entity* out) {
  v1::Primitive* const primitive = out->mutable_primitive();
  Message* const shape = primitive->GetReflection()->MutableMessage(primitive, &kind);
  for (const Setting& setting : settings) {
    Message* within = shape;
    if (const FieldDescriptor* field = FindField(setting.name, &within)) {
      if (absl::Status status = SetField(*field, setting.value, within); !status.ok()) {
        return status;
      }
      continue;
    }
    const absl::StatusOr<bool> common = SetCommon(setting, placement, out);
    if (!common.ok()) return common.status();
    if (*common) continue;
    const int fields = shape->GetDescriptor()->field_count();
    std::vector<std::string> known(static_cast<size_t>(fields));
    for (int i = 0; i < fields; ++i)
      known[static_cast<size_t>(i)] = shape->GetDescriptor()->field(i)->name();
    for (const char* name : {"color", "color_scale.colormap", "color_scale.along", "at", "scale",
                             "turn", "priority", "erase", "label", "lifetime"}) {
      known.emplace_back(name);
    }
    return absl::InvalidArgumentError(absl::StrCat(
        kind.name(), " has no ", EscapeForTerminal(setting.name), Suggestion(setting.name, known)));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Entity> ParseShapeText(absl::string_view text) {
  const absl::StatusOr<std::vector<std::string>> words = Words(text);
  if (!words.ok()) return words.status();
  if (words->empty()) return absl::InvalidArgumentError("a shape is expected, or an expression");
  const google::protobuf::OneofDescriptor& kinds = *v1::Primitive::descriptor()->oneof_decl(0);
  v1::Entity entity;
  for (int i = 0; i < kinds.field_count(); ++i) {
    const FieldDescriptor& kind = *kinds.field(i);
    if (kind.name() != words->front()) continue;
    std::vector<Setting> settings;
    for (size_t w = 1; w < words->size(); ++w) {
      const std::pair<std::string, std::string> parts =
          absl::StrSplit((*words)[w], absl::MaxSplits('=', 1));
      if (!absl::StrContains((*words)[w], '=')) {
        return Wrong(absl::StrCat("after ", kind.name()), (*words)[w], "NAME=VALUE would be right");
      }
      settings.push_back({parts.first, parts.second});
    }
    Placement placement;
    if (absl::Status status = SetShape(kind, settings, &placement, &entity); !status.ok())
      return status;
    placement.Write(entity.mutable_transform());
    return entity;
  }
  // A misspelt shape is none of an expression's beginnings.
  const std::string& first = words->front();
  if (words->size() == 1 || absl::StrContains((*words)[1], '=')) {
    std::vector<std::string> names(static_cast<size_t>(kinds.field_count()));
    for (int i = 0; i < kinds.field_count(); ++i)
      names[static_cast<size_t>(i)] = kinds.field(i)->name();
    const bool name = absl::c_all_of(first, [](char c) {
      return absl::ascii_isalpha(static_cast<unsigned char>(c)) || c == '_';
    });
    if (name && first.size() > 2) {
      return absl::InvalidArgumentError(
          absl::StrCat("there is no shape ", EscapeForTerminal(first), Suggestion(first, names)));
    }
  }
  entity.mutable_primitive()->mutable_implicit()->mutable_surface()->set_text(std::string(text));
  return entity;
}

}  // namespace voxeld::voxelctl
