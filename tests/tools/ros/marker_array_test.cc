#include "tools/ros/marker_array.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/tools/ros/markers_of.h"
#include "tools/markers/markers.h"

namespace voxeld::ros1 {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

foxglove::SceneEntity Made(const Marker& marker) {
  const absl::StatusOr<foxglove::SceneEntity> entity = EntityOf(marker);
  EXPECT_TRUE(entity.ok()) << entity.status();
  return entity.value_or(foxglove::SceneEntity());
}

void ExpectAt(const auto& is, double x, double y, double z) {
  EXPECT_NEAR(is.x(), x, 1e-12);
  EXPECT_NEAR(is.y(), y, 1e-12);
  EXPECT_NEAR(is.z(), z, 1e-12);
}

void ExpectColor(const foxglove::Color& is, double r, double g, double b, double a) {
  EXPECT_EQ((std::array{is.r(), is.g(), is.b(), is.a()}), (std::array{r, g, b, a}));
}

// Returns where a pose puts (x, y, z), by the matrix with which the shapes are drawn.
std::array<double, 3> Posed(const foxglove::Pose& pose, double x, double y, double z) {
  foxglove::SceneEntity entity;
  *entity.add_cubes()->mutable_pose() = pose;
  const client::Affine a = markers::PiecesOf(entity).pieces.at(0).look.transform;
  const auto row = [&](size_t i) {
    return a.m[i] * x + a.m[i + 1] * y + a.m[i + 2] * z + a.m[i + 3];
  };
  return {row(0), row(4), row(8)};
}

void ExpectPosed(const foxglove::Pose& pose, std::array<double, 3> from, std::array<double, 3> to) {
  const std::array<double, 3> is = Posed(pose, from[0], from[1], from[2]);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(is[i], to[i], 1e-12) << i;
}

// A quarter turn about z: x becomes y, and y becomes −x.
void TurnLeft(Marker* marker) {
  marker->pose.orientation.z = marker->pose.orientation.w = std::sqrt(0.5);
}

TEST(EntityOf, SolidsHaveTheirPoseSizeAndColour) {
  Marker marker = Of(Marker::CUBE);
  marker.pose.position.x = 1;
  marker.pose.position.y = 2;
  marker.pose.position.z = 3;
  TurnLeft(&marker);
  marker.scale.x = 4;
  marker.scale.y = 5;
  marker.scale.z = 6;
  marker.color.g = 0.5;
  marker.color.a = 0.25;
  const foxglove::SceneEntity cube = Made(marker);
  EXPECT_EQ(cube.id(), "n/7");
  EXPECT_FALSE(cube.has_lifetime());
  ASSERT_EQ(cube.cubes_size(), 1);
  ExpectAt(cube.cubes(0).size(), 4, 5, 6);
  ExpectColor(cube.cubes(0).color(), 1, 0.5, 0, 0.25);
  ExpectPosed(cube.cubes(0).pose(), {1, 0, 0}, {1, 3, 3});
  marker.type = Marker::SPHERE;
  const foxglove::SceneEntity sphere = Made(marker);
  ASSERT_EQ(sphere.spheres_size(), 1);
  ExpectAt(sphere.spheres(0).size(), 4, 5, 6);
  ExpectPosed(sphere.spheres(0).pose(), {0, 1, 0}, {0, 2, 3});
  marker.type = Marker::CYLINDER;
  const foxglove::SceneEntity cylinder = Made(marker);
  ASSERT_EQ(cylinder.cylinders_size(), 1);
  ExpectAt(cylinder.cylinders(0).size(), 4, 5, 6);
  EXPECT_EQ(cylinder.cylinders(0).bottom_scale(), 1);
  EXPECT_EQ(cylinder.cylinders(0).top_scale(), 1);
}

TEST(EntityOf, AnArrowByItsPoseIsAsLongAsScaleX) {
  Marker marker = Of(Marker::ARROW);
  marker.scale.x = 10;
  marker.scale.y = 0.5;
  const foxglove::SceneEntity entity = Made(marker);
  ASSERT_EQ(entity.arrows_size(), 1);
  const foxglove::ArrowPrimitive& arrow = entity.arrows(0);
  EXPECT_NEAR(arrow.shaft_length(), 7.7, 1e-12);
  EXPECT_NEAR(arrow.head_length(), 2.3, 1e-12);
  EXPECT_EQ(arrow.shaft_diameter(), 0.5);
  EXPECT_EQ(arrow.head_diameter(), 1);
  ExpectColor(arrow.color(), 1, 0, 0, 1);
}

TEST(EntityOf, AnArrowByTwoPointsGoesFromOneToTheOther) {
  Marker marker = Of(Marker::ARROW);
  marker.pose.position.x = 10;
  TurnLeft(&marker);
  marker.scale.x = 0.2;
  marker.scale.y = 0.4;
  marker.scale.z = 0.6;
  AddPoint(&marker, 1, 2, 3);
  AddPoint(&marker, 1, 2, 8);
  const foxglove::SceneEntity entity = Made(marker);
  ASSERT_EQ(entity.arrows_size(), 1);
  const foxglove::ArrowPrimitive& arrow = entity.arrows(0);
  EXPECT_NEAR(arrow.shaft_length(), 4.4, 1e-12);
  EXPECT_NEAR(arrow.head_length(), 0.6, 1e-12);
  EXPECT_EQ(arrow.shaft_diameter(), 0.2);
  EXPECT_EQ(arrow.head_diameter(), 0.4);
  ExpectPosed(arrow.pose(), {0, 0, 0}, {8, 1, 3});
  ExpectPosed(arrow.pose(), {5, 0, 0}, {8, 1, 8});
}

TEST(EntityOf, AnArrowsHeadIsAsLongAsItSaysButNoLongerThanIt) {
  Marker marker = Of(Marker::ARROW);
  marker.scale.z = 0;
  AddPoint(&marker, 0, 0, 0);
  AddPoint(&marker, 2, 0, 0);
  EXPECT_NEAR(Made(marker).arrows(0).head_length(), 0.46, 1e-12);
  marker.scale.z = 9;
  EXPECT_EQ(Made(marker).arrows(0).head_length(), 2);
  EXPECT_EQ(Made(marker).arrows(0).shaft_length(), 0);
}

TEST(EntityOf, ArrowsPointInEveryDirection) {
  for (const std::array<double, 3>& to : std::vector<std::array<double, 3>>{
           {3, 0, 0}, {-3, 0, 0}, {0, 3, 0}, {0, -3, 0}, {0, 0, -3}, {2, -1, 2}, {-2, 2, 1}}) {
    Marker marker = Of(Marker::ARROW);
    AddPoint(&marker, 0, 0, 0);
    AddPoint(&marker, to[0], to[1], to[2]);
    ExpectPosed(Made(marker).arrows(0).pose(), {3, 0, 0}, to);
  }
}

TEST(EntityOf, AnArrowWithoutLengthIsNothing) {
  Marker marker = Of(Marker::ARROW);
  AddPoint(&marker, 1, 1, 1);
  AddPoint(&marker, 1, 1, 1);
  EXPECT_THAT(markers::PiecesOf(Made(marker)).pieces, IsEmpty());
}

TEST(EntityOf, LinesHaveTheirPointsThicknessAndColours) {
  for (const int type : {int{Marker::LINE_STRIP}, int{Marker::LINE_LIST}}) {
    Marker marker = Of(type);
    marker.scale.x = 0.25;
    marker.pose.position.y = 4;
    AddPoint(&marker, 1, 2, 3);
    AddPoint(&marker, 4, 5, 6);
    AddColor(&marker, 0, 1, 0);
    AddColor(&marker, 0, 0, 1, 0.5);
    const foxglove::SceneEntity entity = Made(marker);
    ASSERT_EQ(entity.lines_size(), 1);
    const foxglove::LinePrimitive& line = entity.lines(0);
    EXPECT_EQ(line.type(), type == Marker::LINE_STRIP ? foxglove::LinePrimitive::LINE_STRIP
                                                      : foxglove::LinePrimitive::LINE_LIST);
    EXPECT_EQ(line.thickness(), 0.25);
    EXPECT_FALSE(line.scale_invariant());
    ASSERT_EQ(line.points_size(), 2);
    ExpectAt(line.points(1), 4, 5, 6);
    ASSERT_EQ(line.colors_size(), 2);
    ExpectColor(line.colors(0), 0, 1, 0, 1);
    ExpectColor(line.colors(1), 0, 0, 1, 0.5);
    EXPECT_THAT(line.indices(), IsEmpty());
    ExpectPosed(line.pose(), {0, 0, 0}, {0, 4, 0});
  }
}

TEST(EntityOf, PointsAreLinesFromEachToItself) {
  Marker marker = Of(Marker::POINTS);
  marker.scale.x = 0.5;
  AddPoint(&marker, 1, 0, 0);
  AddPoint(&marker, 0, 1, 0);
  const foxglove::LinePrimitive line = Made(marker).lines(0);
  EXPECT_EQ(line.type(), foxglove::LinePrimitive::LINE_LIST);
  EXPECT_THAT(line.indices(), ElementsAre(0, 0, 1, 1));
  EXPECT_EQ(line.points_size(), 2);
  EXPECT_EQ(line.thickness(), 0.5);
}

TEST(EntityOf, CubesOfAListTurnWithItAndHaveTwelveTrianglesEach) {
  Marker marker = Of(Marker::CUBE_LIST);
  TurnLeft(&marker);
  marker.scale.x = 2;
  marker.scale.y = 4;
  marker.scale.z = 6;
  AddPoint(&marker, 0, 0, 0);
  AddPoint(&marker, 10, 20, 30);
  AddColor(&marker, 0, 1, 0);
  AddColor(&marker, 0, 0, 1);
  const foxglove::SceneEntity entity = Made(marker);
  ASSERT_EQ(entity.triangles_size(), 1);
  const foxglove::TriangleListPrimitive& mesh = entity.triangles(0);
  ASSERT_EQ(mesh.points_size(), 16);
  std::set<std::array<double, 3>> corners;
  for (const foxglove::Point3& p : mesh.points()) corners.insert({p.x(), p.y(), p.z()});
  EXPECT_THAT(
      corners,
      ElementsAre(std::array{-1., -2., -3.}, std::array{-1., -2., 3.}, std::array{-1., 2., -3.},
                  std::array{-1., 2., 3.}, std::array{1., -2., -3.}, std::array{1., -2., 3.},
                  std::array{1., 2., -3.}, std::array{1., 2., 3.}, std::array{9., 18., 27.},
                  std::array{9., 18., 33.}, std::array{9., 22., 27.}, std::array{9., 22., 33.},
                  std::array{11., 18., 27.}, std::array{11., 18., 33.}, std::array{11., 22., 27.},
                  std::array{11., 22., 33.}));
  ASSERT_EQ(mesh.colors_size(), 16);
  ExpectColor(mesh.colors(7), 0, 1, 0, 1);
  ExpectColor(mesh.colors(8), 0, 0, 1, 1);
  ASSERT_EQ(mesh.indices_size(), 72);
  // The mesh is closed: each edge belongs to two triangles.
  std::map<std::set<uint32_t>, int> edges;
  for (int t = 0; t < 24; ++t) {
    for (int i = 0; i < 3; ++i) {
      ++edges[{mesh.indices(3 * t + i), mesh.indices(3 * t + (i + 1) % 3)}];
    }
  }
  EXPECT_EQ(edges.size(), 36u);
  for (const auto& [edge, triangles] : edges) EXPECT_EQ(triangles, 2);
  // The triangles of the first one are each in a face, and together have the areas of the faces.
  std::map<std::pair<int, double>, double> areas;  // by axis and position on it
  for (int t = 0; t < 12; ++t) {
    std::array<std::array<double, 3>, 3> p;
    for (int i = 0; i < 3; ++i) {
      const foxglove::Point3& at = mesh.points(static_cast<int>(mesh.indices(3 * t + i)));
      p[i] = {at.x(), at.y(), at.z()};
    }
    for (int axis = 0; axis < 3; ++axis) {
      if (p[0][axis] != p[1][axis] || p[0][axis] != p[2][axis]) continue;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      areas[{axis, p[0][axis]}] += std::abs((p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) -
                                            (p[2][u] - p[0][u]) * (p[1][v] - p[0][v])) /
                                   2;
    }
  }
  EXPECT_EQ(areas, (std::map<std::pair<int, double>, double>{{{0, -1.}, 24},
                                                             {{0, 1.}, 24},
                                                             {{1, -2.}, 12},
                                                             {{1, 2.}, 12},
                                                             {{2, -3.}, 8},
                                                             {{2, 3.}, 8}}));
  ExpectPosed(mesh.pose(), {1, 0, 0}, {0, 1, 0});
}

TEST(EntityOf, SpheresOfAListAreWhereItsPoseHasThem) {
  Marker marker = Of(Marker::SPHERE_LIST);
  marker.pose.position.z = 5;
  TurnLeft(&marker);
  marker.scale.x = 1;
  marker.scale.y = 2;
  marker.scale.z = 3;
  AddPoint(&marker, 1, 0, 0);
  AddPoint(&marker, 0, 2, 1);
  AddColor(&marker, 0, 1, 0);
  AddColor(&marker, 0, 0, 1);
  const foxglove::SceneEntity entity = Made(marker);
  ASSERT_EQ(entity.spheres_size(), 2);
  ExpectPosed(entity.spheres(0).pose(), {0, 0, 0}, {0, 1, 5});
  ExpectPosed(entity.spheres(1).pose(), {0, 0, 0}, {-2, 0, 6});
  ExpectPosed(entity.spheres(1).pose(), {1, 0, 0}, {-2, 1, 6});
  ExpectAt(entity.spheres(1).size(), 1, 2, 3);
  ExpectColor(entity.spheres(0).color(), 0, 1, 0, 1);
  ExpectColor(entity.spheres(1).color(), 0, 0, 1, 1);
}

TEST(EntityOf, TrianglesAreScaledAndHaveAColourForEachOrForEachCorner) {
  Marker marker = Of(Marker::TRIANGLE_LIST);
  marker.scale.x = 2;
  marker.scale.y = 3;
  marker.scale.z = 4;
  for (int i = 1; i <= 6; ++i) AddPoint(&marker, i, i, i);
  const foxglove::TriangleListPrimitive plain = Made(marker).triangles(0);
  ASSERT_EQ(plain.points_size(), 6);
  ExpectAt(plain.points(1), 4, 6, 8);
  EXPECT_THAT(plain.colors(), IsEmpty());
  EXPECT_THAT(plain.indices(), IsEmpty());
  AddColor(&marker, 0, 1, 0);
  AddColor(&marker, 0, 0, 1);
  const foxglove::TriangleListPrimitive faces = Made(marker).triangles(0);
  ASSERT_EQ(faces.colors_size(), 6);
  ExpectColor(faces.colors(2), 0, 1, 0, 1);
  ExpectColor(faces.colors(3), 0, 0, 1, 1);
  for (int i = 0; i < 4; ++i) AddColor(&marker, 1, 1, 1);
  const foxglove::TriangleListPrimitive corners = Made(marker).triangles(0);
  ASSERT_EQ(corners.colors_size(), 6);
  ExpectColor(corners.colors(1), 0, 0, 1, 1);
  ExpectColor(corners.colors(2), 1, 1, 1, 1);
}

TEST(EntityOf, TextIsAsHighAsScaleZAndTurnsToTheViewer) {
  Marker marker = Of(Marker::TEXT_VIEW_FACING);
  marker.text = "Grüße";
  marker.scale.z = 0.75;
  marker.pose.position.x = 2;
  const foxglove::TextPrimitive text = Made(marker).texts(0);
  EXPECT_EQ(text.text(), "Grüße");
  EXPECT_EQ(text.font_size(), 0.75);
  EXPECT_TRUE(text.billboard());
  ExpectAt(text.pose().position(), 2, 0, 0);
}

TEST(EntityOf, AMeshResourceIsAModelWhichIsNotDrawn) {
  Marker marker = Of(Marker::MESH_RESOURCE);
  marker.mesh_resource = "package://robot/arm.dae";
  const foxglove::SceneEntity entity = Made(marker);
  EXPECT_EQ(entity.models(0).url(), "package://robot/arm.dae");
  EXPECT_EQ(markers::PiecesOf(entity).left_out, "models");
}

TEST(EntityOf, LifetimesAreTaken) {
  Marker marker = Of(Marker::CUBE);
  marker.lifetime.sec = 3;
  marker.lifetime.nsec = 500;
  EXPECT_EQ(Made(marker).lifetime().seconds(), 3);
  EXPECT_EQ(Made(marker).lifetime().nanos(), 500);
}

TEST(EntityOf, AnOrientationMayBeAbsentOrRoughlyOne) {
  Marker marker = Of(Marker::CUBE);
  marker.pose.orientation.w = 0;
  ExpectPosed(Made(marker).cubes(0).pose(), {1, 2, 3}, {1, 2, 3});
  marker.pose.orientation.z = marker.pose.orientation.w = 0.7;  // 0.99 long
  ExpectPosed(Made(marker).cubes(0).pose(), {1, 0, 0}, {0, 1, 0});
}

TEST(EntityOf, SaysWhatIsWrong) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  struct Case {
    int type;
    std::function<void(Marker*)> spoil;
    const char* word;
  };
  const auto points = [](int n) {
    return [n](Marker* m) {
      for (int i = 0; i < n; ++i) AddPoint(m, i, 0, 0);
    };
  };
  const std::vector<Case> cases = {
      {Marker::CUBE, [&](Marker* m) { m->pose.position.y = kNan; }, "not finite"},
      {Marker::CUBE, [&](Marker* m) { m->pose.orientation.x = kNan; }, "not finite"},
      {Marker::CUBE, [&](Marker* m) { m->scale.z = kInf; }, "not finite"},
      {Marker::CUBE, [&](Marker* m) { m->color.b = kInf; }, "not finite"},
      {Marker::LINE_STRIP, [&](Marker* m) { AddPoint(m, 0, 0, kNan); }, "not finite"},
      {Marker::LINE_STRIP, [&](Marker* m) { AddColor(m, 0, kInf, 0); }, "not finite"},
      {Marker::CUBE, [](Marker* m) { m->pose.orientation.w = 2; }, "orientation of length 2"},
      {Marker::CUBE, [](Marker* m) { m->pose.orientation.w = 0.25; }, "orientation of length 0.25"},
      {Marker::ARROW, points(1), "1 points; an arrow has 2, or none"},
      {Marker::ARROW, points(3), "3 points; an arrow has 2, or none"},
      {Marker::LINE_LIST, points(3), "3 points, which is no multiple of 2"},
      {Marker::TRIANGLE_LIST, points(4), "4 points, which is no multiple of 3"},
      {Marker::CUBE_LIST, points(100'000), "100000 points; fewer than 100000"},
      {Marker::SPHERE_LIST, points(100'000), "100000 points; fewer than 100000"},
      {Marker::CUBE, [](Marker* m) { m->lifetime.sec = -1; }, "lifetime of -1 s"},
      {Marker::TEXT_VIEW_FACING, [](Marker* m) { m->text = "\xff"; }, "not UTF-8"},
      {Marker::MESH_RESOURCE, [](Marker* m) { m->mesh_resource = "\xc3"; }, "not UTF-8"},
      {12, [](Marker*) {}, "type 12; 0 to 11 are known"},
      {-1, [](Marker*) {}, "type -1; 0 to 11 are known"}};
  for (const Case& one : cases) {
    Marker marker = Of(one.type);
    one.spoil(&marker);
    const absl::Status status = EntityOf(marker).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << one.word;
    EXPECT_THAT(std::string(status.message()), HasSubstr(one.word));
    EXPECT_THAT(std::string(status.message()), HasSubstr("marker n/7 "));
  }
}

}  // namespace
}  // namespace voxeld::ros1
