#include "display/usb/recorded_session.h"

#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/usb/pcapng.h"
#include "display/usb/usbmon.h"

namespace voxeld::display {
namespace {

constexpr uint8_t kIn = 0x80;

class SessionReader {
 public:
  absl::Status Take(const UsbPacket& packet);
  std::vector<RecordedSession> sessions;

 private:
  absl::Status Submitted(const UsbPacket& packet);
  absl::Status Ended(const UsbPacket& packet);

  uint32_t device_ = 0;                   // bus and address
  std::map<uint64_t, size_t> in_flight_;  // usbmon's id → transfer of the last session
};

absl::Status Bad(const UsbPacket& packet, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("recording, packet ", packet.number, ": ", what));
}

absl::Status SessionReader::Take(const UsbPacket& packet) {
  const UsbmonHeader& header = packet.header;
  if (packet.left_out_before > 0) {
    return Bad(packet, absl::StrCat("before it ", packet.left_out_before,
                                    " packets were left out; only a whole recording can be used"));
  }
  const uint32_t device = uint32_t{header.busnum} << 8 | header.devnum;
  if (sessions.empty() || device != device_) {
    device_ = device;
    in_flight_.clear();
    sessions.emplace_back().first_ns = packet.time_ns;
  }
  RecordedSession& session = sessions.back();
  if (packet.time_ns < session.last_ns) {
    return Bad(packet, "its time is before that of the packet before it");
  }
  session.last_ns = packet.time_ns;
  switch (header.type) {
    case UsbmonHeader::kSubmit:
      return Submitted(packet);
    case UsbmonHeader::kComplete:
    case UsbmonHeader::kError:
      return Ended(packet);
    default:
      return Bad(packet, absl::StrCat("its type is ", int{header.type},
                                      "; it must be 'S' (83), 'C' (67) or 'E' (69)"));
  }
}

absl::Status SessionReader::Submitted(const UsbPacket& packet) {
  const UsbmonHeader& header = packet.header;
  RecordedSession& session = sessions.back();
  RecordedTransfer transfer;
  transfer.packet = packet.number;
  transfer.submitted_ns = packet.time_ns;
  transfer.endpoint = header.epnum;
  bool in = (header.epnum & kIn) != 0;
  switch (header.xfer_type) {
    case UsbmonHeader::kBulk:
      transfer.type = TransferType::kBulk;
      break;
    case UsbmonHeader::kInterrupt:
      transfer.type = TransferType::kInterrupt;
      break;
    case UsbmonHeader::kControl:
      transfer.type = TransferType::kControl;
      transfer.endpoint = 0;
      if (header.flag_setup != 0) return Bad(packet, "a control transfer without its setup bytes");
      transfer.setup = SetupOfBytes(header.setup);
      in = (transfer.setup.request_type & kIn) != 0;
      break;
    default:
      return Bad(packet, absl::StrCat("a transfer of type ", int{header.xfer_type},
                                      "; only interrupt (1), control (2) and bulk (3) are known"));
  }
  if (in) {
    transfer.in_length = header.length;
  } else {
    transfer.out_length = header.length;
    transfer.out = packet.data;
    if (packet.data.size() > header.length) {
      return Bad(packet, absl::StrCat("it sends ", header.length, " bytes, but holds ",
                                      packet.data.size()));
    }
  }
  const size_t index = session.transfers.size();
  if (!in_flight_.emplace(header.id, index).second) {
    return Bad(packet, absl::StrCat("transfer ", header.id, " is submitted, which is in flight"));
  }
  session.by_endpoint[transfer.endpoint].push_back(index);
  session.transfers.push_back(transfer);
  session.steps.push_back({index, false});
  return absl::OkStatus();
}

absl::Status SessionReader::Ended(const UsbPacket& packet) {
  const UsbmonHeader& header = packet.header;
  const auto it = in_flight_.find(header.id);
  if (it == in_flight_.end()) {
    return Bad(packet, absl::StrCat("transfer ", header.id,
                                    " ends, which was not submitted on this device address"));
  }
  RecordedSession& session = sessions.back();
  const size_t index = it->second;
  in_flight_.erase(it);
  RecordedTransfer& transfer = session.transfers[index];
  transfer.completed_ns = packet.time_ns;
  if (header.type == UsbmonHeader::kError) {
    transfer.refused = true;
    transfer.refusal = StatusOfRefusal(header.status);
    return absl::OkStatus();
  }
  transfer.actual_length = header.length;
  const bool in = transfer.in_length > 0;
  transfer.status = StatusOfUsbmon(header.status, in && header.length < transfer.in_length);
  if (in) {
    if (header.length > transfer.in_length) {
      return Bad(packet, absl::StrCat(header.length, " bytes came in, but only ",
                                      transfer.in_length, " were asked for"));
    }
    if (header.length > packet.data.size()) {
      return Bad(packet, absl::StrCat(header.length, " bytes came in, but it holds only ",
                                      packet.data.size(), " of them"));
    }
    transfer.in = packet.data.first(header.length);
  }
  session.steps.push_back({index, true});
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<RecordedSession>> ReadSessions(std::span<const std::byte> file) {
  PcapngReader reader(file);
  SessionReader sessions;
  while (true) {
    const absl::StatusOr<std::optional<UsbPacket>> packet = reader.Next();
    if (!packet.ok()) return packet.status();
    if (!packet->has_value()) break;
    const absl::Status status = sessions.Take(**packet);
    if (!status.ok()) return status;
  }
  if (sessions.sessions.empty()) {
    return absl::InvalidArgumentError("the recording has no packets");
  }
  return std::move(sessions.sessions);
}

std::string TransferName(TransferType type, uint8_t endpoint) {
  if (type == TransferType::kControl) return "control";
  return absl::StrFormat("%s %s 0x%02x", type == TransferType::kBulk ? "bulk" : "interrupt",
                         (endpoint & kIn) != 0 ? "IN" : "OUT", endpoint);
}

}  // namespace voxeld::display
