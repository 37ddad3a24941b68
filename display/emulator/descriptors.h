// The USB descriptors of an emulated voxlink device (docs/protocols/voxlink.md §3).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "display/usb/device_model.h"

namespace voxeld::display::emulator {

struct DescriptorSet {
  std::vector<std::byte> device;
  std::vector<std::byte> configuration;  // with interface, endpoints and their companions
  std::vector<std::byte> bos;
  std::vector<std::byte> ms_os_20;
  std::vector<std::vector<std::byte>> strings;  // 0: languages
};

// Super speed: USB 3.0, bulk packets of 1024 bytes and bursts; else USB 2.1 with packets of 512
// bytes or, at full speed, 64.
DescriptorSet MakeDescriptors(UsbSpeed speed, const std::string& serial);

}  // namespace voxeld::display::emulator
