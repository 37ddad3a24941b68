// Closed curves: of polygons, and of boundaries (voxeld.v1.Boundary).
#pragma once

#include <google/protobuf/repeated_field.h>

#include <cstdint>
#include <vector>

#include "daemon/wire/check.h"
#include "gpu/implicit/graph.h"

namespace voxeld::v1 {
class Boundary;
}

namespace voxeld::daemon::wire {

// Checks the numbers of their points, and where each ends, and answers these.
MaybeFault ToRings(const FieldPath& path, const google::protobuf::RepeatedField<double>& points,
                   const google::protobuf::RepeatedField<uint32_t>& ends, const Limits& limits,
                   std::vector<uint32_t>* out);

// No line that stands for a smooth curve is farther from it than this part of the boundary's extent, across its axis.
inline constexpr double kBoundaryError = 1.0 / 4096;

// Fills in the source's axis and ends, and the points of lines.
MaybeFault ToBoundary(const FieldPath& path, const v1::Boundary& in, const Limits& limits,
                      gpu::implicit::ProgramSource* source, std::vector<uint32_t>* ends,
                      std::vector<float>* points);

}  // namespace voxeld::daemon::wire
