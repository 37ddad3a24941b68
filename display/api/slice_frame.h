// The pixels of one volume, packed as the display wants them. Words only.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace voxeld::display {

enum class PixelFormat : uint8_t {
  kRgb888 = 0,  // R, G, B bytes; row-major
  kRgb332 = 1,  // one byte: R in bits 7–5, G in 4–2, B in 1–0
  // Three planes R, G, B, a bit a pixel; each row padded to a byte, first pixel in bit 7.
  kBitPlanes3 = 2,
};

// How a slice pixel takes its colour from the voxels of its footprint.
enum class Sampling : uint8_t {
  kMax = 0,       // the voxel whose bit-interleaved colour is greatest
  kWeighted = 1,  // a channel: the greatest (weight·c + 127)/255 (depth anti-aliasing)
};

enum class Dither : uint8_t {
  kNone = 0,     // round to the nearest level
  kOrdered = 1,  // 8×8 ordered, by absolute pixel and sub-frame
};

struct FrameLayout {
  int32_t slices = 0;
  int32_t width = 0, height = 0;
  int32_t sub_frames = 1;  // 1 to 64: pictures of each slice in one volume, for dither over time
  PixelFormat format = PixelFormat::kRgb888;

  // Of one slice in one sub-frame.
  size_t bytes_per_slice() const {
    const size_t w = static_cast<size_t>(width), h = static_cast<size_t>(height);
    switch (format) {
      case PixelFormat::kRgb888:
        return w * h * 3;
      case PixelFormat::kRgb332:
        return w * h;
      case PixelFormat::kBitPlanes3:
        return (w + 7) / 8 * h * 3;
    }
    return 0;
  }
  // Pictures in a volume; picture (slice, sub) has index slice·sub_frames + sub.
  size_t pictures() const { return static_cast<size_t>(slices) * static_cast<size_t>(sub_frames); }
  size_t bytes() const { return pictures() * bytes_per_slice(); }
  bool operator==(const FrameLayout&) const = default;
};

// Brightness curve from a voxel's 8-bit channel to linear light, by table: 0 → 0, 65535 = full.
struct Tone {
  std::array<uint16_t, 256> lut{};
  Dither dither = Dither::kOrdered;
  Sampling sampling = Sampling::kMax;
  bool operator==(const Tone&) const = default;
};

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
