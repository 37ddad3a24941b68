// Random frames over a cable with random faults: the visible volume is always one that was
// submitted, whole; every volume has exactly one outcome, which is true; when the faults are over,
// the newest volume is visible.

#include <map>
#include <ostream>
#include <set>
#include <string>

#include "display/api/pixels.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;

struct Case {
  std::string name;
  std::map<std::string, std::string> options;
};
std::ostream& operator<<(std::ostream& out, const Case& c) { return out << c.name; }

Fault RandomFault(std::mt19937& random) {
  const auto below = [&](uint64_t n) { return random() % n; };
  Fault fault;
  fault.when = static_cast<Fault::When>(below(3));
  fault.what = static_cast<Fault::What>(below(9));
  fault.endpoint = below(5) == 0 ? 0x82 : 0x01;
  fault.at = fault.when == Fault::When::kTransfer ? 1 + below(300)
             : fault.when == Fault::When::kByte   ? below(200'000)
                                                  : below(3 * kSecond);
  switch (fault.what) {
    case Fault::What::kStall:
      break;
    case Fault::What::kNak:
    case Fault::What::kDelay:
      fault.amount = below(600) * kMillisecond;
      break;
    case Fault::What::kUnplug:
      fault.amount = below(800) * kMillisecond;
      break;
    case Fault::What::kError:
    case Fault::What::kBabble:
      fault.amount = 1 + below(4);
      break;
    case Fault::What::kPartial:
    case Fault::What::kCorrupt:
    case Fault::What::kDrop:
      fault.amount = below(2000);
      break;
  }
  return fault;
}

class Torture : public testing::TestWithParam<Case> {
 protected:
  // Checks that the device shows a submitted volume.
  void Look(Rig& rig) {
    const auto& shown = rig.device().screen().shown();
    if (shown != nullptr && shown != last_shown_) {
      last_shown_ = shown;
      const DecodedVolume light{.layout = rig.display().info().layout, .pictures = shown->pictures};
      const auto it = by_light_.find(Key(light.Rgb()));
      ASSERT_NE(it, by_light_.end()) << "the device shows what was not submitted";
      seen_volume_ = it->second;
      seen_.insert(it->second);
    }
  }

  // Checks that the outcomes since the last call are true.
  void Check(Rig& rig) {
    ASSERT_EQ(rig.device().credit_excess(), 0u);
    const auto& outcomes = rig.recorder().outcomes;
    for (; checked_ < outcomes.size(); ++checked_) {
      const VolumeOutcome& outcome = outcomes[checked_];
      ASSERT_TRUE(told_.insert(outcome.volume).second) << "two outcomes of " << outcome.volume;
      if (outcome.kind == VolumeOutcome::Kind::kPresented) {
        ASSERT_TRUE(seen_.contains(outcome.volume)) << outcome.volume << " was never seen";
        ASSERT_EQ(seen_volume_, outcome.volume) << "a stale volume is shown";
        ++presented_;
      } else if (outcome.kind == VolumeOutcome::Kind::kReplaced) {
        ASSERT_GT(outcome.replaced_by, outcome.volume);
        ASSERT_FALSE(seen_.contains(outcome.volume));
      }
    }
  }

  static std::string Key(const std::vector<uint8_t>& rgb) { return {rgb.begin(), rgb.end()}; }

  std::map<std::string, uint64_t> by_light_;
  voxlink::VolumePtr last_shown_;
  uint64_t seen_volume_ = 0;
  std::set<uint64_t> seen_, told_;
  size_t checked_ = 0;
  int presented_ = 0;
};

TEST_P(Torture, NothingTornNothingStaleNothingForgotten) {
  int presented = 0, captured = 0;
  for (uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    by_light_.clear();
    last_shown_ = nullptr;
    seen_.clear();
    told_.clear();
    checked_ = 0;
    presented_ = 0;
    Rig rig(GetParam().options);
    FrameSource source(rig.display().info().layout, seed);
    std::mt19937& random = source.random();
    for (size_t i = 0; i < 2 + seed % 12; ++i) rig.faults().Add(RandomFault(random));
    rig.SetObserver([&] { Look(rig); });
    rig.Start();
    SliceFramePtr newest;
    const sync::TimeNs end = rig.clock().Now() + 4 * kSecond;
    bool failed = false;
    const auto step = [&] {
      if (!failed) Check(rig);
      failed = failed || HasFatalFailure();
      return failed;
    };
    while (rig.clock().Now() < end && !failed) {
      const double shares[] = {0.05, 0.3, 1.0};
      newest = source.Next(shares[random() % 3]);
      ASSERT_TRUE(by_light_.emplace(Key(FrameToRgb(*newest)), newest->volume).second);
      rig.display().Submit(newest);
      rig.RunUntil(step, static_cast<sync::TimeNs>(random() % 100) * kMillisecond);
      if (random() % 20 == 0) {
        ASSERT_TRUE(rig.display().SetBlank(true).ok());
        rig.RunUntil(step, static_cast<sync::TimeNs>(random() % 100) * kMillisecond);
        ASSERT_TRUE(rig.display().SetBlank(false).ok());
      }
      if (random() % 10 == 0) {
        rig.display().Capture(kSecond, [&](absl::StatusOr<DecodedVolume> volume) {
          if (!volume.ok()) return;
          const auto it = by_light_.find(Key(volume->Rgb()));
          ASSERT_NE(it, by_light_.end());
          ASSERT_EQ(it->second, volume->volume);
          ++captured;
        });
      }
    }
    // Without faults, the newest volume becomes visible, whatever happened before.
    const std::vector<uint8_t> light = FrameToRgb(*newest);
    EXPECT_TRUE(rig.RunUntil(
        [&] {
          if (step()) return true;
          const auto seen = rig.device().Seen();
          return seen.has_value() && seen->Rgb() == light &&
                 rig.recorder().Of(newest->volume) != nullptr;
        },
        60 * kSecond))
        << DisplayStateName(rig.display().state()) << ": " << rig.display().state_reason();
    rig.display().Stop();
    step();
    for (uint64_t volume = 1; volume <= newest->volume; ++volume) {
      EXPECT_EQ(rig.recorder().Count(volume), 1) << "outcomes of volume " << volume;
    }
    presented += presented_;
    if (failed || HasFailure()) return;
  }
  EXPECT_GT(presented, 100);
  EXPECT_GT(captured, 10);
}

INSTANTIATE_TEST_SUITE_P(
    Devices, Torture,
    testing::Values(
        Case{"Plain", {}},
        Case{"Fragments",
             {{"size", "40x30x5"}, {"max_payload", "1024"}, {"receive_buffer", "65536"}}},
        Case{"Slow",
             {{"size", "32x32x8"},
              {"receive_buffer", "65536"},
              {"max_payload", "4096"},
              {"pacing", "400000"}}},
        Case{"BitPlanes", {{"size", "17x9x40"}, {"format", "bitplanes"}, {"sub_frames", "3"}}},
        Case{"Rotor",
             {{"geometry", "rotor"},
              {"size", "8x6"},
              {"slices", "30"},
              {"eccentricity", "0.5;1.5"},
              {"format", "rgb332"}}}),
    [](const testing::TestParamInfo<Case>& param) { return param.param.name; });

}  // namespace
}  // namespace voxeld::display
