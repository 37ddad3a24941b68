#include "tools/voxelctl/verify/verify.h"

#include <fnmatch.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "daemon/config/display_config.h"
#include "daemon/config/display_view.h"
#include "display/conformance/runner.h"
#include "display/drivers/registry.h"
#include "display/sync/clock.h"
#include "display/usb/libusb/libusb_bus.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"
#include "tools/voxelctl/verify/report.h"

namespace voxeld::voxelctl {
namespace {

using display::conformance::Case;
using display::conformance::CaseResult;
using display::conformance::RunOptions;
using display::conformance::RunResult;
using display::conformance::Subject;
using display::conformance::Verdict;
using display::conformance::WakeWaiter;

// Parses "[NAME=]DRIVER[,KEY=VALUE…]", like the daemon's --display except that the name may be left
// out; the daemon's own options (`view`) are checked and have no effect.
absl::StatusOr<display::DisplayOptions> ReadDisplay(const std::string& text) {
  const std::string first = text.substr(0, text.find(','));
  const bool named = absl::StrContains(first, '=');
  const absl::StatusOr<daemon::DisplayConfig> config =
      daemon::ParseDisplayOption(named ? text : absl::StrCat(first, "=", text));
  if (!config.ok()) return config.status();
  absl::StatusOr<daemon::DisplayOptions> split = daemon::SplitDisplayOptions(*config);
  if (!split.ok()) return split.status();
  return display::DisplayOptions{
      .name = config->name, .driver = config->driver, .options = std::move(split->driver)};
}

// Returns the error of Open with a remedy.
absl::Status CannotOpen(const Subject& subject, const absl::Status& status) {
  std::string help;
  if (absl::IsNotFound(status)) {
    help =
        "; plug it in and switch it on, or say which is meant by its options "
        "(`lsusb` lists what is attached)";
  } else if (absl::IsUnavailable(status)) {
    help =
        "; if voxeld drives it, stop voxeld (`systemctl stop voxeld`) or take the display out "
        "of its configuration: a device has one host";
  }
  return absl::UnavailableError(absl::StrCat(EscapeForTerminal(subject.name), ": ",
                                             EscapeForTerminal(status.message()), help));
}

class Command {
 public:
  Command(const VerifyOptions& options, Interrupt& interrupt, Console& console)
      : options_(options), interrupt_(interrupt), console_(console) {}

  absl::Status Run() {
    const absl::StatusOr<display::DisplayOptions> wanted = ReadDisplay(options_.display);
    if (!wanted.ok()) return wanted.status();
    absl::StatusOr<std::vector<Subject>> subjects =
        display::VerifySubjects(*wanted, {clock_, [this] { return Usb(); }});
    if (!subjects.ok()) return subjects.status();
    if (absl::Status status = CheckFilter(*subjects); !status.ok()) return status;
    if (options_.list) return List(*subjects);

    std::ofstream junit;
    if (!options_.junit.empty()) {
      // Checked before the run, which may take minutes.
      junit.open(options_.junit, std::ios::binary | std::ios::trunc);
      if (!junit) return CannotWrite();
    }
    VerifyReport report{
        .display = wanted->name, .driver = wanted->driver, .seed = options_.seed, .devices = {}};
    for (Subject& subject : *subjects) {
      absl::StatusOr<RunResult> run = RunOne(subject);
      if (!run.ok()) return run.status();
      report.devices.push_back(
          {subject.name, subject.suite.protocol, subject.suite.page, *std::move(run)});
    }
    if (!options_.junit.empty()) {
      junit << JunitXml(report) << std::flush;
      if (!junit) return CannotWrite();
    }
    if (console_.json()) console_.Data(JsonText(ReportJson(report), false));
    const size_t failed = report.Count(Verdict::Kind::kFailed);
    const std::string summary = SummaryText(report);
    if (failed > 0) return absl::FailedPreconditionError(summary);
    if (!console_.json()) console_.Data(absl::StrCat(summary, "\n"));
    return absl::OkStatus();
  }

 private:
  // Created when the first display needs it.
  absl::StatusOr<display::UsbBus*> Usb() {
    if (usb_ == nullptr) {
      absl::StatusOr<std::unique_ptr<display::LibusbBus>> made = display::LibusbBus::Make(clock_);
      if (!made.ok()) return made.status();
      usb_ = *std::move(made);
    }
    return usb_.get();
  }

