// Tests displays in genlock: what their devices show, sweep by sweep, in one thread under a clock
// that stands still.
//
// The oracle knows nothing of volumes and orders: the scene is a number in lit voxels, and the
// number that each device shows in each of its sweeps is read from its slice images.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "daemon/core/core.h"
#include "display/drivers/simulated/simulated.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Dots;
using testing::Entity1;
using testing::Put;
using testing::RecordingSink;

constexpr int kBits = 20;  // of the number shown
constexpr int kRate = 200;
constexpr sync::TimeNs kPeriod = sync::kSecond / kRate;

// A device, and the number seen on it; nullopt: it is dark, or shows the scene from before the
// first number.
struct Screen {
  std::string name;
  display::simulated::Parts parts;
  std::optional<uint64_t> shown;
  uint64_t changes = 0;
};

class Wall {
 public:
  explicit Wall(std::vector<std::map<std::string, std::string>> displays) {
    CoreOptions options;
    options.threads = false;
    core_.emplace(std::move(options), clock_);
    for (size_t i = 0; i < displays.size(); ++i) {
      displays[i].merge(std::map<std::string, std::string>{
          {"size", "10x2x3"}, {"dither", "none"}, {"rate", std::to_string(kRate)}});
      screens_.push_back(std::make_unique<Screen>());
      Screen& screen = *screens_.back();
      screen.name = "d" + std::to_string(i);
      absl::StatusOr<display::simulated::Parts> parts =
          display::simulated::CreateParts({screen.name, "simulated", displays[i]}, clock_, false);
      EXPECT_TRUE(parts.ok()) << parts.status();
      screen.parts = *std::move(parts);
      gpu::EngineOptions engine;
      engine.kind = gpu::EngineKind::kCpu;
      engine.threads = 1;
      engine.inline_execution = true;
      DisplaySetup setup;
      setup.view.mode = ViewOptions::Mode::kVoxels;
      setup.genlock = "wall";
      const absl::Status added = core_->AddDisplay(std::move(screen.parts.display), engine, setup);
      EXPECT_TRUE(added.ok()) << added;
    }
    EXPECT_TRUE(core_->Start().ok());
    core_->OpenSession({}, 0, sink_, [this](auto info) { session_ = *info; });
    Settle();
  }

  sync::TimeNs now() const { return clock_.Now(); }
  Screen& screen(size_t i) { return *screens_[i]; }
  // Returns how often screens have shown different numbers for longer than the time between their
  // sweeps.
  uint64_t differences() const { return differences_; }

  // Inserts the number, as dots.
  void Show(uint64_t number) {
    std::vector<Operation> all;
    for (int bit = 0; bit < kBits; ++bit) {
      const int column = bit % 10, row = bit / 10;
      const uint32_t colour =
          number >> bit & 1 ? 0xFFFFFF : 0x0000FF;  // blue counts as lit and as 0
      if (((number ^ before_) >> bit & 1) == 0 && before_ != 0) continue;
      auto put = testing::Sequence(
          sequence_, Put("a", std::to_string(bit),
                         Entity1(Dots(0, colour), testing::Shift(column + 0.5, row + 0.5, 1.5))));
      sequence_ += put.size();
      all.insert(all.end(), put.begin(), put.end());
    }
    before_ = number;
    auto end = testing::Sequence(sequence_, testing::EndCommit(++frame_));
    sequence_ += end.size();
    all.insert(all.end(), end.begin(), end.end());
    session_.intake->Take({std::move(all), {}, 100});
    core_->Step();
    sink_->receipts.clear();
  }

  void RunFor(sync::TimeNs span) {
    const sync::TimeNs end = clock_.Now() + span;
    while (clock_.Now() < end) {
      const sync::TimeNs next = Settle();
      ++turns_;
      if (core_->Step() <= clock_.Now()) ++spins_;
      clock_.AdvanceTo(std::min(end, std::max(next, clock_.Now() + 1000)));
    }
    Settle();
  }

