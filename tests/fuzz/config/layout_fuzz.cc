// Layout files of Open Pixel Control.

#include <cstdint>
#include <string_view>

#include "display/drivers/wiring/wiring.h"
#include "display/geometry/footprint.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  namespace wiring = display::wiring;
  const std::string_view json(reinterpret_cast<const char*>(data), size);
  const wiring::PixelNumbers numbers{.a_slice = 16, .slices = 4, .a_strip = 8, .unit = "board"};
  for (const double pitch : {1.0, 1e6}) {
    const absl::StatusOr<display::Lattice> lattice = wiring::ParseLayout(json, numbers, pitch);
    if (!lattice.ok()) {
      EXPECT_THAT_HOLDS(absl::IsInvalidArgument(lattice.status()), lattice.status().ToString());
      fuzz::ExpectSays(lattice.status());
    }
    display::DisplayInfo info;
    info.name = "fuzz";
    const bool read = lattice.ok();
    const absl::Status taken = wiring::TakeLattice(info, lattice);
    fuzz::ExpectSays(taken);
    EXPECT_THAT_HOLDS(read || !taken.ok());
    if (taken.ok()) EXPECT_THAT_HOLDS(display::ValidateGeometry(info.geometry).ok());
  }
  return 0;
}
