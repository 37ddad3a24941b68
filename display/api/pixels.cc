#include "display/api/pixels.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace voxeld::display {
namespace {

uint8_t Expand(int value, int max) { return static_cast<uint8_t>((value * 510 + max) / (2 * max)); }

// A pixel's three levels in one slice image.
struct Levels {
  int rgb[3] = {};
};

int BitAt(std::span<const std::byte> bytes, size_t byte, size_t bit) {
  return std::to_integer<int>(bytes[byte]) >> bit & 1;
}

Levels LevelsAt(const FrameLayout& layout, std::span<const std::byte> picture, size_t x, size_t y) {
  const size_t width = static_cast<size_t>(layout.width);
  const size_t height = static_cast<size_t>(layout.height);
  const size_t pixel = y * width + x;
  const size_t bits = static_cast<size_t>(layout.bits_per_channel());
  Levels levels;
  switch (layout.format) {
    case PixelFormat::kRgb888:
      for (size_t c = 0; c < 3; ++c) levels.rgb[c] = std::to_integer<int>(picture[3 * pixel + c]);
      break;
    case PixelFormat::kRgb332: {
      const int packed = std::to_integer<int>(picture[pixel]);
      levels = {{packed >> 5, packed >> 2 & 7, packed & 3}};
      break;
    }
    case PixelFormat::kBitPlanes: {
      const size_t stride = (width + 7) / 8;
      for (size_t plane = 0; plane < 3 * bits; ++plane) {
        int& level = levels.rgb[plane % 3];
        level = level << 1 | BitAt(picture, (plane * height + y) * stride + x / 8, 7 - x % 8);
      }
      break;
    }
    case PixelFormat::kHub75: {
      const size_t half = height / 2;
      for (size_t bit = 0; bit < bits; ++bit) {
        for (size_t c = 0; c < 3; ++c) {
          levels.rgb[c] = levels.rgb[c] << 1 |
                          BitAt(picture, (bit * half + y % half) * width + x, y < half ? c : c + 3);
        }
      }
      break;
    }
    case PixelFormat::kPlanes24:
      for (size_t plane = 0; plane < 24; ++plane) {
        levels.rgb[plane % 3] += BitAt(picture, 3 * pixel + plane / 8, plane % 8);
      }
      break;
  }
  return levels;
}

// Converts one slice image to 8-bit light in `rgb`.
void PictureToRgb(const FrameLayout& layout, std::span<const std::byte> picture,
                  std::span<uint8_t> rgb) {
  if (layout.format == PixelFormat::kRgb888 && layout.bits_per_channel() == 8) {
    std::memcpy(rgb.data(), picture.data(), rgb.size());
    return;
  }
  const int most = layout.format == PixelFormat::kPlanes24 ? kProjectorParts
                                                           : (1 << layout.bits_per_channel()) - 1;
  const int most_of[3] = {most, most, layout.format == PixelFormat::kRgb332 ? 3 : most};
  size_t at = 0;
  for (size_t y = 0; y < static_cast<size_t>(layout.height); ++y) {
    for (size_t x = 0; x < static_cast<size_t>(layout.width); ++x) {
      const Levels levels = LevelsAt(layout, picture, x, y);
      for (size_t c = 0; c < 3; ++c)
        rgb[at++] = Expand(std::min(levels.rgb[c], most_of[c]), most_of[c]);
    }
  }
}

}  // namespace

void SliceToRgb(const FrameLayout& layout, std::span<const std::span<const std::byte>> pictures,
                std::span<uint8_t> rgb) {
  if (pictures.size() == 1) return PictureToRgb(layout, pictures[0], rgb);
  std::vector<uint32_t> sums(rgb.size());
  for (const std::span<const std::byte> picture : pictures) {
    PictureToRgb(layout, picture, rgb);
    for (size_t i = 0; i < rgb.size(); ++i) sums[i] += rgb[i];
  }
  const uint32_t count = static_cast<uint32_t>(pictures.size());
  for (size_t i = 0; i < rgb.size(); ++i) {
    rgb[i] = static_cast<uint8_t>((2 * sums[i] + count) / (2 * count));
  }
}

namespace {

uint64_t BitsIn(std::span<const std::byte> bytes, uint64_t mask) {
  uint64_t count = 0;
  size_t at = 0;
  for (; at + sizeof(uint64_t) <= bytes.size(); at += sizeof(uint64_t)) {
    uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, sizeof(word));
    count += static_cast<uint64_t>(std::popcount(word & mask));
  }
  for (; at < bytes.size(); ++at) {
    const auto byte = std::to_integer<uint64_t>(bytes[at]);
    count += static_cast<uint64_t>(std::popcount(byte & mask));
  }
  return count;
}

uint64_t SumOf(std::span<const std::byte> bytes) {
  uint64_t sum = 0;
  for (const std::byte byte : bytes) sum += std::to_integer<uint64_t>(byte);
  return sum;
}

}  // namespace

double LightOf(const FrameLayout& layout, std::span<const std::byte> picture) {
  const double channels = 3.0 * layout.width * layout.height;
  const auto bits = static_cast<size_t>(layout.bits_per_channel());
  const double most = static_cast<double>((1u << bits) - 1);
  switch (layout.format) {
    case PixelFormat::kRgb888:
      return static_cast<double>(SumOf(picture)) / (most * channels);
    case PixelFormat::kRgb332: {
      double sum = 0;
      for (const std::byte byte : picture) {
        const int v = std::to_integer<int>(byte);
        sum += ((v >> 5) + (v >> 2 & 7)) / 7.0 + (v & 3) / 3.0;
      }
      return sum / channels;
    }
    case PixelFormat::kBitPlanes:
    case PixelFormat::kHub75: {
      // Planes of one weight lie together, the highest first; in HUB75, six bits of a byte are
      // lights.
      const uint64_t mask =
          layout.format == PixelFormat::kHub75 ? 0x3F3F3F3F3F3F3F3F : ~uint64_t{0};
      const size_t size = picture.size() / bits;
      double sum = 0;
      for (size_t bit = 0; bit < bits; ++bit) {
        const auto weight = static_cast<double>(1u << (bits - 1 - bit));
        sum += weight * static_cast<double>(BitsIn(picture.subspan(bit * size, size), mask));
      }
      return sum / (most * channels);
    }
    case PixelFormat::kPlanes24:
      return static_cast<double>(BitsIn(picture, ~uint64_t{0})) / (kProjectorParts * channels);
  }
  return 0;
}

std::vector<uint8_t> FrameToRgb(const SliceFrame& frame) {
  const FrameLayout& layout = frame.layout;
  const size_t per_slice =
      static_cast<size_t>(layout.width) * static_cast<size_t>(layout.height) * 3;
  const size_t subs = static_cast<size_t>(layout.sub_frames);
  std::vector<uint8_t> rgb(per_slice * static_cast<size_t>(layout.slices));
  std::vector<std::span<const std::byte>> pictures(subs);
  for (size_t slice = 0; slice < static_cast<size_t>(layout.slices); ++slice) {
    for (size_t sub = 0; sub < subs; ++sub) {
      pictures[sub] =
          std::span(frame.bytes)
              .subspan((slice * subs + sub) * layout.bytes_per_slice(), layout.bytes_per_slice());
    }
    SliceToRgb(layout, pictures, std::span(rgb).subspan(slice * per_slice, per_slice));
  }
  return rgb;
}

}  // namespace voxeld::display
