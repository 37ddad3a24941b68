#include "daemon/pictures/picture.h"

#include <png.h>
#include <turbojpeg.h>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace voxeld::pictures {
namespace {

constexpr absl::string_view kPngBegins("\x89PNG\r\n\x1a\n", 8), kJpegBegins("\xFF\xD8\xFF", 3);
constexpr size_t kChannels = 3;

absl::Status Broken(absl::string_view format, absl::string_view why) {
  return absl::InvalidArgumentError(
      absl::StrCat("begins as a ", format, " file does, but cannot be read: ", why));
}

const unsigned char* Bytes(absl::string_view bytes) {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

}  // namespace

absl::StatusOr<PictureFile> PictureFile::Open(absl::string_view bytes) {
  if (absl::StartsWith(bytes, kPngBegins)) return OpenPng(bytes);
  if (absl::StartsWith(bytes, kJpegBegins)) return OpenJpeg(bytes);
  return absl::InvalidArgumentError("is neither a PNG nor a JPEG file");
}

absl::StatusOr<PictureFile> PictureFile::OpenPng(absl::string_view bytes) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  const absl::Cleanup free = [&] { png_image_free(&image); };
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0) {
    return Broken("PNG", image.message);
  }
  return PictureFile(bytes, Kind::kPng, {image.width, image.height});
}

absl::Status PictureFile::ReadPng(std::vector<uint8_t>& rgb) const {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  const absl::Cleanup free = [&] { png_image_free(&image); };
  if (png_image_begin_read_from_memory(&image, bytes_.data(), bytes_.size()) == 0) {
    return Broken("PNG", image.message);
  }
  image.format = PNG_FORMAT_RGB;
  image.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;  // if the file does not specify it
  const png_color black = {0, 0, 0};
  if (png_image_finish_read(&image, &black, rgb.data(), 0, nullptr) == 0) {
    return Broken("PNG", image.message);
  }
  return absl::OkStatus();
}

absl::StatusOr<PictureFile> PictureFile::OpenJpeg(absl::string_view bytes) {
  const tjhandle reader = tjInitDecompress();
  const absl::Cleanup destroy = [&] { tjDestroy(reader); };
  int width = 0, height = 0, sampling = 0, colors = 0;
  if (tjDecompressHeader3(reader, Bytes(bytes), bytes.size(), &width, &height, &sampling,
                          &colors) != 0 ||
      width < 1 || height < 1) {
    return Broken("JPEG", tjGetErrorStr2(reader));
  }
  return PictureFile(bytes, Kind::kJpeg,
                     {static_cast<uint32_t>(width), static_cast<uint32_t>(height)});
}

absl::Status PictureFile::ReadJpeg(std::vector<uint8_t>& rgb) const {
  const tjhandle reader = tjInitDecompress();
  const absl::Cleanup destroy = [&] { tjDestroy(reader); };
  // Decode in a single way, so that a file gives the same picture on every processor, and reject
  // files with too many scans.
  constexpr int kFlags = TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS;
  if (tjDecompress2(reader, Bytes(bytes_), bytes_.size(), rgb.data(), static_cast<int>(size_.width),
                    0, static_cast<int>(size_.height), TJPF_RGB, kFlags) != 0) {
    return Broken("JPEG", tjGetErrorStr2(reader));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<uint32_t>> PictureFile::Read() const {
  const size_t count = size_t{size_.width} * size_.height;
  std::vector<uint8_t> rgb(count * kChannels);
  absl::Status status = kind_ == Kind::kPng ? ReadPng(rgb) : ReadJpeg(rgb);
  if (!status.ok()) return status;
  std::vector<uint32_t> pixels(count);
  for (size_t i = 0; i < count; ++i) {
    const uint8_t* const at = &rgb[i * kChannels];
    pixels[i] = uint32_t{at[0]} << 16 | uint32_t{at[1]} << 8 | at[2];
  }
  return pixels;
}

}  // namespace voxeld::pictures
