#include "tools/voxelctl/shape/as_typed.h"

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/voxelctl/shape/drawing.h"

namespace voxeld::voxelctl {
namespace {

enum class TypedKind : uint8_t { kShape, kMask, kObject, kClip };

TypedKind KindOf(const std::string& text) {
  if (absl::StartsWith(text, "mask:")) return TypedKind::kMask;
  if (absl::StartsWith(text, "object ")) return TypedKind::kObject;
  return absl::StartsWith(text, "clip_") ? TypedKind::kClip : TypedKind::kShape;
}

// Returns shape `number` of a kind, from 1; empty if it does not exist.
std::string Nth(std::span<const std::string> shapes, TypedKind kind, size_t number) {
  for (const std::string& shape : shapes) {
    if (KindOf(shape) == kind && --number == 0) return shape;
  }
  return "";
}

std::string OfObject(std::span<const std::string> shapes, const std::string& name, size_t part) {
  for (const std::string& shape : shapes) {
    if (absl::StartsWith(shape, absl::StrCat("object ", name, ":")) && part-- == 0) return shape;
  }
  return "";
}

// `path` is the field's path within its shape: "height", "surface.text".
std::string Said(const std::string& path, const std::string& typed, absl::string_view text) {
  if (absl::EndsWith(path, ".text")) (void)absl::ConsumePrefix(&text, "text ");
  const std::string field = path.substr(0, path.find_first_of(".["));
  for (const char* const unset : {" is 0; ", " is \"\"; ", " is empty; "}) {
    if (absl::StrContains(typed, absl::StrCat(field, "="))) break;
    if (absl::ConsumePrefix(&text, absl::StrCat(field, unset)))
      return absl::StrCat(field, "=… is missing; ", EscapeForTerminal(text));
  }
  return EscapeForTerminal(text);
}

// Removes the text before `end`, and `end`, from the front. Returns false and removes nothing if
// `end` does not occur.
bool TakeUpTo(absl::string_view end, absl::string_view* text, absl::string_view* taken) {
  const size_t at = text->find(end);
  if (at == absl::string_view::npos) return false;
  *taken = text->substr(0, at);
  text->remove_prefix(at + end.size());
  return true;
}

size_t NumberIn(absl::string_view text) {
  size_t number = 0;
  return absl::SimpleAtoi(text, &number) ? number : 0;
}

}  // namespace

absl::Status AsTyped(const absl::Status& refused, std::span<const std::string> shapes) {
  absl::string_view rest = refused.message(), before, layer, id, path, shape;
  if (!TakeUpTo("; the first: ", &rest, &before) || !TakeUpTo("/", &rest, &layer) ||
      !TakeUpTo(", ", &rest, &id) || !TakeUpTo(": ", &rest, &path)) {
    return refused;
  }
  std::string typed;
  absl::string_view field = path, whole;
  if (!TakeUpTo(".primitive.", &field, &whole) || !TakeUpTo(".", &field, &shape)) return refused;
  if (absl::string_view part = whole, skipped; TakeUpTo("definition.parts[", &part, &skipped)) {
    typed = OfObject(shapes, std::string(id), NumberIn(absl::StripSuffix(part, "]")));
  } else if (const size_t space = id.rfind(' '); space != absl::string_view::npos) {
    typed = Nth(shapes, layer == kMaskLayer ? TypedKind::kMask : TypedKind::kShape,
                NumberIn(id.substr(space + 1)));
  }
  if (typed.empty()) return refused;
  std::string text =
      absl::StrCat("\"", EscapeForTerminal(typed), "\": ", Said(std::string(field), typed, rest));
  if (!absl::StrContains(before, " 1 operation ")) {
    absl::StrAppend(&text, "\nnothing is put up; more is wrong, and this is the first");
  }
  return {refused.code(), text};
}

}  // namespace voxeld::voxelctl
