#include "display/emulator/fadecandy_device.h"

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/lut.h"
#include "display/drivers/fadecandy/packets.h"
#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"

namespace voxeld::display::emulator {
namespace {

using sync::kMillisecond;

constexpr sync::TimeNs kRefresh = 2'500'000;

class FadecandyBoard : public testing::Test {
 protected:
  struct Completed {
    TransferStatus status;
    uint32_t actual;
    std::vector<std::byte> in;
  };

  void SetUp() override {
    device_.SetComplete(
        [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
          ASSERT_TRUE(done_.emplace(id, Completed{status, actual, {in.begin(), in.end()}}).second);
        });
  }
  uint64_t Bulk(TransferBytes bytes, bool zero_packet = false) {
    const uint64_t id = next_id_++;
    Urb urb;
    urb.id = id;
    urb.endpoint = fadecandy::kBulkOut;
    urb.out = out_[id] = std::move(bytes);
    urb.zero_packet = zero_packet;
    device_.Submit(urb);
    return id;
  }
  Completed Control(const UsbSetup& setup) {
    Urb urb;
    urb.id = next_id_++;
    urb.setup = setup;
    if ((setup.request_type & 0x80) != 0) urb.length = setup.length;
    device_.Submit(urb);
    return done_.at(urb.id);
  }
  std::vector<int> In(uint8_t type, uint8_t request, uint16_t value, uint16_t index) {
    const Completed done = Control({type, request, value, index, 255});
    if (done.status == TransferStatus::kStall) return {};
    EXPECT_EQ(done.status, TransferStatus::kShort);
    std::vector<int> bytes;
    for (const std::byte b : done.in) bytes.push_back(std::to_integer<int>(b));
    EXPECT_EQ(done.actual, bytes.size());
    return bytes;
  }
  std::string Text(uint8_t index) {
    std::string text;
    const std::vector<int> bytes = In(0x80, 6, static_cast<uint16_t>(0x0300 | index), 0x0409);
    EXPECT_EQ(bytes.at(0), static_cast<int>(bytes.size()));
    for (size_t i = 2; i < bytes.size(); i += 2) text += static_cast<char>(bytes[i]);
    return text;
  }
  std::optional<TransferStatus> Status(uint64_t id) const {
    const auto it = done_.find(id);
    return it == done_.end() ? std::nullopt : std::optional(it->second.status);
  }
  void Pass(sync::TimeNs time) {
    clock_.Advance(time);
    device_.Tick();
  }
  static TransferBytes SetUpBytes() {
    TransferBytes bytes;
    fadecandy::AppendConfig(bytes, fadecandy::kNoInterpolation | fadecandy::kNoDither);
    fadecandy::AppendLut(bytes, fadecandy::MakeLut({.gamma = 1}, 1));
    return bytes;
  }
  static TransferBytes Frame(int value, size_t begin = 0, size_t end = 25) {
    TransferBytes bytes;
    const std::vector<std::byte> rgb(fadecandy::kFrameBytes, static_cast<std::byte>(value));
    fadecandy::AppendFrame(bytes, rgb, begin, end);
    return bytes;
  }

