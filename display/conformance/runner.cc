#include "display/conformance/runner.h"

#include <algorithm>
#include <utility>

namespace voxeld::display::conformance {
namespace {

constexpr sync::TimeNs kComeBack = 5 * sync::kSecond;
constexpr sync::TimeNs kLook = 100 * sync::kMillisecond;

// FNV-1a: a case's random choices must not depend on the standard library.
uint64_t SeedOf(const Case& what, uint64_t seed) {
  uint64_t hash = 14695981039346656037u ^ seed;
  for (const char c : what.id) hash = (hash ^ static_cast<uint8_t>(c)) * 1099511628211u;
  return hash;
}

class Desk {
 public:
  Desk(Subject& subject, sync::Clock& clock, Waiter& waiter, const RunOptions& options)
      : subject_(subject), clock_(clock), waiter_(waiter), options_(options) {}

  bool cancelled() const { return options_.cancelled && options_.cancelled(); }

  CaseResult RunCase(const Case& what) {
    const sync::TimeNs begin = clock_.Now();
    CaseResult result{.what = &what, .verdict = {}, .duration = 0};
    if (absl::Status status = Ready(); !status.ok()) {
      Check check;
      check.Fail("a device that is there and can be stopped", std::string(status.message()));
      result.verdict = check.verdict();
    } else {
      Probe probe(*subject_.transport, clock_, waiter_, SeedOf(what, options_.seed),
                  options_.cancelled);
      what.run(probe);
      result.verdict = probe.check().verdict();
    }
    result.duration = clock_.Now() - begin;
    return result;
  }

  // Also for a cancelled run.
  void Leave() {
    if (!subject_.transport->is_open()) return;
    Rest().IgnoreError();
    subject_.transport->Close();
  }

 private:
  absl::Status Rest() {
    Probe probe(*subject_.transport, clock_, waiter_, options_.seed, nullptr);
    return subject_.suite.rest(probe);
  }

  // Opens the device and brings it to rest. A device that does not come to rest is reopened once.
  absl::Status Ready() {
    absl::Status status = subject_.transport->is_open() ? Rest() : absl::UnavailableError("");
    if (status.ok()) return status;
    subject_.transport->Close();
    // If it is gone already, the next case need not wait as long again.
    const sync::TimeNs deadline = clock_.Now() + (gone_ ? 0 : kComeBack);
    while (true) {
      status = subject_.transport->Open();
      if (status.ok() || clock_.Now() >= deadline || cancelled()) break;
      const sync::TimeNs next = std::min(deadline, clock_.Now() + kLook);
      while (clock_.Now() < next) waiter_.Wait(next);
    }
    gone_ = !status.ok();
    return status.ok() ? Rest() : status;
  }

  Subject& subject_;
  sync::Clock& clock_;
  Waiter& waiter_;
  const RunOptions& options_;
  bool gone_ = false;  // it did not come back within the wait
};

}  // namespace

size_t RunResult::Count(Verdict::Kind kind) const {
  return static_cast<size_t>(
      std::count_if(results.begin(), results.end(),
                    [&](const CaseResult& result) { return result.verdict.kind == kind; }));
}

absl::StatusOr<RunResult> Run(Subject& subject, sync::Clock& clock, Waiter& waiter,
                              const RunOptions& options) {
  if (absl::Status status = subject.transport->Open(); !status.ok()) return status;
  Desk desk(subject, clock, waiter, options);
  RunResult result{.identity = subject.transport->identity(), .results = {}};
  for (const Case& what : subject.suite.cases) {
    if (options.wanted && !options.wanted(what)) continue;
    if (options.on_begin) options.on_begin(what);
    CaseResult ended = desk.RunCase(what);
    if (desk.cancelled()) break;
    if (options.on_end) options.on_end(ended);
    result.results.push_back(std::move(ended));
  }
  desk.Leave();
  if (desk.cancelled()) return absl::CancelledError("interrupted; the device was stopped");
  return result;
}

}  // namespace voxeld::display::conformance
