#include "tools/voxelctl/commands/capture_shown.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/captured_volume.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

// Returns the number of the scene's newest snapshot. Watches an owner that does not exist, because
// such a watch begins with the snapshot only.
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

absl::StatusOr<ShownVolume> Take(const v1::CaptureVolumeRequest& request, Connection& connection) {
  CapturedVolume captured;
  const absl::Status status = connection.CaptureVolume(
      request, [&](const v1::VolumeChunk& chunk) { return captured.Add(chunk); });
  if (!status.ok()) return status;
  ShownVolume shown;
  shown.decoded = captured.header().source() == v1::VolumeHeader::DECODED_FROM_SENT;
  absl::StatusOr<Volume> volume = std::move(captured).Finish();
  if (!volume.ok()) return volume.status();
  shown.volume = *std::move(volume);
  return shown;
}

}  // namespace

absl::StatusOr<ShownVolume> CaptureShown(const std::string& display, double timeout_s,
                                         Connection& connection, Console& console) {
  v1::CaptureVolumeRequest request;
  request.set_name(display);
  request.set_timeout_ns(std::llround(timeout_s * 1e9));
  console.Progress("waiting for a volume …");
  const absl::StatusOr<uint64_t> newest = NewestSnapshot(connection);
  const bool unknown = absl::IsResourceExhausted(newest.status());
  if (!newest.ok() && !unknown) return newest.status();
  if (unknown) {
    console.Say(absl::StrCat("this is what is shown, which may be from before the newest commits: ",
                             newest.status().message()));
  } else {
    request.set_at_least_snapshot(*newest);
  }
  absl::StatusOr<ShownVolume> shown = Take(request, connection);
  if (shown.ok()) shown->up_to_date = !unknown;
  if (unknown || !absl::IsDeadlineExceeded(shown.status())) return shown;
  request.set_at_least_snapshot(0);
  request.set_timeout_ns(sync::kSecond);
  absl::StatusOr<ShownVolume> older = Take(request, connection);
  if (!older.ok()) return shown.status();
  console.Say(absl::StrCat("what is up now is not shown yet, this is from before: ",
                           shown.status().message()));
  return older;
}

absl::StatusOr<ShownVolume> CaptureNow(const std::string& display, Connection& connection) {
  v1::CaptureVolumeRequest request;
  request.set_name(display);
  return Take(request, connection);
}

uint64_t LitPixels(const Volume& volume) {
  uint64_t lit = 0;
  for (size_t i = 0; i < volume.rgb.size(); i += 3) {
    lit += (volume.rgb[i] | volume.rgb[i + 1] | volume.rgb[i + 2]) != 0 ? 1 : 0;
  }
  return lit;
}

std::string ShownText(const ShownVolume& shown) {
  return absl::StrCat("volume ", shown.volume.number, " of display ",
                      EscapeForTerminal(shown.volume.display), ", ",
                      Counted(LitPixels(shown.volume), "slice pixel"), " lit, ",
                      shown.decoded ? "decoded from the bytes sent" : "reported by the device");
}

}  // namespace voxeld::voxelctl
