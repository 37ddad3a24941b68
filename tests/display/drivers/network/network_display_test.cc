#include "display/drivers/network/network_display.h"

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "display/drivers/network/network.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/network/fake_link.h"
#include "tests/display/drivers/rig.h"

namespace voxeld::display::network {
namespace {

using Kind = VolumeOutcome::Kind;
using Options = std::map<std::string, std::string>;

// A display, its wire and a clock that the test moves.
class Network : public testing::Test {
 protected:
  void Make(Options options) {
    options.emplace("address", "10.0.0.1");
    options_ = {.name = "wall", .driver = "network", .options = std::move(options)};
    absl::StatusOr<std::unique_ptr<Display>> display =
        CreateOver(options_, clock_, [&](Protocol, const Endpoint& to) {
          endpoint_ = to.text();
          return std::make_unique<FakeLink>(wire_);
        });
    ASSERT_TRUE(display.ok()) << display.status();
    display_ = *std::move(display);
    source_ = std::make_unique<FrameSource>(display_->info().layout, 1);
  }
  void Start() {
    ASSERT_TRUE(display_->Start(&recorder_, [] {}).ok());
    ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }))
        << display_->state_reason();
    wire_.packets.clear();
  }
  void TearDown() override {
    if (display_ != nullptr) display_->Stop();
  }
  bool RunUntil(const std::function<bool()>& done, sync::TimeNs limit = 20 * sync::kSecond) {
    const sync::TimeNs end = clock_.Now() + limit;
    while (true) {
      const sync::TimeNs next = display_->Tick();
      if (done()) return true;
      if (clock_.Now() >= end) return false;
      clock_.AdvanceTo(std::min(end, std::max(next, clock_.Now() + 1)));
    }
  }
  void RunFor(sync::TimeNs time) {
    RunUntil([] { return false; }, time);
  }
  void Show(double share) {
    frame_ = source_->Next(share);
    display_->Submit(frame_);
    ASSERT_TRUE(RunUntil([&] { return recorder_.Of(frame_->volume) != nullptr; }));
    ASSERT_EQ(recorder_.Of(frame_->volume)->kind, Kind::kPresented)
        << recorder_.Of(frame_->volume)->reason;
  }
  std::string Refusal(Options options) {
    options.emplace("address", "10.0.0.1");
    const DisplayOptions all{.name = "wall", .driver = "network", .options = std::move(options)};
    const auto display = CreateOver(
        all, clock_, [&](Protocol, const Endpoint&) { return std::make_unique<FakeLink>(wire_); });
    EXPECT_FALSE(display.ok());
    return std::string(display.status().message());
  }
  const StreamOptions stream_{.protocol = Protocol::kDdp};

  sync::FakeClock clock_;
  FakeWire wire_;
  DisplayOptions options_;
  std::string endpoint_;
  Recorder recorder_;
  std::unique_ptr<Display> display_;
  std::unique_ptr<FrameSource> source_;
  SliceFramePtr frame_;
};

// 20³ lights are 8,000 pixels: 17 packets of DDP, 48 universes, one message of OPC.
TEST_F(Network, SlicesArePackets) {
  Make({{"cube", "20x20x20"}});
  EXPECT_EQ(display_->info().layout, (FrameLayout{.slices = 17, .width = 480, .height = 1}));
  EXPECT_EQ(endpoint_, "10.0.0.1:4048");
  Make({{"cube", "20x20x20"}, {"protocol", "e131"}});
  EXPECT_EQ(display_->info().layout, (FrameLayout{.slices = 48, .width = 170, .height = 1}));
  EXPECT_EQ(endpoint_, "10.0.0.1:5568");
  Make({{"cube", "20x20x20"}, {"protocol", "artnet"}, {"address", "10.0.0.9:99"}});
  EXPECT_EQ(endpoint_, "10.0.0.9:99");
  Make({{"cube", "20x20x20"}, {"protocol", "opc"}});
  EXPECT_EQ(display_->info().layout, (FrameLayout{.slices = 1, .width = 8000, .height = 1}));
  // Strips that each begin at their own universe.
  Make({{"cube", "10x10x10"}, {"protocol", "e131"}, {"strip", "170"}, {"per_strip", "100"}});
  EXPECT_EQ(display_->info().layout.slices, 10);
}

TEST_F(Network, WhatIsSentIsTheVolume) {
  Make({{"cube", "20x20x20"}});
  Start();
  Show(1);
  ASSERT_EQ(wire_.packets.size(), 17u);
  for (int32_t slice = 0; slice < 17; ++slice) {
    const auto read = Read(stream_, 17, 480, wire_.packets[static_cast<size_t>(slice)]);
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(read->slice, slice);
    EXPECT_EQ(read->last, slice == 16);
    EXPECT_TRUE(
        std::equal(read->rgb.begin(), read->rgb.end(), frame_->bytes.begin() + slice * 1440));
  }
}

