// A display as on the command line: NAME=DRIVER,key=value…

#include <cstdint>
#include <string_view>

#include "daemon/config/display_config.h"
#include "tests/fuzz/config/read_options.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const absl::StatusOr<daemon::DisplayConfig> display = daemon::ParseDisplayOption(text);
  if (!display.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(display.status()), display.status().ToString());
    fuzz::ExpectSays(display.status());
    return 0;
  }
  EXPECT_THAT_HOLDS(daemon::CheckDisplayName(display->name).ok());
  fuzz::ReadOptions(
      {.name = display->name, .driver = display->driver, .options = display->options});
  return 0;
}
