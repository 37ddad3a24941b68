// Separates the payloads of a message before the generated parser runs, so that positions, colours
// and indices are copied once, directly to their destination, and not first into the parser's
// strings.
//
// Every payload (the three bytes fields of voxeld.v1.Vertices, wherever they occur) is replaced by
// a token; everything else stays. The parser alone therefore determines what a message means:
// repeated occurrences, oneofs, unknown fields and invalid UTF-8 are handled as usual.
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
  PayloadTable payloads;  // views into the slices
};

// Returns: false if `out` must not be used and the parser must get the original message. This is so
// for anything but plain, well-formed protobuf (including groups, which the protocol does not use),
// and if the payloads are too small to save work.
bool MakeSkeleton(std::span<const std::string_view> slices, Root root, Skeleton* out);

}  // namespace voxeld::daemon::wire
