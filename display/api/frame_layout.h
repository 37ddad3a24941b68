// The pixel packing of a volume, and how pixels take their light. Plain data with few headers: the
// engines' kernels include it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace voxeld::display {

enum class PixelFormat : uint8_t {
  kRgb888 = 0,  // R, G, B: a byte each, levels from 0; row-major
  kRgb332 = 1,  // one byte: R in bits 7–5, G in 4–2, B in 1–0
  // One bit per pixel, each row padded to a byte, first pixel in bit 7: the planes of the highest
  // bit of R, of G and of B, then of the next lower bit. Each is shown for a time proportional to
  // its bit's value (binary code modulation).
  kBitPlanes = 2,
  // Rows v and v + height/2 (height is even) side by side, as LED panels with a HUB75 connector are
  // shifted: a byte for two pixels, bits 0 to 2 the upper row's R, G and B, bits 3 to 5 the
  // lower's. All of the highest bit, then of the next lower.
  kHub75 = 3,
  // 24 one-bit planes in a 24-bit image, as projectors take them: bit 3·t + c of a pixel is channel
  // c in part t of the eight parts of the sub-frame; bits 0–7 are in the first byte. Dithering is
  // over all parts.
  kPlanes24 = 4,
};
inline constexpr uint8_t kPixelFormats = 5;
inline constexpr int32_t kProjectorParts = 8;  // parts of a sub-frame in kPlanes24

// How a slice pixel takes its colour from the voxels of its footprint.
enum class Sampling : uint8_t {
  kMax = 0,       // the voxel whose bit-interleaved colour is greatest
  kWeighted = 1,  // per channel: the greatest (weight·c + 127)/255 (depth anti-aliasing)
};

enum class Dither : uint8_t {
  kNone = 0,     // round to the nearest level
  kOrdered = 1,  // 8×8 ordered, by absolute pixel and sub-frame
  // 64×64 blue noise by void and cluster, by absolute pixel, slice and sub-frame.
  kBlueNoise = 2,
};

struct FrameLayout {
  int32_t slices = 0;
  int32_t width = 0, height = 0;
  int32_t sub_frames = 1;  // 1 to 64: images of each slice in one volume, for dither over time
  PixelFormat format = PixelFormat::kRgb888;
  // Bits per channel, 1 to 8; 0: the format's default, 8 for kRgb888, 3 for kRgb332 (blue has one
  // less), else 1. kRgb332 and kPlanes24 allow no other value.
  int32_t bits = 0;

  int32_t bits_per_channel() const {
    if (bits != 0) return bits;
    return format == PixelFormat::kRgb888 ? 8 : format == PixelFormat::kRgb332 ? 3 : 1;
  }
  // Bytes of one slice in one sub-frame.
  size_t bytes_per_slice() const {
    const size_t w = static_cast<size_t>(width), h = static_cast<size_t>(height);
    switch (format) {
      case PixelFormat::kRgb888:
        return w * h * 3;
      case PixelFormat::kRgb332:
        return w * h;
      case PixelFormat::kBitPlanes:
        return (w + 7) / 8 * h * 3 * static_cast<size_t>(bits_per_channel());
      case PixelFormat::kHub75:
        return w * (h / 2) * static_cast<size_t>(bits_per_channel());
      case PixelFormat::kPlanes24:
        return w * h * 3;
    }
    return 0;
  }
  // Slice images in a volume; image (slice, sub) has index slice·sub_frames + sub.
  size_t pictures() const { return static_cast<size_t>(slices) * static_cast<size_t>(sub_frames); }
  size_t bytes() const { return pictures() * bytes_per_slice(); }
  bool operator==(const FrameLayout&) const = default;
};

// How much the light of a slice pixel is reduced, so that a volume is evenly bright.
enum class Density : uint8_t {
  kFull = 0,  // not at all
  // Crowded pixels, such as those near a rotor's axis, are dimmed until every place has as much
  // light as the sparsest. One pixel of every voxel stays bright enough to light it alone
  // (display/geometry/density.h).
  kEven = 1,
};

// Tables that map a voxel's 8-bit channel to linear light: 0 → 0, 65535 = full. Red, green, blue.
struct Tone {
  using Curve = std::array<uint16_t, 256>;
  std::array<Curve, 3> lut{};
  Dither dither = Dither::kOrdered;
  Sampling sampling = Sampling::kMax;
  Density density = Density::kFull;

  // Returns the curve of light proportional to the channel.
  static constexpr Curve Linear() {
    Curve curve{};
    for (size_t c = 0; c < curve.size(); ++c) curve[c] = static_cast<uint16_t>(c * 257);
    return curve;
  }
  // Uses one curve for all channels.
  void SetCurve(const Curve& curve) { lut = {curve, curve, curve}; }
  bool operator==(const Tone&) const = default;
};

}  // namespace voxeld::display
