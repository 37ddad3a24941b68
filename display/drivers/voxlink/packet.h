// Packets of voxlink (docs/protocols/voxlink.md §5): writes them, and finds them in a stream of
// bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "display/drivers/voxlink/protocol.h"
#include "display/usb/transfer_bytes.h"

namespace voxeld::display::voxlink {

// Appends packets to a buffer and numbers them. Bytes: TransferBytes or std::vector<std::byte>.
class PacketWriter {
 public:
  // The next packet's number.
  uint32_t sequence() const { return sequence_; }
  // Restarts the stream (START).
  void Restart() { sequence_ = 0; }

  template <typename Bytes>
  void Slice(Bytes& out, uint64_t volume, uint32_t slice, uint16_t sub_frame, uint32_t offset,
             std::span<const std::byte> payload);
  // `bitmap` is empty for base 0.
  template <typename Bytes>
  void Begin(Bytes& out, uint64_t volume, uint64_t base, uint32_t pictures,
             std::span<const std::byte> bitmap);
  template <typename Bytes>
  void End(Bytes& out, uint64_t volume, bool show);
  template <typename Bytes>
  void Show(Bytes& out, uint64_t volume, uint64_t sweep);
  template <typename Bytes>
  void ShowAhead(Bytes& out, uint64_t volume, uint64_t sweep, uint32_t ahead);
  // ABORT, DROP and KEEPALIVE have no payload (volume 0 for the last).
  template <typename Bytes>
  void Plain(Bytes& out, PacketType type, uint64_t volume);

 private:
  // Fills in the fields that all packets share, including sequence and checksums.
  template <typename Bytes>
  void Put(Bytes& out, PacketHeader header, std::span<const std::byte> head,
           std::span<const std::byte> tail);

  uint32_t sequence_ = 0;
};

// Finds packets in a stream that may be split anywhere, and resynchronises after damage: bytes that
// are not a valid header are skipped one by one. Holds at most one packet.
class PacketParser {
 public:
  struct Sink {
    virtual ~Sink() = default;
    // Header and payload are valid; `payload` is valid during the call.
    virtual void OnPacket(const PacketHeader& header, std::span<const std::byte> payload) = 0;
    // The header is valid, the payload is damaged.
    virtual void OnBadPayload(const PacketHeader& header) = 0;
    // `bytes` that belong to no packet were skipped, just before the next call.
    virtual void OnSkipped(size_t bytes) = 0;
  };

  // A header that announces more than `max_payload` bytes is invalid.
  explicit PacketParser(uint32_t max_payload) : max_payload_(max_payload) {}

  void Feed(std::span<const std::byte> bytes, Sink& sink);
  // Returns the bytes held of an unfinished packet.
  size_t pending() const { return partial_.size(); }
  void Reset();

 private:
  bool SoundHeader(std::span<const std::byte> bytes) const;
  void Deliver(std::span<const std::byte> packet, Sink& sink);
  void FlushSkipped(Sink& sink);

  uint32_t max_payload_;
  std::vector<std::byte> partial_;  // the beginning of a packet, kept from one Feed to the next
  size_t skipped_ = 0;
};

}  // namespace voxeld::display::voxlink
