#include "tools/voxelctl/import/map_lines.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kStepDegrees = 2;
constexpr double kOnCut = 1e-9;

Point3 OnSphere(LonLat p) {
  const double lon = p.lon * std::numbers::pi / 180, lat = p.lat * std::numbers::pi / 180;
  return {std::cos(lat) * std::sin(lon), -std::cos(lat) * std::cos(lon), std::sin(lat)};
}

bool IsOnCut(LonLat p) { return std::abs(std::abs(p.lon) - 180) < kOnCut; }
bool IsPole(LonLat p) { return std::abs(std::abs(p.lat) - 90) < kOnCut; }

}  // namespace

absl::Status MapLines::Check(std::span<const LonLat> points) {
  for (const LonLat& p : points) {
    if (!std::isfinite(p.lon) || !std::isfinite(p.lat)) {
      return FileError(file_, absl::StrCat("holds the position (", p.lon, ", ", p.lat, ")"),
                       "coordinates must be finite");
    }
    const bool degrees = std::abs(p.lon) <= 360 && std::abs(p.lat) <= 90 + kOnCut;
    if (globe_ && !degrees) {
      return FileError(file_, absl::StrCat("holds the position (", p.lon, ", ", p.lat, ")"),
                       "a globe wants degrees, longitude within ±360 and latitude within ±90: "
                       "the map is projected, play it without --globe");
    }
    degrees_ = degrees_ && degrees;
  }
  if (lines_.positions.size() + points_.positions.size() + points.size() > kMaxModelVertices) {
    return FileError(file_, "holds too many positions",
                     absl::StrCat("at most ", kMaxModelVertices, " are read"));
  }
  return absl::OkStatus();
}

uint32_t MapLines::AddVertex(LonLat p) {
  lines_.positions.push_back(globe_ ? OnSphere(p) : Point3{p.lon, p.lat, 0});
  return static_cast<uint32_t>(lines_.positions.size() - 1);
}

void MapLines::AddEdge(LonLat from, LonLat to) {
  if (globe_ && ((IsOnCut(from) && IsOnCut(to)) || (IsPole(from) && IsPole(to)))) return;
  if (degrees_ && std::abs(to.lon - from.lon) > 180) {
    // The same end, counted on over the cut.
    const double turn = to.lon > from.lon ? -360 : 360;
    const LonLat onward{to.lon + turn, to.lat};
    if (globe_) {
      to = onward;
    } else {
      const double cut = turn > 0 ? 180 : -180;
      const double span = onward.lon - from.lon;
      const double lat =
          span == 0 ? from.lat : from.lat + (to.lat - from.lat) * ((cut - from.lon) / span);
      if (std::abs(from.lon) <= 180 && std::abs(to.lon) <= 180) {
        AddEdge(from, {cut, lat});
        AddEdge({-cut, lat}, to);
        return;
      }
    }
  }
  if (!has_last_ || last_ != from) AddVertex(from);
  int steps = 1;
  if (globe_) {
    const double widest = std::max(std::abs(to.lon - from.lon), std::abs(to.lat - from.lat));
    steps = std::max(1, static_cast<int>(std::ceil(widest / kStepDegrees)));
  }
  for (int i = 1; i <= steps; ++i) {
    const double t = static_cast<double>(i) / steps;
    const LonLat at =
        i == steps ? to
                   : LonLat{from.lon + (to.lon - from.lon) * t, from.lat + (to.lat - from.lat) * t};
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
  has_last_ = false;
  for (size_t i = 1; i < line.size(); ++i) AddEdge(line[i - 1], line[i]);
  if (closed && line.size() > 2 && line.front() != line.back()) AddEdge(line.back(), line.front());
  return absl::OkStatus();
}

absl::Status MapLines::AddPoint(LonLat point) {
  absl::Status status = Check({&point, 1});
  if (!status.ok()) return status;
  points_.positions.push_back(globe_ ? OnSphere(point) : Point3{point.lon, point.lat, 0});
  return absl::OkStatus();
}

absl::Status MapLines::Finish(std::string format, Model* model) && {
  model->path = file_.path;
  model->format = std::move(format);
  model->globe = globe_;
  model->up = globe_ ? Up::kZ : Up::kY;
  if (!lines_.indices.empty()) model->parts.push_back(std::move(lines_));
  if (!points_.positions.empty()) model->parts.push_back(std::move(points_));
  if (model->parts.empty()) {
    return FileError(file_, "is a map with no line and no point", "at least one is expected");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
