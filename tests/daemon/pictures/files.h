// Image files for tests.
#pragma once

#include <png.h>
#include <turbojpeg.h>

#include <cstdint>
#include <string>
#include <vector>

namespace voxeld::pictures {

// Pixels are 0x00RRGGBB, or with `alpha` 0xAARRGGBB, row by row.
inline std::string PngOf(uint32_t width, uint32_t height, const std::vector<uint32_t>& pixels,
                         bool alpha = false) {
  std::vector<uint8_t> bytes;
  for (const uint32_t pixel : pixels) {
    for (const int shift : {16, 8, 0}) bytes.push_back(static_cast<uint8_t>(pixel >> shift));
    if (alpha) bytes.push_back(static_cast<uint8_t>(pixel >> 24));
  }
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string file(size, '\0');
  if (png_image_write_to_memory(&image, file.data(), &size, 0, bytes.data(), 0, nullptr) == 0) {
    return "";
  }
  file.resize(size);
  return file;
}

// Grey, 16 bits a pixel; the file does not say what its values mean.
inline std::string WideGreyPngOf(uint32_t width, uint32_t height,
                                 const std::vector<uint16_t>& grey) {
  png_image image = {};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  image.format = PNG_FORMAT_LINEAR_Y;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string told(size, '\0');
  if (png_image_write_to_memory(&image, told.data(), &size, 0, grey.data(), 0, nullptr) == 0) {
    return "";
  }
  told.resize(size);
  constexpr size_t kSignature = 8, kBesideData = 12;  // a chunk: length, name, data, CRC-32
  std::string file = told.substr(0, kSignature);
  for (size_t at = kSignature; at < told.size();) {
    size_t chunk = kBesideData;
    for (size_t i = 0; i < 4; ++i)
      chunk += size_t{static_cast<uint8_t>(told[at + i])} << (24 - 8 * i);
    const std::string name = told.substr(at + 4, 4);
    if (name == "IHDR" || name == "IDAT" || name == "IEND") file += told.substr(at, chunk);
    at += chunk;
  }
  return file;
}

inline std::string JpegOf(int width, int height, const std::vector<uint32_t>& pixels) {
  const tjhandle writer = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;  // NOLINT(google-runtime-int): the library's
  std::string file;
  if (tjCompress2(writer, reinterpret_cast<const unsigned char*>(pixels.data()), width, 0, height,
                  TJPF_BGRX, &bytes, &size, TJSAMP_444, 100, TJFLAG_ACCURATEDCT) == 0) {
    file.assign(reinterpret_cast<const char*>(bytes), size);
  }
  tjFree(bytes);
  tjDestroy(writer);
  return file;
}

}  // namespace voxeld::pictures
