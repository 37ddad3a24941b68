// Layout files of Open Pixel Control; and, after a '=', options for the wiring of a cube.

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_split.h"
#include "display/drivers/options.h"
#include "display/drivers/wiring/wiring.h"
#include "display/geometry/footprint.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {
namespace {

namespace wiring = display::wiring;

constexpr wiring::PixelNumbers kNumbers{.a_slice = 16, .slices = 4, .a_strip = 8, .unit = "board"};

void CheckTaken(const absl::StatusOr<display::Lattice>& lattice) {
  if (!lattice.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(lattice.status()), lattice.status().ToString());
    ExpectSays(lattice.status());
  }
  display::DisplayInfo info;
  info.name = "fuzz";
  const bool read = lattice.ok();
  const absl::Status taken = wiring::TakeLattice(info, lattice);
  ExpectSays(taken);
  EXPECT_THAT_HOLDS(read || !taken.ok());
  if (taken.ok()) EXPECT_THAT_HOLDS(display::ValidateGeometry(info.geometry).ok());
}

void ReadCube(const std::string& text) {
  display::DisplayOptions options{.name = "fuzz", .driver = "fuzz"};
  for (const std::string& option : std::vector<std::string>(absl::StrSplit(text, ','))) {
    const std::pair<std::string, std::string> pair =
        absl::StrSplit(option, absl::MaxSplits('=', 1));
    // A path could name any file.
    if (pair.first != "layout") options.options[pair.first] = pair.second;
  }
  display::OptionReader reader(options);
  const absl::StatusOr<display::Lattice> lattice = wiring::ReadLattice(reader, kNumbers);
  const absl::Status read = reader.Finish();
  ExpectSays(read);
  if (read.ok()) CheckTaken(lattice);
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (text.starts_with('=')) {
    fuzz::ReadCube(std::string(text.substr(1)));
    return 0;
  }
  for (const double pitch : {1.0, 1e6}) {
    fuzz::CheckTaken(display::wiring::ParseLayout(text, fuzz::kNumbers, pitch));
  }
  return 0;
}
