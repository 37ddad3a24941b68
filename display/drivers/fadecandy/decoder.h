// Volumes from what goes out to all boards: the other reading of the protocol, strict where a board
// is patient.
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
  // A slice of `layout` is a board: the `device` of OnBytes.
  explicit FadecandyDecoder(const FrameLayout& layout);

  // Transfers of whole packets. DataLoss at the first that breaks the protocol, or that ends a frame
  // of which packets are missing, and from then on. Packets may be sent again.
  absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes, size_t device) override;
  // A volume is complete when all boards were sent a frame, or another one.
  std::optional<DecodedVolume> TakeVolume() override;

 private:
  struct Slice {
    std::vector<std::byte> filling;
    std::bitset<kFramePackets> have;  // of `filling`
    Picture whole;                    // the last one that was ended
    bool fresh = false;               // `whole` was not taken yet
  };

  absl::Status Read(std::span<const std::byte, kPacketBytes> packet, size_t device);

  const FrameLayout layout_;
  std::vector<Slice> slices_;
  absl::Status status_;
};

}  // namespace voxeld::display::fadecandy
