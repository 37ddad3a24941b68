#include "tools/voxelctl/scene/color_by.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "daemon/colormaps/colormaps.h"

namespace voxeld::voxelctl {
namespace {

constexpr Rgb kWithout = {60, 60, 60};
constexpr absl::string_view kCoordinates[] = {"x", "y", "z"};

Rgb ColorOf(uint32_t packed) {
  return {static_cast<uint8_t>(packed >> 16), static_cast<uint8_t>(packed >> 8),
          static_cast<uint8_t>(packed)};
}

const Attribute* Find(const Part& part, const std::string& name) {
  for (const Attribute& one : part.attributes) {
    if (one.name == name) return &one;
  }
  for (const Attribute& one : part.attributes) {
    if (absl::EqualsIgnoreCase(one.name, name)) return &one;
  }
  return nullptr;
}

// Returns the values of a part's vertices; empty if it has no attribute of that name.
std::vector<double> NumbersOf(const Part& part, const std::string& name) {
  if (const Attribute* attribute = Find(part, name); attribute != nullptr)
    return {attribute->values.begin(), attribute->values.end()};
  const auto axis = std::find(std::begin(kCoordinates), std::end(kCoordinates), name);
  if (axis == std::end(kCoordinates)) return {};
  std::vector<double> numbers;
  numbers.reserve(part.positions.size());
  for (const Point3& p : part.positions) {
    const double at[] = {p.x, p.y, p.z};
    numbers.push_back(at[axis - std::begin(kCoordinates)]);
  }
  return numbers;
}

absl::Status NoSuchAttribute(const std::string& name, std::span<const Model> models) {
  std::vector<std::string> known;
  for (const Model& model : models) {
    for (const Part& part : model.parts) {
      for (const Attribute& one : part.attributes) {
        if (std::find(known.begin(), known.end(), one.name) == known.end())
          known.push_back(one.name);
      }
    }
  }
  for (const absl::string_view axis : kCoordinates) known.emplace_back(axis);
  return absl::InvalidArgumentError(absl::StrCat("--color-by is \"", EscapeForTerminal(name),
                                                 "\", which no file contains",
                                                 EscapeForTerminal(Suggestion(name, known))));
}

}  // namespace

absl::StatusOr<Legend> ApplyColorBy(const ColorBy& wanted, std::span<Model> models) {
  Legend legend{.attribute = wanted.attribute,
                .colormap = wanted.colormap.empty() ? "viridis" : wanted.colormap};
  const std::optional<ColorTable> table = FindColormap(legend.colormap);
  if (!table) {
    return absl::InvalidArgumentError(
        absl::StrCat("--colormap is \"", EscapeForTerminal(legend.colormap),
                     "\", which is not a known colour map; ",
                     EscapeForTerminal(ColormapAdvice(legend.colormap))));
  }
  std::vector<std::pair<Part*, std::vector<double>>> colored;
  double least = std::numeric_limits<double>::infinity(), greatest = -least;
  for (Model& model : models) {
    for (Part& part : model.parts) {
      std::vector<double> numbers = NumbersOf(part, wanted.attribute);
      if (numbers.empty()) continue;
      for (const double number : numbers) {
        if (!std::isfinite(number)) continue;
        least = std::min(least, number);
        greatest = std::max(greatest, number);
      }
      colored.emplace_back(&part, std::move(numbers));
    }
  }
  const bool parts = std::any_of(models.begin(), models.end(),
                                 [](const Model& model) { return !model.parts.empty(); });
  if (!parts) {
    return absl::InvalidArgumentError(
        "--color-by is for points, lines and meshes; volumes and drawings have --colormap");
  }
  if (colored.empty()) return NoSuchAttribute(wanted.attribute, models);
  if (!wanted.range && !(least <= greatest)) {
    return absl::InvalidArgumentError(absl::StrCat("--color-by is \"",
                                                   EscapeForTerminal(wanted.attribute),
                                                   "\", which has no numeric value in any file"));
  }
  legend.low = wanted.range ? (*wanted.range)[0] : least;
  legend.high = wanted.range ? (*wanted.range)[1] : greatest;
  const double span = legend.high - legend.low;
  for (auto& [part, numbers] : colored) {
    part->colors.clear();
    part->colors.reserve(numbers.size());
    for (const double number : numbers) {
      if (std::isnan(number)) {
        ++legend.without;
        part->colors.push_back(kWithout);
        continue;
      }
      // If all values are equal, they get the middle of the map.
      const double at = span > 0 ? std::clamp((number - legend.low) / span, 0.0, 1.0) : 0.5;
      part->colors.push_back(ColorOf((*table)[static_cast<size_t>(std::lround(at * 255))]));
    }
    part->normals.clear();
    part->picture = kNoPicture;
    part->texture_coordinates.clear();
  }
  return legend;
}

std::string LegendText(const Legend& legend) {
  std::string text =
      absl::StrFormat("coloured by %s: %g to %g (%s)", EscapeForTerminal(legend.attribute),
                      legend.low, legend.high, EscapeForTerminal(legend.colormap));
  if (legend.without > 0)
    absl::StrAppend(&text, "; ", legend.without, " without a number are grey");
  return text;
}

std::vector<std::array<uint8_t, 3>> LegendColors(const Legend& legend, size_t count) {
  const std::optional<ColorTable> table = FindColormap(legend.colormap);
  std::vector<std::array<uint8_t, 3>> colors;
  for (size_t i = 0; table && i < count; ++i) {
    const Rgb color = ColorOf((*table)[count < 2 ? 128 : i * 255 / (count - 1)]);
    colors.push_back({color.r, color.g, color.b});
  }
  return colors;
}

}  // namespace voxeld::voxelctl
