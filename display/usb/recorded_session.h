// A recording of one device as what happened between each Open and its Close.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display {

struct RecordedTransfer {
  uint64_t packet = 0;  // number of its submission in the file
  TransferType type = TransferType::kBulk;
  uint8_t endpoint = 0;  // 0: control
  UsbSetup setup;
  uint32_t out_length = 0;         // 0 of IN transfers
  std::span<const std::byte> out;  // what the capture kept of it
  uint32_t in_length = 0;          // asked for
  sync::TimeNs submitted_ns = 0;

  bool refused = false;  // with `refusal`; then nothing else follows
  absl::Status refusal;
  TransferStatus status = TransferStatus::kOk;
  uint32_t actual_length = 0;
  std::span<const std::byte> in;
  sync::TimeNs completed_ns = 0;
};

struct RecordedStep {
  size_t transfer = 0;     // of the session's
  bool completes = false;  // else it was submitted
};

struct RecordedSession {
  std::vector<RecordedTransfer> transfers;
  std::vector<RecordedStep> steps;                     // in the order in which they happened
  std::map<uint8_t, std::vector<size_t>> by_endpoint;  // transfers in order
  sync::TimeNs first_ns = 0, last_ns = 0;
};

// Sessions of a pcapng file; `file` must outlive them. A session is a device address's packets.
// InvalidArgument with the packet's number if the recording is damaged, incomplete, or has what a
// UsbTransport does not do.
absl::StatusOr<std::vector<RecordedSession>> ReadSessions(std::span<const std::byte> file);

// "control", "bulk OUT 0x01": what a transfer is called in messages.
std::string TransferName(TransferType type, uint8_t endpoint);

}  // namespace voxeld::display