  sync::FakeClock clock_;
  FadecandyDevice device_{{.serial = "ENICCULV", .refresh_ns = kRefresh}, clock_};
  std::map<uint64_t, TransferBytes> out_;
  std::map<uint64_t, Completed> done_;
  uint64_t next_id_ = 1;
};

TEST_F(FadecandyBoard, Descriptors) {
  EXPECT_EQ(device_.speed(), UsbSpeed::kFull);
  EXPECT_EQ(In(0x80, 6, 0x0100, 0), (std::vector<int>{18, 1, 0, 2, 0, 0, 0, 64, 0x50, 0x1D, 0x7A,
                                                      0x60, 0x08, 0x01, 1, 2, 3, 1}));
  EXPECT_EQ(In(0x80, 6, 0x0200, 0),
            (std::vector<int>{0x09, 0x02, 0x2B, 0x00, 0x02, 0x01, 0x00, 0x80, 0x32, 0x09, 0x04,
                              0x00, 0x00, 0x01, 0xFF, 0x00, 0x00, 0x00, 0x07, 0x05, 0x01, 0x02,
                              0x40, 0x00, 0x00, 0x09, 0x04, 0x01, 0x00, 0x00, 0xFE, 0x01, 0x01,
                              0x04, 0x09, 0x21, 0x0D, 0x10, 0x27, 0x00, 0x04, 0x01, 0x01}));
  EXPECT_EQ(In(0x80, 6, 0x0300, 0), (std::vector<int>{4, 3, 9, 4}));
  EXPECT_EQ(Text(1), "scanlime");
  EXPECT_EQ(Text(2), "Fadecandy");
  EXPECT_EQ(Text(3), "ENICCULV");
  EXPECT_TRUE(In(0x80, 6, 0x0F00, 0).empty());
  EXPECT_EQ(Control({0x80, 6, 0x0100, 0, 8}).status, TransferStatus::kOk);
}

TEST_F(FadecandyBoard, MicrosoftDescriptors) {
  EXPECT_EQ(In(0x80, 6, 0x03EE, 0), (std::vector<int>{18, 3, 'M', 0, 'S', 0, 'F', 0, 'T', 0, '1', 0,
                                                      '0', 0, '0', 0, 0x7E, 0}));
  const std::vector<int> id = In(0xC0, 0x7E, 0, 4);
  ASSERT_EQ(id.size(), 40u);
  EXPECT_EQ(id[0], 40);
  EXPECT_EQ(id[6], 4);
  EXPECT_EQ(std::string(id.begin() + 18, id.begin() + 24), "WINUSB");
  const std::vector<int> properties = In(0xC0, 0x7E, 0, 5);
  ASSERT_EQ(properties.size(), 142u);
  EXPECT_EQ(properties[0], 142);
  EXPECT_EQ(properties[10], 132);
  EXPECT_TRUE(In(0xC0, 0x7E, 0, 6).empty());
}

TEST_F(FadecandyBoard, StandardRequests) {
  EXPECT_EQ(In(0x80, 8, 0, 0), std::vector<int>{0});
  EXPECT_EQ(Control({0x00, 9, 1, 0, 0}).status, TransferStatus::kOk);
  EXPECT_EQ(In(0x80, 8, 0, 0), std::vector<int>{1});
  EXPECT_EQ(Control({0x00, 9, 2, 0, 0}).status, TransferStatus::kStall);
  EXPECT_EQ(Control({0x01, 11, 0, 1, 0}).status, TransferStatus::kOk);
  EXPECT_EQ(Control({0x01, 11, 1, 0, 0}).status, TransferStatus::kStall);
  EXPECT_EQ(Control({0x02, 3, 0, 1, 0}).status, TransferStatus::kOk);
  EXPECT_EQ(In(0x82, 0, 0, 1), (std::vector<int>{1, 0}));
  EXPECT_EQ(Status(Bulk(Frame(1))), TransferStatus::kStall);
  EXPECT_EQ(Control({0x02, 1, 0, 1, 0}).status, TransferStatus::kOk);
  EXPECT_EQ(In(0x82, 0, 0, 1), (std::vector<int>{0, 0}));
  EXPECT_EQ(In(0x80, 0, 0, 0), (std::vector<int>{0, 0}));
  EXPECT_EQ(Status(Bulk(Frame(1))), TransferStatus::kOk);
}

TEST_F(FadecandyBoard, CountsRefreshesAndFrames) {
  Pass(100 * kRefresh);
  Bulk(Frame(1));
  Pass(kRefresh);
  EXPECT_EQ(In(0xC0, 1, 0, 0), (std::vector<int>{101, 0, 0, 0}));
  EXPECT_EQ(In(0xC0, 1, 0, 1), (std::vector<int>{1, 0, 0, 0}));
  EXPECT_TRUE(In(0xC0, 1, 0, 2).empty());
}

TEST_F(FadecandyBoard, LightsAFrameAtTheRefreshAfterItsOwn) {
  EXPECT_EQ(Status(Bulk(SetUpBytes())), TransferStatus::kOk);
  Bulk(Frame(99));
  Pass(kRefresh - 1);
  EXPECT_EQ(device_.light().frames(), 0u);
  Pass(1);
  EXPECT_EQ(device_.light().frames(), 1u);
  EXPECT_EQ(device_.Output()[0], 0);
  Pass(kRefresh);
  for (const uint8_t value : device_.Output()) ASSERT_EQ(value, 99);
}

// There is one endpoint: if a frame has to wait, everything after it waits.
TEST_F(FadecandyBoard, WhatComesBehindAWaitingFrameWaits) {
  Bulk(SetUpBytes());
  const uint64_t first = Bulk(Frame(1)), second = Bulk(Frame(2));
  TransferBytes config;
  fadecandy::AppendConfig(config, 0);
  const uint64_t third = Bulk(std::move(config));
  EXPECT_EQ(Status(first), TransferStatus::kOk);
  EXPECT_FALSE(Status(second).has_value());
  EXPECT_FALSE(Status(third).has_value());
  EXPECT_EQ(device_.light().flags(), 3);
  EXPECT_EQ(device_.NextTimeout(), clock_.Now() + kRefresh);
  Pass(kRefresh);
  EXPECT_EQ(Status(second), TransferStatus::kOk);
  EXPECT_EQ(Status(third), TransferStatus::kOk);
  EXPECT_EQ(device_.light().flags(), 0);
}

TEST_F(FadecandyBoard, ATransferMayHoldTwoFrames) {
  Bulk(SetUpBytes());
  TransferBytes both = Frame(1);
  both.Append(Frame(2));
  const uint64_t id = Bulk(std::move(both));
  EXPECT_FALSE(Status(id).has_value());
  Pass(kRefresh);
  EXPECT_EQ(Status(id), TransferStatus::kOk);
  EXPECT_EQ(done_.at(id).actual, 3200u);
  Pass(2 * kRefresh);
  EXPECT_EQ(device_.Output()[0], 2);
}

TEST_F(FadecandyBoard, WhatWasTakenOfAnUnlinkedTransferStays) {
  Bulk(SetUpBytes());
  TransferBytes both = Frame(1);
  both.Append(Frame(2));
  const uint64_t id = Bulk(std::move(both));
  EXPECT_TRUE(device_.Unlink(id));
  EXPECT_FALSE(device_.Unlink(id));
  Pass(3 * kRefresh);
  EXPECT_EQ(device_.Output()[0], 1);
  EXPECT_FALSE(Status(id).has_value());
}

TEST_F(FadecandyBoard, PacketsEndWithTheirTransfer) {
  Bulk(SetUpBytes());
  TransferBytes frame = Frame(5);
  TransferBytes head(std::span(std::as_const(frame)).first(100));
  EXPECT_EQ(Status(Bulk(std::move(head))), TransferStatus::kOk);
  EXPECT_EQ(device_.short_packets(), 1u);
  EXPECT_EQ(Status(Bulk({}, true)), TransferStatus::kOk);
  Bulk(Frame(5, 0, 10));
  Bulk(Frame(5, 10, 25));
  Pass(2 * kRefresh);
  for (const uint8_t value : device_.Output()) ASSERT_EQ(value, 5);
  EXPECT_EQ(device_.packets(), 26u + 1 + 25);
}

TEST_F(FadecandyBoard, ForgetsWithoutPower) {
  Bulk(SetUpBytes());
  Bulk(Frame(5));
  Pass(2 * kRefresh);
  Bulk(Frame(6));
  const uint64_t waiting = Bulk(Frame(7));
  device_.SetPlugged(false);
  EXPECT_EQ(Status(waiting), TransferStatus::kDisconnected);
  EXPECT_EQ(device_.NextTimeout(), sync::kNever);
  EXPECT_EQ(device_.Output()[0], 0);
  EXPECT_EQ(Status(Bulk(Frame(8))), TransferStatus::kDisconnected);
  device_.SetPlugged(true);
  EXPECT_EQ(device_.plugs(), 2u);
  Bulk(Frame(9));
  Pass(4 * kRefresh);
  EXPECT_EQ(device_.Output()[0], 0);  // no table
  EXPECT_EQ(device_.light().frames(), 1u);
}

TEST_F(FadecandyBoard, AResetEndsWhatIsPending) {
  Bulk(Frame(1));
  const uint64_t waiting = Bulk(Frame(2));
  device_.Reset();
  EXPECT_EQ(Status(waiting), TransferStatus::kCancelled);
  EXPECT_EQ(device_.plugs(), 1u);
}

TEST_F(FadecandyBoard, CatchesUpWithAClockThatJumps) {
  Bulk(SetUpBytes());
  Bulk(Frame(1));
  Pass(3600 * sync::kSecond);
  EXPECT_EQ(device_.Output()[0], 1);
  EXPECT_GT(device_.NextTimeout(), clock_.Now());
  EXPECT_LE(device_.NextTimeout(), clock_.Now() + kRefresh);
}

}  // namespace
}  // namespace voxeld::display::emulator
