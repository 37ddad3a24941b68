#include "tools/lights/datagram.h"

#include <algorithm>
#include <cstring>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace voxeld::lights {
namespace {

namespace artnet = display::network::artnet;
namespace ddp = display::network::ddp;
namespace e131 = display::network::e131;

using View = std::span<const uint8_t>;

uint32_t Get(View in, size_t at, size_t bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < bytes; ++i) value = value << 8 | in[at + i];
  return value;
}

// Returns whether `in` begins with `with`; a shorter `in` does not.
template <size_t n>
bool Begins(View in, const std::array<uint8_t, n>& with) {
  return std::equal(with.begin(), with.end(), in.begin());
}

template <typename... Words>
absl::Status Wrong(const Words&... words) {
  return absl::InvalidArgumentError(absl::StrCat(words...));
}

absl::Status TooShort(View in, size_t least) {
  return Wrong("a packet of ", in.size(), " bytes; it takes ", least, " at least");
}

// ------------------------------------------------------------------------------------------- DDP

constexpr uint8_t kDdpVersion = 0xC0, kDdpTimecode = 0x10, kDdpStorage = 0x08, kDdpReply = 0x04,
                  kDdpQuery = 0x02;
constexpr uint8_t kDdpDefault = 1, kDdpAll = 255;  // destinations
constexpr size_t kDdpTimecodeBytes = 4;

// Returns whether the type is RGB with 8 bits per channel, in either of its encodings, or "as
// configured".
bool IsRgb8(uint8_t type) { return type == 0 || type == 1 || type == ddp::kRgb8; }

absl::StatusOr<Datagram> ReadDdp(View in) {
  if (in.size() < ddp::kHeader) return TooShort(in, ddp::kHeader);
  const uint8_t flags = in[0];
  if ((flags & kDdpVersion) != ddp::kVersion1) {
    return Wrong("byte 0 is ", flags, ": version ", flags >> 6, "; version 1 is read");
  }
  const size_t header = ddp::kHeader + ((flags & kDdpTimecode) != 0 ? kDdpTimecodeBytes : 0);
  if (in.size() < header) return TooShort(in, header);
  Datagram out;
  if (const uint8_t sequence = in[1] & 0x0F; sequence != 0) out.sequence = sequence;
  if ((flags & (kDdpStorage | kDdpReply | kDdpQuery)) != 0) return out;
  if (in[3] != kDdpDefault && in[3] != kDdpAll) return out;  // settings, status, another output
  const size_t length = Get(in, 8, 2);
  if (in.size() - header < length) {
    return Wrong("bytes 8 and 9 say ", length, " bytes of data; ", in.size() - header,
                 " are there");
  }
  out.push = (flags & ddp::kPush) != 0;
  if (length == 0) {
    out.kind = out.push ? Datagram::Kind::kShow : Datagram::Kind::kOther;
    return out;
  }
  if (!IsRgb8(in[2])) return Wrong("byte 2 is ", in[2], "; RGB of 8 bits is ", ddp::kRgb8);
  out.kind = Datagram::Kind::kLights;
  out.first_byte = Get(in, 4, 4);
  out.values = in.subspan(header, length);
  return out;
}

// ----------------------------------------------------------------------------------------- E1.31

constexpr uint8_t kPreview = 0x80;

// Returns whether the low 12 bits of a PDU's length, counted from its own position, are right; the
// high four are 7.
bool HasLength(View in, size_t at) { return Get(in, at, 2) == (0x7000 | (in.size() - at)); }

absl::StatusOr<Datagram> ReadE131(View in) {
  if (in.size() < e131::kSyncBytes) return TooShort(in, e131::kSyncBytes);
  if (!Begins(in, e131::kPreamble)) return Wrong("it does not begin as ACN does");
  const uint32_t root = Get(in, e131::kRootVector, 4), framing = Get(in, e131::kFramingVector, 4);
  Datagram out;
  std::copy_n(in.begin() + e131::kCid, out.source.size(), out.source.begin());
  if (root != e131::kRootData && root != e131::kRootExtended) return out;
  for (const size_t at : {e131::kRootLength, e131::kFramingLength}) {
    if (!HasLength(in, at)) {
      return Wrong("bytes ", at, " and ", at + 1, " are ", Get(in, at, 2), "; with ", in.size(),
                   " bytes they would be ", 0x7000 | (in.size() - at));
    }
  }
  if (root == e131::kRootExtended) {
    if (framing != e131::kFramingSync) return out;  // discovery
    out.kind = Datagram::Kind::kShow;
    out.sequence = in[e131::kSyncSequence];
    out.universe = static_cast<int32_t>(Get(in, e131::kSyncAddress, 2));
    return out;
  }
  if (framing != e131::kFramingData) return out;
  if (in.size() <= e131::kStartCode) return TooShort(in, e131::kData);
  const size_t count = Get(in, e131::kDmpCount, 2);
  if (!HasLength(in, e131::kDmpLength) || in[e131::kDmpVector] != e131::kDmpSet ||
      in[e131::kDmpType] != e131::kDmpAddressType || Get(in, 119, 2) != 0 ||
      Get(in, e131::kDmpIncrement, 2) != 1 || count != in.size() - e131::kStartCode ||
      count > 513) {
    return Wrong("its DMP layer does not set ", in.size() - e131::kData,
                 " properties from 0 on, one after another; 512 are the most");
  }
  out.sequence = in[e131::kSequence];
  out.universe = static_cast<int32_t>(Get(in, e131::kUniverse, 2));
  if (out.universe < 1 || out.universe > e131::kMostUniverse) {
    return Wrong("universe ", out.universe, "; 1 to ", e131::kMostUniverse, " are possible");
  }
  out.priority = in[e131::kPriority];
  if (out.priority > 200) return Wrong("priority ", out.priority, "; 200 is the most");
  out.sync_universe = static_cast<uint16_t>(Get(in, e131::kSync, 2));
  const uint8_t options = in[e131::kOptions];
  if ((options & e131::kStreamTerminated) != 0) {
    out.kind = Datagram::Kind::kEnd;
  } else if ((options & kPreview) == 0 && in[e131::kStartCode] == 0) {
    out.kind = Datagram::Kind::kLights;
    out.values = in.subspan(e131::kData);
  }
  return out;
}

