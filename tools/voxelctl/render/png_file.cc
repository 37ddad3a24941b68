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

}  // namespace

absl::Status WritePng(const std::string& path, const Image& image) {
  png_image png = {};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = 0;
  std::vector<png_byte> bytes;
  const int stride = image.width * 3;
  if (png_image_write_to_memory(&png, nullptr, &size, 0, image.rgb.data(), stride, nullptr) != 0) {
    bytes.resize(size);
    if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), stride,
                                  nullptr) != 0)
      bytes.resize(size);
  }
  if (PNG_IMAGE_FAILED(png) || bytes.empty()) {
    return absl::InternalError(
        absl::StrCat(path, ": the picture could not be encoded: ", png.message));
  }

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

}  // namespace voxeld::voxelctl
