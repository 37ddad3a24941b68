// Tests devices that lie about everything, repeatedly: nothing may crash, and no lie may prevent a
// display from recovering once its device tells the truth.

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "display/emulator/fadecandy_device.h"
#include "display/emulator/hostile_device.h"
#include "display/emulator/voxlink_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/fadecandy/fadecandy_rig.h"
#include "tests/display/usb/transport_rig.h"

namespace voxeld::display {
namespace {

using emulator::HostileDevice;
using sync::kMillisecond;
using sync::kSecond;

InProcessTransport::Options Pumped() {
  InProcessTransport::Options options;
  options.own_thread = false;
  return options;
}

// Lives of a device, each with different lies and `length` long; ten times in between it tells the
// truth. At least `least` lies must have been told.
struct Lives {
  uint64_t count, least;
  sync::TimeNs length;
};
template <typename RunFor, typename Plug, typename Shows>
void Live(const Lives& lives, HostileDevice& device, RunFor run_for, Plug plug, Shows shows) {
  for (uint64_t life = 1; life <= lives.count; ++life) {
    plug(false);
    device.SetSeed(life);
    run_for(kMillisecond);
    plug(true);
    run_for(lives.length);
    if (life % (lives.count / 10) != 0) continue;
    device.SetSeed(std::nullopt);
    plug(false);
    run_for(kMillisecond);
    plug(true);
    run_for(8 * kSecond);  // beyond the longest back-off
    ASSERT_TRUE(shows()) << "after life " << life;
  }
  EXPECT_GT(device.lies(), lives.least);
}

TEST(Hostile, VoxlinkDevices) {
  sync::FakeClock clock;
  const DisplayInfo info = SmallDisplay();
  emulator::VoxlinkDeviceConfig config;
  config.geometry = info.geometry;
  config.volumes_per_second = info.volumes_per_second;
  auto inner = std::make_unique<emulator::VoxlinkDevice>(config, clock);
  emulator::VoxlinkDevice* const screen = inner.get();
  auto hostile = std::make_unique<HostileDevice>(std::move(inner));
  HostileDevice* const device = hostile.get();
  auto transport = std::make_unique<InProcessTransport>(std::move(hostile), clock, Pumped());
  InProcessTransport* const cable = transport.get();
  TransportRig rig(std::move(transport), clock, {[cable] { return cable->Pump(); }});
  rig.Start();
  FrameSource source(info.layout, 1);
  const SliceFramePtr frame = source.Next(1);
  rig.display().Submit(frame);
  Live(
      {.count = 10'000, .least = 10'000, .length = 300 * kMillisecond}, *device,
      [&](sync::TimeNs time) { rig.RunFor(time); },
      [&](bool plugged) {
        cable->WithDevice([&](UsbDeviceModel& model) { model.SetPlugged(plugged); });
      },
      [&] {
        const std::optional<DecodedVolume> seen = screen->Seen();
        if (rig.display().state() != DisplayState::kShowing || !seen.has_value()) return false;
        for (size_t p = 0; p < seen->pictures.size(); ++p) {
          const auto* const picture = frame->bytes.data() + p * frame->layout.bytes_per_slice();
          if (!std::equal(seen->pictures[p]->begin(), seen->pictures[p]->end(), picture)) {
            return false;
          }
        }
        return true;
      });
}

TEST(Hostile, FadecandyBoards) {
  fadecandy::FadecandyRig rig(2);
  rig.Start();
  FrameSource source(rig.display().info().layout, 1);
  const SliceFramePtr frame = source.Next(1);
  rig.display().Submit(frame);
  Live(
      // A board reports little: a counter, after it has been idle for a while.
      {.count = 500, .least = 50, .length = 800 * kMillisecond}, rig.hostile(1),
      [&](sync::TimeNs time) { rig.RunFor(time); },
      [&](bool plugged) { rig.SetPlugged(1, plugged); },
      [&] { return rig.display().state() == DisplayState::kShowing && rig.Sees(*frame); });
}

}  // namespace
}  // namespace voxeld::display
