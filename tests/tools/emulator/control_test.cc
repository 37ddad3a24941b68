#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"
#include "tools/emulator/emulated.h"

namespace voxeld::emulator {
namespace {

constexpr const char* kVoxlink = "voxlink,size=4x4x2,rate=100,serial=A1";

class ControlLines : public testing::TestWithParam<const char*> {
 protected:
  ControlLines() {
    absl::StatusOr<Emulated> device = MakeEmulated(GetParam(), clock_);
    EXPECT_TRUE(device.ok()) << device.status();
    if (device.ok()) device_ = *std::move(device);
  }
  std::string Ask(const std::string& line) { return Control(device_, line); }
  nlohmann::json Status() { return nlohmann::json::parse(Ask("status")); }

  sync::FakeClock clock_;
  Emulated device_;
};

TEST_P(ControlLines, UnplugAndPlug) {
  EXPECT_EQ(Status()["plugged"], true);
  const int plugs = Status()["plugs"];
  EXPECT_EQ(Ask("unplug"), "ok");
  EXPECT_EQ(Status()["plugged"], false);
  EXPECT_EQ(Ask("unplug"), "ok");
  EXPECT_EQ(Ask("plug"), "ok");
  EXPECT_EQ(Status()["plugged"], true);
  EXPECT_EQ(Status()["plugs"], plugs + 1);
}

TEST_P(ControlLines, StatusIsOneLine) {
  EXPECT_EQ(Ask("status").find('\n'), std::string::npos);
  EXPECT_EQ(Status()["lit"], false);
}

TEST_P(ControlLines, FaultsAndClear) {
  EXPECT_EQ(Ask("fault stall@t1"), "ok");
  EXPECT_EQ(Ask("fault nak:20@100ms;unplug:5@b7"), "ok");
  EXPECT_EQ(device_.faults->faults_left(), 3u);
  EXPECT_EQ(Ask("clear"), "ok");
  EXPECT_EQ(device_.faults->faults_left(), 0u);
}

TEST_P(ControlLines, FaultsCountFromNow) {
  int stalls = 0;
  device_.model->SetComplete(
      [&](uint64_t, display::TransferStatus status, uint32_t, std::span<const std::byte>) {
        if (status == display::TransferStatus::kStall) ++stalls;
      });
  const std::byte bytes[1] = {};
  display::Urb urb{.endpoint = 0x01, .setup = {}, .out = bytes};
  for (; urb.id < 4; ++urb.id) device_.model->Submit(urb);
  EXPECT_EQ(stalls, 0);
  EXPECT_EQ(Ask("fault stall@t2"), "ok");
  device_.model->Submit(urb);
  EXPECT_EQ(stalls, 0);
  ++urb.id;
  device_.model->Submit(urb);
  EXPECT_EQ(stalls, 1);
}

TEST_P(ControlLines, WhatIsWrongIsAnsweredAndDoesNothing) {
  EXPECT_TRUE(Ask("fault stall").starts_with("error: ")) << Ask("fault stall");
  EXPECT_TRUE(Ask("fault boom@t1").starts_with("error: ")) << Ask("fault boom@t1");
  EXPECT_TRUE(Ask("fault stall@t1;nonsense").starts_with("error: "));
  EXPECT_EQ(Ask("jump"), "error: \"jump\" is none of fault, clear, hostile, plug, unplug, status");
  EXPECT_TRUE(Ask("").starts_with("error: "));
  EXPECT_EQ(device_.faults->faults_left(), 0u);
  EXPECT_EQ(Status()["plugged"], true);
}

INSTANTIATE_TEST_SUITE_P(Devices, ControlLines, testing::Values(kVoxlink, "fadecandy,serial=A1"),
                         [](const testing::TestParamInfo<const char*>& param) {
                           return std::string(param.index == 0 ? "Voxlink" : "Fadecandy");
                         });

TEST(MakeEmulated, RefusesWhatItDoesNotKnow) {
  sync::FakeClock clock;
  for (const char* spec : {"", "toaster", "voxlink,size=big", "voxlink,colour=red",
                           "fadecandy,refresh=0", "fadecandy,faults=boom@t1"}) {
    const absl::Status status = MakeEmulated(spec, clock).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << spec << ": " << status;
    EXPECT_FALSE(status.message().empty()) << spec;
  }
}

}  // namespace
}  // namespace voxeld::emulator
