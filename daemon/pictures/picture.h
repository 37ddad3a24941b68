// Reads PNG and JPEG files.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::pictures {

struct Size {
  uint32_t width = 0, height = 0;  // at least 1
};

// A picture whose pixels have not been read yet.
class PictureFile {
 public:
  // Reads the header of a file and detects its format from the first bytes. `bytes` must outlive
  // this object. Errors: InvalidArgument if it is neither format or its header is broken; the
  // message begins with a verb.
  static absl::StatusOr<PictureFile> Open(absl::string_view bytes);

  Size size() const { return size_; }

  // Returns: the pixels row by row from the upper left corner, 0x00RRGGBB, 8 bits per channel,
  // sRGB; grey as three equal channels. Transparent pixels are blended over black. Takes 4 bytes
  // per pixel, and the same again while reading. Errors: InvalidArgument if the file is broken or
  // truncated; the message begins with a verb.
  absl::StatusOr<std::vector<uint32_t>> Read() const;

 private:
  enum class Kind { kPng, kJpeg };
  PictureFile(absl::string_view bytes, Kind kind, Size size)
      : bytes_(bytes), kind_(kind), size_(size) {}
  static absl::StatusOr<PictureFile> OpenPng(absl::string_view bytes);
  static absl::StatusOr<PictureFile> OpenJpeg(absl::string_view bytes);
  absl::Status ReadPng(std::vector<uint8_t>& rgb) const;
  absl::Status ReadJpeg(std::vector<uint8_t>& rgb) const;

  absl::string_view bytes_;
  Kind kind_;
  Size size_;
};

}  // namespace voxeld::pictures
