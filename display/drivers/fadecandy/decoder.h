// Rebuilds volumes from the bytes sent to all boards. An independent reading of the protocol,
// strict where a board is tolerant.
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "display/api/display.h"
#include "display/drivers/fadecandy/protocol.h"

namespace voxeld::display::fadecandy {

class FadecandyDecoder final : public WireDecoder {
 public:
  // Each slice of `layout` is a board: the `device` of OnBytes.
  explicit FadecandyDecoder(const FrameLayout& layout);

  // Takes transfers of whole packets. Errors: DataLoss at the first packet that violates the
  // protocol, or that ends a frame with missing packets, and from then on. Packets may be sent
  // again.
  absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes, size_t device) override;
  // A volume is complete when every board was sent a new frame.
  std::optional<DecodedVolume> TakeVolume() override;

 private:
  struct Slice {
    std::vector<std::byte> filling;
    std::bitset<kFramePackets> have;  // packets of `filling` received so far
    Picture whole;                    // the last complete frame
    bool fresh = false;               // `whole` has not been returned yet
  };

  absl::Status Read(std::span<const std::byte, kPacketBytes> packet, size_t device);

  const FrameLayout layout_;
  std::vector<Slice> slices_;
  absl::Status status_;
};

}  // namespace voxeld::display::fadecandy
