// Profiles and their options: the result is a display's geometry, format and tone, or an error.

#include <cstdint>
#include <string>
#include <string_view>

#include "display/drivers/options.h"
#include "display/profiles/profile.h"
#include "tests/fuzz/config/read_options.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<display::Profile> profile = display::ParseProfile(text, "file");
  if (!profile.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(profile.status()), profile.status().ToString());
    fuzz::ExpectSays(profile.status());
    return 0;
  }
  fuzz::ReadOptions({.name = "fuzz", .driver = profile->driver, .options = profile->options});
  return 0;
}
