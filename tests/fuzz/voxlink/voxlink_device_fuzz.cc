// The model of a voxlink device, and a malicious host.

#include <cstdint>

#include "display/emulator/voxlink_device.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/voxlink/device_session.h"

namespace voxeld::fuzz {
namespace {

void Run(Script script) {
  const uint8_t choice = script.Byte();
  display::emulator::VoxlinkDeviceConfig config;
  if ((choice & 1) != 0) {
    config.geometry.shape = display::Rotor{
        .slices_per_turn = 4, .width_px = 3, .height_px = 2, .panels = {display::Rotor::Panel{}}};
  } else {
    display::PlanarStack stack{.width_px = 3, .height_px = 2};
    stack.positions_mm = {0, 1, 2, 3};
    config.geometry.shape = stack;
  }
  config.volumes_per_second = 10;
  config.receive_buffer = 4096;
  config.max_payload = 256;
  config.bytes_per_second = (choice & 2) != 0 ? 20'000 : 0;
  config.watchdog = (choice & 4) == 0;
  config.brightness = config.power_limit = (choice & 8) == 0;
  config.max_sub_frames = 4;
  sync::FakeClock clock;
  display::emulator::VoxlinkDevice device(config, clock);
  uint64_t excess = 0;
  DeviceSession session(device, clock, ExchangeKind::kModel, [&] {
    if (const auto seen = device.Seen()) {
      EXPECT_THAT_HOLDS(device.plugged(), "an unplugged device shows something");
      EXPECT_THAT_HOLDS(seen->pictures.size() == seen->layout.pictures());
      for (const display::Picture& picture : seen->pictures) {
        EXPECT_THAT_HOLDS(picture->size() == seen->layout.bytes_per_slice());
      }
    }
    EXPECT_THAT_HOLDS(device.credit_excess() >= excess || device.credit_excess() == 0);
    excess = device.credit_excess();
    EXPECT_THAT_HOLDS(device.NextTimeout() > clock.Now() - 1);
  });
  session.Run(script);
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
