// A display of Fadecandy boards, with the boards in the same thread, on a clock that a test moves.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/fadecandy_display.h"
#include "display/emulator/fadecandy_device.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/hostile_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display::fadecandy {

inline constexpr sync::TimeNs kRefresh = 2'500'000;

class FadecandyRig {
 public:
  // Returns settings for linear light: no gamma, no dither, no interpolation.
  static FadecandyDisplay::Settings Straight();

  // Boards with serials "A", "B", … in a display of 60 volumes/s; if it accepts any serial, "Z",
  // "Y", ….
  explicit FadecandyRig(size_t boards = 1, FadecandyDisplay::Settings settings = Straight(),
                        bool any_serial = false);
  ~FadecandyRig();

  Display& display() { return *display_; }
  sync::FakeClock& clock() { return clock_; }
  Recorder& recorder() { return recorder_; }
  size_t boards() const { return boards_.size(); }
  emulator::FadecandyDevice& device(size_t board) { return *boards_[board].device; }
  emulator::FaultInjector& faults(size_t board) { return *boards_[board].faults; }
  emulator::HostileDevice& hostile(size_t board) { return *boards_[board].hostile; }
  InProcessTransport& transport(size_t board) { return *boards_[board].transport; }

  void Start();
  void SetPlugged(size_t board, bool plugged);
  // The same as in Rig.
  void Settle();
  bool RunUntil(const std::function<bool()>& done, sync::TimeNs limit = 10 * sync::kSecond);
  void RunFor(sync::TimeNs duration);
  bool RunUntilOutcome(uint64_t volume, sync::TimeNs limit = 10 * sync::kSecond);
  // Called whenever a board may have lit something.
  void SetObserver(std::function<void()> observer) { observer_ = std::move(observer); }

  // Returns whether the board lights the picture of `frame` as linear light.
  bool Sees(size_t board, const SliceFrame& frame) const;
  bool Sees(const SliceFrame& frame) const;
  bool IsDark(size_t board) const;

 private:
  struct BoardParts {
    emulator::FadecandyDevice* device;
    emulator::HostileDevice* hostile;
    emulator::FaultInjector* faults;
    InProcessTransport* transport;
  };

  sync::FakeClock clock_;
  Recorder recorder_;
  std::vector<BoardParts> boards_;
  std::unique_ptr<FadecandyDisplay> display_;
  std::function<void()> observer_;
  bool woken_ = false;
  sync::TimeNs next_tick_ = 0;
  sync::TimeNs next_pump_ = 0;
};

// Creates a display from options, and its boards, with threads of their own.
absl::StatusOr<std::unique_ptr<Display>> CreateEmulated(const DisplayOptions& options,
                                                        sync::Clock& clock);

}  // namespace voxeld::display::fadecandy
