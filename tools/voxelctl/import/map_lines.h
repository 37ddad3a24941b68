// Converts longitude and latitude to lines and points of a model.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Parts of styles that are left out, in several formats.
inline constexpr std::string_view kLineWidths = "widths of lines";
inline constexpr std::string_view kPointSizes = "sizes of points";
inline constexpr std::string_view kPointSymbols = "symbols of points";

// Degrees on a globe; any units on a flat map.
struct LonLat {
  double lon = 0, lat = 0;
  double height = std::numeric_limits<double>::quiet_NaN();  // not-a-number: none
  bool operator==(const LonLat& other) const { return lon == other.lon && lat == other.lat; }
};

// Properties that the lines and points of a feature have in common.
struct MapFeature {
  std::optional<Rgb> line, point;                       // colours
  std::vector<std::pair<std::string, double>> numbers;  // properties that can determine its colour
};

// Returns: `color`, darkened by its transparency, because light cannot occlude.
Rgb WithOpacity(Rgb color, double opacity);

// Collects the lines and points of one map.
//
// Globe: the unit sphere, poles on ±z, longitude 0 to the front (−y), east to the right. Edges
// follow the sphere in steps of at most 2°. Edges along the cut at ±180° or in a pole are artefacts
// of the flat map and are left out. An edge longer than 180° in longitude takes the short way
// round. Flat: x to the right, y up, in the map's own units. If the map is in degrees, an edge
// longer than 180° is split at the cut, which is at 360° if no longitude is negative and one is
// beyond 180°.
class MapLines {
 public:
  // `file` must outlive this object. Without `attributes` the model has none.
  MapLines(const SourceFile& file, bool globe, bool attributes)
      : file_(file), globe_(globe), attributes_(attributes) {}

  // Everything added from here on belongs to `feature`. Returns: a number for ResumeFeature.
  uint32_t BeginFeature(const MapFeature& feature);
  void ResumeFeature(uint32_t number) { feature_ = number; }

  // Adds one strip, or a loop if `closed`, in which the last point is connected to the first.
  // Errors: InvalidArgument if a coordinate is not finite, or not a longitude and latitude on a
  // globe, or the model becomes too large.
  absl::Status AddLine(std::span<const LonLat> line, bool closed);
  absl::Status AddPoint(LonLat point);

  // Counts contents of the map that the model does not show.
  void LeaveOut(std::string_view kind, uint64_t count = 1) { AddLeftOut(kind, count, &counted_); }

  // Writes the model, with a colour for each vertex if any feature has one (white for the others);
  // an attribute for each property that is a number in any feature; and "height" if any is not 0.
  // The heights are counted, because no line is drawn above the map. Errors: InvalidArgument if
  // nothing was added.
  absl::Status Finish(std::string format, Model* model) &&;

 private:
  // Lines are drawn when all are known, because the position of the cut depends on all of them.
  struct Line {
    size_t begin = 0, end = 0;  // of corners_
    uint32_t feature = 0;
    bool closed = false;
  };

  absl::Status Check(std::span<const LonLat> points);
  void Draw(const Line& line);
  void AddEdge(LonLat from, LonLat to);
  uint32_t AddVertex(LonLat point);
  void AddFeatures(const std::vector<uint32_t>& features, std::vector<double> heights, bool points,
                   Part* part);

  const SourceFile& file_;
  bool globe_, attributes_;
  double least_lon_ = 0, most_lon_ = 0, most_lat_ = 0;  // the last is absolute
  std::optional<double> cut_;                           // longitude of the map's right edge
  std::vector<LonLat> corners_;
  std::vector<Line> to_draw_;
  struct Feature {
    std::optional<Rgb> line, point;
    size_t begin = 0, end = 0;  // of numbers_
  };
  std::vector<Feature> features_ = {Feature()};
  std::vector<std::string> names_;                        // of properties
  std::map<std::string, uint32_t> name_numbers_;          // indices of names_
  std::vector<std::pair<uint32_t, double>> numbers_;      // name and value
  std::vector<uint32_t> line_features_, point_features_;  // per vertex
  std::vector<double> line_heights_, point_heights_;      // per vertex
  uint64_t heights_ = 0;                                  // number of heights other than 0
  uint32_t feature_ = 0;
  Part lines_{.kind = Kind::kSegments};
  Part points_{.kind = Kind::kPoints};
  Model counted_;
  LonLat last_;  // the vertex at the end of the previous edge
  bool has_last_ = false;
};

}  // namespace voxeld::voxelctl
