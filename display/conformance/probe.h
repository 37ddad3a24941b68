// A conformance case's access to its device: blocking transfers, each with a time limit, so that no
// device can stall a run. Transfers that do not end are cancelled and reported as timed out.
//
// Single-threaded.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <vector>

#include "display/conformance/check.h"
#include "display/conformance/waiter.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::conformance {

struct Answer {
  TransferStatus status = TransferStatus::kError;
  uint32_t actual = 0;
  std::vector<std::byte> data;  // IN: the received data
  // The device served the request or read.
  bool ok() const { return status == TransferStatus::kOk || status == TransferStatus::kShort; }
};

// Returns "stall", or "ok, 16 bytes".
std::string Describe(const Answer& answer);
// Returns "12 01 00 …": at most 64 bytes.
std::string Hex(std::span<const std::byte> bytes);

class Probe {
 public:
  static constexpr sync::TimeNs kRequestLimit = 2 * sync::kSecond;
  static constexpr sync::TimeNs kBulkLimit = 5 * sync::kSecond;

  // Once `cancelled`, if it is set, returns true, all waits end and the check fails.
  Probe(UsbTransport& transport, sync::Clock& clock, Waiter& waiter, uint64_t seed,
        std::function<bool()> cancelled);
  // Cancels what is still in flight.
  ~Probe();
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  Check& check() { return check_; }
  UsbTransport& transport() { return transport_; }
  sync::TimeNs Now() const { return clock_.Now(); }
  // Returns 0 to `bound` − 1, the same for the same seed.
  uint32_t Random(uint32_t bound);

  Answer In(const UsbSetup& setup);
  Answer Out(const UsbSetup& setup, std::span<const std::byte> data = {});
  Answer Bulk(uint8_t endpoint, std::span<const std::byte> data, bool zero_packet = false,
              sync::TimeNs limit = kBulkLimit);
  Answer ClearHalt(uint8_t endpoint);
  // Cancels what is in flight.
  Answer Reset();

  // Submits without waiting; returns nothing if the device is gone. Timeouts are up to the caller.
  std::optional<TransferId> Post(Transfer&& transfer);
  // Returns a posted transfer's completion, once.
  std::optional<TransferCompletion> Take(TransferId id);
  // Cancels posted transfers and waits for them to end.
  void Cancel(const std::vector<TransferId>& ids);
  // Waits until something completes, or until `until`. Returns false once the run is cancelled.
  bool Step(sync::TimeNs until);
  // Waits at most `limit` until `done` returns true. Returns whether it did.
  bool WaitFor(sync::TimeNs limit, const std::function<bool()>& done);
  void Pause(sync::TimeNs duration);

 private:
  Answer Finish(absl::StatusOr<TransferId> id, sync::TimeNs limit);
  Answer Await(TransferId id, sync::TimeNs limit);
  void Drain();

  UsbTransport& transport_;
  sync::Clock& clock_;
  Waiter& waiter_;
  const std::function<bool()> cancelled_;
  std::minstd_rand random_;
  Check check_;
  std::set<TransferId> posted_;  // neither completed nor given up
  std::map<TransferId, TransferCompletion> done_;
  std::vector<TransferCompletion> drained_;
};

}  // namespace voxeld::display::conformance
