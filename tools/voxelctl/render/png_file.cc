#include "tools/voxelctl/render/png_file.h"

#include <fcntl.h>
#include <png.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

absl::Status SystemError(const std::string& path, const char* what) {
  const int error = errno;
  return absl::PermissionDeniedError(absl::StrCat(path, ": ", what, ": ", std::strerror(error)));
}

// A new file beside `path`, with the permissions that any new file of the user's has;
// −1 and errno if none.
int OpenTemporary(const std::string& path, std::string* temporary) {
  for (int attempt = 0; attempt < 100; ++attempt) {
    *temporary = absl::StrCat(path, ".", ::getpid(), ".", attempt, ".tmp");
    const int file = ::open(temporary->c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0 || errno != EEXIST) return file;
  }
  return -1;
}

absl::Status WriteFile(const std::string& path, const std::vector<png_byte>& bytes) {
  std::string temporary;
  const int file = OpenTemporary(path, &temporary);
  if (file < 0) return SystemError(path, "cannot be written");
  absl::Cleanup remove = [&] { ::unlink(temporary.c_str()); };
  absl::Cleanup close = [&] { ::close(file); };
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t wrote = ::write(file, bytes.data() + done, bytes.size() - done);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return SystemError(path, "could not be written");
    done += static_cast<size_t>(wrote);
  }
  if (::fsync(file) != 0) return SystemError(path, "could not be written");
  if (::rename(temporary.c_str(), path.c_str()) != 0)
    return SystemError(path, "could not be put in place");
  std::move(remove).Cancel();
  return absl::OkStatus();
}

// `png` has size and format; `pixels` and `colors` are as it says.
absl::Status Write(const std::string& path, png_image& png, const void* pixels, int stride,
                   const void* colors) {
  png.version = PNG_IMAGE_VERSION;
  png_alloc_size_t size = 0;
  std::vector<png_byte> bytes;
  if (png_image_write_to_memory(&png, nullptr, &size, 0, pixels, stride, colors) != 0) {
    bytes.resize(size);
    if (png_image_write_to_memory(&png, bytes.data(), &size, 0, pixels, stride, colors) != 0)
      bytes.resize(size);
  }
  if (PNG_IMAGE_FAILED(png) || bytes.empty()) {
    return absl::InternalError(
        absl::StrCat(path, ": the picture could not be encoded: ", png.message));
  }
  return WriteFile(path, bytes);
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
