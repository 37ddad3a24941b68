// Which colour a drawing's lines have.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// #rgb, #rrggbb, rgb(…) and CSS's names. Nothing of what is no colour.
std::optional<Rgb> ParseCssColor(absl::string_view text);

// What an element hands down to those within it.
struct SvgStyle {
  std::string fill = "black", stroke = "none", color = "black";
  bool hidden = false;

  // Takes a property, such as "fill"; others are passed over.
  void Set(absl::string_view property, absl::string_view value);
  // "fill: red; stroke: none"
  void SetAll(absl::string_view declarations);
  // Of the stroke, or else of the fill's edge; nothing if neither is painted. Black, which is ink on paper, is white light.
  std::optional<Rgb> LineColor() const;
};

// Declarations by simple selectors: an element's name, ".class", "#id".
using CssRules = std::map<std::string, std::string>;
// Adds those of a style sheet; what is none of these selectors is passed over.
void AddCssRules(absl::string_view sheet, CssRules* rules);

}  // namespace voxeld::voxelctl
