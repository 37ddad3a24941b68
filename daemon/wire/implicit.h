// Implicit shapes (voxeld.v1.Implicit) into programs that engines run.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Implicit;
}

namespace voxeld::daemon::wire {

// Fills record, program and bounds of `out`, all but the colour.
MaybeFault ToImplicit(const FieldPath& path, const v1::Implicit& in, const DecodeContext& context,
                      GeometryData* out);

}  // namespace voxeld::daemon::wire
