#include "display/drivers/voxlink/voxlink.h"

#include <utility>

#include "display/drivers/usb_options.h"
#include "display/drivers/voxlink/voxlink_display.h"

namespace voxeld::display::voxlink {

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  OptionReader reader(options);
  UsbOptions usb{ReadUsbMatch(reader), ReadUsbRecord(reader)};
  usb.match.interface = {kInterfaceClass, kInterfaceSubclass, kInterfaceProtocol};
  absl::StatusOr<DisplayInfo> info = ReadDisplayInfo(options, reader);
  if (!info.ok()) return info.status();
  absl::StatusOr<std::unique_ptr<UsbTransport>> transport =
      MakeUsbTransport(usb, options.name, context);
  if (!transport.ok()) return transport.status();
  return std::make_unique<VoxlinkDisplay>(*std::move(info), *std::move(transport), context.clock);
}

}  // namespace voxeld::display::voxlink
