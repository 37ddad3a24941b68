#include "display/usb/usb_bus.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace voxeld::display {

std::string UsbMatch::ToString() const {
  const auto id = [](const std::optional<uint16_t>& number) {
    return number.has_value() ? absl::StrFormat("%04x", *number) : std::string("*");
  };
  std::string text = vendor_id.has_value() || product_id.has_value()
                         ? absl::StrCat(id(vendor_id), ":", id(product_id))
                         : std::string("of any kind");
  if (interface.has_value()) {
    absl::StrAppend(&text, absl::StrFormat(" with an interface of class %02X:%02X:%02X",
                                           (*interface)[0], (*interface)[1], (*interface)[2]));
  }
  if (!serial.empty()) absl::StrAppend(&text, " with serial \"", serial, "\"");
  if (!path.empty()) absl::StrAppend(&text, " at ", path);
  return text;
}

}  // namespace voxeld::display
