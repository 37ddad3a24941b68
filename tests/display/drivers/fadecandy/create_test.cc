#include <map>
#include <string>
#include <utility>
#include <vector>

#include "display/drivers/fadecandy/fadecandy.h"
#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/fadecandy/fadecandy_rig.h"

namespace voxeld::display::fadecandy {
namespace {

using Values = std::map<std::string, std::string>;

std::string Refusal(Values values) {
  sync::FakeClock clock;
  const auto display =
      CreateEmulated({.name = "d", .driver = "fadecandy", .options = values}, clock);
  if (display.ok()) return "accepted";
  EXPECT_EQ(display.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(display.status().message());
}

TEST(FadecandyOptions, ACubeOfEightByDefault) {
  sync::FakeClock clock;
  const auto display = CreateEmulated({.name = "d", .driver = "fadecandy"}, clock);
  ASSERT_TRUE(display.ok()) << display.status();
  const DisplayInfo& info = (*display)->info();
  EXPECT_EQ(info.layout, (FrameLayout{.slices = 1, .width = 512, .height = 1}));
  EXPECT_EQ(info.volumes_per_second, 60);
  EXPECT_EQ(info.tone.dither, Dither::kNone);
  for (const Tone::Curve& curve : info.tone.lut) EXPECT_EQ(curve, Tone::Linear());
  EXPECT_EQ(info.geometry.grid.nx, 8);
  EXPECT_EQ(info.geometry.grid.ny, 8);
  EXPECT_EQ(info.geometry.grid.nz, 8);
  EXPECT_EQ(info.geometry.grid.origin_mm, (Vec3{-4, -4, -4}));
  EXPECT_EQ((*display)->state(), DisplayState::kStopped);
}

TEST(FadecandyOptions, TransportsAreAskedForBySerialOrPlace) {
  sync::FakeClock clock;
  std::vector<std::pair<std::string, size_t>> asked;
  const auto make = [&](const BoardPlace& board) {
    asked.emplace_back(board.serial, board.index);
    InProcessTransport::Options carrier;
    carrier.own_thread = false;
    return std::make_unique<InProcessTransport>(
        std::make_unique<emulator::FadecandyDevice>(emulator::FadecandyDeviceConfig{}, clock),
        clock, carrier);
  };
  ASSERT_TRUE(CreateOver({.name = "d", .options = {{"boards", "B;A"}}}, clock, make).ok());
  ASSERT_TRUE(CreateOver({.name = "d", .options = {{"boards", "2"}}}, clock, make).ok());
  EXPECT_EQ(asked,
            (std::vector<std::pair<std::string, size_t>>{{"B", 0}, {"A", 1}, {"", 0}, {"", 1}}));
}

TEST(FadecandyOptions, RefusalsNameKeyValueAndWhatIsRight) {
  EXPECT_EQ(Refusal({{"boards", "65"}}),
            "display \"d\": boards is \"65\"; it must be from 1 to 64, or serial numbers with ';' "
            "between them");
  EXPECT_EQ(
      Refusal({{"white", "1;1"}}),
      "display \"d\": white is \"1;1\"; it must be three numbers from 0 to 2 with ';' between "
      "them");
  EXPECT_EQ(Refusal({{"gamma", "0"}}),
            "display \"d\": gamma is \"0\"; it must be a number from 0.1 to 10");
  EXPECT_EQ(Refusal({{"cutoff", "1"}}),
            "display \"d\": cutoff is \"1\"; it must be a number from 0 to 0.999");
  EXPECT_EQ(Refusal({{"led", "blink"}}),
            "display \"d\": led is \"blink\"; it must be one of traffic, off, on");
  EXPECT_EQ(Refusal({{"cube", "9x8x8"}}),
            "display \"d\": a cube of 9x8x8 lights, 64 on a strip, from pixel 0 on, ends at pixel "
            "575; the last one there is, with 512 a board, is 511");
  EXPECT_EQ(Refusal({{"layout", "/nonexistent"}}),
            "display \"d\": layout \"/nonexistent\": it cannot be opened");
  EXPECT_NE(Refusal({{"pitch_mm", "100000"}}).find("cell_mm.x"), std::string::npos);
  EXPECT_NE(Refusal({{"size", "8x8x8"}}).find("unknown option size"), std::string::npos);
}

TEST(FadecandyOptions, ReachTheBoards) {
  sync::FakeClock clock;
  Recorder recorder;
  emulator::FadecandyDevice* device = nullptr;
  InProcessTransport* transport = nullptr;
  const auto display = CreateOver(
      {.name = "d",
       .options = {{"dither", "none"},
                   {"interpolate", "true"},
                   {"led", "on"},
                   {"gamma", "1"},
                   {"white", "1;0.5;0"},
                   {"brightness", "0.5"}}},
      clock, [&](const BoardPlace&) {
        auto model =
            std::make_unique<emulator::FadecandyDevice>(emulator::FadecandyDeviceConfig{}, clock);
        device = model.get();
        InProcessTransport::Options carrier;
        carrier.own_thread = false;
        auto made = std::make_unique<InProcessTransport>(std::move(model), clock, carrier);
        transport = made.get();
        return made;
      });
  ASSERT_TRUE(display.ok()) << display.status();
  ASSERT_TRUE((*display)->Start(&recorder, [] {}).ok());
  auto frame = std::make_shared<SliceFrame>();
  frame->volume = 1;
  frame->layout = (*display)->info().layout;
  frame->bytes.assign(kFrameBytes, std::byte{100});
  frame->changed_in = {1};
  (*display)->Submit(frame);
  for (int i = 0; i < 100; ++i) {
    (*display)->Tick();
    transport->Pump();
    clock.Advance(sync::kMillisecond);
  }
  EXPECT_EQ(recorder.Count(1), 1);
  EXPECT_EQ(device->light().flags(), kNoDither | kManualLed | kLedOn);
  EXPECT_TRUE(device->light().led());
  EXPECT_EQ(device->Output()[0], 50);
  EXPECT_EQ(device->Output()[1], 25);
  EXPECT_EQ(device->Output()[2], 0);
}

}  // namespace
}  // namespace voxeld::display::fadecandy
