#include "display/usb/pcapng.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

// draft-ietf-opsawg-pcapng §4: block types
constexpr uint32_t kSectionHeader = 0x0A0D0D0A;
constexpr uint32_t kInterfaceDescription = 1;
constexpr uint32_t kObsoletePacket = 2;
constexpr uint32_t kSimplePacket = 3;
constexpr uint32_t kInterfaceStatistics = 5;
constexpr uint32_t kEnhancedPacket = 6;
constexpr uint32_t kByteOrder = 0x1A2B3C4D;

// Options: §3.5 for all blocks, then of the section header (§4.1), the interface description (§4.2),
// the enhanced packet (§4.3) and the interface statistics (§4.6).
constexpr uint16_t kOptEnd = 0, kOptComment = 1;
constexpr uint16_t kShbUserApplication = 4;
constexpr uint16_t kIfName = 2, kIfTsResolution = 9, kIfTsOffset = 14;
constexpr uint16_t kEpbDropCount = 4;
constexpr uint16_t kIsbStartTime = 2, kIsbEndTime = 3, kIsbReceived = 4, kIsbDropped = 5;

constexpr uint8_t kNanoseconds = 9;
constexpr size_t kBlockFrame = 12;    // type and both lengths
constexpr size_t kPacketFields = 20;  // fields of an enhanced packet before its data
constexpr size_t kMostText = 60'000;  // an option's length has 16 bits

constexpr size_t Padded(size_t size) { return (size + 3) & ~size_t{3}; }

using Bytes = std::vector<std::byte>;

void PutBytes(Bytes& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

template <typename T>
void Put(Bytes& out, const T& value) {
  PutBytes(out, std::as_bytes(std::span(&value, 1)));
}

void PutPadded(Bytes& out, std::span<const std::byte> bytes) {
  PutBytes(out, bytes);
  out.resize(out.size() + Padded(bytes.size()) - bytes.size());
}

void PutOption(Bytes& out, uint16_t code, std::span<const std::byte> value) {
  Put(out, code);
  Put(out, static_cast<uint16_t>(value.size()));
  PutPadded(out, value);
}

template <typename T>
void PutOptionOf(Bytes& out, uint16_t code, const T& value) {
  PutOption(out, code, std::as_bytes(std::span(&value, 1)));
}

void PutText(Bytes& out, uint16_t code, std::string_view text) {
  if (text.empty()) return;
  text = text.substr(0, kMostText);
  PutOption(out, code, std::as_bytes(std::span(text.data(), text.size())));
}

// Begin and end a block; ending it writes its length at both ends.
size_t BeginBlock(Bytes& out, uint32_t type) {
  const size_t begin = out.size();
  Put(out, type);
  Put(out, uint32_t{0});
  return begin;
}

void EndBlock(Bytes& out, size_t begin) {
  const auto length = static_cast<uint32_t>(out.size() - begin + sizeof(uint32_t));
  Put(out, length);
  std::memcpy(out.data() + begin + sizeof(uint32_t), &length, sizeof(length));
}

std::array<uint32_t, 2> HighLow(sync::TimeNs time_ns) {
  const auto ticks = static_cast<uint64_t>(std::max<sync::TimeNs>(time_ns, 0));
  return {static_cast<uint32_t>(ticks >> 32), static_cast<uint32_t>(ticks)};
}

}  // namespace

void AppendRecordingStart(const RecordingInfo& info, Bytes& out) {
  const size_t section = BeginBlock(out, kSectionHeader);
  Put(out, kByteOrder);
  Put(out, uint16_t{1});  // major
  Put(out, uint16_t{0});  // minor
  Put(out, int64_t{-1});  // length of the section: unspecified
  PutText(out, kShbUserApplication, info.application);
  Put(out, uint32_t{kOptEnd});
  EndBlock(out, section);

  const size_t interface = BeginBlock(out, kInterfaceDescription);
  Put(out, kLinkTypeUsbLinuxMmapped);
  Put(out, uint16_t{0});
  Put(out, uint32_t{0});  // packets are not truncated
  PutText(out, kIfName, info.interface_name);
  PutOptionOf(out, kIfTsResolution, kNanoseconds);
  Put(out, uint32_t{kOptEnd});
  EndBlock(out, interface);
}

