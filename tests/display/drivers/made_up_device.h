// A fictitious voxlink device, for tests of what devices report about themselves.
#pragma once

#include "display/drivers/voxlink/capabilities.h"

namespace voxeld::display::voxlink {

// Its geometry must still be set; slices and pixels are counted from that when it is encoded.
inline DeviceCapabilities MadeUpDevice(uint16_t version) {
  DeviceCapabilities device;
  device.fixed.version = version;
  device.fixed.formats = 0x05;
  device.fixed.max_sub_frames = 4;
  device.fixed.receive_buffer = 1 << 20;
  device.fixed.max_payload = 65536;
  device.fixed.volume_buffers = 3;
  device.fixed.min_rate_mhz = 1000;
  device.fixed.nominal_rate_mhz = device.fixed.max_rate_mhz = 30'000;
  device.fixed.keepalive_ms = 100;
  return device;
}

}  // namespace voxeld::display::voxlink
