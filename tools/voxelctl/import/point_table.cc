#include "tools/voxelctl/import/point_table.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

// Names that belong together; earlier ones are preferred.
struct Family {
  std::array<PointColumn, 3> columns;
  std::array<absl::string_view, 3> names;  // empty: it has fewer
};
constexpr std::array<PointColumn, 3> kPlaceColumns = {PointColumn::kX, PointColumn::kY,
                                                      PointColumn::kZ};
constexpr std::array<PointColumn, 3> kHeightColumn = {PointColumn::kZ};
constexpr std::array<PointColumn, 3> kNormalColumns = {PointColumn::kNormalX, PointColumn::kNormalY,
                                                       PointColumn::kNormalZ};
constexpr std::array<PointColumn, 3> kColorColumns = {PointColumn::kRed, PointColumn::kGreen,
                                                      PointColumn::kBlue};
constexpr std::array<PointColumn, 3> kGreyColumn = {PointColumn::kIntensity};
constexpr Family kFamilies[] = {{kPlaceColumns, {"x", "y", ""}},
                                {kPlaceColumns, {"easting", "northing", ""}},
                                {kPlaceColumns, {"lon", "lat", ""}},
                                {kPlaceColumns, {"longitude", "latitude", ""}},
                                {kHeightColumn, {"z", "", ""}},
                                {kHeightColumn, {"height", "", ""}},
                                {kHeightColumn, {"elevation", "", ""}},
                                {kHeightColumn, {"altitude", "", ""}},
                                {kNormalColumns, {"nx", "ny", "nz"}},
                                {kNormalColumns, {"normal_x", "normal_y", "normal_z"}},
                                {kColorColumns, {"red", "green", "blue"}},
                                {kColorColumns, {"r", "g", "b"}},
                                {kColorColumns, {"diffuse_red", "diffuse_green", "diffuse_blue"}},
                                {kColorColumns, {"diffuse_r", "diffuse_g", "diffuse_b"}},
                                {kGreyColumn, {"intensity", "", ""}},
                                {kGreyColumn, {"i", "", ""}},
                                {kGreyColumn, {"reflectance", "", ""}}};

double Of(const PointRow& row, PointColumn column) { return row[static_cast<size_t>(column)]; }

uint8_t Byte(double fraction) {
  return static_cast<uint8_t>(std::clamp(fraction * 255 + 0.5, 0.0, 255.0));
}

}  // namespace

PointColumns PointColumnsByName(std::span<const std::string> names) {
  std::vector<std::string> lower;
  for (const std::string& name : names)
    lower.push_back(absl::AsciiStrToLower(absl::StripAsciiWhitespace(name)));
  const auto at = [&](absl::string_view name) {
    return static_cast<size_t>(std::ranges::find(lower, name) - lower.begin());
  };
  PointColumns columns(names.size());
  const auto take = [&](const Family& family) {
    for (size_t i = 0; i < 3 && !family.names[i].empty(); ++i) {
      const size_t found = at(family.names[i]);
      const bool is_taken = std::ranges::find(columns, family.columns[i]) != columns.end();
      if (found < columns.size() && !is_taken) columns[found] = family.columns[i];
    }
  };
  // Complete families first.
  for (const Family& family : kFamilies) {
    const bool is_complete = std::ranges::all_of(family.names, [&](absl::string_view name) {
      return name.empty() || at(name) < columns.size();
    });
    if (is_complete) take(family);
  }
  for (const Family& family : kFamilies) take(family);
  return columns;
}

PointLayout PointLayout::Of(PointColumns columns, bool may_be_grey) {
  const auto has = [&](PointColumn column) {
    return std::ranges::find(columns, column) != columns.end();
  };
  const auto drop = [&](std::initializer_list<PointColumn> some) {
    for (std::optional<PointColumn>& column : columns) {
      if (column && std::ranges::find(some, *column) != some.end()) column.reset();
    }
  };
  const bool is_packed = has(PointColumn::kPackedColor);
  if (is_packed || !has(PointColumn::kRed) || !has(PointColumn::kGreen) || !has(PointColumn::kBlue))
    drop({PointColumn::kRed, PointColumn::kGreen, PointColumn::kBlue});
  if (!has(PointColumn::kNormalX) || !has(PointColumn::kNormalY) || !has(PointColumn::kNormalZ))
    drop({PointColumn::kNormalX, PointColumn::kNormalY, PointColumn::kNormalZ});
  if (is_packed || has(PointColumn::kRed) || !may_be_grey) drop({PointColumn::kIntensity});
  PointLayout layout;
  for (size_t c = 0; c < columns.size(); ++c) {
    if (!columns[c]) layout.others.push_back(c);
    if (!columns[c] || columns[c] == PointColumn::kIntensity) layout.attributes.push_back(c);
    if (columns[c] && columns[c] != PointColumn::kPackedColor)
      layout.has[static_cast<size_t>(*columns[c])] = true;
  }
  for (const PointColumn channel : kColorColumns)
    layout.has[static_cast<size_t>(channel)] |= is_packed;
  layout.shown = std::move(columns);
  return layout;
}

