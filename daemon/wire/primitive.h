// Converts primitives (voxeld.v1.Primitive) to content that the core stores and the engine draws.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Primitive;
}

namespace voxeld::daemon::wire {

MaybeFault ToContent(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                     Content* out);

}  // namespace voxeld::daemon::wire
