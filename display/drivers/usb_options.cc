#include "display/drivers/usb_options.h"

#include <algorithm>
#include <cctype>
#include <string>

#include "absl/strings/numbers.h"

namespace voxeld::display {
namespace {

std::optional<uint16_t> ReadId(OptionReader& reader, const std::string& key) {
  const std::string text = reader.Text(key, "");
  if (text.empty() && !reader.has(key)) return std::nullopt;
  const bool digits =
      std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isxdigit(c) != 0; });
  uint32_t id = 0;
  if (text.size() != 4 || !digits || !absl::SimpleHexAtoi(text, &id)) {
    reader.Refuse(key, "four hexadecimal digits, such as 1d50");
    return std::nullopt;
  }
  return static_cast<uint16_t>(id);
}

}  // namespace

UsbMatch ReadUsbMatch(OptionReader& reader) {
  UsbMatch match;
  match.vendor_id = ReadId(reader, "vendor");
  match.product_id = ReadId(reader, "product");
  match.serial = reader.Text("serial", "");
  match.path = reader.Text("path", "");
  return match;
}

}  // namespace voxeld::display
