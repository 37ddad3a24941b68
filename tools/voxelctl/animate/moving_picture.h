// Pictures one after another, as a file or as files.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Takes pictures of one size. Nothing is at its place before Finish() unless it says so; without Finish() nothing stays.
// Messages of errors begin with the file's name, made fit for a terminal. Not thread-safe.
class MovingPicture {
 public:
  virtual ~MovingPicture() = default;
  virtual absl::Status Add(const Image& image) = 0;
  virtual absl::Status Finish() = 0;
};

// Digits in place of the first run of "#"s of the file's name (not of its folder's), as many as there are "#"s at
// least; the pattern itself if there are none.
std::string NumberedName(const std::string& pattern, int number);

// A PNG each, which is at its place as soon as it is whole. Numbers from 1.
std::unique_ptr<MovingPicture> PngFrames(const std::string& pattern);

// A GIF that begins again at its end, `fps` 1 to 50. All its pictures share one palette, so they are kept, packed,
// until Finish(); colours that the palette lacks are put together from two, in an ordered dither, which stays where it
// is while the picture moves.
absl::StatusOr<std::unique_ptr<MovingPicture>> GifMovie(const std::string& path, double fps);

// An MP4 (H.264, yuv420p), made by the program ffmpeg, which gets raw pictures through a pipe: FailedPrecondition, with
// how to get it, where it is not. `width` and `height` are even.
absl::StatusOr<std::unique_ptr<MovingPicture>> Mp4Movie(const std::string& path, double fps,
                                                        int width, int height);

}  // namespace voxeld::voxelctl
