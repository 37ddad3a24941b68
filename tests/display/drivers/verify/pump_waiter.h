// A conformance run in one thread on a fake clock: waiting means running the device.
#pragma once

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "display/conformance/runner.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"

namespace voxeld::display::conformance {

class PumpWaiter final : public Waiter {
 public:
  PumpWaiter(InProcessTransport& transport, sync::FakeClock& clock)
      : transport_(transport), clock_(clock) {
    transport_.SetWake([this] { woken_ = true; });
  }
  ~PumpWaiter() override { transport_.SetWake(nullptr); }

  void Wait(sync::TimeNs until) override {
    woken_ = false;
    const sync::TimeNs next = transport_.Pump();
    if (woken_) return;
    clock_.AdvanceTo(std::max(clock_.Now(), std::min(next, until)));
    transport_.Pump();
  }

 private:
  InProcessTransport& transport_;
  sync::FakeClock& clock_;
  bool woken_ = false;
};

// A device model on its cable, with a suite, ready to run.
class Rig {
 public:
  Rig(std::unique_ptr<UsbDeviceModel> device, sync::FakeClock& clock, Suite suite) : clock_(clock) {
    InProcessTransport::Options options;
    options.own_thread = false;
    auto transport = std::make_unique<InProcessTransport>(std::move(device), clock, options);
    transport_ = transport.get();
    subject_ = {"device", std::move(transport), std::move(suite)};
  }

  InProcessTransport& transport() { return *transport_; }

  absl::StatusOr<RunResult> Run(RunOptions options = {}) {
    PumpWaiter waiter(*transport_, clock_);
    return conformance::Run(subject_, clock_, waiter, options);
  }

 private:
  sync::FakeClock& clock_;
  InProcessTransport* transport_ = nullptr;
  Subject subject_;
};

// Returns "volume.whole (5.4): expected …; seen …" for each case that failed, for messages.
inline std::string Failures(const RunResult& run) {
  std::string text;
  for (const CaseResult& result : run.results) {
    if (result.verdict.kind != Verdict::Kind::kFailed) continue;
    absl::StrAppend(&text, "\n", result.what->id, " (", result.what->section, "): expected ",
                    result.verdict.expected, "; seen ", result.verdict.seen);
  }
  return text;
}

inline std::set<std::string> FailedIds(const RunResult& run) {
  std::set<std::string> ids;
  for (const CaseResult& result : run.results) {
    if (result.verdict.kind == Verdict::Kind::kFailed) ids.insert(result.what->id);
  }
  return ids;
}

}  // namespace voxeld::display::conformance
