#include "display/drivers/network/packets.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace voxeld::display::network {
namespace {

using Bytes = std::vector<std::byte>;
using View = std::span<const std::byte>;

void Put(Bytes& out, size_t at, uint32_t value, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) {
    out[at + i] = static_cast<std::byte>(value >> (8 * (bytes - 1 - i)) & 0xFF);
  }
}

uint32_t Get(View in, size_t at, size_t bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < bytes; ++i) value = value << 8 | std::to_integer<uint32_t>(in[at + i]);
  return value;
}

void PutBytes(Bytes& out, size_t at, std::span<const uint8_t> bytes) {
  std::transform(bytes.begin(), bytes.end(), out.begin() + static_cast<std::ptrdiff_t>(at),
                 [](uint8_t byte) { return std::byte{byte}; });
}

// Requires: `in` is at least as long.
bool Begins(View in, std::span<const uint8_t> with) {
  return std::memcmp(in.data(), with.data(), with.size()) == 0;
}

// Writes the lengths of nested layers, each to the packet's end.
void PutLength(Bytes& out, size_t at) {
  Put(out, at, 0x7000 | static_cast<uint32_t>(out.size() - at), 2);
}
bool HasLength(View in, size_t at) { return Get(in, at, 2) == (0x7000 | (in.size() - at)); }

Bytes AcnRoot(size_t size, uint32_t vector, const std::array<uint8_t, 16>& cid) {
  Bytes out(size);
  PutBytes(out, 0, e131::kPreamble);
  PutLength(out, e131::kRootLength);
  Put(out, e131::kRootVector, vector, 4);
  PutBytes(out, e131::kCid, cid);
  PutLength(out, e131::kFramingLength);
  return out;
}

std::optional<ReadPacket> ReadDdp(int32_t slices, int32_t pixels, View in) {
  if (in.size() < ddp::kHeader) return std::nullopt;
  const uint32_t flags = Get(in, 0, 1), offset = Get(in, 4, 4), length = Get(in, 8, 2);
  const uint32_t slice_bytes = static_cast<uint32_t>(pixels) * 3;
  if ((flags & ~uint32_t{ddp::kPush}) != ddp::kVersion1 || Get(in, 2, 1) != ddp::kRgb8 ||
      length != in.size() - ddp::kHeader || length != slice_bytes || offset % slice_bytes != 0 ||
      offset / slice_bytes >= static_cast<uint32_t>(slices)) {
    return std::nullopt;
  }
  return ReadPacket{.slice = static_cast<int32_t>(offset / slice_bytes),
                    .last = (flags & ddp::kPush) != 0,
                    .sequence = static_cast<uint8_t>(Get(in, 1, 1) & 0x0F),
                    .rgb = in.subspan(ddp::kHeader)};
}

std::optional<ReadPacket> ReadE131(const StreamOptions& options, int32_t slices, int32_t pixels,
                                   View in) {
  if (in.size() < e131::kSyncBytes || !Begins(in, e131::kPreamble) ||
      !HasLength(in, e131::kRootLength) || !HasLength(in, e131::kFramingLength)) {
    return std::nullopt;
  }
  const uint32_t root = Get(in, e131::kRootVector, 4), framing = Get(in, e131::kFramingVector, 4);
  if (root == e131::kRootExtended && framing == e131::kFramingSync) {
    if (in.size() != e131::kSyncBytes ||
        static_cast<int32_t>(Get(in, e131::kSyncAddress, 2)) != options.sync_universe) {
      return std::nullopt;
    }
    return ReadPacket{.kind = ReadPacket::Kind::kSync,
                      .sequence = static_cast<uint8_t>(Get(in, e131::kSyncSequence, 1))};
  }
  const size_t bytes = static_cast<size_t>(pixels) * 3;
  if (root != e131::kRootData || framing != e131::kFramingData ||
      in.size() != e131::kData + bytes || !HasLength(in, e131::kDmpLength) ||
      Get(in, e131::kDmpVector, 1) != e131::kDmpSet ||
      Get(in, e131::kDmpType, 1) != e131::kDmpAddressType ||
      Get(in, e131::kDmpCount, 2) != bytes + 1 || Get(in, e131::kStartCode, 1) != 0) {
    return std::nullopt;
  }
  const int32_t slice = static_cast<int32_t>(Get(in, e131::kUniverse, 2)) - options.first_universe;
  if (slice < 0 || slice >= slices) return std::nullopt;
  const bool ends = (Get(in, e131::kOptions, 1) & e131::kStreamTerminated) != 0;
  return ReadPacket{.kind = ends ? ReadPacket::Kind::kEnd : ReadPacket::Kind::kPixels,
                    .slice = slice,
                    .sequence = static_cast<uint8_t>(Get(in, e131::kSequence, 1)),
                    .rgb = in.subspan(e131::kData)};
}

