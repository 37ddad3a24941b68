// Tests which light is where, with places computed by hand.
#include "tools/voxelctl/lights/light_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace voxeld::voxelctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Voxels of 2 mm, with the volume's corner at (-10, 0, 0); a scene that is rotated, doubled and
// moved: voxel = (5 - 2y, 2x, 4z + 1).
v1::DisplayDescription Display(int nx, int ny, int nz) {
  v1::DisplayDescription display;
  display.set_name("cube");
  v1::VoxelGrid& grid = *display.mutable_geometry()->mutable_grid();
  grid.set_nx(nx);
  grid.set_ny(ny);
  grid.set_nz(nz);
  grid.mutable_pitch_mm()->set_x(2);
  grid.mutable_pitch_mm()->set_y(2);
  grid.mutable_pitch_mm()->set_z(2);
  grid.mutable_origin_mm()->set_x(-10);
  for (const double value : {0., -2., 0., 5., 2., 0., 0., 0., 0., 0., 4., 1.}) {
    display.mutable_scene_to_voxel()->add_m(value);
  }
  return display;
}

// Returns where a place is in voxels: by the map, and the display's view in reverse.
std::vector<double> Voxel(const LightMap& map, size_t place) {
  const auto apply = [](const auto& m, const std::vector<double>& p) {
    std::vector<double> out;
    for (int row = 0; row < 3; ++row) {
      out.push_back(m[row * 4] * p[0] + m[row * 4 + 1] * p[1] + m[row * 4 + 2] * p[2] +
                    m[row * 4 + 3]);
    }
    return out;
  };
  const std::vector<double> scene =
      apply(map.transform.m,
            {map.places[place * 3], map.places[place * 3 + 1], map.places[place * 3 + 2]});
  const std::vector<double> view = {0, -2, 0, 5, 2, 0, 0, 0, 0, 0, 4, 1};
  return apply(view, scene);
}

TEST(LightMap, ABoxOfAsManyLightsIsTheVoxels) {
  const auto map = LightsInBox({3, 2, 2}, Display(3, 2, 2));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(map->lights, 12u);
  EXPECT_TRUE(map->cells);
  EXPECT_THAT(Voxel(*map, 0), ElementsAre(0, 0, 0));
  EXPECT_THAT(Voxel(*map, 1), ElementsAre(1, 0, 0));
  EXPECT_THAT(Voxel(*map, 3), ElementsAre(0, 1, 0));
  EXPECT_THAT(Voxel(*map, 11), ElementsAre(2, 1, 1));
}

TEST(LightMap, ABoxIsInTheMiddleAndAsLargeAsItCanBe) {
  const auto map = LightsInBox({2, 2, 2}, Display(12, 8, 20));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_THAT(Voxel(*map, 0), ElementsAre(2, 0, 6));  // lights of four voxels
  EXPECT_THAT(Voxel(*map, 7), ElementsAre(6, 4, 10));
}

TEST(LightMap, ABoxLiesWithinARotorsRound) {
  v1::DisplayDescription display = Display(10, 10, 4);
  display.mutable_geometry()->mutable_rotor();
  const auto map = LightsInBox({3, 4, 1}, display);  // its diagonal is 5 lights: of two voxels each
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_THAT(Voxel(*map, 0), ElementsAre(2, 1, 1));
  EXPECT_THAT(Voxel(*map, 11), ElementsAre(6, 7, 1));
}

TEST(LightMap, ALatticesLightsAreItsPixels) {
  v1::DisplayDescription display = Display(3, 2, 2);
  v1::Lattice& lattice = *display.mutable_geometry()->mutable_lattice();
  // Pixels 1, 4 and 6, in voxels (0, 0, 0), (2, 1, 0) and (1, 1, 1): in their middles.
  for (const uint32_t pixel : {1u, 4u, 6u}) lattice.add_pixels(pixel);
  for (const double x : {-9., -5., -7.}) lattice.add_x_mm(x);
  for (const double y : {1., 3., 3.}) lattice.add_y_mm(y);
  for (const double z : {1., 1., 3.}) lattice.add_z_mm(z);
  const auto map = LightsOf(display);
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(map->lights, 7u);
  EXPECT_THAT(map->light, ElementsAre(1, 4, 6));
  EXPECT_THAT(Voxel(*map, 1), ElementsAre(2, 1, 0));
  EXPECT_THAT(Voxel(*map, 2), ElementsAre(1, 1, 1));
  std::vector<uint8_t> values;
  for (uint8_t i = 0; i < 21; ++i) values.push_back(i);
  const client::Points picture = map->Picture(values);
  EXPECT_THAT(picture.vertices.colors.view(), ElementsAre(3, 4, 5, 12, 13, 14, 18, 19, 20));
}

TEST(LightMap, ALayoutIsFitted) {
  // Ten units along x and five along y: between the middles of the volume's 11 voxels there is one
  // voxel for each unit.
  const auto map = LightsOfLayout(
      R"([{"point": [0, 0, 0]}, null, {"point": [10, 0, 0]}, {"point": [10, 5, 0]}])",
      Display(11, 11, 3));
  ASSERT_TRUE(map.ok()) << map.status();
  EXPECT_EQ(map->lights, 4u);
  EXPECT_FALSE(map->cells);
  EXPECT_THAT(map->light, ElementsAre(0, 2, 3));
  EXPECT_THAT(Voxel(*map, 0), ElementsAre(0.5, 3, 1.5));
  EXPECT_THAT(Voxel(*map, 1), ElementsAre(10.5, 3, 1.5));
  EXPECT_THAT(Voxel(*map, 2), ElementsAre(10.5, 8, 1.5));
}

TEST(LightMap, SaysWhatIsWrong) {
  EXPECT_THAT(std::string(LightsOf(Display(3, 2, 2)).status().message()),
              HasSubstr("--size WxHxD"));
  EXPECT_THAT(std::string(LightsInBox({1024, 1024, 1}, Display(3, 2, 2)).status().message()),
              HasSubstr("1048576 lights; 262144 are the most"));
  EXPECT_THAT(std::string(LightsOfLayout("[{}, 5]", Display(3, 2, 2)).status().message()),
              HasSubstr("entry 1 is 5"));
  EXPECT_FALSE(LightsInBox({1, 1, 1}, Display(0, 2, 2)).ok());
  v1::DisplayDescription flat = Display(3, 2, 2);
  flat.mutable_scene_to_voxel()->set_m(10, 0);
  EXPECT_THAT(std::string(LightsInBox({1, 1, 1}, flat).status().message()),
              HasSubstr("cannot be turned round"));
}

}  // namespace
}  // namespace voxeld::voxelctl
