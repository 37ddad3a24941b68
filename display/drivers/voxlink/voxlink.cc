#include "display/drivers/voxlink/voxlink.h"

#include <algorithm>
#include <utility>

#include "display/drivers/usb_options.h"
#include "display/drivers/voxlink/verify/suite.h"
#include "display/drivers/voxlink/voxlink_display.h"

namespace voxeld::display::voxlink {
namespace {

struct Read {
  UsbOptions usb;
  bool calibrated;
  DisplayInfo info;
};

absl::StatusOr<Read> ReadOptions(const DisplayOptions& options) {
  OptionReader reader(options);
  UsbOptions usb{ReadUsbMatch(reader), ReadUsbRecord(reader)};
  const bool calibrated = reader.Flag("calibrated", false);
  usb.match.interface = {kInterfaceClass, kInterfaceSubclass, kInterfaceProtocol};
  absl::StatusOr<DisplayInfo> info = ReadDisplayInfo(options, reader);
  if (!info.ok()) return info.status();
  return Read{std::move(usb), calibrated, *std::move(info)};
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  absl::StatusOr<Read> read = ReadOptions(options);
  if (!read.ok()) return read.status();
  absl::StatusOr<std::unique_ptr<UsbTransport>> transport =
      MakeUsbTransport(read->usb, options.name, context);
  if (!transport.ok()) return transport.status();
  return std::make_unique<VoxlinkDisplay>(std::move(read->info), *std::move(transport),
                                          context.clock, VoxlinkLink::Options(), read->calibrated);
}

absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context) {
  absl::StatusOr<Read> read = ReadOptions(options);
  if (!read.ok()) return read.status();
  absl::StatusOr<std::unique_ptr<UsbTransport>> transport =
      MakeUsbTransport(read->usb, options.name, context);
  if (!transport.ok()) return transport.status();
  static constexpr std::string_view kGeometry[] = {"geometry",  "size",    "slices", "positions_mm",
                                                   "points_mm", "strokes", "motion", "blades"};
  const bool configured = std::any_of(std::begin(kGeometry), std::end(kGeometry), [&](auto key) {
    return options.options.contains(std::string(key));
  });
  const Configured said{read->info.geometry, read->info.layout, read->calibrated};
  std::vector<conformance::Subject> subjects;
  subjects.push_back(
      {options.name, *std::move(transport), MakeSuite(configured ? &said : nullptr)});
  return subjects;
}

}  // namespace voxeld::display::voxlink
