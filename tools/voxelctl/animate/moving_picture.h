// Sequences of pictures, written to one file or to several.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

// Accepts pictures of one size. The output does not exist before Finish() unless stated otherwise;
// without Finish() nothing remains. Error messages begin with the file's name, escaped for a
// terminal. Not thread-safe.
class MovingPicture {
 public:
  virtual ~MovingPicture() = default;
  virtual absl::Status Add(const Image& image) = 0;
  virtual absl::Status Finish() = 0;
};

// Replaces the first run of "#" in the file's name (not in its folder's) by the number, with at
// least as many digits; returns the pattern unchanged if there is no "#".
std::string NumberedName(const std::string& pattern, int number);

// Writes PNG files, numbered from 1; each appears as soon as it is complete.
std::unique_ptr<MovingPicture> PngFrames(const std::string& pattern);

// Writes a GIF that repeats, with `fps` from 1 to 50. All pictures share one palette, so they are
// stored, packed, until Finish(). Colours that the palette lacks are composed from two by an
// ordered dither, which stays in place while the picture moves.
absl::StatusOr<std::unique_ptr<MovingPicture>> GifMovie(const std::string& path, double fps);

// Writes an MP4 (H.264, yuv420p) with the program ffmpeg, which receives raw pictures through a
// pipe. Requires: `width` and `height` are even. Errors: FailedPrecondition, with how to install
// it, if ffmpeg is missing.
absl::StatusOr<std::unique_ptr<MovingPicture>> Mp4Movie(const std::string& path, double fps,
                                                        int width, int height);

}  // namespace voxeld::voxelctl