bool IsColor(PointColumn column) {
  return column == PointColumn::kRed || column == PointColumn::kGreen ||
         column == PointColumn::kBlue;
}

void ChannelRange::Add(double channel) {
  if (std::isfinite(channel)) greatest_ = std::max(greatest_, channel);
}

std::optional<Rgb> ColorOfChannels(double red, double green, double blue) {
  if (!std::isfinite(red) || !std::isfinite(green) || !std::isfinite(blue)) return std::nullopt;
  return Rgb{Byte(red), Byte(green), Byte(blue)};
}

std::vector<Rgb> GreysOf(std::span<const float> intensities, uint64_t* unknown) {
  float least = std::numeric_limits<float>::max(), greatest = -least;
  for (const float intensity : intensities) {
    if (!std::isfinite(intensity)) continue;
    least = std::min(least, intensity);
    greatest = std::max(greatest, intensity);
  }
  const double span = greatest > least ? double{greatest} - double{least} : 0;
  std::vector<Rgb> greys;
  greys.reserve(intensities.size());
  for (const float intensity : intensities) {
    const double part = span > 0 ? (double{intensity} - double{least}) / span : 1;
    const bool is_known = std::isfinite(intensity);
    *unknown += is_known ? 0 : 1;
    greys.push_back(is_known ? ColorOfChannels(part, part, part).value_or(kUnknownColor)
                             : kUnknownColor);
  }
  return greys;
}

std::optional<double> NumberOfWord(absl::string_view word) {
  if (absl::StartsWith(word, "+") && !absl::StartsWith(word, "+-")) word.remove_prefix(1);
  double value = 0;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), value);
  if (read.ec != std::errc() || read.ptr != word.data() + word.size()) return std::nullopt;
  return value;
}

absl::StatusOr<PointTable> PointTable::Make(const SourceFile& file, const PointLayout& layout,
                                            double full_scale) {
  PointTable table;
  table.has_ = layout.has;
  table.full_scale_ = full_scale;
  for (const auto& [column, name] :
       {std::pair(PointColumn::kX, "x"), {PointColumn::kY, "y"}, {PointColumn::kZ, "z"}}) {
    if (!table.Has(column)) {
      return FileError(file, absl::StrCat("has no column ", name),
                       "points have x, y and z at least");
    }
  }
  table.part_.kind = Kind::kPoints;
  return table;
}

void PointTable::Reserve(uint64_t count) {
  part_.positions.reserve(std::min(count, kMaxModelVertices));
}

void PointTable::SetAttributes(std::vector<std::string> names) {
  for (std::string& name : names) part_.attributes.push_back({std::move(name), {}});
}

absl::Status PointTable::Add(const SourceFile& file, const PointRow& row, absl::string_view what,
                             std::span<const double> attributes) {
  const Point3 at{Of(row, PointColumn::kX), Of(row, PointColumn::kY), Of(row, PointColumn::kZ)};
  if (std::isnan(at.x) || std::isnan(at.y) || std::isnan(at.z)) {
    ++nowhere_;
    return absl::OkStatus();
  }
  if (!std::isfinite(at.x) || !std::isfinite(at.y) || !std::isfinite(at.z)) {
    return FileError(file, absl::StrCat(what, " is (", at.x, ", ", at.y, ", ", at.z, ")"),
                     "coordinates must be finite");
  }
  if (part_.positions.size() >= kMaxModelVertices) {
    return FileError(file, absl::StrCat("has more than ", kMaxModelVertices, " points"),
                     "take a part of it");
  }
  part_.positions.push_back(at);
  for (size_t i = 0; i < part_.attributes.size(); ++i)
    part_.attributes[i].values.push_back(attributes[i]);
  if (Has(PointColumn::kNormalX)) {
    part_.normals.push_back(
        UnitOrZero({Of(row, PointColumn::kNormalX), Of(row, PointColumn::kNormalY),
                    Of(row, PointColumn::kNormalZ)}));
  }
  if (Has(PointColumn::kRed)) {
    const std::optional<Rgb> color = ColorOfChannels(Of(row, PointColumn::kRed) / full_scale_,
                                                     Of(row, PointColumn::kGreen) / full_scale_,
                                                     Of(row, PointColumn::kBlue) / full_scale_);
    uncolored_ += color ? 0 : 1;
    part_.colors.push_back(color.value_or(kUnknownColor));
  } else if (Has(PointColumn::kIntensity)) {
    const double intensity = Of(row, PointColumn::kIntensity);
    intensities_.push_back(static_cast<float>(intensity));
  }
  return absl::OkStatus();
}

Model PointTable::Finish(const SourceFile& file, std::string format) && {
  if (!intensities_.empty()) part_.colors = GreysOf(intensities_, &uncolored_);
  Model model;
  model.path = file.path;
  model.format = std::move(format);
  model.up = Up::kZ;
  model.lit_already = !part_.colors.empty();
  AddLeftOut("points that are not a number", nowhere_, &model);
  AddLeftOut(kUnknownColors, uncolored_, &model);
  model.parts.push_back(std::move(part_));
  return model;
}

}  // namespace voxeld::voxelctl