size_t UsbPacketBlockSize(const UsbPacket& packet) {
  constexpr size_t kOptionHead = 4, kDropCount = 12, kEnd = 4;
  return kBlockFrame + kPacketFields + sizeof(UsbmonHeader) + Padded(packet.data.size()) +
         kOptionHead + Padded(std::min(packet.comment.size(), kMostText)) + kDropCount + kEnd;
}

void AppendUsbPacket(const UsbPacket& packet, Bytes& out) {
  const sync::TimeNs time_ns = std::max<sync::TimeNs>(packet.time_ns, 0);
  UsbmonHeader header = packet.header;
  header.ts_sec = time_ns / sync::kSecond;
  header.ts_usec = static_cast<int32_t>(time_ns % sync::kSecond / 1000);
  header.len_cap = static_cast<uint32_t>(packet.data.size());

  const size_t block = BeginBlock(out, kEnhancedPacket);
  const auto size = static_cast<uint32_t>(sizeof(header) + packet.data.size());
  Put(out, uint32_t{0});  // the interface
  Put(out, HighLow(time_ns));
  Put(out, size);  // captured
  Put(out, size);  // original length
  Put(out, header);
  PutPadded(out, packet.data);
  PutText(out, kOptComment, packet.comment);
  if (packet.left_out_before > 0) PutOptionOf(out, kEpbDropCount, packet.left_out_before);
  if (!packet.comment.empty() || packet.left_out_before > 0) Put(out, uint32_t{kOptEnd});
  EndBlock(out, block);
}

void AppendStatistics(const RecordingStatistics& statistics, Bytes& out) {
  const size_t block = BeginBlock(out, kInterfaceStatistics);
  Put(out, uint32_t{0});  // the interface
  Put(out, HighLow(statistics.last_ns));
  PutText(out, kOptComment, statistics.comment);
  PutOptionOf(out, kIsbStartTime, HighLow(statistics.first_ns));
  PutOptionOf(out, kIsbEndTime, HighLow(statistics.last_ns));
  PutOptionOf(out, kIsbReceived, statistics.received);
  PutOptionOf(out, kIsbDropped, statistics.left_out);
  Put(out, uint32_t{kOptEnd});
  EndBlock(out, block);
}

// ---- reading

