// Reads the clip of a layer (voxeld.v1.Clip).
#pragma once

#include "daemon/wire/check.h"

namespace voxeld::v1 {
class Clip;
}

namespace voxeld::daemon::wire {

MaybeFault ToClip(const FieldPath& path, const v1::Clip& in, const Limits& limits, Clip* out);

}  // namespace voxeld::daemon::wire