// --------------------------------------------------------------------------------------- Art-Net

constexpr uint16_t kOpPoll = 0x2000, kOpPollReply = 0x2100;

absl::StatusOr<Datagram> ReadArtNet(View in) {
  constexpr size_t kOpCode = 8, kVersion = 10, kSequence = 12, kUniverse = 14, kLength = 16;
  if (in.size() < kOpCode + 2) return TooShort(in, kOpCode + 2);
  if (!Begins(in, artnet::kId)) return Wrong("it does not begin with \"Art-Net\"");
  const uint16_t op = static_cast<uint16_t>(in[kOpCode] | in[kOpCode + 1] << 8);
  Datagram out;
  if (op != artnet::kOpDmx && op != artnet::kOpSync && op != kOpPoll) return out;
  if (in.size() < kVersion + 2) return TooShort(in, kVersion + 2);
  if (const uint32_t version = Get(in, kVersion, 2); version < artnet::kRevision) {
    return Wrong("revision ", version, "; ", artnet::kRevision, " and later are read");
  }
  if (op != artnet::kOpDmx) {
    out.kind = op == kOpPoll ? Datagram::Kind::kAsk : Datagram::Kind::kShow;
    return out;
  }
  if (in.size() < artnet::kHeader) return TooShort(in, artnet::kHeader);
  const size_t length = Get(in, kLength, 2);
  if (length < 2 || length > 512)
    return Wrong("bytes 16 and 17 say ", length, " values; 2 to 512 are possible");
  if (in.size() - artnet::kHeader < length) {
    return Wrong("bytes 16 and 17 say ", length, " values; ", in.size() - artnet::kHeader,
                 " are there");
  }
  out.kind = Datagram::Kind::kLights;
  if (in[kSequence] != 0) out.sequence = in[kSequence];
  out.universe = (in[kUniverse] | in[kUniverse + 1] << 8) & artnet::kMostUniverse;
  out.values = in.subspan(artnet::kHeader, length);
  return out;
}

}  // namespace

absl::StatusOr<Datagram> ReadDatagram(Protocol protocol, std::span<const uint8_t> packet) {
  switch (protocol) {
    case Protocol::kDdp:
      return ReadDdp(packet);
    case Protocol::kE131:
      return ReadE131(packet);
    case Protocol::kArtNet:
      return ReadArtNet(packet);
    case Protocol::kOpc:
      break;
  }
  return Wrong("Open Pixel Control comes as a stream, not in packets");
}

std::array<uint8_t, 239> ArtPollReply(std::array<uint8_t, 4> ip, uint16_t port, int32_t first,
                                      int32_t universes) {
  std::array<uint8_t, 239> out{};
  const auto put = [&out](size_t at, std::string_view text) {
    std::copy(text.begin(), text.end(), out.begin() + static_cast<std::ptrdiff_t>(at));
  };
  std::copy(artnet::kId.begin(), artnet::kId.end(), out.begin());
  out[8] = kOpPollReply & 0xFF;
  out[9] = kOpPollReply >> 8;
  std::copy(ip.begin(), ip.end(), out.begin() + 10);
  out[14] = port & 0xFF;
  out[15] = static_cast<uint8_t>(port >> 8);
  out[18] = static_cast<uint8_t>(first >> 8 & 0x7F);  // net
  out[19] = static_cast<uint8_t>(first >> 4 & 0x0F);  // sub-net
  out[23] = 0xD0;                                     // indicators normal, addresses set here
  put(26, "voxeld");
  put(44, "voxeld: lights of a volumetric display");
  put(108, "#0001 [0000] ready");
  // A reply has four ports at most, whose universes differ in their last four bits.
  const int32_t ports = std::clamp<int32_t>(universes, 1, std::min(4, 16 - (first & 0x0F)));
  out[173] = static_cast<uint8_t>(ports);
  for (int32_t i = 0; i < ports; ++i) {
    const auto at = static_cast<size_t>(i);
    out[174 + at] = 0x80;  // an output, of DMX512
    out[182 + at] = 0x80;  // data is being received
    out[190 + at] = static_cast<uint8_t>((first + i) & 0x0F);
  }
  out[212] = 0x08;  // addresses of 15 bits
  return out;
}

}  // namespace voxeld::lights
