// A display with its device in one thread and on a clock that a test moves.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/drivers/simulated/simulated.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"

namespace voxeld::display {

// Records the display's reports, in order.
struct Recorder final : Display::Listener {
  void OnOutcome(const VolumeOutcome& outcome) override { outcomes.push_back(outcome); }
  void OnState(DisplayState state, const std::string& reason) override {
    states.emplace_back(state, reason);
  }
  bool HasNewer() const override { return has_newer; }
  void OnHeld(uint64_t volume) override { held.push_back(volume); }
  void OnOrdered(uint64_t volume, sync::TimeNs at, bool taken) override {
    orders.push_back({volume, at, taken});
  }
  // Returns the number of outcomes of one volume.
  int Count(uint64_t volume) const;
  const VolumeOutcome* Of(uint64_t volume) const;

  struct Order {
    uint64_t volume;
    sync::TimeNs at;
    bool taken;
  };
  bool has_newer = false;
  std::vector<uint64_t> held;
  std::vector<Order> orders;
  std::vector<VolumeOutcome> outcomes;
  std::vector<std::pair<DisplayState, std::string>> states;
};

// Frames whose pictures change at random, numbered as an engine would number them.
class FrameSource {
 public:
  FrameSource(const FrameLayout& layout, uint32_t seed);
  // Returns the next volume, in which each picture changes with probability `share`, and at least
  // one if that is above 0.
  SliceFramePtr Next(double share);
  std::mt19937& random() { return random_; }

 private:
  std::mt19937 random_;
  SliceFrame current_;
};

class Rig {
 public:
  // `options` of the simulated driver; small by default: size=8x8x6.
  explicit Rig(std::map<std::string, std::string> options = {});
  ~Rig();

  Display& display() { return *parts_.display; }
  sync::FakeClock& clock() { return clock_; }
  Recorder& recorder() { return recorder_; }
  emulator::VoxlinkDevice& device() { return *parts_.device; }
  emulator::FaultInjector& faults() { return *parts_.faults; }
  InProcessTransport& transport() { return *parts_.transport; }

  void Start();
  // Runs everything of device and driver that is due now, until nothing is left.
  void Settle();
  // Advances the time to what is due next, step by step, until `done` or for `limit`. Returns false
  // if it was not done.
  bool RunUntil(const std::function<bool()>& done, sync::TimeNs limit = 10 * sync::kSecond);
  void RunFor(sync::TimeNs duration);
  // Runs until the volume has its outcome.
  bool RunUntilOutcome(uint64_t volume, sync::TimeNs limit = 10 * sync::kSecond);
  void SetPlugged(bool plugged);
  // Sets a function that is called whenever the device may have done something, before the driver
  // is notified.
  void SetObserver(std::function<void()> observer) { observer_ = std::move(observer); }

 private:
  sync::FakeClock clock_;
  Recorder recorder_;
  simulated::Parts parts_;
  std::function<void()> observer_;
  bool woken_ = false;
  sync::TimeNs next_tick_ = 0;
  sync::TimeNs next_pump_ = 0;
};

}  // namespace voxeld::display
