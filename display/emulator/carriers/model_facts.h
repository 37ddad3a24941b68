// What a carrier has to say of a device before anybody asks the device: read from its descriptors,
// by requests as a host would send.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

struct ModelFacts {
  struct Endpoint {
    uint8_t address = 0;  // with bit 7 for IN
    uint8_t attributes = 0;
    uint16_t packet = 0;
    uint8_t interval = 0;
  };
  uint16_t vendor_id = 0, product_id = 0, bcd_device = 0;
  std::string serial;                              // ASCII only
  std::vector<std::byte> device, configuration;    // descriptors
  std::vector<std::array<uint8_t, 3>> interfaces;  // class, subclass, protocol
  std::vector<Endpoint> endpoints;
};

// Takes over the model's completions: set them anew afterwards.
ModelFacts ReadFacts(UsbDeviceModel& model);

// The eight bytes of a setup packet, as on the wire.
UsbSetup ParseSetup(const uint8_t (&bytes)[8]);

}  // namespace voxeld::display::emulator
