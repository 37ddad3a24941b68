// Divides a recording of one device into sessions, from each Open to its Close.
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
  uint32_t out_length = 0;         // 0 for IN transfers
  std::span<const std::byte> out;  // the part of it that the capture kept
  uint32_t in_length = 0;          // requested
  sync::TimeNs submitted_ns = 0;

  bool refused = false;  // set with `refusal`; then nothing else follows
  absl::Status refusal;
  TransferStatus status = TransferStatus::kOk;
  uint32_t actual_length = 0;
  std::span<const std::byte> in;
  sync::TimeNs completed_ns = 0;
};

struct RecordedStep {
  size_t transfer = 0;     // index in the session
  bool completes = false;  // false: it was submitted
};

struct RecordedSession {
  std::vector<RecordedTransfer> transfers;
  std::vector<RecordedStep> steps;                     // in the order in which they happened
  std::map<uint8_t, std::vector<size_t>> by_endpoint;  // transfers in order
  sync::TimeNs first_ns = 0, last_ns = 0;
};

// Returns the sessions of a pcapng file, which must outlive them. A session is the packets of one
// device address. Errors: InvalidArgument with the packet's number if the recording is damaged or
// incomplete, or contains something that a UsbTransport does not do.
absl::StatusOr<std::vector<RecordedSession>> ReadSessions(std::span<const std::byte> file);

// Returns a transfer's name for messages: "control", "bulk OUT 0x01".
std::string TransferName(TransferType type, uint8_t endpoint);

}  // namespace voxeld::display