  absl::Status Update(size_t screen, DisplayUpdate update) {
    absl::Status status = absl::UnknownError("no answer");
    core_->UpdateDisplay(screens_[screen]->name, std::move(update),
                         [&](auto result) { status = result.status(); });
    Settle();
    return status;
  }
  // Captures what a screen shows; the results are counted.
  void Capture(size_t screen) {
    ++captures_;
    core_->Capture(screens_[screen]->name, 2 * sync::kSecond, 0, [this](const auto& volume) {
      ++captured_;
      if (absl::IsDataLoss(volume.status()) || absl::IsInternal(volume.status())) {
        ++broken_captures_;
        std::cout << volume.status() << "\n";
      }
    });
  }
  uint64_t captures() const { return captures_; }
  uint64_t captured() const { return captured_; }
  uint64_t broken_captures() const { return broken_captures_; }
  // Returns the part of the turns after which the daemon wanted another turn at once.
  double idle_turns() const { return static_cast<double>(spins_) / static_cast<double>(turns_); }

  Stats GetStats() {
    Stats stats;
    core_->GetStats([&](absl::StatusOr<Stats> s) { stats = *s; });
    Settle();
    return stats;
  }

 private:
  sync::TimeNs Settle() {
    sync::TimeNs next = sync::kNever;
    for (int i = 0; i < 4; ++i) {
      next = core_->Step();
      for (const auto& screen : screens_) {
        next = std::min(next, screen->parts.transport->Pump());
      }
      Look();
    }
    return next;
  }

  static std::optional<uint64_t> Read(const Screen& screen) {
    const std::optional<display::DecodedVolume> seen = screen.parts.device->Seen();
    if (!seen.has_value()) return std::nullopt;
    const std::vector<uint8_t> rgb = seen->Rgb(1, 1);
    uint64_t number = 0;
    bool any = false;
    for (int bit = 0; bit < kBits; ++bit) {
      const size_t at = (static_cast<size_t>(bit / 10) * 10 + bit % 10) * 3;
      any = any || rgb[at + 2] != 0;
      if (rgb[at] != 0) number |= uint64_t{1} << bit;
    }
    if (!any) return std::nullopt;  // the scene from before the first number
    return number;
  }

