// Tests the device model's requests: those that are not in the protocol's table are stalled and
// change nothing.

#include <cstdint>
#include <vector>

#include "gtest/gtest.h"
#include "tests/display/emulator/bench.h"

namespace voxeld::display::emulator {
namespace voxlink_requests_test {

using voxlink::Request;

constexpr auto kStall = TransferStatus::kStall;
constexpr auto kOk = TransferStatus::kOk;

std::vector<std::byte> Mode(uint8_t format, uint8_t sub_frames, uint32_t rate) {
  return voxlink::BytesOf(
      voxlink::Mode{.format = format, .sub_frames = sub_frames, .rate_mhz = rate});
}

TEST(VoxlinkRequests, AModeHasASubFrameAtLeast) {
  Bench bench;
  EXPECT_EQ(bench.Out(Request::kSetMode, 0, Mode(1, 2, 0))->status, kOk);
  EXPECT_EQ(bench.Out(Request::kSetMode, 0, Mode(0, 0, 0))->status, kStall);
  const auto mode = voxlink::Load<voxlink::Mode>(bench.In(Request::kGetMode, 0, 16)->in);
  EXPECT_EQ(mode.format, 1);
  EXPECT_EQ(mode.sub_frames, 2);
}

TEST(VoxlinkRequests, ValuesThatAreNotInTheTableAreStalled) {
  Bench bench;
  const auto limit = voxlink::BytesOf(uint32_t{12'000});
  for (const uint16_t value : {1, 2, 0x100, 0xFFFF}) {
    SCOPED_TRACE(value);
    EXPECT_EQ(bench.In(Request::kGetStatus, value, sizeof(voxlink::Status))->status, kStall);
    EXPECT_EQ(bench.In(Request::kGetMode, value, sizeof(voxlink::Mode))->status, kStall);
    EXPECT_EQ(bench.Out(Request::kSetMode, value, Mode(1, 1, 0))->status, kStall);
    EXPECT_EQ(bench.Out(Request::kSetPowerLimit, value, limit)->status, kStall);
    EXPECT_EQ(bench.Out(Request::kStart, value)->status, kStall);
  }
  EXPECT_FALSE(bench.device().screen().running());
  EXPECT_EQ(bench.device().power_limit_mw(), 0u);
  EXPECT_EQ(bench.device().layout().format, PixelFormat::kRgb888);
  EXPECT_EQ(bench.Out(Request::kSetBlank, 2)->status, kStall);
  EXPECT_FALSE(bench.device().screen().blanked());

  bench.StartSession();
  EXPECT_EQ(bench.Out(Request::kStop, 1)->status, kStall);
  EXPECT_TRUE(bench.device().screen().running());
}

TEST(VoxlinkRequests, DataThatAreNotInTheTableAreStalled) {
  Bench bench;
  const std::vector<std::byte> byte(1);
  EXPECT_EQ(bench.Out(Request::kStart, 0, byte)->status, kStall);
  EXPECT_FALSE(bench.device().screen().running());
  EXPECT_EQ(bench.Out(Request::kSetBrightness, 7, byte)->status, kStall);
  EXPECT_EQ(bench.device().brightness(), 1);
  EXPECT_EQ(bench.Out(Request::kSetBlank, 1, byte)->status, kStall);
  EXPECT_FALSE(bench.device().screen().blanked());
  for (const size_t size : {0, 15, 17}) {
    EXPECT_EQ(bench.Out(Request::kSetMode, 0, std::vector<std::byte>(size))->status, kStall);
  }
  for (const size_t size : {0, 3, 5}) {
    EXPECT_EQ(
        bench.Out(Request::kSetPowerLimit, 0, std::vector<std::byte>(size, std::byte{1}))->status,
        kStall);
  }
  EXPECT_EQ(bench.device().power_limit_mw(), 0u);

  bench.StartSession();
  EXPECT_EQ(bench.Out(Request::kStop, 0, byte)->status, kStall);
  EXPECT_TRUE(bench.device().screen().running());
}

}  // namespace voxlink_requests_test
}  // namespace voxeld::display::emulator
