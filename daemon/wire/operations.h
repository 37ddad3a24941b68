// The operations of a StreamRequest, one by one.
#pragma once

#include <vector>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class StreamRequest;
}

namespace voxeld::daemon::wire {

struct Sinks {
  std::vector<Operation>* operations;
  Refusals* refused;
};

// Appends what `request` asks for (anything but an Open) to `out`, under `sequence`. `path` is that
// of the request itself.
void DecodeOperation(const FieldPath& path, const v1::StreamRequest& request, uint64_t sequence,
                     const DecodeContext& context, const Sinks& out);

}  // namespace voxeld::daemon::wire
