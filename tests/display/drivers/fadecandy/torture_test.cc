// Random frames over cables with random faults: no board ever lights what was not submitted, every
// volume has exactly one outcome, and when the faults are over the newest volume is lit.

#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "display/api/pixels.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/fadecandy/fadecandy_rig.h"

namespace voxeld::display::fadecandy {
namespace {

using emulator::Fault;
using sync::kMillisecond;
using sync::kSecond;

// Bytes lost or changed on the wire are left out: USB prevents them, and the protocol does not
// detect them.
Fault RandomFault(std::mt19937& random) {
  const auto below = [&](uint64_t n) { return random() % n; };
  constexpr Fault::What kWhats[] = {
      Fault::What::kStall,  Fault::What::kNak,    Fault::What::kPartial, Fault::What::kError,
      Fault::What::kUnplug, Fault::What::kBabble, Fault::What::kDelay};
  Fault fault;
  fault.when = static_cast<Fault::When>(below(3));
  fault.what = kWhats[below(std::size(kWhats))];
  fault.at = fault.when == Fault::When::kTransfer ? 1 + below(300)
             : fault.when == Fault::When::kByte   ? below(200'000)
                                                  : below(3 * kSecond);
  switch (fault.what) {
    case Fault::What::kNak:
    case Fault::What::kDelay:
      fault.amount = below(10) == 0 ? 1500 * kMillisecond : below(300) * kMillisecond;
      break;
    case Fault::What::kUnplug:
      fault.amount = below(800) * kMillisecond;
      break;
    case Fault::What::kError:
    case Fault::What::kBabble:
      fault.amount = 1 + below(4);
      break;
    default:
      fault.amount = below(2000);
  }
  return fault;
}

std::string Key(std::span<const uint8_t> bytes) { return {bytes.begin(), bytes.end()}; }

TEST(FadecandyTorture, NothingTornNothingStaleNothingForgotten) {
  uint64_t presented = 0, captured = 0, attaches = 0, resent = 0;
  for (uint32_t seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const size_t boards = 1 + seed % 3;
    FadecandyRig rig(boards);
    FrameSource source(rig.display().info().layout, seed);
    std::mt19937& random = source.random();
    for (size_t i = 0; i < 2 + seed % 8; ++i) {
      rig.faults(random() % boards).Add(RandomFault(random));
    }
    // The pictures that each board may light.
    std::vector<std::set<std::string>> pictures(boards);
    std::map<std::string, uint64_t> volumes;
    bool strange = false;
    rig.SetObserver([&] {
      for (size_t b = 0; b < boards; ++b) {
        const auto output = rig.device(b).Output();
        strange |= !rig.IsDark(b) && !pictures[b].contains(Key(output));
      }
    });
    rig.Start();
    SliceFramePtr newest;
    const sync::TimeNs end = rig.clock().Now() + 4 * kSecond;
    while (rig.clock().Now() < end) {
      const double shares[] = {0.05, 0.5, 1.0};
      newest = source.Next(shares[random() % 3]);
      const std::vector<uint8_t> rgb = FrameToRgb(*newest);
      ASSERT_TRUE(volumes.emplace(Key(rgb), newest->volume).second);
      for (size_t b = 0; b < boards; ++b) {
        std::vector<uint8_t> light(rgb.begin() + static_cast<ptrdiff_t>(b * kFrameBytes),
                                   rgb.begin() + static_cast<ptrdiff_t>((b + 1) * kFrameBytes));
        for (uint8_t& value : light) {
          if (value >= 128 && value < 255) ++value;
        }
        pictures[b].insert(Key(light));
      }
      rig.display().Submit(newest);
      rig.RunFor(static_cast<sync::TimeNs>(random() % 50) * kMillisecond);
      if (random() % 20 == 0) {
        ASSERT_TRUE(rig.display().SetBlank(true).ok());
        rig.RunFor(static_cast<sync::TimeNs>(random() % 50) * kMillisecond);
        ASSERT_TRUE(rig.display().SetBlank(false).ok());
      }
      if (random() % 10 == 0) {
        rig.display().Capture(kSecond, [&](absl::StatusOr<DecodedVolume> volume) {
          if (!volume.ok()) return;
          const auto it = volumes.find(Key(volume->Rgb()));
          ASSERT_NE(it, volumes.end());
          ASSERT_EQ(it->second, volume->volume);
          ++captured;
        });
      }
      ASSERT_FALSE(strange) << "a board lights what was not submitted";
    }
    EXPECT_TRUE(rig.RunUntil(
        [&] { return rig.Sees(*newest) && rig.recorder().Of(newest->volume) != nullptr; },
        60 * kSecond))
        << DisplayStateName(rig.display().state()) << ": " << rig.display().state_reason();
    EXPECT_FALSE(strange);
    rig.SetObserver(nullptr);
    rig.display().Stop();
    for (uint64_t volume = 1; volume <= newest->volume; ++volume) {
      EXPECT_EQ(rig.recorder().Count(volume), 1) << "outcomes of volume " << volume;
    }
    presented += rig.display().stats().volumes_presented;
    attaches += rig.display().stats().attaches;
    resent += rig.display().stats().slices_resent;
    if (HasFailure()) return;
  }
  EXPECT_GT(presented, 1000u);
  EXPECT_GT(captured, 50u);
  EXPECT_GT(attaches, 40u);
  EXPECT_GT(resent, 10u);
}

}  // namespace
}  // namespace voxeld::display::fadecandy
