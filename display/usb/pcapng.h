// Recordings of USB traffic as pcapng files (draft-ietf-opsawg-pcapng) that Wireshark can open: one
// section, one interface of link type LINKTYPE_USB_LINUX_MMAPPED with times in nanoseconds, a
// packet for each submission and each completion, statistics at the end.
//
// Bytes only; packet_recorder.h puts them into files.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/usbmon.h"

namespace voxeld::display {

inline constexpr uint16_t kLinkTypeUsbLinuxMmapped = 220;

struct UsbPacket {
  sync::TimeNs time_ns = 0;  // since 1970; the header's ts_sec and ts_usec are derived from it
  UsbmonHeader header{};     // len_cap is derived from `data`
  std::span<const std::byte> data;
  std::string_view comment;      // UTF-8; empty: none
  uint64_t left_out_before = 0;  // packets left out between the previous one and this one
  // Set by the reader:
  uint64_t number = 0;  // from 1, as Wireshark counts
  uint64_t offset = 0;  // offset of its block in the file
};

struct RecordingInfo {
  std::string application;  // the writing application, UTF-8
  std::string interface_name;
};

struct RecordingStatistics {
  sync::TimeNs first_ns = 0, last_ns = 0;  // of received packets
  uint64_t received = 0;
  uint64_t left_out = 0;  // of those
  std::string comment;    // UTF-8; empty: none
};

// The most bytes of data that a packet may have.
inline constexpr size_t kMostPacketData = size_t{64} << 20;

// Each appends whole blocks. The start comes first in a file, the statistics last.
void AppendRecordingStart(const RecordingInfo& info, std::vector<std::byte>& out);
// Requires: `data` has at most kMostPacketData bytes.
void AppendUsbPacket(const UsbPacket& packet, std::vector<std::byte>& out);
void AppendStatistics(const RecordingStatistics& statistics, std::vector<std::byte>& out);
// Returns an upper bound of the bytes that AppendUsbPacket appends.
size_t UsbPacketBlockSize(const UsbPacket& packet);

// Reads the above, and files of other writers: both byte orders, several sections and interfaces,
// any time resolution, unknown blocks and options. The file is untrusted. Packets of other link
// types, and blocks that hold packets without a time, are errors.
class PcapngReader {
 public:
  // `file` must outlive the reader and its packets, which point into it.
  explicit PcapngReader(std::span<const std::byte> file) : file_(file) {}

  // Returns the next packet, or nothing at the end. Errors: InvalidArgument with what is wrong and
  // at which offset; every later call returns the same error.
  absl::StatusOr<std::optional<UsbPacket>> Next();

 private:
  struct Interface {
    uint16_t link_type = 0;
    uint8_t resolution = 6;      // if_tsresol
    int64_t offset_seconds = 0;  // if_tsoffset
  };
  struct Block {
    uint32_t type = 0;
    uint64_t offset = 0;              // in the file
    std::span<const std::byte> body;  // between the two lengths
  };
  struct Option {
    uint16_t code = 0;
    std::span<const std::byte> value;
  };

  template <typename T>
  T Get(std::span<const std::byte> bytes, size_t at) const;
  absl::Status Bad(uint64_t offset, const std::string& what);
  absl::StatusOr<Block> NextBlock();
  absl::Status ReadSection(const Block& block);
  absl::Status ReadInterface(const Block& block);
  absl::StatusOr<UsbPacket> ReadPacket(const Block& block);
  // Returns the options from `at` in the block's body on.
  absl::StatusOr<std::vector<Option>> ReadOptions(const Block& block, size_t at);
  absl::StatusOr<sync::TimeNs> TimeOf(uint64_t ticks, const Interface& from, uint64_t offset);

  const std::span<const std::byte> file_;
  size_t at_ = 0;
  bool swapped_ = false;  // the section has the other byte order
  bool in_section_ = false;
  std::vector<Interface> interfaces_;  // of the section
  uint64_t packets_ = 0;
  absl::Status failed_;
};

}  // namespace voxeld::display
