#include "tools/voxelctl/import/map_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kStepDegrees = 2;
constexpr double kOnCut = 1e-9;
constexpr double kMostLatitude = 90 + kOnCut;
constexpr uint64_t kMostNumbers = uint64_t{1} << 27;  // over all attributes: half a gigabyte
constexpr double kNoNumber = std::numeric_limits<double>::quiet_NaN();

Point3 OnSphere(LonLat p) {
  const double lon = p.lon * std::numbers::pi / 180, lat = p.lat * std::numbers::pi / 180;
  return {std::cos(lat) * std::sin(lon), -std::cos(lat) * std::cos(lon), std::sin(lat)};
}

// Interpolates between two places; `t` is 1 at `to`.
LonLat Between(LonLat from, LonLat to, double t) {
  return {from.lon + (to.lon - from.lon) * t, from.lat + (to.lat - from.lat) * t,
          from.height + (to.height - from.height) * t};
}

double HeightOf(LonLat p) { return std::isfinite(p.height) ? p.height : kNoNumber; }

bool IsOnCut(LonLat p) { return std::abs(std::abs(p.lon) - 180) < kOnCut; }
bool IsPole(LonLat p) { return std::abs(std::abs(p.lat) - 90) < kOnCut; }

}  // namespace

Rgb WithOpacity(Rgb color, double opacity) {
  const double share = opacity >= 0 && opacity <= 1 ? opacity : 1;
  const auto scale = [share](uint8_t channel) {
    return static_cast<uint8_t>(std::lround(channel * share));
  };
  return {scale(color.r), scale(color.g), scale(color.b)};
}

uint32_t MapLines::BeginFeature(const MapFeature& feature) {
  Feature kept{feature.line, feature.point, numbers_.size(), 0};
  for (const auto& [name, value] : feature.numbers) {
    if (!attributes_ || !std::isfinite(value)) continue;
    const auto [at, is_new] =
        name_numbers_.emplace(name, static_cast<uint32_t>(name_numbers_.size()));
    if (is_new) names_.push_back(name);
    numbers_.emplace_back(at->second, value);
  }
  kept.end = numbers_.size();
  // Features without any of these share an entry.
  if (!kept.line && !kept.point && kept.begin == kept.end) {
    return feature_ = 0;
  }
  features_.push_back(kept);
  return feature_ = static_cast<uint32_t>(features_.size() - 1);
}

absl::Status MapLines::Check(std::span<const LonLat> points) {
  for (const LonLat& p : points) {
    if (!std::isfinite(p.lon) || !std::isfinite(p.lat)) {
      return FileError(file_, absl::StrCat("holds the position (", p.lon, ", ", p.lat, ")"),
                       "coordinates must be finite");
    }
    const bool degrees = std::abs(p.lon) <= 360 && std::abs(p.lat) <= kMostLatitude;
    if (globe_ && !degrees) {
      return FileError(file_, absl::StrCat("holds the position (", p.lon, ", ", p.lat, ")"),
                       "a globe wants degrees, longitude within ±360 and latitude within ±90: "
                       "the map is projected, play it without --globe");
    }
    least_lon_ = std::min(least_lon_, p.lon);
    most_lon_ = std::max(most_lon_, p.lon);
    most_lat_ = std::max(most_lat_, std::abs(p.lat));
    if (!std::isnan(p.height) && p.height != 0) ++heights_;
  }
  if (corners_.size() + points_.positions.size() + points.size() > kMaxModelVertices) {
    return FileError(file_, "holds too many positions",
                     absl::StrCat("at most ", kMaxModelVertices, " are read"));
  }
  return absl::OkStatus();
}

uint32_t MapLines::AddVertex(LonLat p) {
  lines_.positions.push_back(globe_ ? OnSphere(p) : Point3{p.lon, p.lat, 0});
  line_features_.push_back(feature_);
  line_heights_.push_back(HeightOf(p));
  return static_cast<uint32_t>(lines_.positions.size() - 1);
}

void MapLines::AddEdge(LonLat from, LonLat to) {
  if (globe_ && ((IsOnCut(from) && IsOnCut(to)) || (IsPole(from) && IsPole(to)))) return;
  if (cut_ && std::abs(to.lon - from.lon) > 180) {
    // The same end, with its longitude continued across the cut.
    const bool is_eastward = to.lon < from.lon;
    const LonLat onward{to.lon + (is_eastward ? 360 : -360), to.lat, to.height};
    if (globe_) {
      to = onward;
    } else {
      const double right = *cut_, left = right - 360;
      const double span = onward.lon - from.lon;
      LonLat edge =
          Between(from, onward, span == 0 ? 0 : ((is_eastward ? right : left) - from.lon) / span);
      edge.lon = is_eastward ? right : left;
      if (from.lon != edge.lon) AddEdge(from, edge);
      edge.lon = is_eastward ? left : right;
      if (to.lon != edge.lon) AddEdge(edge, to);
      return;
    }
  }
  if (!has_last_ || last_ != from) AddVertex(from);
  int steps = 1;
  if (globe_) {
    const double widest = std::max(std::abs(to.lon - from.lon), std::abs(to.lat - from.lat));
    steps = std::max(1, static_cast<int>(std::ceil(widest / kStepDegrees)));
  }
  for (int i = 1; i <= steps; ++i) {
    const LonLat at = i == steps ? to : Between(from, to, static_cast<double>(i) / steps);
    const uint32_t index = AddVertex(at);
    lines_.indices.push_back(index - 1);
    lines_.indices.push_back(index);
  }
  last_ = to;
  has_last_ = true;
}

