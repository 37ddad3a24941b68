#include "display/geometry/corrector.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "display/geometry/footprint.h"
#include "display/geometry/keystone.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

using ::testing::HasSubstr;

void ExpectNear(const Vec3& a, const Vec3& b, double error) {
  EXPECT_NEAR(a.x, b.x, error);
  EXPECT_NEAR(a.y, b.y, error);
  EXPECT_NEAR(a.z, b.z, error);
}

TEST(Corrector, OfNothingLeavesPlaces) {
  const Corrector none(std::nullopt), unit(Correction{});
  const Vec3 p = {1.25, -3, 7};
  for (const Corrector* corrector : {&none, &unit}) {
    EXPECT_EQ(corrector->ToTrue(p), p);
    EXPECT_EQ(corrector->ToNominal(p), p);
  }
}

TEST(Corrector, TurnsAndMoves) {
  Correction correction;
  correction.affine = {0, -1, 0, 10, 1, 0, 0, 20, 0, 0, 2, 30};
  const Corrector corrector(correction);
  ExpectNear(corrector.ToTrue({1, 2, 3}), {8, 21, 36}, 1e-12);
  ExpectNear(corrector.ToNominal({8, 21, 36}), {1, 2, 3}, 1e-12);
}

TEST(Corrector, DisplacesStraightBetweenPlaces) {
  Correction correction;
  correction.displacement = {2,
                             2,
                             2,
                             {0, 0, 0},
                             {10, 10, 10},
                             {{}, {2, 0, 0}, {}, {2, 0, 0}, {}, {2, 0, 0}, {}, {2, 0, 4}}};
  const Corrector corrector(correction);
  ExpectNear(corrector.ToTrue({5, 5, 5}), {6, 5, 5.5}, 1e-12);
  ExpectNear(corrector.ToTrue({-5, 5, 5}), {-5, 5, 5}, 1e-12);
  ExpectNear(corrector.ToTrue({20, 20, 20}), {22, 20, 24}, 1e-12);
}

TEST(Corrector, ThereAndBack) {
  for (const GeometryCase& c : FlatCases()) {
    if (!c.geometry.correction) continue;
    SCOPED_TRACE(c.name);
    const Corrector corrector(c.geometry.correction);
    for (int i = 0; i < 500; ++i) {
      const Vec3 p = {15 * std::sin(i * 1.1), 15 * std::sin(i * 2.3), 15 * std::sin(i * 3.7)};
      ExpectNear(corrector.ToTrue(corrector.ToNominal(p)), p, 1e-8);
      const PicturePlace q = {p.x / 2, p.y / 2},
                         back = corrector.PictureToTrue(3, corrector.PictureToNominal(3, q));
      EXPECT_NEAR(back.u, q.u, 1e-9);
      EXPECT_NEAR(back.v, q.v, 1e-9);
    }
  }
}

TEST(Keystone, TakesCornersToWhereTheyAre) {
  const std::array<PicturePlace, 4> to = {{{-9, -8}, {12, -7.5}, {10, 8.5}, {-8, 7}}};
  const Homography h = *HomographyOfCorners({10, 8}, to);
  const PicturePlace from[4] = {{-10, -8}, {10, -8}, {10, 8}, {-10, 8}};
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(h.At(from[i]).u, to[i].u, 1e-12);
    EXPECT_NEAR(h.At(from[i]).v, to[i].v, 1e-12);
  }
  const Homography same = *HomographyOfCorners({10, 8}, {{{-10, -8}, {10, -8}, {10, 8}, {-10, 8}}});
  EXPECT_NEAR(same.At({3, 4}).u, 3, 1e-12);
  EXPECT_EQ(HomographyOfCorners({10, 8}, {{{0, 0}, {1, 1}, {2, 2}, {3, 3}}}), std::nullopt);
}

std::string ErrorOf(const Correction& correction, Geometry geometry) {
  geometry.correction = correction;
  return std::string(CheckCorrection(geometry).message());
}

TEST(CheckCorrection, SaysWhatIsWrong) {
  const Geometry stack = StackCases()[0].geometry, rotor = RotorCases()[0].geometry;
  EXPECT_EQ(ErrorOf({}, stack), "");
  Correction c;
  c.affine[0] = NAN;
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("correction.affine[0] is nan"));
  c = {};
  c.affine[0] = -1;
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("determinant is -1: it must be from 1/8 to 8"));
  c = {};
  c.homographies.push_back({1, 0, 0, 0, 1, 0, 0, 0, 1});
  EXPECT_EQ(ErrorOf(c, stack), "");
  EXPECT_THAT(ErrorOf(c, rotor), HasSubstr("only a planar stack and a helix have projected"));
  c.homographies.push_back(c.homographies[0]);
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("is 2: it must be 1, or one for each of the 12 slices"));
  c.homographies = {{1, 0, 0, 0, -1, 0, 0, 0, 1}};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("mirror pictures by mirror_u and mirror_v"));
  c.homographies = {{1, 0, 0, 0, 1, 0, 0.5, 0, 1}};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("from 1/8 to 8 over all of the picture"));
  c.homographies = {{1e308, -1e308, 0, 0, 1e-300, 0, 0, 0, 1}};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("within 1e+06 mm"));
  c = {};
  c.affine = {1e6, 0, 0, 0, 0, 1e6, 0, 0, 0, 0, 1e-12, 0};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("the norm of affine is"));
  c.affine = {8, 0, 0, 0, 0, 8, 0, 0, 0, 0, 1 / 64.0, 0};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("the norm of affine's inverse is"));
  c = {};
  c.displacement = {2, 2, 2, {0, 0, 0}, {10, 10, 10}, std::vector<Vec3>(7)};
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("at_mm is 7: it must be 8"));
  c.displacement->at_mm.resize(8);
  EXPECT_EQ(ErrorOf(c, stack), "");
  c.displacement->at_mm[1].x = 6;
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("measure at more places"));
  c.displacement->at_mm[1].x = INFINITY;
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("at_mm[1]"));
  c.displacement->nx = 1;
  EXPECT_THAT(ErrorOf(c, stack), HasSubstr("displacement.nx is 1: it must be from 2 to 64"));
}

// The line on which the picture's nominal places are infinitely far away runs through the grid.
TEST(FlatFootprints, HorizonsAreFarAway) {
  PlanarStack stack;
  stack.width_px = stack.height_px = 32;
  stack.positions_mm = EvenPositions(4, 1);
  Geometry geometry{stack, {}, Correction{}};
  geometry.correction->homographies = {{.5, 0, 0, 0, .5, 0, 1 / 21.0, 0, 1}};
  geometry.grid = CentredGrid(64, 32, 4, {1, 1, 1});
  ASSERT_EQ(ValidateGeometry(geometry), absl::OkStatus());
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_GT(table.outer.entries.size(), 500u);
}

}  // namespace
}  // namespace voxeld::display
