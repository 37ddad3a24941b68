// Longitude and latitude to lines and points of a model.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Degrees on a globe; any units on a flat map.
struct LonLat {
  double lon = 0, lat = 0;
  bool operator==(const LonLat&) const = default;
};

// Collects the lines and points of one map.
//
// Globe: the unit sphere, poles on ±z, longitude 0 to the front (−y), east to the right. Edges
// follow the sphere in steps of at most 2°; those that run along the cut at ±180° or lie in a pole
// belong to the paper, not the Earth, and are left out. An edge longer than 180° in longitude goes
// the short way round. Flat: x to the right, y up, in the map's own units. If the map is in
// degrees, an edge longer than 180° is split at the cut.
class MapLines {
 public:
  // `file` must outlive it.
  MapLines(const SourceFile& file, bool globe) : file_(file), globe_(globe) {}

  // One strip, or a loop if `closed`: its last point goes on to its first.
  // InvalidArgument if a coordinate is not finite, or no longitude and latitude on a globe,
  // or the model becomes too large.
  absl::Status AddLine(std::span<const LonLat> line, bool closed);
  absl::Status AddPoint(LonLat point);

  // InvalidArgument if nothing was added.
  absl::Status Finish(std::string format, Model* model) &&;

 private:
  absl::Status Check(std::span<const LonLat> points);
  void AddEdge(LonLat from, LonLat to);
  uint32_t AddVertex(LonLat point);

  const SourceFile& file_;
  bool globe_;
  bool degrees_ = true;  // as long as every coordinate could be degrees
  Part lines_{.kind = Kind::kSegments};
  Part points_{.kind = Kind::kPoints};
  LonLat last_;  // the vertex that ended the edge before
  bool has_last_ = false;
};

}  // namespace voxeld::voxelctl
