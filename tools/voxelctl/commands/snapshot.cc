#include <cstdint>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/capture_shown.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/render/png_file.h"
#include "tools/voxelctl/render/render_volume.h"
#include "tools/voxelctl/text/proto_json.h"

namespace voxeld::voxelctl {

absl::Status Snapshot(const SnapshotOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<ShownVolume> shown =
      CaptureShown(options.display, options.timeout_s, connection, console);
  if (!shown.ok()) return shown.status();
  const Volume& volume = shown->volume;

  console.Progress("drawing …");
  const Image image =
      options.slices
          ? ContactSheet(volume)
          : RenderVolume(volume, {.width = options.width,
                                  .height = options.height,
                                  .angles = {options.azimuth_degrees, options.elevation_degrees}});
  if (absl::Status status = WritePng(options.file, image); !status.ok()) return status;

  const uint64_t lit = LitPixels(volume);
  if (console.json()) {
    console.Data(JsonText({{"file", options.file},
                           {"display", volume.display},
                           {"volume", volume.number},
                           {"slices", volume.slices},
                           {"slice_width", volume.width},
                           {"slice_height", volume.height},
                           {"lit_pixels", lit},
                           {"up_to_date", shown->up_to_date},
                           {"source", shown->decoded ? "DECODED_FROM_SENT" : "REPORTED_BY_DEVICE"},
                           {"width", image.width},
                           {"height", image.height}},
                          false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", image.width, "x", image.height,
                           ", ", ShownText(*shown)));
  if (lit == 0) console.Say(kNothingLit);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
