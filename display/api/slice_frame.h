// The pixels of one volume, packed in the display's format.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "display/api/frame_layout.h"

namespace voxeld::display {

// The bytes of one slice image, layout.bytes_per_slice() of them; shared between volumes that have
// it in common.
using Picture = std::shared_ptr<const std::vector<std::byte>>;

// One volume. Immutable once handed over.
struct SliceFrame {
  // Numbers ascend from 1; volumes that came out unchanged, or failed, are skipped.
  uint64_t volume = 0;
  FrameLayout layout;
  std::vector<std::byte> bytes;  // layout.bytes(): image after image
  // layout.pictures(): the volume in which each slice image last changed.
  std::vector<uint64_t> changed_in;
};

using SliceFramePtr = std::shared_ptr<const SliceFrame>;

}  // namespace voxeld::display
