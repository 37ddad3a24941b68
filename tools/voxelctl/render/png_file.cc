#include "tools/voxelctl/render/png_file.h"

#include <png.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/files/whole_file.h"

namespace voxeld::voxelctl {
namespace {

// `png` has size and format, which describe `pixels` and `colors`.
absl::Status Write(const std::string& path, png_image& png, const void* pixels, int stride,
                   const void* colors) {
  png.version = PNG_IMAGE_VERSION;
  png_alloc_size_t size = 0;
  std::string bytes;
  if (png_image_write_to_memory(&png, nullptr, &size, 0, pixels, stride, colors) != 0) {
    bytes.resize(size);
    if (png_image_write_to_memory(&png, bytes.data(), &size, 0, pixels, stride, colors) != 0)
      bytes.resize(size);
  }
  if (PNG_IMAGE_FAILED(png) || bytes.empty()) {
    return absl::InternalError(
        absl::StrCat(EscapeForTerminal(path), ": the picture could not be encoded: ", png.message));
  }
  return WriteWholeFile(path, bytes);
}

}  // namespace

absl::Status WritePng(const std::string& path, const Image& image) {
  png_image png = {};
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  return Write(path, png, image.rgb.data(), image.width * 3, nullptr);
}

absl::Status WritePalettePng(const std::string& path, const PaletteImage& image) {
  png_image png = {};
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB_COLORMAP;
  png.colormap_entries = static_cast<png_uint_32>(image.colors.size());
  return Write(path, png, image.indices.data(), image.width, image.colors.data());
}

}  // namespace voxeld::voxelctl