namespace {

template <typename T>
T Swapped(T value) {
  auto bytes = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

void SwapHeader(UsbmonHeader& header) {
  header.id = Swapped(header.id);
  header.busnum = Swapped(header.busnum);
  header.ts_sec = Swapped(header.ts_sec);
  header.ts_usec = Swapped(header.ts_usec);
  header.status = Swapped(header.status);
  header.length = Swapped(header.length);
  header.len_cap = Swapped(header.len_cap);
  header.interval = Swapped(header.interval);
  header.start_frame = Swapped(header.start_frame);
  header.xfer_flags = Swapped(header.xfer_flags);
  header.ndesc = Swapped(header.ndesc);
}

}  // namespace

// Requires: `bytes` hold it, which callers have checked.
template <typename T>
T PcapngReader::Get(std::span<const std::byte> bytes, size_t at) const {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return swapped_ ? Swapped(value) : value;
}

absl::Status PcapngReader::Bad(uint64_t offset, const std::string& what) {
  failed_ = absl::InvalidArgumentError(absl::StrCat("recording, offset ", offset, ": ", what));
  return failed_;
}

absl::StatusOr<PcapngReader::Block> PcapngReader::NextBlock() {
  const std::span<const std::byte> rest = file_.subspan(at_);
  if (rest.size() < kBlockFrame) {
    return Bad(at_, absl::StrCat("the file ends in a block's head: ", rest.size(), " of ",
                                 kBlockFrame, " bytes"));
  }
  Block block;
  block.offset = at_;
  block.type = Get<uint32_t>(rest, 0);
  if (block.type == kSectionHeader) {
    // The type is the same in both byte orders; the field after the length says which it is.
    swapped_ = false;
    const auto order = Get<uint32_t>(rest, 8);
    if (order != kByteOrder && order != Swapped(kByteOrder)) {
      return Bad(at_ + 8, absl::StrCat("the byte-order magic is 0x", absl::Hex(order),
                                       "; it must be 0x1A2B3C4D in either order"));
    }
    swapped_ = order != kByteOrder;
  } else if (!in_section_) {
    return Bad(at_, absl::StrCat("block type 0x", absl::Hex(block.type),
                                 "; a pcapng file begins with a section header (0x0A0D0D0A)"));
  }
  const auto length = Get<uint32_t>(rest, 4);
  if (length < kBlockFrame || length % 4 != 0) {
    return Bad(at_ + 4, absl::StrCat("a block's length is ", length,
                                     "; it must be a multiple of 4 and at least ", kBlockFrame));
  }
  if (length > rest.size()) {
    return Bad(at_ + 4, absl::StrCat("a block's length is ", length, ", but the file has only ",
                                     rest.size(), " bytes from there"));
  }
  const auto again = Get<uint32_t>(rest, length - 4);
  if (again != length) {
    return Bad(at_ + length - 4,
               absl::StrCat("a block's length at its end is ", again, "; at its start ", length));
  }
  block.body = rest.subspan(8, length - kBlockFrame);
  at_ += length;
  return block;
}

absl::StatusOr<std::vector<PcapngReader::Option>> PcapngReader::ReadOptions(const Block& block,
                                                                            size_t at) {
  std::vector<Option> options;
  while (block.body.size() - at >= 4) {
    const auto code = Get<uint16_t>(block.body, at);
    const size_t length = Get<uint16_t>(block.body, at + 2);
    if (code == kOptEnd) break;
    at += 4;
    if (Padded(length) > block.body.size() - at) {
      return Bad(block.offset + 8 + at - 2,
                 absl::StrCat("option ", code, " has ", length, " bytes; its block ends after ",
                              block.body.size() - at));
    }
    options.push_back({code, block.body.subspan(at, length)});
    at += Padded(length);
  }
  return options;
}

absl::Status PcapngReader::ReadSection(const Block& block) {
  if (block.body.size() < 16) {
    return Bad(block.offset + 4, absl::StrCat("a section header of ", block.body.size(),
                                              " bytes; it has at least 16"));
  }
  const auto major = Get<uint16_t>(block.body, 4);
  if (major != 1) {
    return Bad(block.offset + 12,
               absl::StrCat("pcapng's major version is ", major, "; 1 can be read"));
  }
  in_section_ = true;
  interfaces_.clear();
  return absl::OkStatus();
}

absl::Status PcapngReader::ReadInterface(const Block& block) {
  if (block.body.size() < 8) {
    return Bad(block.offset + 4, absl::StrCat("an interface description of ", block.body.size(),
                                              " bytes; it has at least 8"));
  }
  Interface interface;
  interface.link_type = Get<uint16_t>(block.body, 0);
  absl::StatusOr<std::vector<Option>> options = ReadOptions(block, 8);
  if (!options.ok()) return options.status();
  for (const Option& option : *options) {
    if (option.code == kIfTsResolution && option.value.size() == 1) {
      interface.resolution = std::to_integer<uint8_t>(option.value[0]);
    } else if (option.code == kIfTsOffset && option.value.size() == 8) {
      interface.offset_seconds = Get<int64_t>(option.value, 0);
    }
  }
  interfaces_.push_back(interface);
  return absl::OkStatus();
}

absl::StatusOr<sync::TimeNs> PcapngReader::TimeOf(uint64_t ticks, const Interface& from,
                                                  uint64_t offset) {
  using Wide = __int128;
  const int power = from.resolution & 0x7F;
  const bool binary = (from.resolution & 0x80) != 0;
  if (power > (binary ? 63 : 18)) {
    return Bad(offset,
               absl::StrCat("times of the interface have a resolution of ", binary ? "2" : "10",
                            "^-", power, "; at most 2^-63 or 10^-18 can be read"));
  }
  Wide time = static_cast<Wide>(ticks) * sync::kSecond;
  if (binary) {
    time >>= power;
  } else {
    int64_t units = 1;
    for (int i = 0; i < power; ++i) units *= 10;
    time /= units;
  }
  time += static_cast<Wide>(from.offset_seconds) * sync::kSecond;
  if (time < 0 || time > INT64_MAX) {
    return Bad(offset, absl::StrCat("the packet's time, ", ticks,
                                    " ticks, lies before 1970 or after 2262"));
  }
  return static_cast<sync::TimeNs>(time);
}

absl::StatusOr<UsbPacket> PcapngReader::ReadPacket(const Block& block) {
  const std::span<const std::byte> body = block.body;
  if (body.size() < kPacketFields) {
    return Bad(block.offset + 4, absl::StrCat("a packet block of ", body.size(),
                                              " bytes; it has at least ", kPacketFields));
  }
  const auto interface = Get<uint32_t>(body, 0);
  if (interface >= interfaces_.size()) {
    return Bad(block.offset + 8, absl::StrCat("a packet of interface ", interface, "; there are ",
                                              interfaces_.size()));
  }
  if (interfaces_[interface].link_type != kLinkTypeUsbLinuxMmapped) {
    return Bad(block.offset + 8,
               absl::StrCat("a packet of link type ", interfaces_[interface].link_type, "; only ",
                            kLinkTypeUsbLinuxMmapped, " (USB_LINUX_MMAPPED) can be read"));
  }
  const uint64_t ticks = uint64_t{Get<uint32_t>(body, 4)} << 32 | Get<uint32_t>(body, 8);
  const absl::StatusOr<sync::TimeNs> time =
      TimeOf(ticks, interfaces_[interface], block.offset + 12);
  if (!time.ok()) return time.status();
  const size_t captured = Get<uint32_t>(body, 12);
  if (captured > body.size() - kPacketFields) {
    return Bad(block.offset + 20, absl::StrCat("a packet of ", captured, " bytes in a block with ",
                                               body.size() - kPacketFields));
  }
  if (captured < sizeof(UsbmonHeader)) {
    return Bad(block.offset + 20, absl::StrCat("a packet of ", captured, " bytes; usbmon's header ",
                                               "alone has ", sizeof(UsbmonHeader)));
  }
  UsbPacket packet;
  packet.time_ns = *time;
  packet.number = ++packets_;
  packet.offset = block.offset;
  std::memcpy(&packet.header, body.data() + kPacketFields, sizeof(packet.header));
  if (swapped_) SwapHeader(packet.header);
  packet.data = body.subspan(kPacketFields + sizeof(UsbmonHeader), captured - sizeof(UsbmonHeader));
  if (packet.header.len_cap < packet.data.size()) {
    packet.data = packet.data.first(packet.header.len_cap);
  }
  const absl::StatusOr<std::vector<Option>> options =
      ReadOptions(block, kPacketFields + std::min(Padded(captured), body.size() - kPacketFields));
  if (!options.ok()) return options.status();
  for (const Option& option : *options) {
    if (option.code == kOptComment) {
      packet.comment = {reinterpret_cast<const char*>(option.value.data()), option.value.size()};
    } else if (option.code == kEpbDropCount && option.value.size() == 8) {
      packet.left_out_before = Get<uint64_t>(option.value, 0);
    }
  }
  return packet;
}

absl::StatusOr<std::optional<UsbPacket>> PcapngReader::Next() {
  if (!failed_.ok()) return failed_;
  while (at_ < file_.size()) {
    const absl::StatusOr<Block> block = NextBlock();
    if (!block.ok()) return block.status();
    absl::Status status;
    switch (block->type) {
      case kSectionHeader:
        status = ReadSection(*block);
        break;
      case kInterfaceDescription:
        status = ReadInterface(*block);
        break;
      case kEnhancedPacket: {
        absl::StatusOr<UsbPacket> packet = ReadPacket(*block);
        if (!packet.ok()) return packet.status();
        return *packet;
      }
      case kObsoletePacket:
      case kSimplePacket:
        status = Bad(block->offset, absl::StrCat("a packet block of type ", block->type,
                                                 "; packets must be of type ", kEnhancedPacket));
        break;
      default:
        break;
    }
    if (!status.ok()) return status;
  }
  if (!in_section_) return Bad(0, "the file is empty; it must begin with a section header");
  return std::nullopt;
}

}  // namespace voxeld::display
