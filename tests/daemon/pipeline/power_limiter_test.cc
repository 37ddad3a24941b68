#include "daemon/pipeline/power_limiter.h"

#include <gtest/gtest.h>

#include <random>

namespace voxeld::daemon {
namespace {

TEST(Dimmed, StepsAreShares) {
  display::Tone tone;
  tone.SetCurve(display::Tone::Linear());
  EXPECT_EQ(Dimmed(tone, kLightSteps), tone);
  const display::Tone half = Dimmed(tone, kLightSteps / 2);
  const display::Tone none = Dimmed(tone, 0);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(half.lut[c][255], 32768);
    EXPECT_EQ(half.lut[c][0], 0);
    EXPECT_EQ(none.lut[c][255], 0);
  }
}

display::SliceFrame FrameOf(const display::FrameLayout& layout) {
  display::SliceFrame frame;
  frame.layout = layout;
  frame.bytes.resize(layout.bytes());
  frame.changed_in.assign(layout.pictures(), 1);
  return frame;
}

// Compared with a plain sum of all bytes.
TEST(LightMeter, AddsUpWhatChanged) {
  const display::FrameLayout layout{.slices = 5, .width = 4, .height = 3, .sub_frames = 2};
  display::SliceFrame frame = FrameOf(layout);
  LightMeter meter;
  EXPECT_EQ(meter.Measure(frame), 0);
  std::mt19937 random(1);
  for (uint64_t volume = 2; volume < 50; ++volume) {
    const size_t picture = random() % layout.pictures();
    for (size_t i = 0; i < layout.bytes_per_slice(); ++i) {
      frame.bytes[picture * layout.bytes_per_slice() + i] = static_cast<std::byte>(random());
    }
    frame.changed_in[picture] = volume;
    double sum = 0;
    for (const std::byte b : frame.bytes) sum += std::to_integer<int>(b);
    const double want = sum / 255 / static_cast<double>(frame.bytes.size());
    EXPECT_NEAR(meter.Measure(frame), want, 0.002);  // sub-frames are averaged in whole levels
  }
  // A picture whose number has not changed is not measured again.
  const double before = meter.Measure(frame);
  frame.bytes.assign(frame.bytes.size(), std::byte{255});
  EXPECT_EQ(meter.Measure(frame), before);
  frame.changed_in.assign(frame.changed_in.size(), 50);
  EXPECT_EQ(meter.Measure(frame), 1);
}

TEST(PowerLimiter, WithoutALimitAllIsAdmitted) {
  PowerLimiter limiter(100);
  EXPECT_TRUE(limiter.Admit(1, 0));
  EXPECT_EQ(limiter.steps(), kLightSteps);
  EXPECT_EQ(limiter.power_w(), 100);
  EXPECT_EQ(limiter.next(), sync::kNever);
}

// Nothing above the limit is ever admitted, whatever dither does to the steps, and the limiter does
// not take long.
TEST(PowerLimiter, NothingAboveTheLimitIsAdmitted) {
  std::mt19937 random(2);
  PowerLimiter limiter(100);
  limiter.SetLimit(30);
  sync::TimeNs now = 0;
  for (int i = 0; i < 2000; ++i) {
    const double full = static_cast<double>(random() % 1001) / 1000;
    now += static_cast<sync::TimeNs>(random() % sync::kSecond);
    limiter.Rise(now);
    int tries = 0;
    double light = 0;
    while (true) {
      const double noise = 0.95 + static_cast<double>(random() % 100) / 1000;
      light = full * limiter.steps() / kLightSteps * noise;
      if (limiter.Admit(light, now)) break;
      ASSERT_LE(++tries, 5);
    }
    EXPECT_LE(light * 100, 30);
  }
}

TEST(PowerLimiter, LightComesBackAfterASecondAndNotAtTheLimit) {
  PowerLimiter limiter(100);
  limiter.SetLimit(50);
  EXPECT_FALSE(limiter.Admit(1, 0));
  EXPECT_EQ(limiter.steps(), 32);
  EXPECT_TRUE(limiter.Admit(0.5, 0));
  EXPECT_EQ(limiter.next(), sync::kNever) << "the scene is as bright as before";
  // A little darker: nine tenths would not be kept.
  EXPECT_TRUE(limiter.Admit(0.46, 0));
  EXPECT_EQ(limiter.next(), sync::kNever);
  // Half as bright.
  EXPECT_TRUE(limiter.Admit(0.25, 100));
  EXPECT_EQ(limiter.next(), 100 + sync::kSecond);
  EXPECT_FALSE(limiter.Rise(100 + sync::kSecond - 1));
  EXPECT_TRUE(limiter.Rise(100 + sync::kSecond));
  EXPECT_EQ(limiter.steps(), 57);  // 32 · 0.9 · 50 / 25
  EXPECT_EQ(limiter.next(), sync::kNever);
  // Brighter within the second: the brightness does not rise.
  EXPECT_TRUE(limiter.Admit(0.3, 0));
  EXPECT_NE(limiter.next(), sync::kNever);
  EXPECT_TRUE(limiter.Admit(0.46, 0));
  EXPECT_EQ(limiter.next(), sync::kNever);
}

// A limit below one step of the scene's light: dark, and lit again when the scene allows a step.
TEST(PowerLimiter, MayComeToNothing) {
  PowerLimiter limiter(1000);
  limiter.SetLimit(1);
  sync::TimeNs now = 0;
  while (!limiter.Admit(static_cast<double>(limiter.steps()) / kLightSteps, now)) {
  }
  EXPECT_EQ(limiter.steps(), 0);
  ASSERT_NE(limiter.next(), sync::kNever);
  now = limiter.next();
  EXPECT_TRUE(limiter.Rise(now));
  EXPECT_EQ(limiter.steps(), 1);
  EXPECT_FALSE(limiter.Admit(1.0 / kLightSteps, now)) << "still too bright";
  EXPECT_EQ(limiter.steps(), 0);
  EXPECT_TRUE(limiter.Admit(0, now));
  now = limiter.next();
  EXPECT_TRUE(limiter.Rise(now));
  EXPECT_TRUE(limiter.Admit(0.0005 / kLightSteps, now)) << "the scene is nearly dark now";
  EXPECT_TRUE(limiter.Rise(limiter.next()));
  EXPECT_EQ(limiter.steps(), kLightSteps);
}

}  // namespace
}  // namespace voxeld::daemon
