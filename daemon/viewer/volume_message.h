// Encodes changes of a volume for the page (docs/protocols/viewer.md §3).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/volume_feed.h"
#include "daemon/viewer/pixel_places.h"

namespace voxeld::daemon::viewer {

// The first byte of a binary message.
enum class MessageKind : uint8_t { kVolume = 1, kDark = 2, kSent = 3, kDifference = 4 };

// Returns: the slices of `change` with all their lit pixels, for the watch `watch`. Requires:
// `change` and `places` belong to the same display.
std::string VolumeMessage(uint16_t watch, const VolumeFeed::Change& change, PixelPlaces& places);
// Returns: places of pixels, lit or not (PixelPlaces::Sample).
std::string DarkMessage(uint16_t watch, PixelPlaces& places);
// Returns: a message with points that belong to no particular slice.
std::string PointsMessage(MessageKind kind, uint16_t watch, uint64_t volume, const Points& points);

// Appends the lit pixels of the `wanted` slices. Returns: alternating slice numbers and numbers of
// pixels.
std::vector<uint32_t> AppendLit(const display::DecodedVolume& volume,
                                const std::vector<int32_t>& wanted, PixelPlaces& places,
                                Points* points);

}  // namespace voxeld::daemon::viewer
