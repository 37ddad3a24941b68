// Converts closed curves: polygons and boundaries (voxeld.v1.Boundary).
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

// Checks the numbers of points and where each ring ends, and returns them.
MaybeFault ToRings(const FieldPath& path, const google::protobuf::RepeatedField<double>& points,
                   const google::protobuf::RepeatedField<uint32_t>& ends, const Limits& limits,
                   std::vector<uint32_t>* out);

// Maximum distance between a smooth curve and the lines that represent it, as a fraction of the
// boundary's extent across its axis.
inline constexpr double kBoundaryError = 1.0 / 4096;

// Fills in the source's axis and ends, and the points of the lines.
MaybeFault ToBoundary(const FieldPath& path, const v1::Boundary& in, const Limits& limits,
                      gpu::implicit::ProgramSource* source, std::vector<uint32_t>* ends,
                      std::vector<float>* points);

}  // namespace voxeld::daemon::wire
