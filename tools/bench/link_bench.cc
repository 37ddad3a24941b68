// Measures what a display's driver and its transport cost and which rate they reach, with
// pre-rendered volumes of which one always waits in the mailbox.
//
//   voxel-link-bench [DEVICE] [--usb] [--plain] [--seconds 10] [--share 1] [--json]
//
// DEVICE is "key=value,…", the options of the simulated driver. The default is a display of 192
// one-bit frames of 912x1140 pixels per volume at 15 volumes a second, at the end of a cable of 400
// MB/s. Without --usb the device is a model in this process, and its CPU time is reported
// separately. With --usb it is a device of this system that has those options; --plain sends it
// packets that are ready in memory, through libusb alone. --share is the share of the slice images
// that change from volume to volume.
#include <pthread.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "display/drivers/registry.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "display/usb/in_process.h"
#include "display/usb/libusb/libusb_bus.h"
#include "tools/bench/plain_link.h"
#include "tools/bench/timed_model.h"

namespace voxeld::bench {
namespace {

using display::Display;
using display::SliceFrame;
using sync::TimeNs;

constexpr const char* kVx1 = "size=912x1140x64,format=bitplanes,rate=15,pacing=400000000";

[[noreturn]] void Fail(const std::string& why) {
  std::fprintf(stderr, "voxel-link-bench: %s\n", why.c_str());
  std::exit(1);
}

TimeNs ProcessCpu() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto ns = [](const timeval& time) {
    return time.tv_sec * sync::kSecond + time.tv_usec * 1000;
  };
  return ns(usage.ru_utime) + ns(usage.ru_stime);
}

// Volumes whose bytes are made beforehand. With a share below 1, a volume differs from the previous
// one in some slice images only.
class Frames {
 public:
  Frames(const display::FrameLayout& layout, double share) : layout_(layout), share_(share) {
    std::mt19937_64 random(1);
    // One volume is shown, one is being sent, one waits, and one is being made.
    for (size_t i = 0; i < (share < 1 ? 1 : 5); ++i) {
      auto frame = std::make_shared<SliceFrame>();
      frame->layout = layout;
      frame->bytes.resize(layout.bytes());
      frame->changed_in.resize(layout.pictures());
      for (std::byte& byte : frame->bytes) byte = static_cast<std::byte>(random());
      ring_.push_back(std::move(frame));
    }
  }

  display::SliceFramePtr Next() {
    ++volume_;
    if (share_ < 1 && volume_ > 1) {
      ring_[0] = std::make_shared<SliceFrame>(*ring_[0]);
      const size_t size = layout_.bytes_per_slice(), pictures = layout_.pictures();
      const auto changed = std::max<size_t>(1, static_cast<size_t>(share_ * pictures));
      for (size_t i = 0; i < changed; ++i) {
        const size_t p = (volume_ * changed + i) % pictures;
        for (size_t b = 0; b < size; ++b) ring_[0]->bytes[p * size + b] ^= std::byte{0x5A};
        ring_[0]->changed_in[p] = volume_;
      }
    } else {
      std::rotate(ring_.begin(), ring_.begin() + 1, ring_.end());
      if (ring_[0].use_count() > 1) Fail("a volume is held for longer than the driver says");
      std::fill(ring_[0]->changed_in.begin(), ring_[0]->changed_in.end(), volume_);
    }
    ring_[0]->volume = volume_;
    return ring_[0];
  }

 private:
  const display::FrameLayout layout_;
  const double share_;
  std::vector<std::shared_ptr<SliceFrame>> ring_;  // newest first
  uint64_t volume_ = 0;
};

struct Result {
  uint64_t presented = 0, lost = 0, underruns = 0, bytes = 0, recoveries = 0;
  double seconds = 0;
  double driver = 0, transport = 0, model = 0;  // shares of a core
};

// Owns a display for some time, as the daemon's pipeline does.
class Run final : private Display::Listener {
 public:
  Run(Display& display, const TimedModel* model, sync::Clock& clock, double share)
      : display_(display), model_(model), clock_(clock), frames_(display.info().layout, share) {}

