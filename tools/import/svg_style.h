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

// What an element hands down to those within it, and how it is itself.
struct SvgStyle {
  std::string fill = "black", stroke = "none", color = "black";
  std::string stop_color = "black";  // of a gradient's stop
  double fill_opacity = 1, stroke_opacity = 1;
  double opacity = 1;        // its own
  double outer_opacity = 1;  // of all that it is within
  bool even_odd = false;
  bool visible = true;
  bool displayed = true;  // its own, and so of all within it

  // What those within begin with.
  SvgStyle Inherited() const;
  // Takes a property, such as "fill"; others, and values of more than 1 KiB, are passed over.
  void Set(absl::string_view property, absl::string_view value);
  // "fill: red; stroke: none"
  void SetAll(absl::string_view declarations);
};

// The properties that Set takes, which may be attributes, too.
inline constexpr const char* kSvgProperties[] = {
    "fill",      "stroke",       "color",          "display", "visibility",
    "fill-rule", "fill-opacity", "stroke-opacity", "opacity", "stop-color"};

// Declarations by simple selectors: an element's name, ".class", "#id".
using CssRules = std::map<std::string, std::string>;
// Adds those of a style sheet, up to 4 KiB for each selector; what is none of these selectors is passed over.
void AddCssRules(absl::string_view sheet, CssRules* rules);

}  // namespace voxeld::voxelctl
