#include "display/emulator/fadecandy_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "display/drivers/fadecandy/packets.h"
#include "gtest/gtest.h"

namespace voxeld::display::emulator {
namespace {

using fadecandy::kFrameBytes;
using fadecandy::kLutEntries;
using Table = std::array<uint16_t, kLutEntries>;
using Rgb = std::array<std::byte, kFrameBytes>;

// §8 of the protocol in real numbers. Every value that occurs is a multiple of 2⁻²⁴ below 2¹⁷, so
// doubles represent it exactly.
struct Lit {
  int out;
  int residual;
};
Lit InRealNumbers(int prev, int next, double share, const Table& entries, int residual) {
  const double between = std::floor(257 * (prev + (next - prev) * share));
  const double place = between / 256;
  const auto below = static_cast<size_t>(place);
  const double from = std::floor(entries[below] / 2.0);
  const double to = std::floor(entries[below + 1] / 2.0);
  const double light = std::floor(2 * (from + (to - from) * (place - static_cast<double>(below))));
  const double wanted = light + residual;
  const double out = std::clamp(std::floor((wanted + 128) / 256), 0.0, 255.0);
  return {static_cast<int>(out), static_cast<int>(wanted - 257 * out)};
}

TEST(FadecandyLight, EqualsRealNumbersInTenMillionCases) {
  std::mt19937 random(1);
  const auto below = [&](uint32_t n) { return static_cast<int>(random() % n); };
  Table entries{}, halved{};
  for (int i = 0; i < 10'000'000; ++i) {
    if (i % 1000 == 0) {
      // Any table; every third time an ascending one, as hosts have it.
      for (uint16_t& entry : entries) entry = static_cast<uint16_t>(random());
      if (i % 3000 == 0) std::sort(entries.begin(), entries.end());
      for (size_t k = 0; k < kLutEntries; ++k) halved[k] = entries[k] >> 1;
    }
    const int prev = below(256), next = below(256), residual = below(511) - 383;
    const uint32_t c = i % 8 == 0 ? 0x10000u * static_cast<uint32_t>(below(2)) : random() % 0x10001;
    const Lit want = InRealNumbers(prev, next, c / 65536.0, entries, residual);
    auto carried = static_cast<int16_t>(residual);
    const uint8_t out = FadecandyDither(
        FadecandyLookUp(halved,
                        FadecandyFade(static_cast<uint8_t>(prev), static_cast<uint8_t>(next), c)),
        carried);
    ASSERT_EQ(out, want.out) << prev << " to " << next << " at " << c << ", residual " << residual;
    ASSERT_EQ(carried, want.residual) << prev << " to " << next << " at " << c;
  }
}

TEST(FadecandyLight, ByHand) {
  EXPECT_EQ(FadecandyFade(0, 255, 0), 0u);
  EXPECT_EQ(FadecandyFade(0, 255, 0x10000), 65535u);
  EXPECT_EQ(FadecandyFade(255, 255, 0x1234), 65535u);
  EXPECT_EQ(FadecandyFade(0, 255, 0x8000), 32767u);
  EXPECT_EQ(FadecandyFade(100, 200, 0x4000), 125u * 257);
  Table halved{};
  halved[0x20] = 1000;
  halved[0x21] = 3000;
  EXPECT_EQ(FadecandyLookUp(halved, 0x2000), 2000u);
  EXPECT_EQ(FadecandyLookUp(halved, 0x2080), 4000u);
  EXPECT_EQ(FadecandyLookUp(halved, 0x20FF), (1000u * 1 + 3000u * 255) >> 7);
  // A third of a step: 85 is shown as 0, 0 and then 1, and so on.
  int16_t residual = 0;
  std::vector<int> shown;
  for (int i = 0; i < 6; ++i) shown.push_back(FadecandyDither(85, residual));
  EXPECT_EQ(shown, (std::vector<int>{0, 1, 0, 0, 1, 0}));
  // Full light never wraps.
  residual = 127;
  EXPECT_EQ(FadecandyDither(65534, residual), 255);
  EXPECT_EQ(residual, 126);
  // At full light, the byte is too large by more than a step: the dark after it is not below 0.
  residual = 0;
  EXPECT_EQ(FadecandyDither(65152, residual), 255);
  EXPECT_EQ(residual, -383);
  EXPECT_EQ(FadecandyDither(0, residual), 0);
  EXPECT_EQ(residual, -383);
}

// Feeds bytes into the light, packet by packet. Returns how many packets it accepted.
size_t Feed(FadecandyLight& light, const TransferBytes& bytes) {
  size_t packets = 0;
  for (size_t at = 0; at < bytes.size(); at += 64, ++packets) {
    if (!light.Take(std::span(std::as_const(bytes)).subspan(at).first<64>())) break;
  }
  return packets;
}
size_t FeedFrame(FadecandyLight& light, const Rgb& rgb) {
  TransferBytes bytes;
  fadecandy::AppendFrame(bytes, rgb, 0, fadecandy::kFramePackets);
  return Feed(light, bytes);
}
void FeedConfig(FadecandyLight& light, uint8_t flags) {
  TransferBytes bytes;
  fadecandy::AppendConfig(bytes, flags);
  ASSERT_EQ(Feed(light, bytes), 1u);
}
// Linear channels: entry i is 256·i.
void FeedStraightLut(FadecandyLight& light) {
  fadecandy::Lut lut;
  for (size_t i = 0; i < lut.size(); ++i) {
    lut[i] = static_cast<uint16_t>(std::min<size_t>(i % kLutEntries * 256, 65535));
  }
  TransferBytes bytes;
  fadecandy::AppendLut(bytes, lut);
  ASSERT_EQ(Feed(light, bytes), 25u);
}
Rgb Plain(int value) {
  Rgb rgb;
  rgb.fill(static_cast<std::byte>(value));
  return rgb;
}

TEST(FadecandyLight, IsDarkWithoutTable) {
  FadecandyLight light;
  FeedFrame(light, Plain(255));
  for (int64_t ms = 1; ms < 10; ++ms) light.Refresh(ms);
  EXPECT_EQ(light.frames(), 1u);
  EXPECT_EQ(light.refreshes(), 9u);
  for (const uint8_t value : light.Output()) ASSERT_EQ(value, 0);
}

TEST(FadecandyLight, FadesFromFrameToFrame) {
  FadecandyLight light;
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoDither);
  FeedFrame(light, Plain(40));
  light.Refresh(100);
  FeedFrame(light, Plain(200));
  light.Refresh(200);  // 40 was next for 100 ms
  light.Refresh(225);
  EXPECT_EQ(light.Output()[0], 80);
  light.Refresh(250);
  EXPECT_EQ(light.Output()[700], 120);
  light.Refresh(300);
  EXPECT_EQ(light.Output()[1535], 201);  // (200·257 + 128) / 256
  light.Refresh(100'000);
  EXPECT_EQ(light.Output()[0], 201);
  // A pause of a minute makes a fade of a minute: a frame that is sent twice is shown at once.
  FeedFrame(light, Plain(10));
  light.Refresh(160'000);
  light.Refresh(165'000);
  EXPECT_GT(light.Output()[0], 150);
  FeedFrame(light, Plain(10));
  light.Refresh(165'002);
  light.Refresh(165'004);
  EXPECT_EQ(light.Output()[0], 10);
}

TEST(FadecandyLight, WithoutInterpolationTheFrameIsThereAtTheNextRefresh) {
  FadecandyLight light;
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoDither | fadecandy::kNoInterpolation);
  FeedFrame(light, Plain(40));
  light.Refresh(1000);
  light.Refresh(1002);
  EXPECT_EQ(light.Output()[0], 40);
}

TEST(FadecandyLight, DitherMeansTheSixteenBits) {
  FadecandyLight light;
  fadecandy::Lut lut{};
  lut[128] = 2 * 1234;  // red, at 0x80: 2468 of 65535 is 9.603 steps
  lut[129] = 2 * 1234;
  TransferBytes bytes;
  fadecandy::AppendLut(bytes, lut);
  Feed(light, bytes);
  FeedConfig(light, fadecandy::kNoInterpolation);
  FeedFrame(light, Plain(128));
  light.Refresh(1);
  int sum = 0;
  for (int64_t ms = 2; ms < 1002; ++ms) {
    light.Refresh(ms);
    ASSERT_TRUE(light.Output()[3] == 9 || light.Output()[3] == 10);
    sum += light.Output()[3];
  }
  EXPECT_NEAR(sum, 1000 * 2468 / 257.0, 1);
  EXPECT_EQ(light.Output()[4], 0);
}

TEST(FadecandyLight, AFinishedFrameWaitsForTheRefresh) {
  FadecandyLight light;
  EXPECT_EQ(FeedFrame(light, Plain(1)), 25u);
  EXPECT_TRUE(light.frame_waits());
  EXPECT_EQ(FeedFrame(light, Plain(2)), 0u);
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoInterpolation);
  light.Refresh(1);
  EXPECT_EQ(FeedFrame(light, Plain(2)), 25u);
  light.Refresh(2);
  light.Refresh(3);
  EXPECT_EQ(light.Output()[0], 2);
  EXPECT_EQ(light.frames(), 2u);
}

TEST(FadecandyLight, WhatIsLeftOutShowsTheFrameThreeBack) {
  FadecandyLight light;
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoInterpolation | fadecandy::kNoDither);
  for (const int value : {10, 20, 30}) {
    FeedFrame(light, Plain(value));
    light.Refresh(value);
  }
  TransferBytes bytes;
  fadecandy::AppendFrame(bytes, Plain(40), 24, 25);
  Feed(light, bytes);
  light.Refresh(40);
  light.Refresh(50);
  EXPECT_EQ(light.Output()[0], 10);
  EXPECT_EQ(light.Output()[504 * 3], 40);
}

TEST(FadecandyLight, IgnoresWhatIsMalformed) {
  FadecandyLight light;
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoInterpolation | fadecandy::kNoDither);
  FeedFrame(light, Plain(7));
  light.Refresh(1);
  for (const int control : {0x19, 0x1F, 0x59, 0x5F, 0xC0, 0xF8, 0xFF}) {
    std::array<std::byte, 64> packet;
    packet.fill(std::byte{0xAA});
    packet[0] = static_cast<std::byte>(control);
    EXPECT_TRUE(light.Take(packet));
  }
  EXPECT_FALSE(light.frame_waits());
  light.Refresh(2);
  light.Refresh(3);
  for (const uint8_t value : light.Output()) ASSERT_EQ(value, 7);
  EXPECT_EQ(light.flags(), fadecandy::kNoInterpolation | fadecandy::kNoDither);
}

TEST(FadecandyLight, StripsAreGreenRedBlue) {
  FadecandyLight light;
  FeedStraightLut(light);
  FeedConfig(light, fadecandy::kNoInterpolation | fadecandy::kNoDither);
  Rgb rgb = Plain(0);
  const size_t pixel = 5 * 64 + 3;
  rgb[pixel * 3] = std::byte{1};
  rgb[pixel * 3 + 1] = std::byte{2};
  rgb[pixel * 3 + 2] = std::byte{3};
  FeedFrame(light, rgb);
  light.Refresh(1);
  light.Refresh(2);
  for (size_t strip = 0; strip < 8; ++strip) {
    const auto out = light.Strip(strip);
    for (size_t i = 0; i < out.size(); ++i) {
      const int want = strip != 5 || i / 3 != 3 ? 0 : std::array{2, 1, 3}[i % 3];
      ASSERT_EQ(out[i], want) << strip << ", " << i;
    }
  }
}

TEST(FadecandyLight, LedShowsTrafficOrWhatTheHostWants) {
  FadecandyLight light;
  light.Refresh(1);
  EXPECT_FALSE(light.led());
  FeedConfig(light, 0);
  light.Refresh(2);
  EXPECT_TRUE(light.led());
  light.Refresh(3);
  EXPECT_FALSE(light.led());
  FeedConfig(light, fadecandy::kManualLed | fadecandy::kLedOn);
  light.Refresh(4);
  light.Refresh(5);
  EXPECT_TRUE(light.led());
  FeedConfig(light, fadecandy::kManualLed);
  light.Refresh(6);
  EXPECT_FALSE(light.led());
}

}  // namespace
}  // namespace voxeld::display::emulator
