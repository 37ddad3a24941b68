// Converts implicit shapes (voxeld.v1.Implicit) to programs that engines run.
#pragma once

#include <vector>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "gpu/implicit/graph.h"

namespace voxeld::v1 {
class Implicit;
}

namespace voxeld::daemon::wire {

// Compiles the graph; fills kind, counts and arrays of `out`.
MaybeFault ToProgram(const FieldPath& path, const gpu::implicit::Graph& graph,
                     const gpu::implicit::ProgramSource& source,
                     const std::vector<float>& ring_points, GeometryData* out);

// Fills record, program and bounds of `out`, but not the colour.
MaybeFault ToImplicit(const FieldPath& path, const v1::Implicit& in, const DecodeContext& context,
                      GeometryData* out);

}  // namespace voxeld::daemon::wire
