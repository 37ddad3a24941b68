// The hand of a conformance case on its device: transfers that are waited for, each with a limit, so
// that no device can hold a run up. What does not come back is cancelled and told as timed out.
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
  std::vector<std::byte> data;  // IN: what came
  // A request, or a read, that the device served.
  bool ok() const { return status == TransferStatus::kOk || status == TransferStatus::kShort; }
};

// "stall", or "ok, 16 bytes".
std::string Describe(const Answer& answer);
// "12 01 00 …": at most 64 bytes.
std::string Hex(std::span<const std::byte> bytes);

class Probe {
 public:
  static constexpr sync::TimeNs kRequestLimit = 2 * sync::kSecond;
  static constexpr sync::TimeNs kBulkLimit = 5 * sync::kSecond;

  // `cancelled`, if it is set: nothing is waited for any more once it says so, and the check fails.
  Probe(UsbTransport& transport, sync::Clock& clock, Waiter& waiter, uint64_t seed,
        std::function<bool()> cancelled);
  // Cancels what is still in flight.
  ~Probe();
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

  Check& check() { return check_; }
  UsbTransport& transport() { return transport_; }
  sync::TimeNs Now() const { return clock_.Now(); }
  // 0 to `bound` − 1, the same for the same seed.
  uint32_t Random(uint32_t bound);

  Answer In(const UsbSetup& setup);
  Answer Out(const UsbSetup& setup, std::span<const std::byte> data = {});
  Answer Bulk(uint8_t endpoint, std::span<const std::byte> data, bool zero_packet = false,
              sync::TimeNs limit = kBulkLimit);
  Answer ClearHalt(uint8_t endpoint);
  // What is in flight is cancelled.
  Answer Reset();

  // Without waiting; nothing if the device is gone. Timeouts are the caller's affair.
  std::optional<TransferId> Post(Transfer&& transfer);
  // Of a posted transfer: its completion, once.
  std::optional<TransferCompletion> Take(TransferId id);
  // Cancels posted transfers and waits for their ends.
  void Cancel(const std::vector<TransferId>& ids);
  // Something completes, or `until` has come. False once the run is cancelled.
  bool Step(sync::TimeNs until);
  // Until `done`, at most for `limit`. True if `done` held.
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
  std::set<TransferId> posted_;  // and neither completed nor given up
  std::map<TransferId, TransferCompletion> done_;
  std::vector<TransferCompletion> drained_;
};

}  // namespace voxeld::display::conformance
