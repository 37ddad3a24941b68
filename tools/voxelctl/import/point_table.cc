#include "tools/voxelctl/import/point_table.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "tools/voxelctl/import/surface_builder.h"

namespace voxeld::voxelctl {
namespace {

struct Known {
  absl::string_view name;
  PointColumn column;
};
constexpr Known kNames[] = {
    {"x", PointColumn::kX},
    {"easting", PointColumn::kX},
    {"lon", PointColumn::kX},
    {"longitude", PointColumn::kX},
    {"y", PointColumn::kY},
    {"northing", PointColumn::kY},
    {"lat", PointColumn::kY},
    {"latitude", PointColumn::kY},
    {"z", PointColumn::kZ},
    {"height", PointColumn::kZ},
    {"elevation", PointColumn::kZ},
    {"altitude", PointColumn::kZ},
    {"nx", PointColumn::kNormalX},
    {"normal_x", PointColumn::kNormalX},
    {"ny", PointColumn::kNormalY},
    {"normal_y", PointColumn::kNormalY},
    {"nz", PointColumn::kNormalZ},
    {"normal_z", PointColumn::kNormalZ},
    {"r", PointColumn::kRed},
    {"red", PointColumn::kRed},
    {"g", PointColumn::kGreen},
    {"green", PointColumn::kGreen},
    {"b", PointColumn::kBlue},
    {"blue", PointColumn::kBlue},
    {"i", PointColumn::kIntensity},
    {"intensity", PointColumn::kIntensity},
    {"reflectance", PointColumn::kIntensity},
};

double Of(const PointRow& row, PointColumn column) { return row[static_cast<size_t>(column)]; }

uint8_t Byte(double fraction) {
  const double scaled = fraction * 255 + 0.5;
  return std::isfinite(scaled) ? static_cast<uint8_t>(std::clamp(scaled, 0.0, 255.0)) : 0;
}

}  // namespace

std::optional<PointColumn> PointColumnOf(absl::string_view name) {
  const std::string lower = absl::AsciiStrToLower(absl::StripAsciiWhitespace(name));
  absl::string_view bare = lower;
  absl::ConsumePrefix(&bare, "diffuse_");
  const auto found = std::ranges::find(kNames, bare, &Known::name);
  if (found == std::end(kNames)) return std::nullopt;
  return found->column;
}

double FullScaleOf(double greatest) { return greatest <= 1 ? 1 : greatest <= 255 ? 255 : 65535; }

bool IsColor(PointColumn column) {
  return column == PointColumn::kRed || column == PointColumn::kGreen ||
         column == PointColumn::kBlue;
}

absl::StatusOr<PointTable> PointTable::Make(const SourceFile& file,
                                            const std::array<bool, kPointColumns>& has,
                                            double full_scale) {
  PointTable table;
  table.has_ = has;
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
  if (Has(PointColumn::kNormalX) && Has(PointColumn::kNormalY) && Has(PointColumn::kNormalZ)) {
    part_.normals.push_back(
        UnitOrZero({Of(row, PointColumn::kNormalX), Of(row, PointColumn::kNormalY),
                    Of(row, PointColumn::kNormalZ)}));
  }
  if (Has(PointColumn::kRed) && Has(PointColumn::kGreen) && Has(PointColumn::kBlue)) {
    const double red = Of(row, PointColumn::kRed), green = Of(row, PointColumn::kGreen),
                 blue = Of(row, PointColumn::kBlue);
    if (std::isnan(red) || std::isnan(green) || std::isnan(blue)) {
      ++uncolored_;
      part_.colors.push_back({255, 255, 255});
    } else {
      part_.colors.push_back(
          {Byte(red / full_scale_), Byte(green / full_scale_), Byte(blue / full_scale_)});
    }
  } else if (Has(PointColumn::kIntensity)) {
    const double intensity = Of(row, PointColumn::kIntensity);
    intensities_.push_back(static_cast<float>(intensity));
  }
  return absl::OkStatus();
}

Model PointTable::Finish(const SourceFile& file, std::string format) && {
  if (!intensities_.empty()) {
    float least = std::numeric_limits<float>::max(), greatest = -least;
    for (const float intensity : intensities_) {
      if (!std::isfinite(intensity)) continue;
      least = std::min(least, intensity);
      greatest = std::max(greatest, intensity);
    }
    // If all are equal, they become white.
    const double span = greatest > least ? double{greatest} - double{least} : 0;
    for (const float intensity : intensities_) {
      const bool is_known = std::isfinite(intensity);
      uncolored_ += is_known ? 0 : 1;
      const uint8_t grey =
          is_known && span > 0 ? Byte((double{intensity} - double{least}) / span) : 255;
      part_.colors.push_back({grey, grey, grey});
    }
  }
  Model model;
  model.path = file.path;
  model.format = std::move(format);
  model.up = Up::kZ;
  model.lit_already = !part_.colors.empty();
  AddLeftOut("points that are not a number", nowhere_, &model);
  AddLeftOut("colours and intensities that are not a number (shown white)", uncolored_, &model);
  model.parts.push_back(std::move(part_));
  return model;
}

}  // namespace voxeld::voxelctl
