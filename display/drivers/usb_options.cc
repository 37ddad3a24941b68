#include "display/drivers/usb_options.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/numbers.h"
#include "display/usb/recording_transport.h"

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

std::string ReadUsbRecord(OptionReader& reader) { return reader.Text("record", ""); }

absl::StatusOr<std::unique_ptr<UsbTransport>> MakeUsbTransport(const UsbOptions& options,
                                                               const std::string& display,
                                                               const DriverContext& context) {
  const absl::StatusOr<UsbBus*> usb = context.usb();
  if (!usb.ok()) return usb.status();
  std::unique_ptr<UsbTransport> transport = (*usb)->MakeTransport(options.match);
  if (options.record.empty()) return transport;
  const auto wall = std::chrono::system_clock::now().time_since_epoch();
  return RecordToFile(options.record, std::move(transport), context.clock,
                      {.name = display,
                       .limits = {},
                       .transport = {.wall_offset_ns = std::chrono::nanoseconds(wall).count() -
                                                       context.clock.Now()}});
}

}  // namespace voxeld::display
