#include "display/drivers/fadecandy/fadecandy.h"

#include <algorithm>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "display/drivers/fadecandy/boards.h"
#include "display/drivers/fadecandy/fadecandy_display.h"
#include "display/drivers/fadecandy/protocol.h"
#include "display/drivers/fadecandy/verify/suite.h"
#include "display/drivers/usb_options.h"

namespace voxeld::display::fadecandy {
namespace {

// Boards refresh some 400 times a second.
constexpr double kMostVolumesPerSecond = 400;

ColorCurve ReadCurve(OptionReader& reader) {
  ColorCurve curve;
  curve.gamma = reader.Number("gamma", curve.gamma, 0.1, 10);
  curve.slope = reader.Number("slope", curve.slope, 0, 100);
  curve.cutoff = reader.Number("cutoff", curve.cutoff, 0, 0.999);
  if (const std::vector<double> white = reader.Numbers("white"); !white.empty()) {
    if (white.size() != 3 ||
        !std::all_of(white.begin(), white.end(), [](double w) { return w >= 0 && w <= 2; })) {
      reader.Refuse("white", "three numbers from 0 to 2 with ';' between them");
    } else {
      std::copy(white.begin(), white.end(), curve.white.begin());
    }
  }
  return curve;
}

uint8_t ReadFlags(OptionReader& reader) {
  const bool dithers = reader.Choice("dither", {"temporal", "none"}, 0) == 0;
  const bool fades = reader.Flag("interpolate", false);
  constexpr uint8_t kLeds[] = {0, kManualLed, kManualLed | kLedOn};
  const uint8_t led = kLeds[reader.Choice("led", {"traffic", "off", "on"}, 0)];
  return static_cast<uint8_t>((dithers ? 0 : kNoDither) | (fades ? 0 : kNoInterpolation) | led);
}

// Each board records into a file of its own: "cube.pcapng" becomes "cube-0.pcapng",
// "cube-1.pcapng", ….
std::string RecordOf(const std::string& path, size_t board, size_t boards) {
  if (path.empty() || boards == 1) return path;
  const std::filesystem::path file(path);
  return file.parent_path() /
         absl::StrCat(file.stem().string(), "-", board, file.extension().string());
}

}  // namespace

namespace {

MakeTransport OnBus(const DisplayOptions& options, const DriverContext& context) {
  return [&options, &context](const BoardPlace& board) {
    UsbOptions usb;
    usb.match.vendor_id = kVendorId;
    usb.match.product_id = kProductId;
    usb.match.serial = board.serial;
    if (board.serial.empty() && board.count > 1) {
      usb.match.member = {board.index, board.count, options.name};
    }
    usb.record = board.record;
    return MakeUsbTransport(usb, options.name, context);
  };
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  return CreateOver(options, context.clock, OnBus(options, context));
}

absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context) {
  std::vector<conformance::Subject> subjects;
  const MakeTransport make = OnBus(options, context);
  // Reads and checks the options as for a display; none of its transports is opened.
  const absl::StatusOr<std::unique_ptr<Display>> checked =
      CreateOver(options, context.clock, [&](const BoardPlace& board) {
        absl::StatusOr<std::unique_ptr<UsbTransport>> transport = make(board);
        if (transport.ok()) {
          subjects.push_back(
              {board.serial.empty() ? absl::StrCat("board ", board.index + 1) : board.serial,
               *std::move(transport), MakeSuite()});
          return make({.serial = board.serial, .index = board.index, .count = board.count});
        }
        return transport;
      });
  if (!checked.ok()) return checked.status();
  return subjects;
}

absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock,
                                                    const MakeTransport& make_transport) {
  OptionReader reader(options);
  const Boards boards = ReadBoards(reader);
  const auto count = static_cast<int32_t>(boards.serials.size());
  FadecandyDisplay::Settings settings;
  settings.curve = ReadCurve(reader);
  settings.full_brightness = reader.Number("brightness", 1, 1e-3, 1);
  settings.flags = ReadFlags(reader);
  DisplayInfo info;
  info.name = options.name;
  info.driver = options.driver;
  info.layout = {.slices = count, .width = kPixels, .height = 1};
  info.volumes_per_second = reader.Number("rate", 60, 0.5, kMostVolumesPerSecond);
  // The board applies the colour curve.
  info.tone = MakeTone({.dither = Dither::kNone});
  absl::StatusOr<Lattice> lattice = wiring::ReadLattice(reader, PixelsOf(count));
  const std::string record = ReadUsbRecord(reader);
  if (absl::Status status = reader.Finish(); !status.ok()) return status;
  if (absl::Status status = wiring::TakeLattice(info, std::move(lattice)); !status.ok()) {
    return status;
  }
  std::vector<FadecandyDisplay::Wire> wires;
  for (size_t i = 0; i < boards.serials.size(); ++i) {
    absl::StatusOr<std::unique_ptr<UsbTransport>> transport =
        make_transport({.serial = boards.serials[i],
                        .index = i,
                        .count = boards.serials.size(),
                        .record = RecordOf(record, i, boards.serials.size())});
    if (!transport.ok()) return transport.status();
    wires.push_back({*std::move(transport), boards.serials[i]});
  }
  return std::make_unique<FadecandyDisplay>(std::move(info), settings, std::move(wires), clock);
}

}  // namespace voxeld::display::fadecandy
