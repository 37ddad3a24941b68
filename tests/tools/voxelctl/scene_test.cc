// Tests placement, style and packing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "client/cpp/src/encode.h"
#include "tests/daemon/pictures/files.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tools/voxelctl/scene/look.h"
#include "tools/voxelctl/scene/pack.h"
#include "tools/voxelctl/scene/placement.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {
namespace {

Model Cloud(std::vector<Point3> positions) {
  Model model;
  model.parts.push_back({.kind = Kind::kPoints, .positions = std::move(positions)});
  return model;
}

struct Extent {
  double x = 0, y = 0, z = 0, radius = 0;
};

Extent Measure(const Model& model) {
  Extent e;
  for (const Point3& p : model.parts[0].positions) {
    e = {std::max(e.x, std::abs(p.x)), std::max(e.y, std::abs(p.y)), std::max(e.z, std::abs(p.z)),
         std::max(e.radius, std::hypot(p.x, p.y))};
  }
  return e;
}

TEST(VisibleSpace, OfADefaultView) {
  // 200×100×50 voxels, [-1, 1] along x: 100 voxels a unit.
  const gpu::Affine view{{100, 0, 0, 100, 0, 100, 0, 50, 0, 0, 100, 25}};
  const absl::StatusOr<DisplaySpace> space = VisibleSpace(200, 100, 50, view, false);
  ASSERT_THAT(space, IsOk());
  EXPECT_EQ(space->center, (Point3{0, 0, 0}));
  EXPECT_EQ(space->half, (Point3{1, 0.5, 0.25}));
}

TEST(VisibleSpace, InVoxelsAndTurned) {
  const absl::StatusOr<DisplaySpace> voxels = VisibleSpace(200, 100, 50, gpu::Affine(), true);
  ASSERT_THAT(voxels, IsOk());
  EXPECT_EQ(voxels->center, (Point3{100, 50, 25}));
  EXPECT_EQ(voxels->half, (Point3{100, 50, 25}));
  EXPECT_TRUE(voxels->round);
  // A quarter turn about z, off centre: the largest cube that fits.
  const absl::StatusOr<DisplaySpace> turned =
      VisibleSpace(200, 100, 50, {{0, -10, 0, 120, 10, 0, 0, 50, 0, 0, 10, 25}}, false);
  ASSERT_THAT(turned, IsOk());
  EXPECT_NEAR(turned->half.x, 2.5, 1e-12);
  EXPECT_NEAR(turned->center.y, 2, 1e-12);  // voxel x 100 is scene y 2
  EXPECT_NEAR(turned->center.x, 0, 1e-12);
}

TEST(VisibleSpace, RefusesASingularView) {
  EXPECT_THAT(VisibleSpace(10, 10, 10, {{1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0}}, false),
              Fails(Words{"determinant 0"}));
}

TEST(Intersection, OfTwoDisplays) {
  const DisplaySpace a{{0, 0, 0}, {1, 1, 1}, false}, b{{0.5, 0, 0}, {1, 0.5, 2}, true};
  const DisplaySpace both = Intersection(a, b);
  EXPECT_EQ(both.center, (Point3{0.25, 0, 0}));
  EXPECT_EQ(both.half, (Point3{0.75, 0.5, 1}));
  EXPECT_TRUE(both.round);
  EXPECT_EQ(Intersection(a, {{9, 0, 0}, {1, 1, 1}, false}).half, a.half);
}

TEST(PlaceModels, CentresAndFillsABox) {
  Model model = Cloud({{1000, 2000, 3000}, {1010, 2002, 3001}});
  PlaceModels({&model, 1}, {.center = {5, 5, 5}, .half = {1, 0.5, 0.25}}, {});
  const Extent e = Measure(model);
  EXPECT_NEAR(e.x, 0.97, 1e-9);
  EXPECT_NEAR(e.y, 0.97 / 5, 1e-9);
  EXPECT_NEAR(e.z, 0.97 / 10, 1e-9);
}

TEST(PlaceModels, TallThingsFit) {
  Model model = Cloud({{0, 0, 0}, {1, 1, 20}});
  PlaceModels({&model, 1}, {.half = {1, 1, 0.25}}, {});
  EXPECT_NEAR(Measure(model).z, 0.97 * 0.25, 1e-9);
}

TEST(PlaceModels, SpinningAndRoundDisplaysLeaveRoomToTurn) {
  for (const bool spin : {true, false}) {
    Model model = Cloud({{-1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {1, -1, 0.1}});
    PlaceModels({&model, 1}, {.half = {1, 2, 3}, .round = !spin}, {.spin = spin});
    EXPECT_NEAR(Measure(model).radius, 0.97, 1e-9);
  }
}

TEST(PlaceModels, ExtremeUnitsAndSinglePoints) {
  for (const double unit : {1e-30, 1e30, 1e300}) {
    Model model = Cloud({{-unit, 0, 0}, {unit, 0, 0}});
    PlaceModels({&model, 1}, DisplaySpace(), {});
    EXPECT_NEAR(Measure(model).x, 0.97, 1e-6) << unit;
  }
  Model point = Cloud({{7, 8, 9}});
  PlaceModels({&point, 1}, DisplaySpace(), {});
  EXPECT_EQ(point.parts[0].positions[0], (Point3{0, 0, 0}));
}

TEST(PlaceModels, SeveralShareOneSpaceUnlessEachIsAsked) {
  for (const bool each : {false, true}) {
    Model models[2] = {Cloud({{0, 0, 0}, {1, 0, 0}}), Cloud({{3, 0, 0}, {4, 0, 0}})};
    PlaceModels(models, DisplaySpace(), {.each = each});
    EXPECT_NEAR(models[0].parts[0].positions[0].x, -0.97, 1e-9);
    EXPECT_NEAR(models[0].parts[0].positions[1].x, each ? 0.97 : -0.97 / 2, 1e-9);
    EXPECT_NEAR(models[1].parts[0].positions[1].x, 0.97, 1e-9);
  }
}

TEST(PlaceModels, ModelsOfOneSpaceHaveOneUnit) {
  for (const bool each : {false, true}) {
    Model models[3] = {Cloud({{0, 0, 0}, {1, 0, 0}}), Cloud({{0, 0, 0}, {100, 0, 0}}),
                       Cloud({{0, 0, 0}, {4, 0, 0}})};
    models[0].path = "metres.glb";
    models[0].unit = 1;
    models[1].unit = 0.01;
    PlaceModels(models, DisplaySpace(), {.each = each});
    const auto width = [&](size_t i) {
      return models[i].parts[0].positions[1].x - models[i].parts[0].positions[0].x;
    };
    EXPECT_NEAR(width(1), width(0), 1e-9) << "100 cm are 1 m";
    EXPECT_NEAR(width(2), each ? width(0) : 4 * width(0), 1e-9);
    EXPECT_EQ(models[0].note, "");
    EXPECT_EQ(models[1].note, "");
    EXPECT_EQ(models[2].note, each ? ""
                                   : "its unit of length is not known; it is shown as if it had "
                                     "metres, as metres.glb");
  }
}

TEST(PlaceModels, AGlobeKeepsItsCentreAndHoldsMeshesInside) {
  Model models[2] = {Cloud({{0, 0, 1}, {0.5, 0, 0}}), Cloud({{10, 10, 10}, {30, 20, 20}})};
  models[0].globe = true;
  PlaceModels(models, {.half = {1, 1, 0.5}}, {});
  EXPECT_NEAR(models[0].parts[0].positions[0].z, 0.97 * 0.5, 1e-9);
  EXPECT_NEAR(models[0].parts[0].positions[1].x, 0.97 * 0.25, 1e-9);
  for (const Point3& p : models[1].parts[0].positions)
    EXPECT_LT(std::hypot(p.x, p.y, p.z), 0.97 * 0.5);
}

TEST(InstanceTransform, TurnsCounterClockwiseAboutTheMiddle) {
  const gpu::Affine quarter = InstanceTransform({.center = {1, 2, 3}}, 0.25);
  const gpu::Point3d p = gpu::Map(quarter, 1, 0, 5);
  EXPECT_NEAR(p.x, 1, 1e-12);
  EXPECT_NEAR(p.y, 3, 1e-12);
  EXPECT_NEAR(p.z, 8, 1e-12);
}

Model Triangle(Point3 normal) {
  Model model;
  model.parts.push_back({.kind = Kind::kTriangles,
                         .positions = {{0, 0, 0}, {1, 0, 0}, {0, 0, 1}, {1, 0, 1}},
                         .normals = std::vector<Point3>(4, normal),
                         .colors = {},
                         .indices = {0, 1, 2, 1, 3, 2}});
  return model;
}

TEST(ApplyLook, ShadesByTheNormalUnlessFlat) {
  Model to_light = Triangle({-0.3651, -0.6390, 0.6770}), away = Triangle({0.3651, 0.6390, -0.6770}),
        flat = Triangle({0.3651, 0.6390, -0.6770});
  for (Model* model : {&to_light, &away, &flat}) model->parts[0].colors.assign(4, {200, 100, 60});
  ApplyLook({&to_light, 1}, {});
  ApplyLook({&away, 1}, {});
  ApplyLook({&flat, 1}, {.flat = true});
  EXPECT_EQ(to_light.parts[0].colors[0], (Rgb{200, 100, 60}));
  EXPECT_EQ(away.parts[0].colors[0], (Rgb{60, 30, 18}));
  EXPECT_EQ(flat.parts[0].colors[0], (Rgb{200, 100, 60}));
}

TEST(ApplyLook, ScansKeepTheirLight) {
  Model scan = Triangle({0.3651, 0.6390, -0.6770});
  scan.lit_already = true;
  scan.parts[0].colors.assign(4, {200, 100, 60});
  ApplyLook({&scan, 1}, {});
  EXPECT_EQ(scan.parts[0].colors[0], (Rgb{200, 100, 60}));
}

TEST(ApplyLook, DefaultsDifferByModelAndBlackIsLifted) {
  Model models[3] = {Triangle({}), Triangle({}), Triangle({})};
  models[2].parts[0].colors.assign(4, {0, 0, 0});
  ApplyLook(models, {});
  EXPECT_NE(models[0].parts[0].colors[0], models[1].parts[0].colors[0]);
  const Rgb lifted = models[2].parts[0].colors[0];
  EXPECT_GT(lifted.r, 20);
}

TEST(ApplyLook, Fills) {
  Model lines = Triangle({}), dots = Triangle({});
  ApplyLook({&lines, 1}, {.fill = FillStyle::kLines});
  EXPECT_EQ(lines.parts[0].kind, Kind::kSegments);
  EXPECT_EQ(lines.parts[0].indices.size(), 10u);  // five edges: the shared one once
  ApplyLook({&dots, 1}, {.fill = FillStyle::kDots});
  EXPECT_EQ(dots.parts[0].kind, Kind::kPoints);
  EXPECT_TRUE(dots.parts[0].indices.empty());
}

// ---------------------------------------------------------------------------------- packing

// Triangles as multisets of corners, taken from the messages.
using Corner = std::tuple<float, float, float, int>;
using Triangles = std::multiset<std::array<Corner, 3>>;

Corner CornerAt(const v1::Vertices& vertices, uint32_t index) {
  float xyz[3];
  std::memcpy(xyz, vertices.positions().data() + index * 12, 12);
  return {xyz[0], xyz[1], xyz[2], static_cast<uint8_t>(vertices.colors()[index * 3])};
}

// A strip of `count` triangles, so that neighbours share vertices.
Model Strip(uint32_t count) {
  Model model;
  Part part;
  for (uint32_t i = 0; i < count + 2; ++i) {
    part.positions.push_back({static_cast<double>(i), static_cast<double>(i % 2), 0});
    part.colors.push_back({static_cast<uint8_t>(i), 1, 2});
  }
  for (uint32_t i = 0; i < count; ++i) part.indices.insert(part.indices.end(), {i, i + 1, i + 2});
  model.parts.push_back(std::move(part));
  return model;
}

struct Packed {
  absl::StatusOr<PackedSizes> sizes;
  std::vector<v1::StreamRequest> requests;
};

Packed Pack(const Model& model, const client::Limits& limits) {
  Packed packed{absl::UnknownError("not run"), {}};
  packed.sizes =
      PackObject(model, "thing", limits,
                 [&](const std::string& object, const std::vector<client::Part>& parts, uint64_t) {
                   const absl::StatusOr<client::DefineOperation> define =
                       client::EncodeDefinition(object, parts);
                   EXPECT_THAT(define, IsOk());
                   EXPECT_TRUE(packed.requests.emplace_back().ParseFromString(
                       client::EncodeOperation(*define).Flat()));
                   return absl::OkStatus();
                 });
  return packed;
}

struct LimitsCase {
  uint64_t message_bytes, vertices, indices;
};

class PackWithin : public testing::TestWithParam<LimitsCase> {};

TEST_P(PackWithin, LimitsLosesNothing) {
  client::Limits limits;
  limits.max_message_bytes = GetParam().message_bytes;
  limits.max_vertices_per_entity = GetParam().vertices;
  limits.max_indices_per_entity = GetParam().indices;
  const Model model = Strip(100000);
  const Packed packed = Pack(model, limits);
  ASSERT_THAT(packed.sizes, IsOk());
  EXPECT_EQ(packed.sizes->objects, packed.requests.size());
  EXPECT_EQ(packed.sizes->indices, 300000u);

  Triangles expected, got;
  const Part& part = model.parts[0];
  for (size_t i = 0; i < part.indices.size(); i += 3) {
    std::array<Corner, 3> triangle;
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t v = part.indices[i + c];
      triangle[c] = {static_cast<float>(part.positions[v].x),
                     static_cast<float>(part.positions[v].y), 0.0f, part.colors[v].r};
    }
    expected.insert(triangle);
  }
  std::set<std::string> defined;
  for (size_t r = 0; r + 1 < packed.requests.size(); ++r) {
    const v1::StreamRequest& request = packed.requests[r];
    EXPECT_LE(request.ByteSizeLong(),
              std::min<uint64_t>(
                  1 << 20, GetParam().message_bytes == 0 ? UINT64_MAX : GetParam().message_bytes));
    defined.insert(request.define_object().object());
    ASSERT_EQ(request.define_object().definition().parts_size(), 1);
    const v1::Vertices& vertices =
        request.define_object().definition().parts(0).primitive().mesh().vertices();
    if (GetParam().vertices != 0) {
      EXPECT_LE(vertices.count(), GetParam().vertices);
    }
    if (GetParam().indices != 0) {
      EXPECT_LE(vertices.index_count(), GetParam().indices);
    }
    EXPECT_EQ(vertices.positions().size(), vertices.count() * 12u);
    EXPECT_EQ(vertices.colors().size(), vertices.count() * 3u);
    ASSERT_EQ(vertices.index_type(), v1::ELEMENT_TYPE_U16);
    ASSERT_EQ(vertices.indices().size(), vertices.index_count() * 2u);
    for (uint32_t i = 0; i < vertices.index_count(); i += 3) {
      std::array<Corner, 3> triangle;
      for (uint32_t c = 0; c < 3; ++c) {
        uint16_t index = 0;
        std::memcpy(&index, vertices.indices().data() + (i + c) * 2, 2);
        ASSERT_LT(index, vertices.count());
        triangle[c] = CornerAt(vertices, index);
      }
      got.insert(triangle);
    }
  }
  EXPECT_TRUE(got == expected);
  const v1::DefineObject& root = packed.requests.back().define_object();
  EXPECT_EQ(root.object(), "thing");
  EXPECT_EQ(static_cast<size_t>(root.definition().parts_size()), defined.size());
  for (const v1::Object::Part& child : root.definition().parts())
    EXPECT_TRUE(defined.contains(child.primitive().instance().object()));
}

INSTANTIATE_TEST_SUITE_P(Cases, PackWithin,
                         testing::Values(LimitsCase{0, 0, 0}, LimitsCase{4 << 20, 1 << 20, 1 << 20},
                                         LimitsCase{20000, 0, 0}, LimitsCase{0, 1000, 0},
                                         LimitsCase{0, 0, 999}));

TEST(PackObject, KindsGoIntoPiecesOfTheirOwn) {
  Model model = Strip(3);
  model.parts.push_back({.kind = Kind::kPoints,
                         .positions = {{1, 2, 3}},
                         .normals = {},
                         .colors = {{1, 1, 1}},
                         .indices = {}});
  model.parts.push_back({.kind = Kind::kSegments,
                         .positions = {{1, 2, 3}, {4, 5, 6}},
                         .normals = {},
                         .colors = {{1, 1, 1}, {2, 2, 2}},
                         .indices = {0, 1}});
  model.parts.push_back({.kind = Kind::kPoints,
                         .positions = {{7, 8, 9}},
                         .normals = {},
                         .colors = {{1, 1, 1}},
                         .indices = {}});
  const Packed packed = Pack(model, {});
  ASSERT_THAT(packed.sizes, IsOk());
  ASSERT_EQ(packed.requests.size(), 4u);
  EXPECT_TRUE(packed.requests[0].define_object().definition().parts(0).primitive().has_mesh());
  EXPECT_EQ(packed.requests[1]
                .define_object()
                .definition()
                .parts(0)
                .primitive()
                .segments()
                .vertices()
                .index_count(),
            2u);
  EXPECT_EQ(packed.requests[2]
                .define_object()
                .definition()
                .parts(0)
                .primitive()
                .points()
                .vertices()
                .count(),
            2u);
}

// `triangles` without a picture, and as many on the second of two pictures.
Model HalfTextured(const std::string& picture, size_t triangles) {
  Model model = Strip(triangles);
  model.pictures = {"another", picture};
  Part textured = model.parts[0];
  textured.picture = 1;
  for (size_t v = 0; v < textured.positions.size(); ++v)
    textured.texture_coordinates.push_back({static_cast<float>(v), 0.25f});
  model.parts.push_back(std::move(textured));
  return model;
}

TEST(PackObject, APictureGoesWithEachPieceOfItsPart) {
  const std::string picture = pictures::PngOf(2, 1, {0xff0000, 0x00ff00});
  for (const uint64_t message : {uint64_t{0}, uint64_t{64} << 10}) {
    client::Limits limits;
    limits.max_message_bytes = message;
    const Packed packed = Pack(HalfTextured(picture, 5000), limits);
    ASSERT_THAT(packed.sizes, IsOk());
    uint64_t textured = 0, plain = 0;
    for (const v1::StreamRequest& request : packed.requests) {
      if (message > 0) {
        EXPECT_LE(request.ByteSizeLong(), message);
      }
      if (!request.define_object().definition().parts(0).primitive().has_mesh()) continue;
      const v1::Mesh& mesh = request.define_object().definition().parts(0).primitive().mesh();
      if (!mesh.has_texture()) {
        plain += mesh.vertices().index_count() / 3;
        continue;
      }
      textured += mesh.vertices().index_count() / 3;
      EXPECT_EQ(mesh.texture().picture(), picture);
      ASSERT_EQ(mesh.texture().coordinates().size(), mesh.vertices().count() * 8u);
      for (uint32_t v = 0; v < mesh.vertices().count(); ++v) {
        float place[2], position[3];
        std::memcpy(place, mesh.texture().coordinates().data() + v * 8, 8);
        std::memcpy(position, mesh.vertices().positions().data() + v * 12, 12);
        EXPECT_EQ(place[1], 0.25f);
        EXPECT_EQ(place[0], position[0]) << v;  // as placed by HalfTextured
      }
    }
    EXPECT_EQ(textured, 5000u);
    EXPECT_EQ(plain, 5000u);
    EXPECT_EQ(packed.sizes->note, "");
  }
}

TEST(PackObject, APictureThatIsNotSentColoursTheVertices) {
  // Points have no pictures, and the second is larger than a message.
  const std::string picture = pictures::PngOf(2, 1, {0xff8000, 0x00ff00});
  Model points{.path = "p"};
  points.pictures = {picture};
  points.parts.push_back({.kind = Kind::kPoints,
                          .positions = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}},
                          .colors = {{255, 255, 255}, {255, 255, 255}, {100, 100, 100}},
                          .texture_coordinates = {{0.1f, 0}, {-0.1f, 7}, {2.2f, 0.5f}},
                          .picture = 0});
  const Packed packed = Pack(points, {});
  ASSERT_THAT(packed.sizes, IsOk());
  EXPECT_THAT(packed.sizes->note, testing::HasSubstr("at the vertices alone"));
  EXPECT_EQ(packed.requests[0]
                .define_object()
                .definition()
                .parts(0)
                .primitive()
                .points()
                .vertices()
                .colors(),
            std::string("\xff\x80\x00\x00\xff\x00\x64\x32\x00", 9));
}

TEST(PackObject, APictureThatCannotBeReadIsSaid) {
  const Packed packed = Pack(HalfTextured("GIF89a", 2), {});
  ASSERT_THAT(packed.sizes, IsOk());
  EXPECT_THAT(packed.sizes->note, testing::HasSubstr("a picture of it"));
}

TEST(PackObject, SaysWhatIsTooSmall) {
  client::Limits limits;
  limits.max_parts_per_object = 2;
  limits.max_vertices_per_entity = 100;
  EXPECT_THAT(Pack(Strip(1000), limits).sizes,
              Fails(Words{"over 2 pieces", "max_parts_per_object"}));
  limits.max_vertices_per_entity = 2;
  EXPECT_THAT(Pack(Strip(1), limits).sizes, Fails(Words{"no room"}));
}

TEST(PackObject, StopsWhereTheSinkFails) {
  int calls = 0;
  const auto result = PackObject(
      Strip(10), "thing", {}, [&](const std::string&, const std::vector<client::Part>&, uint64_t) {
        ++calls;
        return absl::UnavailableError("gone");
      });
  EXPECT_THAT(result, Fails(Words{"gone"}));
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace voxeld::voxelctl
