#include "display/usb/libusb/descriptors.h"

namespace voxeld::display {
namespace {

constexpr int kInterfaceType = 4;
constexpr size_t kInterfaceSize = 9;

}  // namespace

std::vector<UsbInterface> FindInterfaces(std::span<const std::byte> descriptors) {
  std::vector<UsbInterface> found;
  while (descriptors.size() >= 2) {
    const auto at = [&](size_t i) { return std::to_integer<uint8_t>(descriptors[i]); };
    const size_t length = at(0);
    if (length < 2 || length > descriptors.size()) break;
    if (at(1) == kInterfaceType && length >= kInterfaceSize) {
      found.push_back({at(2), at(3), {at(5), at(6), at(7)}});
    }
    descriptors = descriptors.subspan(length);
  }
  return found;
}

std::optional<uint8_t> ChooseInterface(const std::vector<UsbInterface>& interfaces,
                                       const std::optional<std::array<uint8_t, 3>>& triple) {
  for (const UsbInterface& interface : interfaces) {
    if (!triple.has_value()) return uint8_t{0};
    if (interface.triple == *triple) return interface.number;
  }
  return std::nullopt;
}

}  // namespace voxeld::display