// After each attach the picture is sent twice, with sequence numbers half their range apart.
TEST_F(Network, AReceiverThatRemembersE131sNumbersTakesTheFirstPicture) {
  Make({{"cube", "20x20x20"}, {"protocol", "e131"}});
  ASSERT_TRUE(display_->Start(&recorder_, [] {}).ok());
  ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }));
  ASSERT_EQ(wire_.packets.size(), 2u * 48);
  for (size_t slice = 0; slice < 48; ++slice) {
    const auto number = [&](size_t i) { return std::to_integer<int>(wire_.packets[i][111]); };
    EXPECT_EQ((number(48 + slice) - number(slice) + 256) % 256, 129) << slice;
  }
}

TEST_F(Network, KeepsNoPowerLimitWhetherItIsThereOrNot) {
  Make({{"cube", "4x4x4"}});
  EXPECT_EQ(display_->SetPowerLimit(5).code(), absl::StatusCode::kUnimplemented);
  Start();
  EXPECT_EQ(display_->SetPowerLimit(5).code(), absl::StatusCode::kUnimplemented);
  EXPECT_FALSE(display_->keeps_power_limit());
}

TEST_F(Network, OnlyWhatChangedIsSentAndTheLastPushes) {
  Make({{"cube", "20x20x20"}});
  Start();
  Show(1);
  wire_.packets.clear();
  Show(0.3);
  ASSERT_FALSE(wire_.packets.empty());
  ASSERT_LT(wire_.packets.size(), 17u);
  for (size_t i = 0; i < wire_.packets.size(); ++i) {
    const auto read = Read(stream_, 17, 480, wire_.packets[i]);
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(frame_->changed_in[static_cast<size_t>(read->slice)], frame_->volume);
    EXPECT_EQ(read->last, i + 1 == wire_.packets.size());
  }
}

TEST_F(Network, VolumesKeepTheirPace) {
  Make({{"cube", "4x4x4"}, {"rate", "50"}});
  Start();
  const sync::TimeNs begin = clock_.Now();
  for (int i = 0; i < 10; ++i) Show(1);
  EXPECT_EQ(clock_.Now() - begin, 10 * 20 * sync::kMillisecond);
  const std::vector<sync::TimeNs> sweeps = display_->ComingSweeps(2);
  ASSERT_EQ(sweeps.size(), 2u);
  EXPECT_EQ(sweeps[1] - sweeps[0], 20 * sync::kMillisecond);
}

// A controller that missed a packet gets it again within a second; DMX controllers expect regular
// packets.
TEST_F(Network, SilenceIsFilledWithThePicture) {
  Make({{"cube", "20x20x20"}, {"protocol", "e131"}, {"sync_universe", "99"}});
  Start();
  Show(1);
  wire_.packets.clear();
  RunFor(3 * sync::kSecond);
  EXPECT_EQ(wire_.packets.size(), 3u * 49);  // 48 universes and the packet that shows them
  EXPECT_EQ(display_->stats().slices_sent, 48u);
}

TEST_F(Network, OpcNeedsNoRepeats) {
  Make({{"cube", "4x4x4"}, {"protocol", "opc"}});
  Start();
  Show(1);
  wire_.packets.clear();
  RunFor(3 * sync::kSecond);
  EXPECT_TRUE(wire_.packets.empty());
}

TEST_F(Network, ColoursGoInTheLightsOrderUnderBrightness) {
  Make({{"cube", "1x1x1"}, {"color_order", "grb"}});
  Start();
  SliceFrame frame{.volume = 1, .layout = display_->info().layout};
  frame.bytes = {std::byte{200}, std::byte{100}, std::byte{50}};
  frame.changed_in = {1};
  display_->Submit(std::make_shared<const SliceFrame>(frame));
  ASSERT_TRUE(RunUntil([&] { return recorder_.Of(1) != nullptr; }));
  const auto newest = [&] {
    const std::vector<std::byte>& packet = wire_.packets.back();
    return std::vector<std::byte>(packet.end() - 3, packet.end());
  };
  EXPECT_EQ(newest(), (std::vector<std::byte>{std::byte{100}, std::byte{200}, std::byte{50}}));
  ASSERT_TRUE(display_->SetBrightness(0.5).ok());
  RunFor(sync::kMillisecond);
  EXPECT_EQ(newest(), (std::vector<std::byte>{std::byte{50}, std::byte{100}, std::byte{25}}));
  ASSERT_TRUE(display_->SetBlank(true).ok());
  RunFor(sync::kMillisecond);
  EXPECT_EQ(newest(), std::vector<std::byte>(3));
  ASSERT_TRUE(display_->SetBlank(false).ok());
  RunFor(sync::kMillisecond);
  EXPECT_EQ(newest(), (std::vector<std::byte>{std::byte{50}, std::byte{100}, std::byte{25}}));
}

