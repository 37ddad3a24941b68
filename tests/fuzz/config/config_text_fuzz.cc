// The configuration's text: it gives either errors with their places, or a configuration that is
// the same when it is printed and read again.

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include "daemon/config/config.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  daemon::Config config;
  config.server.listen = {*daemon::ParseAddress("127.0.0.1:50551")};  // the default without a file
  const absl::Status status = daemon::ReadConfigText(text, "file", &config);
  if (!status.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(status), status.ToString());
    fuzz::ExpectSays(status);
    for (const absl::string_view line : absl::StrSplit(status.message(), '\n')) {
      EXPECT_THAT_HOLDS(absl::StartsWith(line, "file:"), "without a place: ", line);
    }
    return 0;
  }
  const std::string printed = daemon::ToToml(config);
  daemon::Config again;
  const absl::Status reread = daemon::ReadConfigText(printed, "file", &again);
  EXPECT_THAT_HOLDS(reread.ok(), reread.ToString(), "\n", printed);
  EXPECT_THAT_HOLDS(daemon::ToToml(again) == printed, printed);
  EXPECT_THAT_HOLDS(again.displays.size() == config.displays.size());
  fuzz::ExpectSays(daemon::LocalSocketAddress(config.server).status());
  fuzz::ExpectSays(daemon::AccessOf(config.security).status());
  fuzz::ExpectSays(daemon::CheckSecurity(config));
  return 0;
}
