// Runs a suite over a device.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "display/conformance/check.h"
#include "display/conformance/suite.h"
#include "display/conformance/waiter.h"
#include "display/sync/clock.h"
#include "display/usb/usb_transport.h"

namespace voxeld::display::conformance {

struct CaseResult {
  const Case* what = nullptr;  // the suite's
  Verdict verdict;
  sync::TimeNs duration = 0;
};

struct RunResult {
  UsbIdentity identity;             // of the device, while it was open
  std::vector<CaseResult> results;  // of the cases that were wanted, in their order
  // How often a verdict was given.
  size_t Count(Verdict::Kind kind) const;
};

struct RunOptions {
  std::function<bool(const Case&)> wanted;               // null: all
  std::function<void(const Case&)> on_begin;             // may be null
  std::function<void(const CaseResult& result)> on_end;  // may be null
  std::function<bool()> cancelled;                       // may be null; any thread's flag
  uint64_t seed = 1;  // of what cases choose by chance; a case's choices depend on no other case
};

// Opens the transport, runs, leaves the device at rest and closes. A case that finds no device any
// more fails; the ones after it wait a while for it to come back. What Open says, if there is no
// device to begin with; Cancelled when `cancelled` said so.
absl::StatusOr<RunResult> Run(Subject& subject, sync::Clock& clock, Waiter& waiter,
                              const RunOptions& options);

}  // namespace voxeld::display::conformance
