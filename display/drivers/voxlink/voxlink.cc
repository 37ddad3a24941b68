#include "display/drivers/voxlink/voxlink.h"

#include <utility>

#include "display/drivers/usb_options.h"
#include "display/drivers/voxlink/voxlink_display.h"

namespace voxeld::display::voxlink {

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  OptionReader reader(options);
  UsbMatch match = ReadUsbMatch(reader);
  match.interface = {kInterfaceClass, kInterfaceSubclass, kInterfaceProtocol};
  absl::StatusOr<DisplayInfo> info = ReadDisplayInfo(options, reader);
  if (!info.ok()) return info.status();
  const absl::StatusOr<UsbBus*> usb = context.usb();
  if (!usb.ok()) return usb.status();
  return std::make_unique<VoxlinkDisplay>(*std::move(info), (*usb)->MakeTransport(std::move(match)),
                                          context.clock);
}

}  // namespace voxeld::display::voxlink