TEST_F(Network, ADisplayThatStopsIsDarkAndSaysSo) {
  Make({{"cube", "1x1x1"}, {"protocol", "e131"}});
  Start();
  Show(1);
  wire_.packets.clear();
  display_->Stop();
  ASSERT_EQ(wire_.packets.size(), 4u);
  const StreamOptions stream{.protocol = Protocol::kE131};
  for (size_t i = 0; i < 4; ++i) {
    const auto read = Read(stream, 1, 1, wire_.packets[i]);
    ASSERT_TRUE(read.has_value());
    EXPECT_EQ(read->kind, i == 0 ? ReadPacket::Kind::kPixels : ReadPacket::Kind::kEnd);
    EXPECT_EQ(std::vector<std::byte>(read->rgb.begin(), read->rgb.end()),
              std::vector<std::byte>(3));
  }
}

TEST_F(Network, NobodyThereIsToldAndTriedAgain) {
  Make({{"cube", "4x4x4"}});
  wire_.broken = absl::UnavailableError("10.0.0.1:4048: sent to: Connection refused");
  ASSERT_TRUE(display_->Start(&recorder_, [] {}).ok());
  RunFor(sync::kSecond);
  EXPECT_EQ(display_->state(), DisplayState::kAttaching);
  EXPECT_EQ(display_->state_reason(), "10.0.0.1:4048: sent to: Connection refused");
  EXPECT_GT(wire_.opened, 2);
  EXPECT_EQ(wire_.opened, wire_.closed);
  wire_.broken = absl::OkStatus();
  ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }));
  Show(1);
}

TEST_F(Network, WhatIsOnItsWayWhenTheControllerGoesIsLostAndComesAgain) {
  Make({{"cube", "20x20x20"}});
  Start();
  Show(1);
  wire_.room = 3 * 1450;
  display_->Submit(source_->Next(1));
  RunFor(10 * sync::kMillisecond);
  EXPECT_EQ(recorder_.Of(2), nullptr);  // delayed, not given up
  wire_.broken = absl::UnavailableError("10.0.0.1:4048: send: Network is unreachable");
  ASSERT_TRUE(RunUntil([&] { return recorder_.Of(2) != nullptr; }));
  EXPECT_EQ(recorder_.Of(2)->kind, Kind::kLost);
  EXPECT_EQ(recorder_.Of(2)->reason, "10.0.0.1:4048: send: Network is unreachable");
  EXPECT_EQ(recorder_.Of(2)->bytes_sent, 3u * 1450);
  EXPECT_EQ(display_->state(), DisplayState::kLost);
  wire_.broken = absl::OkStatus();
  wire_.room = SIZE_MAX;
  wire_.packets.clear();
  ASSERT_TRUE(RunUntil([&] { return display_->state() == DisplayState::kShowing; }));
  // Whole, and twice: the previous volume, as a proof, and the newest; what the controller holds is
  // unknown.
  EXPECT_EQ(wire_.packets.size(), 2u * 17);
  Show(0.1);
}

TEST_F(Network, ARoomThatComesBackIsUsed) {
  Make({{"cube", "20x20x20"}});
  Start();
  wire_.room = 5 * 1450;
  display_->Submit(source_->Next(1));
  RunFor(10 * sync::kMillisecond);
  EXPECT_EQ(wire_.packets.size(), 5u);
  wire_.room = SIZE_MAX;
  ASSERT_TRUE(RunUntil([&] { return recorder_.Of(1) != nullptr; }));
  EXPECT_EQ(recorder_.Of(1)->kind, Kind::kPresented);
  EXPECT_EQ(wire_.packets.size(), 17u);
}

TEST_F(Network, SaysWhatIsWrongWithOptions) {
  EXPECT_NE(Refusal({{"address", "wled.local"}}).find("an address in numbers"), std::string::npos);
  EXPECT_NE(Refusal({{"protocol", "dmx"}}).find("one of ddp, e131, artnet, opc"),
            std::string::npos);
  EXPECT_NE(Refusal({{"priority", "10"}}).find("unknown option priority"), std::string::npos);
  EXPECT_NE(Refusal({{"color_order", "rgbw"}}).find("one of rgb, rbg"), std::string::npos);
  EXPECT_NE(Refusal({{"protocol", "opc"}, {"cube", "64x64x64"}}).find("16384 a channel"),
            std::string::npos);
  const DisplayOptions none{.name = "wall", .driver = "network", .options = {}};
  const auto display = CreateOver(
      none, clock_, [&](Protocol, const Endpoint&) { return std::make_unique<FakeLink>(wire_); });
  EXPECT_NE(display.status().message().find("address is \"\""), std::string::npos)
      << display.status();
}

}  // namespace
}  // namespace voxeld::display::network
