// Decodes the operations of a StreamRequest individually.
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

// Appends the operations of `request` (which is not an Open) to `out`, numbered `sequence`. `path`
// is that of the request.
void DecodeOperation(const FieldPath& path, const v1::StreamRequest& request, uint64_t sequence,
                     const DecodeContext& context, const Sinks& out);

}  // namespace voxeld::daemon::wire