absl::Status MapLines::AddLine(std::span<const LonLat> line, bool closed) {
  absl::Status status = Check(line);
  if (!status.ok()) return status;
  if (line.size() < 2) {
    if (line.size() == 1) LeaveOut("lines of one position");
    return absl::OkStatus();
  }
  to_draw_.push_back({corners_.size(), corners_.size() + line.size(), feature_, closed});
  corners_.insert(corners_.end(), line.begin(), line.end());
  return absl::OkStatus();
}

absl::Status MapLines::AddPoint(LonLat point) {
  absl::Status status = Check({&point, 1});
  if (!status.ok()) return status;
  points_.positions.push_back(globe_ ? OnSphere(point) : Point3{point.lon, point.lat, 0});
  point_features_.push_back(feature_);
  point_heights_.push_back(HeightOf(point));
  return absl::OkStatus();
}

void MapLines::Draw(const Line& line) {
  feature_ = line.feature;
  has_last_ = false;
  const std::span<const LonLat> at(corners_.data() + line.begin, line.end - line.begin);
  for (size_t i = 1; i < at.size(); ++i) AddEdge(at[i - 1], at[i]);
  if (line.closed && at.size() > 2 && at.front() != at.back()) AddEdge(at.back(), at.front());
}

void MapLines::AddFeatures(const std::vector<uint32_t>& features, std::vector<double> heights,
                           bool points, Part* part) {
  const auto color_of = [&](uint32_t feature) {
    return points ? features_[feature].point : features_[feature].line;
  };
  if (std::any_of(features.begin(), features.end(),
                  [&](uint32_t feature) { return color_of(feature).has_value(); })) {
    for (const uint32_t feature : features)
      part->colors.push_back(color_of(feature).value_or(Rgb{255, 255, 255}));
  }
  std::vector<bool> is_used(features_.size(), false);
  for (const uint32_t feature : features) is_used[feature] = true;
  constexpr uint32_t kNone = UINT32_MAX;
  std::vector<uint32_t> places(names_.size(), kNone);  // indices of attributes
  std::vector<bool> is_skipped(names_.size(), false);
  for (size_t i = 0; i < features_.size(); ++i) {
    for (size_t k = features_[i].begin; is_used[i] && k < features_[i].end; ++k) {
      const uint32_t name = numbers_[k].first;
      if (places[name] != kNone || is_skipped[name]) continue;
      if ((part->attributes.size() + 1) * features.size() > kMostNumbers) {
        is_skipped[name] = true;
        LeaveOut("numeric properties");
        continue;
      }
      places[name] = static_cast<uint32_t>(part->attributes.size());
      part->attributes.push_back({names_[name], std::vector<double>(features.size(), kNoNumber)});
    }
  }
  for (size_t i = 0; i < features.size(); ++i) {
    const Feature& feature = features_[features[i]];
    for (size_t k = feature.begin; k < feature.end; ++k) {
      if (places[numbers_[k].first] != kNone)
        part->attributes[places[numbers_[k].first]].values[i] = numbers_[k].second;
    }
  }
  const bool is_named = std::any_of(part->attributes.begin(), part->attributes.end(),
                                    [](const Attribute& one) { return one.name == "height"; });
  if (attributes_ && heights_ > 0 && !is_named)
    part->attributes.push_back({"height", std::move(heights)});
}

absl::Status MapLines::Finish(std::string format, Model* model) && {
  // In degrees, the map's left and right edges are the same place: those at ±180, or those at 0 and
  // 360.
  const bool degrees = least_lon_ >= -360 && most_lon_ <= 360 && most_lat_ <= kMostLatitude;
  const bool around_zero = least_lon_ >= -180 && most_lon_ <= 180;
  if (degrees && !around_zero && least_lon_ >= 0) {
    cut_ = 360;
  } else if (degrees && (around_zero || globe_)) {
    cut_ = 180;
  }
  for (const Line& line : to_draw_) Draw(line);
  if (lines_.positions.size() + points_.positions.size() > kMaxModelVertices) {
    return FileError(file_, "holds too many positions",
                     absl::StrCat("at most ", kMaxModelVertices, " are drawn"));
  }
  corners_ = {};
  AddFeatures(line_features_, std::move(line_heights_), false, &lines_);
  AddFeatures(point_features_, std::move(point_heights_), true, &points_);
  if (heights_ > 0 && !attributes_) LeaveOut("heights", heights_);
  model->path = file_.path;
  model->format = std::move(format);
  model->globe = globe_;
  model->up = globe_ ? Up::kZ : Up::kY;
  for (const LeftOut& one : counted_.left_out) AddLeftOut(one.kind, one.count, model);
  if (!lines_.indices.empty()) model->parts.push_back(std::move(lines_));
  if (!points_.positions.empty()) model->parts.push_back(std::move(points_));
  if (model->parts.empty()) {
    const std::string left_out = NoteOf(counted_);
    return FileError(file_,
                     absl::StrCat("is a map with no line and no point",
                                  left_out.empty() ? "" : " that is shown", left_out),
                     "at least one is expected");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
