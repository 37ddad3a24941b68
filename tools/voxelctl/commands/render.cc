#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/animate/moving_picture.h"
#include "tools/voxelctl/commands/capture_shown.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/render/render_volume.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

absl::StatusOr<std::unique_ptr<MovingPicture>> Begin(const TurntableOptions& options) {
  switch (options.format) {
    case PictureFormat::kGif:
      return GifMovie(options.file, options.fps);
    case PictureFormat::kMp4:
      return Mp4Movie(options.file, options.fps, options.width, options.height);
    case PictureFormat::kPng:
      break;
  }
  return PngFrames(options.file);
}

// Returns how many pictures are drawn at the same time: one per core, as far as memory allows. Each
// needs about 200 bytes per pixel.
int AtOnce(const TurntableOptions& options) {
  constexpr int64_t kMostBytes = int64_t{1} << 30;
  const int64_t each = int64_t{200} * options.width * options.height;
  const auto cores = static_cast<int64_t>(std::thread::hardware_concurrency());
  return static_cast<int>(std::clamp<int64_t>(std::min(cores, kMostBytes / each), 1, 16));
}

// Draws `count` pictures from number `first` on.
std::vector<Image> Draw(const Volume& volume, const TurntableOptions& options, int first,
                        int count) {
  std::vector<Image> images(static_cast<size_t>(count));
  const auto draw = [&](int i) {
    images[static_cast<size_t>(i)] = RenderVolume(
        volume,
        {.width = options.width,
         .height = options.height,
         .angles = {options.azimuth_degrees + 360 * options.turns * (first + i) / options.frames,
                    options.elevation_degrees},
         .around = options.frames > 1});
  };
  std::vector<std::thread> others;
  others.reserve(static_cast<size_t>(count));
  for (int i = 1; i < count; ++i) others.emplace_back(draw, i);
  draw(0);
  for (std::thread& other : others) other.join();
  return images;
}

// Returns the total size of all files that were made.
uint64_t Size(const TurntableOptions& options) {
  uint64_t bytes = 0;
  const int files = options.format == PictureFormat::kPng ? options.frames : 1;
  for (int i = 1; i <= files; ++i) {
    const std::string name =
        options.format == PictureFormat::kPng ? NumberedName(options.file, i) : options.file;
    std::error_code error;
    const auto size = std::filesystem::file_size(name, error);
    if (!error) bytes += size;
  }
  return bytes;
}

void Tell(const TurntableOptions& options, const ShownVolume& first, const ShownVolume& last,
          double seconds, Console& console) {
  const uint64_t lit = LitPixels(last.volume), bytes = Size(options);
  if (console.json()) {
    console.Data(JsonText({{"file", options.file},
                           {"frames", options.frames},
                           {"fps", options.fps},
                           {"turns", options.turns},
                           {"width", options.width},
                           {"height", options.height},
                           {"bytes", bytes},
                           {"display", last.volume.display},
                           {"first_volume", first.volume.number},
                           {"last_volume", last.volume.number},
                           {"lit_pixels", lit},
                           {"up_to_date", first.up_to_date},
                           {"live", options.live}},
                          false));
    return;
  }
  console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ",
                           Counted(static_cast<uint64_t>(options.frames), "picture"), " of ",
                           options.width, "x", options.height, ", ", Bytes(bytes), ", ",
                           ShownText(last)));
  const double wanted = (options.frames - 1) / options.fps;
  if (options.live && seconds > 1.1 * wanted + 0.1) {
    console.Say(absl::StrFormat(
        "the pictures took %.1f s, and are shown in %.1f s: what moved is faster than it was; "
        "--size or --fps can be less",
        seconds, wanted));
  }
  if (lit == 0) console.Say(kNothingLit);
}

}  // namespace

absl::Status Render(const TurntableOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console) {
  // An unwritable file is reported before the display is waited for.
  absl::StatusOr<std::unique_ptr<MovingPicture>> movie = Begin(options);
  if (!movie.ok()) return movie.status();
  absl::StatusOr<ShownVolume> shown =
      CaptureShown(options.display, options.timeout_s, connection, console);
  if (!shown.ok()) return shown.status();
  ShownVolume first;
  first.volume.number = shown->volume.number;
  first.up_to_date = shown->up_to_date;
  if (!console.live() && !console.json() && options.frames > 1) {
    // A progress bar cannot be drawn.
    console.Say(absl::StrCat("drawing ", options.frames, " pictures …"));
  }
  sync::SystemClock clock;
  const sync::TimeNs began = clock.Now();
  const int at_once = options.live ? 1 : AtOnce(options);
  for (int i = 0; i < options.frames; i += at_once) {
    console.ProgressBar("drawing", static_cast<double>(i) / options.frames,
                        absl::StrCat(i, " of ", options.frames));
    if (options.live && i > 0) {
      interrupt.WaitUntil(clock, began + std::llround(i * 1e9 / options.fps));
      if (interrupt.requested()) return absl::CancelledError("interrupted");
      shown = CaptureNow(options.display, connection);
      if (!shown.ok()) return shown.status();
    }
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    const int count = std::min(at_once, options.frames - i);
    for (const Image& image : Draw(shown->volume, options, i, count)) {
      if (absl::Status status = (*movie)->Add(image); !status.ok()) return status;
    }
  }
  const double seconds = static_cast<double>(clock.Now() - began) / 1e9;
  console.Progress("writing …");
  if (absl::Status status = (*movie)->Finish(); !status.ok()) return status;
  Tell(options, first, *shown, seconds, console);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
