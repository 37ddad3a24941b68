// A message without its payloads: what the generated parser is given instead of the bytes that came,
// so that positions, colours and indices are copied once, to where they are kept, and not into the
// parser's strings first.
//
// Every payload (the three bytes fields of voxeld.v1.Vertices, wherever they occur) is replaced by a
// token; all else stays. So the parser alone decides what a message means: repeated occurrences,
// oneofs, unknown fields and text that is not UTF-8 are dealt with as ever.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "daemon/wire/payload.h"

namespace voxeld::daemon::wire {

enum class Root : uint8_t { kStreamRequest, kApplyUpdateRequest };

struct Skeleton {
  std::string bytes;
  PayloadTable payloads;  // views of the slices
};

// False: `out` is not to be used, and the parser is to be given what came. So it is for everything
// that is not plain, well-formed protobuf (groups too, which no message of ours has), and where
// payloads are so small that it is not worth while.
bool MakeSkeleton(std::span<const std::string_view> slices, Root root, Skeleton* out);

}  // namespace voxeld::daemon::wire
