#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/capture_shown.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/export/export_files.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

std::string Items(const ExportOptions& options, const ExportSummary& summary) {
  switch (options.format) {
    case ExportFormat::kPly:
      return Counted(summary.items, "point");
    case ExportFormat::kVox:
      return absl::StrCat(Counted(summary.items, "voxel"), " in ",
                          Counted(summary.models, "model"));
    case ExportFormat::kNpz:
      break;
  }
  return Counted(summary.items, "lit pixel");
}

}  // namespace

absl::Status Export(const ExportOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<ShownVolume> shown =
      CaptureShown(options.display, options.timeout_s, connection, console);
  if (!shown.ok()) return shown.status();
  console.Progress("writing …");
  ExportSummary summary;
  const auto write = options.format == ExportFormat::kPly   ? WritePly
                     : options.format == ExportFormat::kVox ? WriteVox
                                                            : WriteNpz;
  if (absl::Status status = write(options.file, shown->volume, &summary); !status.ok())
    return status;
  const uint64_t lit = LitPixels(shown->volume);
  if (console.json()) {
    console.Data(JsonText({{"file", options.file},
                           {"items", summary.items},
                           {"models", summary.models},
                           {"left_out", summary.left_out},
                           {"bytes", summary.bytes},
                           {"display", shown->volume.display},
                           {"volume", shown->volume.number},
                           {"lit_pixels", lit},
                           {"up_to_date", shown->up_to_date}},
                          false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", Items(options, summary), ", ",
                           Bytes(summary.bytes), ", ", ShownText(*shown)));
  if (summary.left_out > 0 && options.format != ExportFormat::kNpz) {
    console.Say(absl::StrCat(Counted(summary.left_out, "lit pixel"),
                             " lie outside of the display's volume, and are not in it"));
  }
  if (lit == 0) console.Say(kNothingLit);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
