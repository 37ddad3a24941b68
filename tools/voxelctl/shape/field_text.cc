#include "tools/voxelctl/shape/field_text.h"

#include <cmath>
#include <cstring>
#include <fstream>
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
#include "common/text/color_names.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

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

// Returns "solid" for FILL_SOLID: the value's name without the prefix that the enumeration's values
// share.
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
    // Words before the numbers, such as an axis or a form.
    absl::string_view rest = absl::StripLeadingAsciiWhitespace(text);
    while (!rest.empty() && absl::ascii_isalpha(static_cast<unsigned char>(rest[0]))) {
      const absl::string_view word = rest.substr(0, rest.find(' '));
      const auto& fields = *v1::Boundary::descriptor();
      const char* const field = word.size() == 1 ? "axis" : "form";
      if (absl::Status status = SetEnum(*fields.FindFieldByName(field), word, boundary);
          !status.ok())
        return status;
      rest = absl::StripLeadingAsciiWhitespace(rest.substr(word.size()));
    }
    const absl::StatusOr<std::vector<double>> numbers = Numbers(name, rest);
    if (!numbers.ok()) return numbers.status();
    boundary->mutable_points()->Assign(numbers->begin(), numbers->end());
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat(name, " is nothing that can be typed here"));
}

absl::Status ReadFile(const FieldDescriptor& field, absl::string_view path, absl::string_view what,
                      std::string* out) {
  std::ifstream file{std::string(path), std::ios::binary};
  std::ostringstream whole;
  if (!file || !(whole << file.rdbuf())) {
    return Wrong(field.name(), path, absl::StrCat("the path of ", what, " would be right"));
  }
  *out = std::move(whole).str();
  return absl::OkStatus();
}

// Sets a picture from a file's path, or from bytes.
absl::Status SetPicture(const FieldDescriptor& field, absl::string_view text, Message* out) {
  std::string bytes;
  absl::string_view code = text;
  if (absl::ConsumePrefix(&code, "base64:")) {
    if (!absl::Base64Unescape(code, &bytes)) {
      return Wrong(field.name(), text, "base64 would be right, or a file's path");
    }
  } else {
    const absl::Status status =
        ReadFile(field, text, "a PNG or JPEG file that can be read", &bytes);
    if (!status.ok()) return status;
  }
  out->GetReflection()->SetString(out, &field, std::move(bytes));
  return absl::OkStatus();
}

// Returns the element type that an enumeration field of the same message sets, if there is one.
v1::ElementType TypeBeside(const Message& message) {
  for (const char* name : {"type", "height_type"}) {
    const FieldDescriptor* const field = message.GetDescriptor()->FindFieldByName(name);
    if (field != nullptr && field->enum_type() == v1::ElementType_descriptor()) {
      return static_cast<v1::ElementType>(message.GetReflection()->GetEnumValue(message, field));
    }
  }
  return v1::ELEMENT_TYPE_UNSPECIFIED;
}

// Appends one number to a packed array. Errors: InvalidArgument if the type cannot represent it.
absl::Status AppendNumber(absl::string_view name, double number, v1::ElementType type,
                          std::string* out) {
  const auto append = [&](auto value) {
    out->append(reinterpret_cast<const char*>(&value), sizeof(value));
    return absl::OkStatus();
  };
  if (type == v1::ELEMENT_TYPE_UNSPECIFIED || type == v1::ELEMENT_TYPE_F32) {
    return append(static_cast<float>(number));
  }
  const double most = type == v1::ELEMENT_TYPE_U16 ? 65535 : 255;  // RGBA8: four numbers per sample
  if (number != std::floor(number) || number < 0 || number > most) {
    const auto* value = v1::ElementType_descriptor()->FindValueByNumber(type);
    return Wrong(name, absl::StrCat(number),
                 absl::StrCat("whole numbers from 0 to ", most, " would be right for the type ",
                              value == nullptr ? "" : ShortName(*value)));
  }
  return type == v1::ELEMENT_TYPE_U16 ? append(static_cast<uint16_t>(number))
                                      : append(static_cast<uint8_t>(number));
}

// Sets a packed array: colours, or numbers of the message's element type, otherwise in single
// precision; or the unchanged bytes of a file.
absl::Status SetBytes(const FieldDescriptor& field, absl::string_view text, Message* out) {
  if (field.name() == "picture") return SetPicture(field, text, out);
  std::string bytes;
  if (absl::ConsumePrefix(&text, "file:")) {
    if (absl::Status status = ReadFile(field, text, "a file that can be read", &bytes);
        !status.ok()) {
      return status;
    }
    out->GetReflection()->SetString(out, &field, std::move(bytes));
    return absl::OkStatus();
  }
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
    const v1::ElementType type = TypeBeside(*out);
    for (const double number : *numbers) {
      const absl::Status status = AppendNumber(field.name(), number, type, &bytes);
      if (!status.ok()) return status;
    }
  }
  out->GetReflection()->SetString(out, &field, std::move(bytes));
  return absl::OkStatus();
}

}  // namespace

absl::Status Wrong(absl::string_view name, absl::string_view value, absl::string_view right) {
  return absl::InvalidArgumentError(absl::StrCat(EscapeForTerminal(std::string(name)), " is \"",
                                                 EscapeForTerminal(std::string(value)), "\"; ",
                                                 right));
}

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

absl::Status SetColor(absl::string_view name, absl::string_view text, v1::Color* out) {
  const std::optional<uint32_t> rgb = ParseColor(text);
  if (!rgb) return Wrong(name, text, ColorAdvice(text));
  out->set_rgb(*rgb);
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
      // Splits a text into lines, because a shell leaves \n unchanged.
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

}  // namespace voxeld::voxelctl
