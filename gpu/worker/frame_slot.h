// The layout of a frame in a segment on its way from a worker, and how it is checked and copied.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "display/api/slice_frame.h"
#include "gpu/cpu/executor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// The numbers of all the layout's slice images, then their bytes, even if the engine owns a part:
// the rest is never written, so it takes no memory.
struct FrameSlot {
  size_t pictures = 0, bytes = 0;
  size_t size() const { return pictures * sizeof(uint64_t) + bytes; }
  FrameBuffer In(std::span<std::byte> segment) const;
};

// The slice images of some slices, [begin, end).
struct PictureRange {
  size_t begin = 0, end = 0;
  static PictureRange Of(const display::FrameLayout& layout, SliceRange slices);
};
// Returns their bytes in a buffer.
std::span<std::byte> BytesOf(const display::FrameLayout& layout, const FrameBuffer& buffer,
                             PictureRange pictures);

// Returns an executor that checks frames of `bytes` bytes: it has several threads only if that is
// worth it.
std::unique_ptr<Executor> MakeFrameExecutor(size_t bytes);

// Returns a CRC-32C of the slice images' numbers and of the bytes of each one that is newer than
// `holds`.
uint32_t FrameCrc(const display::FrameLayout& layout, const FrameBuffer& buffer,
                  PictureRange pictures, uint64_t holds, Executor& executor);

// Returns the same for `from`, and in the same pass copies to `to` the numbers, and the slice
// images that are newer than those that `to` holds.
uint32_t CopyFrame(const display::FrameLayout& layout, const FrameBuffer& from, uint64_t from_holds,
                   PictureRange pictures, const FrameBuffer& to, uint64_t to_holds,
                   Executor& executor);

}  // namespace voxeld::gpu