  absl::Status CannotWrite() const {
    return absl::InternalError(
        absl::StrCat("--junit: ", EscapeForTerminal(options_.junit), " cannot be written"));
  }

  bool Wanted(const Case& what) const {
    return options_.filter.empty() ||
           fnmatch(options_.filter.c_str(), what.id.c_str(), FNM_EXTMATCH) == 0;
  }

  absl::Status CheckFilter(const std::vector<Subject>& subjects) const {
    for (const Subject& subject : subjects) {
      for (const Case& what : subject.suite.cases) {
        if (Wanted(what)) return absl::OkStatus();
      }
    }
    return absl::InvalidArgumentError(
        absl::StrCat("--filter is ", EscapeForTerminal(options_.filter),
                     ", which no case matches; one such as 'volume.*' is expected (`voxelctl "
                     "verify DISPLAY --list` names the cases)"));
  }

  absl::Status List(const std::vector<Subject>& subjects) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    Table table({{"CASE"}, {"SECTION"}, {"WHAT THE DEVICE DOES"}});
    const Subject& subject = subjects.front();  // all devices of a display are of one kind
    for (const Case& what : subject.suite.cases) {
      if (!Wanted(what)) continue;
      list.push_back({{"id", what.id}, {"section", what.section}, {"title", what.title}});
      table.Add({what.id, what.section, what.title});
    }
    console_.Data(console_.json() ? JsonText({{"protocol", subject.suite.protocol},
                                              {"page", subject.suite.page},
                                              {"cases", std::move(list)}},
                                             false)
                                  : table.Text());
    return absl::OkStatus();
  }

  // Opens the device, and waits for a missing one as long as requested.
  absl::Status Open(Subject& subject) {
    constexpr sync::TimeNs kLook = 100 * sync::kMillisecond;
    const auto wait = static_cast<sync::TimeNs>(options_.wait_s * sync::kSecond);
    const sync::TimeNs deadline = clock_.Now() + wait;
    absl::Status status = subject.transport->Open();
    while (absl::IsNotFound(status) && clock_.Now() < deadline &&
           !interrupt_.WaitUntil(clock_, std::min(deadline, clock_.Now() + kLook))) {
      status = subject.transport->Open();
    }
    return status;
  }

  absl::StatusOr<RunResult> RunOne(Subject& subject) {
    // Opening reports what is wrong with a remedy; running would report it without one.
    if (absl::Status status = Open(subject); !status.ok()) return CannotOpen(subject, status);
    if (!console_.json()) Announce(subject);
    subject.transport->Close();

    WakeWaiter waiter(*subject.transport, clock_);
    const int listener = interrupt_.AddListener([&waiter] { waiter.Wake(); });
    const auto done = absl::MakeCleanup([&] { interrupt_.RemoveListener(listener); });
    RunOptions run;
    run.seed = options_.seed;
    run.wanted = [this](const Case& what) { return Wanted(what); };
    run.cancelled = [this] { return interrupt_.requested(); };
    if (!console_.json()) {
      run.on_begin = [this](const Case& what) { console_.Progress(absl::StrCat(what.id, " …")); };
      run.on_end = [&](const CaseResult& result) {
        console_.Data(CaseText(result, subject.suite.page));
      };
    }
    absl::StatusOr<RunResult> result = display::conformance::Run(subject, clock_, waiter, run);
    if (result.ok() || absl::IsCancelled(result.status())) return result;
    return CannotOpen(subject, result.status());
  }

  void Announce(const Subject& subject) {
    const display::UsbIdentity identity = subject.transport->identity();
    console_.Data(absl::StrCat(EscapeForTerminal(subject.name), ": ", subject.suite.protocol,
                               ", device ", absl::Hex(identity.vendor_id, absl::kZeroPad4), ":",
                               absl::Hex(identity.product_id, absl::kZeroPad4), ", serial ",
                               EscapeForTerminal(identity.serial), ", at ",
                               EscapeForTerminal(identity.path), "\n"));
  }

  const VerifyOptions& options_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  std::unique_ptr<display::LibusbBus> usb_;
};

}  // namespace

absl::Status Verify(const VerifyOptions& options, Interrupt& interrupt, Console& console) {
  return Command(options, interrupt, console).Run();
}

}  // namespace voxeld::voxelctl
