// The pixels of one volume, packed as the display wants them. Words only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "display/api/frame_layout.h"

namespace voxeld::display {

// One picture's bytes, layout.bytes_per_slice() of them;
// shared between volumes that have it in common.
using Picture = std::shared_ptr<const std::vector<std::byte>>;

// One volume. Immutable once handed over.
struct SliceFrame {
  // Numbers ascend from 1; those of volumes that came out unchanged, or to nothing, are left out.
  uint64_t volume = 0;
  FrameLayout layout;
  std::vector<std::byte> bytes;  // layout.bytes(): picture after picture
  // layout.pictures(): the volume in which each picture last changed.
  std::vector<uint64_t> changed_in;
};

using SliceFramePtr = std::shared_ptr<const SliceFrame>;

}  // namespace voxeld::display
