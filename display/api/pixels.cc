#include "display/api/pixels.h"

namespace voxeld::display {
namespace {

uint8_t Expand(int value, int max) { return static_cast<uint8_t>((value * 510 + max) / (2 * max)); }

// One picture as 8-bit light into `rgb`.
void PictureToRgb(const FrameLayout& layout, std::span<const std::byte> picture,
                  std::span<uint8_t> rgb) {
  const size_t width = static_cast<size_t>(layout.width);
  const size_t height = static_cast<size_t>(layout.height);
  switch (layout.format) {
    case PixelFormat::kRgb888:
      for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = std::to_integer<uint8_t>(picture[i]);
      return;
    case PixelFormat::kRgb332:
      for (size_t i = 0; i < width * height; ++i) {
        const int packed = std::to_integer<int>(picture[i]);
        rgb[3 * i] = Expand(packed >> 5, 7);
        rgb[3 * i + 1] = Expand((packed >> 2) & 7, 7);
        rgb[3 * i + 2] = Expand(packed & 3, 3);
      }
      return;
    case PixelFormat::kBitPlanes3: {
      const size_t stride = (width + 7) / 8;
      for (size_t plane = 0; plane < 3; ++plane) {
        for (size_t y = 0; y < height; ++y) {
          const std::byte* row = picture.data() + (plane * height + y) * stride;
          for (size_t x = 0; x < width; ++x) {
            const int bit = std::to_integer<int>(row[x / 8]) >> (7 - x % 8) & 1;
            rgb[(y * width + x) * 3 + plane] = bit != 0 ? 255 : 0;
          }
        }
      }
      return;
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
