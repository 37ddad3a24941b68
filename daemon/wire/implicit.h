// Implicit shapes (voxeld.v1.Implicit) into programs that engines run.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <cstdint>
#include <vector>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "gpu/implicit/graph.h"

namespace voxeld::v1 {
class Implicit;
}

namespace voxeld::daemon::wire {

// Closed curves: checks the numbers of their points, and where each ends, and answers these.
MaybeFault ToRings(const FieldPath& path, const google::protobuf::RepeatedField<double>& points,
                   const google::protobuf::RepeatedField<uint32_t>& ends, const Limits& limits,
                   std::vector<uint32_t>* out);
// Compiles; fills kind, counts and arrays of `out`.
MaybeFault ToProgram(const FieldPath& path, const gpu::implicit::Graph& graph,
                     const gpu::implicit::ProgramSource& source,
                     const std::vector<float>& ring_points, GeometryData* out);

// Fills record, program and bounds of `out`, all but the colour.
MaybeFault ToImplicit(const FieldPath& path, const v1::Implicit& in, const DecodeContext& context,
                      GeometryData* out);

}  // namespace voxeld::daemon::wire