  // Returns the time between sweeps that belong together: half a period from the first display's.
  sync::TimeNs apart() const { return (screens_.size() > 2 ? kPeriod : kPeriod / 2) + 10'000; }

  // When one screen changes, the others follow with their own sweeps.
  void Look() {
    bool differ = false;
    std::optional<uint64_t> first;
    for (const auto& screen : screens_) {
      const std::optional<uint64_t> number = Read(*screen);
      if (number != screen->shown && number.has_value()) ++screen->changes;
      screen->shown = number;
      if (!number.has_value()) continue;
      differ = differ || (first.has_value() && *first != *number);
      first = number;
    }
    if (!differ) {
      differ_since_ = sync::kNever;
    } else if (differ_since_ == sync::kNever) {
      differ_since_ = clock_.Now();
    } else if (!told_ && clock_.Now() - differ_since_ > apart()) {
      ++differences_;
      std::cout << "after " << frame_ << " commits the screens show";
      for (const auto& screen : screens_) {
        std::cout << " " << (screen->shown ? std::to_string(*screen->shown) : "nothing");
      }
      std::cout << "\n";
      core_->GetStats([](absl::StatusOr<Stats> stats) {
        for (const DisplayFigures& d : stats->displays) {
          std::cout << "  " << d.name << " " << display::DisplayStateName(d.state) << " ("
                    << d.state_reason << "), slips " << d.genlock_slips << ", put off "
                    << d.genlock_postponed << ", dropped " << d.genlock_dropped << "\n";
        }
      });
    }
    told_ = differ && differ_since_ != sync::kNever && clock_.Now() - differ_since_ > apart();
  }

  sync::FakeClock clock_;
  std::optional<Core> core_;
  std::shared_ptr<RecordingSink> sink_ = std::make_shared<RecordingSink>();
  SessionInfo session_;
  uint64_t sequence_ = 0, frame_ = 0, before_ = 0;
  std::vector<std::unique_ptr<Screen>> screens_;
  uint64_t differences_ = 0, turns_ = 0, spins_ = 0;
  uint64_t captures_ = 0, captured_ = 0, broken_captures_ = 0;
  sync::TimeNs differ_since_ = sync::kNever;
  bool told_ = false;
};

// A sanitizer makes each volume take a hundred times as long.
#if defined(VOXELD_SANITIZED)
constexpr uint64_t kSomeVolumes = 2000;
#else
constexpr uint64_t kSomeVolumes = 10'000;
#endif
// The number of volumes for which the lock holds.
constexpr uint64_t kAllVolumes = 100'000;

TEST(CoreGenlock, DisplaysShowTheSameNumberOrNone) {
  Wall wall({{}, {}});
  wall.RunFor(sync::kSecond);
  for (uint64_t n = 1; n <= 100; ++n) {
    wall.Show(n);
    wall.RunFor(kPeriod * 5 + kPeriod / 7);
    for (size_t i = 0; i < 2; ++i) EXPECT_EQ(wall.screen(i).shown, n) << "screen " << i;
  }
  EXPECT_EQ(wall.differences(), 0u);
  EXPECT_LT(wall.idle_turns(), 0.05);
  const Stats stats = wall.GetStats();
  EXPECT_GE(stats.displays[0].genlock_volumes, 100u);
  EXPECT_EQ(stats.displays[0].genlock_dropped, 0u);
  EXPECT_EQ(stats.displays[0].genlock_slips, 0u);
}

// One display has a slow link, on which transfers stall for several sweeps, and whose answers are
// as late as the lock allows; it is also unplugged and plugged in again now and then. The other is
// unplugged once.
void ExpectNoDifference(uint64_t wanted, uint32_t seed) {
  Wall wall({{}, {{"pacing", "200000"}}});
  std::mt19937 random(seed);
  Screen& slow = wall.screen(1);
  const auto fault = [&](Screen& screen, display::emulator::Fault::What what, uint8_t endpoint,
                         sync::TimeNs amount) {
    using Fault = display::emulator::Fault;
    screen.parts.transport->WithDevice([&](display::UsbDeviceModel&) {
      screen.parts.faults->Add({.when = Fault::When::kTime,
                                .at = 0,
                                .endpoint = endpoint,
                                .what = what,
                                .amount = static_cast<uint64_t>(amount)});
    });
  };
  using What = display::emulator::Fault::What;
  uint64_t number = 0, volumes = 0, restarts = 0;
  for (uint64_t step = 0; volumes < wanted; ++step) {
    ASSERT_LT(step, 30 * wanted) << volumes << " volumes so far";
    if (random() % 2 == 0) wall.Show(++number);
    if (random() % 16 == 0) fault(slow, What::kNak, 0x01, random() % (6 * kPeriod));
    if (random() % 16 == 0) fault(slow, What::kDelay, 0x82, random() % (kPeriod / 8));
    if (step % 2000 == 999)
      fault(slow, What::kUnplug, 0x01, kPeriod * (1 + random() % 100)), ++restarts;
    if (step == 3000) fault(wall.screen(0), What::kUnplug, 0x01, kPeriod * 50);
    wall.RunFor(static_cast<sync::TimeNs>(random() % (2 * kPeriod)));
    if (step % 64 == 0) volumes = wall.GetStats().displays[0].genlock_volumes;
  }
  const DisplayFigures figures = wall.GetStats().displays[1];
  std::cout << figures.genlock_volumes << " volumes shown by all, " << figures.genlock_dropped
            << " dropped, " << figures.genlock_postponed << " orders put off, "
            << figures.genlock_slips << " slips; " << restarts << " restarts; "
            << wall.screen(0).changes << " and " << slow.changes << " changes seen\n";
  EXPECT_EQ(wall.differences(), 0u);
  EXPECT_EQ(figures.genlock_slips, 0u);
  EXPECT_GT(figures.genlock_postponed, 0u) << "nothing was delayed";
  EXPECT_GT(restarts, 0u);
  // In the end both show the newest, once the faults are over.
  wall.RunFor(sync::kSecond);
  wall.Show(++number);
  wall.RunFor(sync::kSecond);
  EXPECT_EQ(wall.screen(0).shown, number);
  EXPECT_EQ(slow.shown, number);
}

TEST(CoreGenlock, NeitherDelayNorRestartMakesThemDiffer) { ExpectNoDifference(kSomeVolumes, 7); }

TEST(CoreGenlock, NorDoTheyInALongShow) {
  const char* wanted = std::getenv("VOXELD_GENLOCK_VOLUMES");
  ExpectNoDifference(wanted == nullptr ? kAllVolumes : std::strtoull(wanted, nullptr, 10), 8);
}

// Three displays that are blanked and lit again, captured, and whose links fail with and without
// the device being unplugged: none differs, and in the end all show the newest.
TEST(CoreGenlock, WhateverIsAskedOfThemTheyGoOn) {
  using What = display::emulator::Fault::What;
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    Wall wall({{}, {}, {}});
    std::mt19937 random(seed);
    uint64_t number = 0;
    for (int step = 0; step < 400; ++step) {
      const size_t screen = random() % 3;
      switch (random() % 16) {
        case 0:
          wall.Capture(screen);
          break;
        case 1:
          EXPECT_TRUE(wall.Update(screen, {.blank = true}).ok());
          break;
        case 2:
          EXPECT_TRUE(wall.Update(screen, {.blank = false}).ok());
          break;
        case 3:
          wall.screen(screen).parts.transport->WithDevice([&](display::UsbDeviceModel&) {
            const What faults[] = {What::kStall, What::kError, What::kNak, What::kUnplug};
            const What what = faults[random() % 4];
            const uint64_t amount = what == What::kError ? 1 + random() % 12
                                    : what == What::kNak ? random() % (8 * kPeriod)
                                                         : random() % (40 * kPeriod);
            wall.screen(screen).parts.faults->Add(
                {.when = display::emulator::Fault::When::kTime,
                 .at = 0,
                 .endpoint = random() % 3 == 0 ? uint8_t{0x82} : uint8_t{0x01},
                 .what = what,
                 .amount = amount});
          });
          break;
        default:
          wall.Show(++number);
      }
      wall.RunFor(static_cast<sync::TimeNs>(random() % (4 * kPeriod)));
    }
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(wall.Update(i, {.blank = false}).ok());
      Screen& screen = wall.screen(i);
      screen.parts.transport->WithDevice([&](display::UsbDeviceModel& device) {
        screen.parts.faults->Clear();
        device.SetPlugged(true);
      });
    }
    wall.RunFor(10 * sync::kSecond);
    wall.Show(++number);
    wall.RunFor(2 * sync::kSecond);
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(wall.screen(i).shown, number) << "screen " << i;
      const DisplayFigures figures = wall.GetStats().displays[i];
      EXPECT_EQ(figures.state, display::DisplayState::kShowing) << figures.state_reason;
      EXPECT_EQ(figures.commits_pending, 0u);
    }
    EXPECT_EQ(wall.captured(), wall.captures());
    EXPECT_EQ(wall.broken_captures(), 0u);
    EXPECT_LT(wall.idle_turns(), 0.1);
    EXPECT_EQ(wall.differences(), 0u);
  }
}

TEST(CoreGenlock, MembersHaveOneRate) {
  sync::FakeClock clock;
  CoreOptions options;
  options.threads = false;
  Core core(std::move(options), clock);
  const auto add = [&](const std::string& name, const char* rate, const std::string& genlock) {
    auto parts = display::simulated::CreateParts(
        {name, "simulated", {{"size", "4x4x2"}, {"rate", rate}}}, clock, false);
    gpu::EngineOptions engine;
    engine.kind = gpu::EngineKind::kCpu;
    engine.inline_execution = true;
    return core.AddDisplay(std::move(parts->display), engine, {.genlock = genlock});
  };
  EXPECT_TRUE(add("a", "30", "wall").ok());
  const absl::Status other = add("b", "25", "wall");
  EXPECT_EQ(other.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(other.message().find("has 25 volumes/s and \"a\", of the same genlock \"wall\", 30"),
            std::string::npos)
      << other.message();
  EXPECT_TRUE(add("c", "25", "another").ok());
  EXPECT_TRUE(add("d", "25", "").ok());
}

}  // namespace
}  // namespace voxeld::daemon
