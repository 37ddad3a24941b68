#include "daemon/viewer/volume_message.h"

#include <bit>
#include <cstring>
#include <utility>
#include <vector>

namespace voxeld::daemon::viewer {
namespace {

static_assert(std::endian::native == std::endian::little);

struct Header {
  MessageKind kind;
  uint8_t whole;
  uint16_t watch;
  uint32_t slices, points, reserved;
  uint64_t volume;
};
static_assert(sizeof(Header) == 24);

template <typename T>
void Put(std::string& out, const std::vector<T>& values) {
  out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

// `slices` alternates slice numbers and numbers of points.
std::string Message(Header header, const std::vector<uint32_t>& slices, const Points& points) {
  header.slices = static_cast<uint32_t>(slices.size() / 2);
  header.points = static_cast<uint32_t>(points.size());
  std::string out;
  out.reserve(sizeof(header) + slices.size() * 4 + points.size() * 9 + 4);
  out.append(reinterpret_cast<const char*>(&header), sizeof(header));
  Put(out, slices);
  Put(out, points.x);
  Put(out, points.y);
  Put(out, points.z);
  Put(out, points.rgb);
  return out;
}

}  // namespace

std::vector<uint32_t> AppendLit(const display::DecodedVolume& volume,
                                const std::vector<int32_t>& wanted, PixelPlaces& places,
                                Points* points) {
  std::vector<uint32_t> slices;
  const auto each = static_cast<size_t>(places.width()) * static_cast<size_t>(places.height()) * 3;
  for (size_t i = 0; i < wanted.size();) {
    // Unpacks a run of consecutive slices at once, up to a few megabytes.
    const int32_t first = wanted[i];
    const size_t most = std::max<size_t>(1, (size_t{4} << 20) / each);
    size_t count = 1;
    while (count < most && i + count < wanted.size() &&
           wanted[i + count] == first + static_cast<int32_t>(count)) {
      ++count;
    }
    const std::vector<uint8_t> rgb = volume.Rgb(first, static_cast<int32_t>(count));
    for (size_t n = 0; n < count; ++n) {
      const int32_t slice = first + static_cast<int32_t>(n);
      slices.push_back(static_cast<uint32_t>(slice));
      slices.push_back(static_cast<uint32_t>(
          places.Append(slice, std::span(rgb).subspan(n * each, each), points)));
    }
    i += count;
  }
  return slices;
}

std::string VolumeMessage(uint16_t watch, const VolumeFeed::Change& change, PixelPlaces& places) {
  Points points;
  const std::vector<uint32_t> slices = AppendLit(change.volume, change.slices, places, &points);
  return Message({.kind = MessageKind::kVolume,
                  .whole = change.whole,
                  .watch = watch,
                  .volume = change.volume.volume},
                 slices, points);
}

std::string DarkMessage(uint16_t watch, PixelPlaces& places) {
  return Message({.kind = MessageKind::kDark, .whole = true, .watch = watch, .volume = 0}, {},
                 places.Sample());
}

std::string PointsMessage(MessageKind kind, uint16_t watch, uint64_t volume, const Points& points) {
  return Message({.kind = kind, .whole = true, .watch = watch, .volume = volume},
                 {0, static_cast<uint32_t>(points.size())}, points);
}

}  // namespace voxeld::daemon::viewer
