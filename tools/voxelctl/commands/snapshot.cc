#include <cmath>
#include <cstdint>
#include <limits>

#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/captured_volume.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/render/png_file.h"
#include "tools/voxelctl/render/render_volume.h"
#include "tools/voxelctl/text/escape.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

uint64_t LitPixels(const Volume& volume) {
  uint64_t lit = 0;
  for (size_t i = 0; i < volume.rgb.size(); i += 3) {
    lit += (volume.rgb[i] | volume.rgb[i + 1] | volume.rgb[i + 2]) != 0 ? 1 : 0;
  }
  return lit;
}

// The number of the scene's newest snapshot. A watch of an owner that nobody is begins with it alone.
absl::StatusOr<uint64_t> NewestSnapshot(Connection& connection) {
  v1::WatchSceneRequest request;
  request.set_owner(std::numeric_limits<uint64_t>::max());
  uint64_t newest = 0;
  const absl::Status status =
      connection.WatchScene(request, [&](const v1::WatchSceneResponse& message) {
        newest = message.in_sync();
        return newest == 0;
      });
  if (newest == 0) return status.ok() ? absl::UnavailableError("the scene was not told") : status;
  return newest;
}

absl::Status Capture(const v1::CaptureVolumeRequest& request, Connection& connection,
                     CapturedVolume* out) {
  return connection.CaptureVolume(request,
                                  [&](const v1::VolumeChunk& chunk) { return out->Add(chunk); });
}

}  // namespace

absl::Status Snapshot(const SnapshotOptions& options, Connection& connection, Console& console) {
  v1::CaptureVolumeRequest request;
  request.set_name(options.display);
  request.set_timeout_ns(std::llround(options.timeout_s * 1e9));
  console.Progress("waiting for a volume …");
  // What was up when the command was given is in the picture.
  const absl::StatusOr<uint64_t> newest = NewestSnapshot(connection);
  const bool unknown = absl::IsResourceExhausted(newest.status());
  if (!newest.ok() && !unknown) return newest.status();
  if (unknown) {
    console.Say(absl::StrCat("this is what is shown, which may be from before the newest commits: ",
                             newest.status().message()));
  } else {
    request.set_at_least_snapshot(*newest);
  }
  CapturedVolume captured;
  absl::Status status = Capture(request, connection, &captured);
  const bool behind = !unknown && absl::IsDeadlineExceeded(status);
  if (behind) {
    captured = CapturedVolume();
    request.set_at_least_snapshot(0);
    request.set_timeout_ns(sync::kSecond);
    if (!Capture(request, connection, &captured).ok()) return status;
    console.Say(
        absl::StrCat("what is up now is not shown yet, this is from before: ", status.message()));
    status = absl::OkStatus();
  }
  if (!status.ok()) return status;
  const bool decoded = captured.header().source() == v1::VolumeHeader::DECODED_FROM_SENT;
  const absl::StatusOr<Volume> volume = std::move(captured).Finish();
  if (!volume.ok()) return volume.status();

  console.Progress("drawing …");
  const Image image =
      options.slices
          ? ContactSheet(*volume)
          : RenderVolume(*volume, {.width = options.width,
                                   .height = options.height,
                                   .angles = {options.azimuth_degrees, options.elevation_degrees}});
  status = WritePng(options.file, image);
  if (!status.ok()) return status;

  const uint64_t lit = LitPixels(*volume);
  if (console.json()) {
    console.Data(JsonText({{"file", options.file},
                           {"display", volume->display},
                           {"volume", volume->number},
                           {"slices", volume->slices},
                           {"slice_width", volume->width},
                           {"slice_height", volume->height},
                           {"lit_pixels", lit},
                           {"up_to_date", !behind && !unknown},
                           {"source", decoded ? "DECODED_FROM_SENT" : "REPORTED_BY_DEVICE"},
                           {"width", image.width},
                           {"height", image.height}},
                          false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", image.width, "x", image.height,
                           ", volume ", volume->number, " of display ",
                           EscapeForTerminal(volume->display), ", ", Counted(lit, "slice pixel"),
                           " lit, ",
                           decoded ? "decoded from the bytes sent" : "reported by the device"));
  if (lit == 0)
    console.Say(
        "no pixel is lit: see `voxelctl entities` for what is up, `voxelctl stats` for where it "
        "went");
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
