// Facts about a device that a carrier must know before the host asks for them. They are read from
// its descriptors, by the requests that a host would send.
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

// Replaces the model's completion callback: set it again afterwards.
ModelFacts ReadFacts(UsbDeviceModel& model);

// Parses the eight bytes of a setup packet, as on the wire.
UsbSetup ParseSetup(const uint8_t (&bytes)[8]);

}  // namespace voxeld::display::emulator
