#include "tests/fuzz/config/read_options.h"

#include <string>

#include "display/api/geometry.h"
#include "display/drivers/registry.h"
#include "display/geometry/footprint.h"
#include "display/sync/fake_clock.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {

void ReadOptions(const display::DisplayOptions& options) {
  display::OptionReader reader(options);
  const absl::StatusOr<display::DisplayInfo> info = display::ReadDisplayInfo(options, reader);
  const display::ToneOptions tone = display::ReadTone(reader);
  const absl::Status read = reader.Finish();
  ExpectSays(info.status());
  ExpectSays(read);
  if (info.ok() && read.ok()) {
    const absl::Status valid = display::ValidateGeometry(info->geometry);
    EXPECT_THAT_HOLDS(valid.ok(), valid.ToString());
    EXPECT_THAT_HOLDS(info->layout.pictures() > 0 && info->layout.bytes_per_slice() > 0);
    EXPECT_THAT_HOLDS(info->volumes_per_second > 0);
    const display::Tone made = display::MakeTone(tone);
    for (const auto& channel : made.lut) {
      EXPECT_THAT_HOLDS(channel[0] == 0);
      for (size_t i = 1; i < channel.size(); ++i) EXPECT_THAT_HOLDS(channel[i] >= channel[i - 1]);
    }
  }
  // Files are named by paths, which could name any file.
  if (options.options.contains("layout")) return;
  sync::FakeClock clock;
  for (const std::string& driver : display::DriverNames()) {
    display::DisplayOptions with = options;
    with.driver = driver;
    ExpectSays(display::VerifySubjects(with, clock).status());
  }
}

}  // namespace voxeld::fuzz
