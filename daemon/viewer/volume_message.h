// A change of a volume as bytes for the page (docs/protocols/viewer.md §3).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/core/volume_feed.h"
#include "daemon/viewer/pixel_places.h"

namespace voxeld::daemon::viewer {

// What the first byte of a binary message says.
enum class MessageKind : uint8_t { kVolume = 1, kDark = 2, kSent = 3, kDifference = 4 };

// The slices of `change` with all their lit pixels, for the watch of that number. `change` is of the display that
// `places` is of.
std::string VolumeMessage(uint16_t watch, const VolumeFeed::Change& change, PixelPlaces& places);
// Where pixels are, lit or not (PixelPlaces::Sample).
std::string DarkMessage(uint16_t watch, PixelPlaces& places);
// Points that are of no slice in particular.
std::string PointsMessage(MessageKind kind, uint16_t watch, uint64_t volume, const Points& points);

// Appends the lit pixels of `wanted` slices; answers slice numbers and how many each has, in turns.
std::vector<uint32_t> AppendLit(const display::DecodedVolume& volume,
                                const std::vector<int32_t>& wanted, PixelPlaces& places,
                                Points* points);

}  // namespace voxeld::daemon::viewer
