// Pictures: PNG and JPEG files.
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

// A picture that has not been read yet.
class PictureFile {
 public:
  // Reads the head of a file; which of the two it is its first bytes tell. The bytes must live as long.
  // InvalidArgument: it is neither, or its head is broken; the message begins with a verb.
  static absl::StatusOr<PictureFile> Open(absl::string_view bytes);

  Size size() const { return size_; }

  // Row by row from the upper left corner, 0x00RRGGBB, 8 bits a channel, as sRGB; grey as three alike.
  // What is not opaque is laid over black. Takes 4 bytes a pixel, and while it reads as much again.
  // InvalidArgument: the file is broken, or ends too soon; the message begins with a verb.
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
