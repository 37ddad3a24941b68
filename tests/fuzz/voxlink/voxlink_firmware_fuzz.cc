// The C99 device for microcontrollers, and a malicious host.

#include <cstdint>

#include "display/drivers/voxlink/capabilities.h"
#include "tests/display/drivers/firmware/firmware_device.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/voxlink/device_session.h"

namespace voxeld::fuzz {
namespace {

void Run(Script script) {
  const uint8_t choice = script.Byte();
  display::PlanarStack stack{.width_px = 3, .height_px = 2};
  stack.positions_mm = {0, 1, 2, 3};
  const bool watchdog = (choice & 1) != 0;
  const display::voxlink::DeviceCapabilities capabilities{
      .fixed = {.version = 0x0100,
                .formats = 0x1F,
                .max_sub_frames = 4,
                .features = (watchdog ? 1u : 0u) | 2u | 4u | 8u | 16u,
                .receive_buffer = 4096,
                .max_payload = 256,
                .volume_buffers = 3,
                .min_rate_mhz = 2'500,
                .max_rate_mhz = 10'000,
                .nominal_rate_mhz = 10'000,
                .keepalive_ms = 100,
                .watchdog_ms = static_cast<uint16_t>(watchdog ? 250 : 0)},
      .geometry = {.shape = stack}};
  sync::FakeClock clock;
  display::FirmwareDevice device(capabilities, display::UsbSpeed::kSuper, clock);
  DeviceSession session(device, clock, ExchangeKind::kFirmware, [&] {
    const auto light = device.Light();
    EXPECT_THAT_HOLDS(light.empty() ||
                      light.size() == size_t{device.core().pictures} * device.core().picture_bytes);
    for (const std::byte byte : light) (void)byte;
    EXPECT_THAT_HOLDS(device.core().header_have <= 40 && device.core().payload_have <= 256);
    EXPECT_THAT_HOLDS(device.core().events_count <= VOXLINK_EVENTS);
    EXPECT_THAT_HOLDS(light.empty() || device.plugged());
  });
  session.Run(script);
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
