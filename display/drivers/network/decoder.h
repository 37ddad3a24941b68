// Rebuilds volumes from outgoing packets, for captures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/network/color_order.h"
#include "display/drivers/network/packets.h"

namespace voxeld::display::network {

class NetworkDecoder final : public WireDecoder {
 public:
  NetworkDecoder(const FrameLayout& layout, StreamOptions stream, ColorOrder order);

  // Takes a whole packet. Packets that end a stream or trigger the show contain no pixels.
  absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes, size_t device) override;
  // Returns the content of all slices, once each has come, if anything came since the last call.
  std::optional<DecodedVolume> TakeVolume() override;

 private:
  const FrameLayout layout_;
  const StreamOptions stream_;
  const ColorOrder order_;
  absl::Status status_;
  std::vector<Picture> slices_;
  bool fresh_ = false;
};

}  // namespace voxeld::display::network
