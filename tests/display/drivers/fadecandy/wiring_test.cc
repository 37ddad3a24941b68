// Tests the way from a voxel to its LED, through everything in between.

#include <memory>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/boards.h"
#include "display/drivers/wiring/wiring.h"
#include "display/geometry/footprint.h"
#include "tests/display/drivers/fadecandy/display_fixture.h"

namespace voxeld::display::fadecandy {
namespace {

using wiring::CubeLattice;
using wiring::CubeWiring;

struct Led {
  size_t board, strip, place;
};

class FadecandyWiring : public Fadecandy {
 protected:
  // Lights the voxels of a cube one by one, according to its geometry, and checks that the LED
  // returned by `led_of` is lit, and no other.
  template <typename LedOf>
  void Check(CubeWiring wiring, size_t boards, LedOf led_of) {
    Start(boards);
    const absl::StatusOr<Lattice> lattice =
        CubeLattice(wiring, PixelsOf(static_cast<int32_t>(boards)), 10);
    ASSERT_TRUE(lattice.ok()) << lattice.status();
    Geometry geometry;
    geometry.shape = *lattice;
    geometry.grid = DefaultGrid(geometry);
    ASSERT_TRUE(ValidateGeometry(geometry).ok());
    const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
    const VoxelGrid& grid = geometry.grid;
    ASSERT_EQ(grid.nx * grid.ny * grid.nz, wiring.size[0] * wiring.size[1] * wiring.size[2]);
    for (int32_t z = 0; z < grid.nz; ++z) {
      for (int32_t y = 0; y < grid.ny; ++y) {
        for (int32_t x = 0; x < grid.nx; ++x) {
          SCOPED_TRACE(testing::Message() << x << ", " << y << ", " << z);
          ASSERT_NO_FATAL_FAILURE(Light(table, x, y, z));
          ASSERT_NO_FATAL_FAILURE(OnlyLit(led_of(x, y, z)));
        }
      }
    }
  }

 private:
  void Light(const FootprintTable& table, int32_t x, int32_t y, int32_t z) {
    auto frame = std::make_shared<SliceFrame>();
    frame->volume = stats().volumes_submitted + 1;
    frame->layout = rig_->display().info().layout;
    frame->bytes.resize(frame->layout.bytes());
    frame->changed_in.assign(frame->layout.pictures(), frame->volume);
    for (int32_t s = 0; s < table.slices; ++s) {
      for (int32_t u = 0; u < table.width; ++u) {
        for (const FootprintEntry& entry : table.Outer(s, u)) {
          if (entry.x != x || entry.y != y || entry.z != z) continue;
          frame->bytes[static_cast<size_t>(s) * kFrameBytes + static_cast<size_t>(u) * 3] =
              std::byte{100};
        }
      }
    }
    rig_->display().Submit(frame);
    ASSERT_TRUE(rig_->RunUntilOutcome(frame->volume));
    rig_->RunFor(2 * kRefresh);
  }
  void OnlyLit(Led led) {
    for (size_t b = 0; b < rig_->boards(); ++b) {
      for (size_t s = 0; s < kStrips; ++s) {
        const auto out = rig_->device(b).light().Strip(s);
        for (size_t i = 0; i < out.size(); ++i) {
          const bool red_of_led =
              b == led.board && s == led.strip && i == 3 * led.place + 1;  // G, R, B
          ASSERT_EQ(out[i], red_of_led ? 100 : 0)
              << "board " << b << " strip " << s << " LED " << i / 3;
        }
      }
    }
  }
};

TEST_F(FadecandyWiring, AStripASlice) {
  Check({.size = {4, 3, 5}, .per_strip = 12}, 1, [](int32_t x, int32_t y, int32_t z) {
    return Led{0, static_cast<size_t>(z), static_cast<size_t>(4 * y + x)};
  });
}

TEST_F(FadecandyWiring, RowsThatGoToAndFro) {
  Check({.size = {4, 3, 2}, .serpentine = CubeWiring::Serpentine::kRows, .per_strip = 12}, 1,
        [](int32_t x, int32_t y, int32_t z) {
          return Led{0, static_cast<size_t>(z), static_cast<size_t>(4 * y + (y == 1 ? 3 - x : x))};
        });
}

// Columns hang from the top, one strip each; the ninth is the second board's first.
TEST_F(FadecandyWiring, ColumnsFromTheTop) {
  Check({.size = {3, 3, 5}, .order = {2, 0, 1}, .flip = {false, false, true}, .per_strip = 5}, 2,
        [](int32_t x, int32_t y, int32_t z) {
          const auto column = static_cast<size_t>(3 * y + x);
          return Led{column / 8, column % 8, static_cast<size_t>(4 - z)};
        });
}

// Turned by 90 degrees, the x direction becomes the y direction, starting at the far end of x.
TEST_F(FadecandyWiring, Turned) {
  Check({.size = {4, 2, 1}, .quarter_turns = 1}, 1, [](int32_t x, int32_t y, int32_t) {
    return Led{0, 0, static_cast<size_t>(4 * (1 - x) + y)};
  });
}

}  // namespace
}  // namespace voxeld::display::fadecandy
