// The voxlink driver over a cable to a device that lies, both controlled by a script: each volume
// has one outcome, and once the device tells the truth the display shows the newest one. On a clock
// of its own; single-threaded.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "display/api/display.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "tests/fuzz/voxlink/lying_device.h"

namespace voxeld::fuzz {

// Records the outcomes of volumes.
struct Ledger final : display::Display::Listener {
  void OnOutcome(const display::VolumeOutcome& outcome) override {
    EXPECT_THAT_HOLDS(owed.erase(outcome.volume) == 1, "volume ", outcome.volume,
                      " has an outcome too many");
  }
  void OnState(display::DisplayState, const std::string& reason) override {
    for (const char c : reason) {
      EXPECT_THAT_HOLDS(static_cast<unsigned char>(c) >= 32, "a reason is not printable");
    }
  }
  void OnHeld(uint64_t volume) override { held = volume; }
  void OnOrdered(uint64_t volume, sync::TimeNs, bool taken) override {
    if (!taken) held = volume;
  }
  std::set<uint64_t> owed;
  uint64_t held = 0;  // held by the device; 0: none
};

class HostSession {
 public:
  // The script's first byte selects the mode (its lowest two bits: a genlock's display, if they are
  // 1; the next two: how rare lies are; the highest: numbers of packets and events, and the
  // device's time, begin shortly before they wrap).
  explicit HostSession(Script& script);
  ~HostSession() { display_->Stop(); }

  void Run();

 private:
  bool ShowsTheNewest() const;
  void Order(sync::TimeNs at, uint32_t ahead);
  void Step();
  void Submit(uint8_t value);
  void Plug(bool plugged);
  void Settle();
  void Pass(sync::TimeNs duration);

  Script& script_;
  sync::FakeClock clock_;
  Ledger ledger_;
  display::DisplayInfo info_;
  display::emulator::VoxlinkDevice* screen_ = nullptr;
  LyingDevice* device_ = nullptr;
  display::InProcessTransport* cable_ = nullptr;
  std::unique_ptr<display::voxlink::VoxlinkDisplay> display_;
  std::shared_ptr<display::SliceFrame> newest_;
  uint64_t volume_ = 0;
  bool holding_ = false;
  bool rare_ = false;  // of lies, darkness and unplugged cables
  bool woken_ = false;
  sync::TimeNs next_ = 0;
};

}  // namespace voxeld::fuzz
