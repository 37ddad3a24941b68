// How a frame lies in a segment on its way from a worker, and how it is looked through and copied.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "display/api/slice_frame.h"
#include "gpu/cpu/executor.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// The numbers of all the layout's pictures, then their bytes, also where the engine owns a part: of
// the rest nobody writes anything, so it costs nothing.
struct FrameSlot {
  size_t pictures = 0, bytes = 0;
  size_t size() const { return pictures * sizeof(uint64_t) + bytes; }
  FrameBuffer In(std::span<std::byte> segment) const;
};

// The pictures of some slices, [begin, end).
struct PictureRange {
  size_t begin = 0, end = 0;
  static PictureRange Of(const display::FrameLayout& layout, SliceRange slices);
};
// Their bytes in a buffer.
std::span<std::byte> BytesOf(const display::FrameLayout& layout, const FrameBuffer& buffer,
                             PictureRange pictures);

// To look through frames of so many bytes: several threads only where that is worth it.
std::unique_ptr<Executor> MakeFrameExecutor(size_t bytes);

// A CRC-32C of the pictures' numbers and of what each that is newer than `holds` has.
uint32_t FrameCrc(const display::FrameLayout& layout, const FrameBuffer& buffer,
                  PictureRange pictures, uint64_t holds, Executor& executor);

// The same of `from`, and in the same go the numbers, and the pictures that are newer than what `to`
// holds, into `to`.
uint32_t CopyFrame(const display::FrameLayout& layout, const FrameBuffer& from, uint64_t from_holds,
                   PictureRange pictures, const FrameBuffer& to, uint64_t to_holds,
                   Executor& executor);

}  // namespace voxeld::gpu
