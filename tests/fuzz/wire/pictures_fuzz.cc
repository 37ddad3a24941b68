// PNG and JPEG: a head that is trusted only as far as it is checked, and rows.

#include <cstdint>
#include <vector>

#include "absl/strings/string_view.h"
#include "daemon/pictures/picture.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  const absl::string_view bytes(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<pictures::PictureFile> file = pictures::PictureFile::Open(bytes);
  if (!file.ok()) {
    fuzz::ExpectSays(file.status());
    return 0;
  }
  const auto [width, height] = file->size();
  EXPECT_THAT_HOLDS(width > 0 && height > 0);
  // Like the decoder, which has a limit of its own.
  if (uint64_t{static_cast<uint32_t>(width)} * static_cast<uint32_t>(height) > 16 << 10) return 0;
  const absl::StatusOr<std::vector<uint32_t>> pixels = file->Read();
  if (!pixels.ok()) {
    fuzz::ExpectSays(pixels.status());
    return 0;
  }
  EXPECT_THAT_HOLDS(pixels->size() ==
                    size_t{static_cast<uint32_t>(width)} * static_cast<uint32_t>(height));
  for (const uint32_t pixel : *pixels) EXPECT_THAT_HOLDS(pixel <= 0xFFFFFF);
  return 0;
}