std::optional<ReadPacket> ReadArtNet(const StreamOptions& options, int32_t slices, int32_t pixels,
                                     View in) {
  if (in.size() < artnet::kSyncBytes || !Begins(in, artnet::kId) ||
      Get(in, 10, 2) != artnet::kRevision) {
    return std::nullopt;
  }
  const uint32_t op = Get(in, 8, 1) | Get(in, 9, 1) << 8;
  if (op == artnet::kOpSync) return ReadPacket{.kind = ReadPacket::Kind::kSync};
  const size_t bytes = (static_cast<size_t>(pixels) * 3 + 1) / 2 * 2;
  if (op != artnet::kOpDmx || in.size() != artnet::kHeader + bytes || Get(in, 16, 2) != bytes) {
    return std::nullopt;
  }
  const int32_t universe = static_cast<int32_t>(Get(in, 14, 1) | Get(in, 15, 1) << 8);
  const int32_t slice = universe - options.first_universe;
  if (slice < 0 || slice >= slices) return std::nullopt;
  return ReadPacket{.slice = slice,
                    .sequence = static_cast<uint8_t>(Get(in, 12, 1)),
                    .rgb = in.subspan(artnet::kHeader, static_cast<size_t>(pixels) * 3)};
}

std::optional<ReadPacket> ReadOpc(const StreamOptions& options, int32_t slices, int32_t pixels,
                                  View in) {
  const size_t bytes = static_cast<size_t>(pixels) * 3;
  if (in.size() != opc::kHeader + bytes || Get(in, 1, 1) != opc::kSetPixels ||
      Get(in, 2, 2) != bytes) {
    return std::nullopt;
  }
  const int32_t slice = static_cast<int32_t>(Get(in, 0, 1)) - options.first_universe;
  if (slice < 0 || slice >= slices) return std::nullopt;
  return ReadPacket{.slice = slice, .rgb = in.subspan(opc::kHeader)};
}

}  // namespace

int32_t MostPixels(Protocol protocol) {
  switch (protocol) {
    case Protocol::kDdp:
      return ddp::kPixels;
    case Protocol::kE131:
    case Protocol::kArtNet:
      return kUniversePixels;
    case Protocol::kOpc:
      return opc::kPixels;
  }
  return 0;
}

int32_t MostSlices(const StreamOptions& options) {
  constexpr int32_t kMost = 512;
  switch (options.protocol) {
    case Protocol::kDdp:
      return kMost;
    case Protocol::kE131:
      return std::min(kMost, e131::kMostUniverse - options.first_universe + 1);
    case Protocol::kArtNet:
      return std::min(kMost, artnet::kMostUniverse - options.first_universe + 1);
    case Protocol::kOpc:
      return std::min(8, 255 - options.first_universe + 1);
  }
  return 0;
}

PacketWriter::PacketWriter(StreamOptions options, int32_t pixels)
    : options_(std::move(options)),
      pixels_(pixels),
      universe_sequences_(static_cast<size_t>(MostSlices(options_))) {}

std::vector<std::byte> PacketWriter::Pixels(int32_t slice, std::span<const uint8_t> rgb,
                                            bool last) {
  switch (options_.protocol) {
    case Protocol::kDdp:
      return Ddp(slice, rgb, last);
    case Protocol::kE131:
      return E131(slice, rgb, 0);
    case Protocol::kArtNet:
      return ArtNet(slice, rgb);
    case Protocol::kOpc:
      return Opc(slice, rgb);
  }
  return {};
}

std::vector<std::byte> PacketWriter::Ddp(int32_t slice, std::span<const uint8_t> rgb, bool last) {
  Bytes out(ddp::kHeader + rgb.size());
  ddp_sequence_ = static_cast<uint8_t>(ddp_sequence_ % 15 + 1);
  Put(out, 0, ddp::kVersion1 | (last ? ddp::kPush : 0u), 1);
  Put(out, 1, ddp_sequence_, 1);
  Put(out, 2, ddp::kRgb8, 1);
  Put(out, 3, ddp::kDefaultOutput, 1);
  Put(out, 4, static_cast<uint32_t>(slice * pixels_ * 3), 4);
  Put(out, 8, static_cast<uint32_t>(rgb.size()), 2);
  PutBytes(out, ddp::kHeader, rgb);
  return out;
}

