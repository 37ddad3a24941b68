#include "display/emulator/descriptors.h"

#include <string_view>

#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/descriptor_bytes.h"

namespace voxeld::display::emulator {
namespace {

using voxlink::kBulkOut;
using voxlink::kInterruptIn;
using Bytes = DescriptorBytes;

constexpr uint16_t kVendorId = 0x1209;  // pid.codes, for testing
constexpr uint16_t kProductId = 0x0001;
constexpr uint32_t kWindows81 = 0x06030000;
constexpr std::string_view kVoxlinkInterfaceGuid = "{8F5C2C1B-6D1E-4B61-9E36-2B0D3C5A7E11}";

Bytes Device(UsbSpeed speed) {
  Bytes out;
  Put8(out, {18, 1});
  Put16(out, speed == UsbSpeed::kSuper ? 0x0300 : 0x0210);
  Put8(out, {0, 0, 0, speed == UsbSpeed::kSuper ? 9 : 64});
  Put16(out, kVendorId);
  Put16(out, kProductId);
  Put16(out, 0x0100);
  Put8(out, {1, 2, 3, 1});
  return out;
}

void Endpoint(Bytes& out, UsbSpeed speed, int address, int attributes, uint16_t packet,
              int interval, int burst) {
  Put8(out, {7, 5, address, attributes});
  Put16(out, packet);
  Put8(out, {interval});
  if (speed != UsbSpeed::kSuper) return;
  Put8(out, {6, 48, burst, 0});
  Put16(out, attributes == 3 ? packet : 0);  // bytes per interval
}

uint16_t BulkPacketSize(UsbSpeed speed) {
  return speed == UsbSpeed::kFull ? 64 : speed == UsbSpeed::kHigh ? 512 : 1024;
}

Bytes Configuration(UsbSpeed speed) {
  Bytes rest;
  Put8(rest, {9, 4, 0, 0, 2, voxlink::kInterfaceClass, voxlink::kInterfaceSubclass,
              voxlink::kInterfaceProtocol, 0});
  Endpoint(rest, speed, kBulkOut, 2, BulkPacketSize(speed), 0, 15);
  Endpoint(rest, speed, kInterruptIn, 3, voxlink::kEventSize, 1, 0);
  Bytes out;
  Put8(out, {9, 2});
  Put16(out, static_cast<uint16_t>(9 + rest.size()));
  Put8(out, {1, 1, 0, 0xC0, 1});  // self-powered
  out.insert(out.end(), rest.begin(), rest.end());
  return out;
}

Bytes MsOs20() {
  Bytes out;
  Put16(out, 10);  // set header
  Put16(out, 0);
  Put32(out, kWindows81);
  Put16(out, 10 + 20 + 132);
  Put16(out, 20);  // compatible ID
  Put16(out, 3);
  for (const char c : std::string_view("WINUSB\0\0\0\0\0\0\0\0\0\0", 16)) Put8(out, {c});
  Put16(out, 132);  // registry property
  Put16(out, 4);
  Put16(out, 7);  // REG_MULTI_SZ
  Put16(out, 42);
  PutUtf16(out, "DeviceInterfaceGUIDs");
  Put16(out, 0);
  Put16(out, 80);
  PutUtf16(out, kVoxlinkInterfaceGuid);
  Put32(out, 0);
  return out;
}

Bytes Bos(UsbSpeed speed, size_t ms_length) {
  Bytes capabilities;
  int count = 2;
  Put8(capabilities, {7, 16, 2, 2, 0, 0, 0});  // USB 2.0 extension: LPM
  if (speed == UsbSpeed::kSuper) {
    Put8(capabilities, {10, 16, 3, 0, 0x0E, 0, 1, 10, 0xFF, 0x07});
    ++count;
  }
  Put8(capabilities, {28, 16, 5, 0});  // platform capability, D8DD60DF-4589-4CC7-9CD2-659D9E648A9F
  Put8(capabilities, {0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65, 0x9D, 0x9E,
                      0x64, 0x8A, 0x9F});
  Put32(capabilities, kWindows81);
  Put16(capabilities, static_cast<uint16_t>(ms_length));
  Put8(capabilities, {voxlink::kMsVendorCode, 0});
  Bytes out;
  Put8(out, {5, 15});
  Put16(out, static_cast<uint16_t>(5 + capabilities.size()));
  Put8(out, {count});
  out.insert(out.end(), capabilities.begin(), capabilities.end());
  return out;
}

}  // namespace

DescriptorSet MakeDescriptors(UsbSpeed speed, const std::string& serial) {
  DescriptorSet set;
  set.device = Device(speed);
  set.configuration = Configuration(speed);
  set.ms_os_20 = MsOs20();
  set.bos = Bos(speed, set.ms_os_20.size());
  Bytes languages;
  Put8(languages, {4, 3, 0x09, 0x04});
  set.strings = {languages, StringDescriptor("voxeld"),
                 StringDescriptor("Simulated volumetric display"),
                 StringDescriptor(std::string_view(serial).substr(0, 126))};
  return set;
}

}  // namespace voxeld::display::emulator
