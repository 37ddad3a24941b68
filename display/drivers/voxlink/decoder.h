// Rebuilds volumes from a voxlink driver's outgoing bytes. An independent reading of the protocol,
// strict where a device is tolerant. The stream may start anywhere between two volumes, with a
// volume of base 0.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "display/api/display.h"
#include "display/drivers/voxlink/assembler.h"
#include "display/drivers/voxlink/packet.h"

namespace voxeld::display::voxlink {

class VoxlinkDecoder final : public WireDecoder, private PacketParser::Sink {
 public:
  VoxlinkDecoder(const FrameLayout& layout, uint32_t max_payload);

  // Errors: DataLoss at the first byte that violates the protocol, and from then on. Slices may be
  // sent again after VOLUME_END (if the device had lost them), and a volume may be started again.
  absl::Status OnBytes(uint8_t endpoint, std::span<const std::byte> bytes, size_t device) override;
  std::optional<DecodedVolume> TakeVolume() override;

 private:
  void OnPacket(const PacketHeader& header, std::span<const std::byte> payload) override;
  void OnBadPayload(const PacketHeader& header) override;
  void OnSkipped(size_t bytes) override;
  void Begin(const PacketHeader& header, std::span<const std::byte> payload);
  void End(const PacketHeader& header);
  void Fail(const PacketHeader& header, const char* what);

  const FrameLayout layout_;
  PacketParser parser_;
  VolumeAssembler assembler_;
  std::optional<uint32_t> sequence_;  // expected of the next packet; empty before the first
  VolumePtr complete_;                // the last complete volume: the base of the next
  bool fresh_ = false;                // complete_ has not been returned yet
  uint64_t bytes_ = 0;
  absl::Status status_;
};

}  // namespace voxeld::display::voxlink
