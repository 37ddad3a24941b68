// Packets of the Fadecandy (docs/protocols/fadecandy.md §2 to §5), appended to a transfer: whole
// packets of 64 bytes, whose unused bytes are 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "display/drivers/fadecandy/protocol.h"
#include "display/usb/transfer_bytes.h"

namespace voxeld::display::fadecandy {

// Appends packets [begin, end) of a frame, at most kFramePackets; the last one has FINAL. `rgb` is
// the whole frame: kFrameBytes.
void AppendFrame(TransferBytes& out, std::span<const std::byte> rgb, size_t begin, size_t end);

void AppendLut(TransferBytes& out, const Lut& lut);

// `flags`: bits of ConfigFlag.
void AppendConfig(TransferBytes& out, uint8_t flags);

// The part of a frame's bytes in packet `index`: at the same offset for reader and writer.
constexpr size_t FrameOffset(size_t index) { return index * kPixelsPerPacket * 3; }
constexpr size_t FrameLength(size_t index) {
  const size_t left = kFrameBytes - FrameOffset(index);
  return left < kPixelsPerPacket * 3 ? left : kPixelsPerPacket * 3;
}

}  // namespace voxeld::display::fadecandy
