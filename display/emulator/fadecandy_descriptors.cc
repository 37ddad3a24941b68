#include "display/emulator/fadecandy_descriptors.h"

#include <string_view>

#include "display/drivers/fadecandy/protocol.h"
#include "display/emulator/descriptor_bytes.h"

namespace voxeld::display::emulator {
namespace {

using Bytes = DescriptorBytes;

constexpr std::string_view kFadecandyInterfaceGuid = "{2B4D1F36-53A0-4E0C-9C55-0C7A1D8E6B42}";

Bytes Device() {
  Bytes out;
  Put8(out, {18, 1, 0x00, 0x02, 0, 0, 0, 64});
  Put16(out, fadecandy::kVendorId);
  Put16(out, fadecandy::kProductId);
  Put16(out, fadecandy::kBcdDevice);
  Put8(out, {1, 2, 3, 1});
  return out;
}

Bytes Configuration() {
  Bytes out;
  Put8(out, {0x09, 0x02, 0x2B, 0x00, 0x02, 0x01, 0x00, 0x80, 0x32});
  Put8(out, {0x09, 0x04, 0x00, 0x00, 0x01, 0xFF, 0x00, 0x00, 0x00});
  Put8(out, {0x07, 0x05, 0x01, 0x02, 0x40, 0x00, 0x00});
  Put8(out, {0x09, 0x04, 0x01, 0x00, 0x00, 0xFE, 0x01, 0x01, 0x04});
  Put8(out, {0x09, 0x21, 0x0D, 0x10, 0x27, 0x00, 0x04, 0x01, 0x01});
  return out;
}

Bytes MsCompatibleId() {
  Bytes out;
  Put32(out, 16 + 24);
  Put16(out, 0x0100);
  Put16(out, fadecandy::kMsCompatibleId);
  Put8(out, {1, 0, 0, 0, 0, 0, 0, 0});  // one function
  Put8(out, {0, 1});                    // interface 0
  for (const char c : std::string_view("WINUSB\0\0", 8)) Put8(out, {c});
  out.resize(40);
  return out;
}

Bytes MsProperties() {
  constexpr std::string_view kName = "DeviceInterfaceGUID";
  const int name = static_cast<int>(2 * kName.size() + 2);
  const int data = static_cast<int>(2 * kFadecandyInterfaceGuid.size() + 2);
  const int property = 14 + name + data;
  Bytes out;
  Put32(out, 10 + property);
  Put16(out, 0x0100);
  Put16(out, fadecandy::kMsProperties);
  Put16(out, 1);  // one property
  Put32(out, property);
  Put32(out, 1);  // text
  Put16(out, name);
  PutUtf16(out, kName);
  Put16(out, 0);
  Put32(out, data);
  PutUtf16(out, kFadecandyInterfaceGuid);
  Put16(out, 0);
  return out;
}

}  // namespace

std::optional<Bytes> FadecandyDescriptor(uint16_t value, const std::string& serial) {
  switch (value) {
    case 0x0100:
      return Device();
    case 0x0200:
      return Configuration();
    case 0x0300: {
      Bytes languages;
      Put8(languages, {4, 3, 0x09, 0x04});
      return languages;
    }
    case 0x0301:
      return StringDescriptor("scanlime");
    case 0x0302:
      return StringDescriptor("Fadecandy");
    case 0x0303:
      return StringDescriptor(std::string_view(serial).substr(0, 126));
    case 0x0304:
      return StringDescriptor("Fadecandy Bootloader");
    case 0x03EE: {
      Bytes os = StringDescriptor("MSFT100");
      Put8(os, {fadecandy::kMsVendorCode, 0});
      os[0] = static_cast<std::byte>(os.size());
      return os;
    }
    default:
      return std::nullopt;
  }
}

std::optional<Bytes> FadecandyMsDescriptor(uint16_t index) {
  if (index == fadecandy::kMsCompatibleId) return MsCompatibleId();
  if (index == fadecandy::kMsProperties) return MsProperties();
  return std::nullopt;
}

}  // namespace voxeld::display::emulator
