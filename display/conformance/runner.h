// Runs a suite on a device.
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
  const Case* what = nullptr;  // points into the suite
  Verdict verdict;
  sync::TimeNs duration = 0;
};

struct RunResult {
  UsbIdentity identity;             // the device's, while it was open
  std::vector<CaseResult> results;  // of the selected cases, in their order
  // Returns how often a verdict was given.
  size_t Count(Verdict::Kind kind) const;
};

struct RunOptions {
  std::function<bool(const Case&)> wanted;               // null: all
  std::function<void(const Case&)> on_begin;             // may be null
  std::function<void(const CaseResult& result)> on_end;  // may be null
  std::function<bool()> cancelled;                       // may be null; called from any thread
  // seed of the cases' random choices; a case's choices do not depend on other cases
  uint64_t seed = 1;
};

// Opens the transport, runs the cases, leaves the device at rest and closes. A case that loses its
// device fails; the ones after it wait a while for the device to come back. Errors: Open's, if no
// device was found at first; Cancelled when `cancelled` returned true.
absl::StatusOr<RunResult> Run(Subject& subject, sync::Clock& clock, Waiter& waiter,
                              const RunOptions& options);

}  // namespace voxeld::display::conformance