  Result For(double seconds) {
    Start();
    const auto duration = static_cast<TimeNs>(seconds * sync::kSecond);
    const TimeNs patience = clock_.Now() + 20 * sync::kSecond;
    while (began_ == 0 || clock_.Now() < began_ + duration) {
      if (began_ == 0 && clock_.Now() > patience) {
        Fail(absl::StrCat("no volume is shown: ", display_.state_reason()));
      }
      const TimeNs next = display_.Tick();
      while (display_.mailbox_free()) display_.Submit(frames_.Next());
      Wait(next);
    }
    Account(+1);
    result_.seconds = static_cast<double>(clock_.Now() - began_) / sync::kSecond;
    result_.underruns = display_.stats().underruns - underruns_before_;
    for (double* part : {&result_.driver, &result_.transport, &result_.model}) {
      *part /= result_.seconds * sync::kSecond;
    }
    counting_ = false;
    display_.Stop();
    return result_;
  }

 private:
  void Start() {
    const absl::Status status = display_.Start(this, [this] {
      sync::MutexLock lock(mutex_);
      woken_ = true;
      changed_.NotifyAll();
    });
    if (!status.ok()) Fail(std::string(status.message()));
  }

  void Wait(TimeNs next) {
    sync::MutexLock lock(mutex_);
    while (!woken_ && clock_.Now() < next) clock_.WaitUntil(mutex_, changed_, next);
    woken_ = false;
  }

  // Adds (+1) or subtracts (−1) the CPU time used so far.
  void Account(double sign) {
    timespec own{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &own);
    const double driver = static_cast<double>(own.tv_sec) * sync::kSecond + own.tv_nsec;
    result_.driver += sign * driver;
    if (model_ == nullptr) {
      result_.transport += sign * (static_cast<double>(ProcessCpu()) - driver);
    } else {
      const double inside = static_cast<double>(model_->inside_ns());
      result_.model += sign * inside;
      result_.transport += sign * (static_cast<double>(model_->thread_ns()) - inside);
    }
  }

  void OnOutcome(const display::VolumeOutcome& outcome) override {
    if (outcome.kind == display::VolumeOutcome::Kind::kLost) {
      if (counting_) ++result_.lost;
      return;
    }
    if (outcome.kind != display::VolumeOutcome::Kind::kPresented) return;
    if (began_ == 0 && ++shown_before_ == kWarmUp) {
      began_ = clock_.Now();
      counting_ = true;
      underruns_before_ = display_.stats().underruns;
      Account(-1);
      return;
    }
    if (!counting_) return;
    ++result_.presented;
    result_.bytes += outcome.bytes_sent;
  }
  void OnState(display::DisplayState state, const std::string& reason) override {
    if (counting_ && state == display::DisplayState::kLost) Fail(reason);
  }

  static constexpr int kWarmUp = 5;  // volumes