std::vector<std::byte> PacketWriter::E131(int32_t slice, std::span<const uint8_t> rgb,
                                          uint8_t flags) {
  Bytes out = AcnRoot(e131::kData + rgb.size(), e131::kRootData, options_.cid);
  Put(out, e131::kFramingVector, e131::kFramingData, 4);
  const size_t name = std::min(options_.source_name.size(), e131::kSourceNameBytes - 1);
  std::memcpy(out.data() + e131::kSourceName, options_.source_name.data(), name);
  Put(out, e131::kPriority, options_.priority, 1);
  Put(out, e131::kSync, static_cast<uint32_t>(options_.sync_universe), 2);
  Put(out, e131::kSequence, universe_sequences_[static_cast<size_t>(slice)]++, 1);
  Put(out, e131::kOptions, flags, 1);
  Put(out, e131::kUniverse, static_cast<uint32_t>(options_.first_universe + slice), 2);
  PutLength(out, e131::kDmpLength);
  Put(out, e131::kDmpVector, e131::kDmpSet, 1);
  Put(out, e131::kDmpType, e131::kDmpAddressType, 1);
  Put(out, e131::kDmpIncrement, 1, 2);
  Put(out, e131::kDmpCount, static_cast<uint32_t>(rgb.size() + 1), 2);
  PutBytes(out, e131::kData, rgb);
  return out;
}

std::vector<std::byte> PacketWriter::ArtNet(int32_t slice, std::span<const uint8_t> rgb) {
  const size_t length = rgb.size() + rgb.size() % 2;  // must be even
  Bytes out(artnet::kHeader + length);
  PutBytes(out, 0, artnet::kId);
  Put(out, 8, artnet::kOpDmx & 0xFF, 1);
  Put(out, 9, artnet::kOpDmx >> 8, 1);
  Put(out, 10, artnet::kRevision, 2);
  uint8_t& sequence = universe_sequences_[static_cast<size_t>(slice)];
  // 0 would mean that packets have no sequence
  sequence = static_cast<uint8_t>(sequence % 255 + 1);
  Put(out, 12, sequence, 1);
  const auto universe = static_cast<uint32_t>(options_.first_universe + slice);
  Put(out, 14, universe & 0xFF, 1);
  Put(out, 15, universe >> 8, 1);
  Put(out, 16, static_cast<uint32_t>(length), 2);
  PutBytes(out, artnet::kHeader, rgb);
  return out;
}

std::vector<std::byte> PacketWriter::Opc(int32_t slice, std::span<const uint8_t> rgb) const {
  Bytes out(opc::kHeader + rgb.size());
  Put(out, 0, static_cast<uint32_t>(options_.first_universe + slice), 1);
  Put(out, 1, opc::kSetPixels, 1);
  Put(out, 2, static_cast<uint32_t>(rgb.size()), 2);
  PutBytes(out, opc::kHeader, rgb);
  return out;
}

bool PacketWriter::Leap() {
  if (options_.protocol != Protocol::kE131) return false;
  for (uint8_t& sequence : universe_sequences_) sequence = static_cast<uint8_t>(sequence + 128);
  sync_sequence_ = static_cast<uint8_t>(sync_sequence_ + 128);
  return true;
}

std::vector<std::byte> PacketWriter::Sync() {
  if (options_.sync_universe == 0) return {};
  if (options_.protocol == Protocol::kArtNet) {
    Bytes out(artnet::kSyncBytes);
    PutBytes(out, 0, artnet::kId);
    Put(out, 8, artnet::kOpSync & 0xFF, 1);
    Put(out, 9, artnet::kOpSync >> 8, 1);
    Put(out, 10, artnet::kRevision, 2);
    return out;
  }
  if (options_.protocol != Protocol::kE131) return {};
  Bytes out = AcnRoot(e131::kSyncBytes, e131::kRootExtended, options_.cid);
  Put(out, e131::kFramingVector, e131::kFramingSync, 4);
  Put(out, e131::kSyncSequence, sync_sequence_++, 1);
  Put(out, e131::kSyncAddress, static_cast<uint32_t>(options_.sync_universe), 2);
  return out;
}

std::vector<std::byte> PacketWriter::End(int32_t slice, std::span<const uint8_t> rgb) {
  if (options_.protocol != Protocol::kE131) return {};
  return E131(slice, rgb, e131::kStreamTerminated);
}

std::optional<ReadPacket> Read(const StreamOptions& options, int32_t slices, int32_t pixels,
                               std::span<const std::byte> packet) {
  switch (options.protocol) {
    case Protocol::kDdp:
      return ReadDdp(slices, pixels, packet);
    case Protocol::kE131:
      return ReadE131(options, slices, pixels, packet);
    case Protocol::kArtNet:
      return ReadArtNet(options, slices, pixels, packet);
    case Protocol::kOpc:
      return ReadOpc(options, slices, pixels, packet);
  }
  return std::nullopt;
}

}  // namespace voxeld::display::network