  Display& display_;
  const TimedModel* const model_;
  sync::Clock& clock_;
  Frames frames_;
  Result result_;
  TimeNs began_ = 0;
  bool counting_ = false;
  int shown_before_ = 0;
  uint64_t underruns_before_ = 0;

  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
};

struct Options {
  std::string device = kVx1;
  bool usb = false, plain = false, json = false;
  double seconds = 10, share = 1;
};

template <typename T>
T Must(absl::StatusOr<T> value) {
  if (!value.ok()) Fail(std::string(value.status().message()));
  return *std::move(value);
}

display::DisplayOptions DisplayOptionsOf(const std::string& text, const char* driver) {
  display::DisplayOptions options{.name = "bench", .driver = driver, .options = {}};
  for (const auto& part : absl::StrSplit(text, ',', absl::SkipEmpty())) {
    const std::pair<std::string, std::string> option =
        absl::StrSplit(part, absl::MaxSplits('=', 1));
    options.options[option.first] = option.second;
  }
  return options;
}

void Print(const Options& options, const Result& result, double full_bytes) {
  const double mb = static_cast<double>(result.bytes) / 1e6 / result.seconds;
  const double a_volume =
      result.presented == 0 ? 0 : static_cast<double>(result.bytes) / result.presented;
  if (options.json) {
    std::printf("%s\n", nlohmann::json{{"seconds", result.seconds},
                                       {"volumes", result.presented},
                                       {"lost", result.lost},
                                       {"underruns", result.underruns},
                                       {"megabytes_per_second", mb},
                                       {"bytes_per_volume", a_volume},
                                       {"driver_core_share", result.driver},
                                       {"transport_core_share", result.transport},
                                       {"model_core_share", result.model}}
                            .dump()
                            .c_str());
    return;
  }
  std::printf(
      "%llu volumes in %.1f s: %.2f a second, %.1f MB/s, %.0f bytes a volume (%.1f times "
      "fewer than its pictures have)\n%llu underruns, %llu lost\n",
      static_cast<unsigned long long>(result.presented), result.seconds,
      static_cast<double>(result.presented) / result.seconds, mb, a_volume,
      full_bytes / std::max(a_volume, 1.0), static_cast<unsigned long long>(result.underruns),
      static_cast<unsigned long long>(result.lost));
  if (options.plain) return;
  std::printf("of a core: driver %.1f %%, transport %.1f %%", 100 * result.driver,
              100 * result.transport);
  if (!options.usb) std::printf("; and the device's model %.1f %%", 100 * result.model);
  std::printf("\n");
}

Result InProcess(const Options& options, sync::Clock& clock) {
  auto emulated =
      Must(display::simulated::ReadEmulatedDevice(DisplayOptionsOf(options.device, "simulated")));
  auto model = std::make_unique<TimedModel>(
      std::make_unique<display::emulator::VoxlinkDevice>(emulated.config, clock));
  const TimedModel* const timed = model.get();
  auto transport = std::make_unique<display::InProcessTransport>(
      std::move(model), clock, display::InProcessTransport::Options{});
  display::voxlink::VoxlinkDisplay display(std::move(emulated.info), std::move(transport), clock);
  return Run(display, timed, clock, options.share).For(options.seconds);
}

Result OnUsb(const Options& options, sync::Clock& clock) {
  display::DisplayOptions what = DisplayOptionsOf(options.device, "voxlink");
  // These options concern only the device itself.
  for (const char* key : {"pacing", "speed", "faults"}) what.options.erase(key);
  const std::unique_ptr<display::LibusbBus> bus = Must(display::LibusbBus::Make(clock));
  const std::unique_ptr<Display> display = Must(display::CreateDisplay(
      what, {clock, [&]() -> absl::StatusOr<display::UsbBus*> { return bus.get(); }}));
  return Run(*display, nullptr, clock, options.share).For(options.seconds);
}

int Main(int argc, char** argv) {
  Options options;
  CLI::App app("What a display's driver and its transport cost.", "voxel-link-bench");
  app.add_option("device", options.device, "key=value,…: the simulated driver's options")
      ->capture_default_str();
  app.add_flag("--usb", options.usb, "a device of this system, not a model in this process");
  app.add_flag("--plain", options.plain, "packets ready in memory, through libusb alone");
  app.add_option("--seconds", options.seconds)->check(CLI::Range(0.1, 1e6));
  app.add_option("--share", options.share, "part of the pictures that change")
      ->check(CLI::Range(0.0, 1.0));
  app.add_flag("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  sync::SystemClock clock;
  display::DisplayOptions what = DisplayOptionsOf(options.device, "simulated");
  what.options.erase("record");
  const display::FrameLayout layout =
      Must(display::simulated::ReadEmulatedDevice(what)).info.layout;
  Result result;
  if (options.plain) {
    const PlainResult plain = Must(StreamPlainly(layout, options.seconds));
    result.presented = plain.volumes;
    result.bytes = plain.bytes;
    result.seconds = plain.seconds;
  } else {
    result = options.usb ? OnUsb(options, clock) : InProcess(options, clock);
  }
  Print(options, result, static_cast<double>(layout.bytes()));
  return 0;
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) { return voxeld::bench::Main(argc, argv); }
