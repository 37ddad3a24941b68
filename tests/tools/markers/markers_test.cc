#include "tools/markers/markers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "common/json/json_depth.h"
#include "tools/markers/foxglove_client.h"
#include "tools/markers/marker_scene.h"

namespace voxeld::markers {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

void Set(foxglove::Vector3* to, double x, double y, double z) {
  to->set_x(x);
  to->set_y(y);
  to->set_z(z);
}

void Set(foxglove::Color* to, double r, double g, double b, double a = 1) {
  to->set_r(r);
  to->set_g(g);
  to->set_b(b);
  to->set_a(a);
}

client::Vec3 Apply(const client::Affine& a, double x, double y, double z) {
  const auto row = [&](size_t i) {
    return a.m[i] * x + a.m[i + 1] * y + a.m[i + 2] * z + a.m[i + 3];
  };
  return {row(0), row(4), row(8)};
}

void ExpectNear(const client::Vec3& is, double x, double y, double z) {
  EXPECT_NEAR(is.x, x, 1e-12);
  EXPECT_NEAR(is.y, y, 1e-12);
  EXPECT_NEAR(is.z, z, 1e-12);
}

TEST(Markers, PosesTurnAndThenMove) {
  foxglove::SceneEntity entity;
  foxglove::CubePrimitive* cube = entity.add_cubes();
  Set(cube->mutable_pose()->mutable_position(), 1, 2, 3);
  // A quarter turn about z, given by a quaternion that is twice as long as it should be.
  cube->mutable_pose()->mutable_orientation()->set_z(2 * std::sqrt(0.5));
  cube->mutable_pose()->mutable_orientation()->set_w(2 * std::sqrt(0.5));
  Set(cube->mutable_size(), 4, 5, 6);
  Set(cube->mutable_color(), 1, 0.5, 0, 0.5);
  const Pieces made = PiecesOf(entity);
  ASSERT_EQ(made.pieces.size(), 1u);
  const auto& box = std::get<client::Box>(made.pieces[0].shape);
  EXPECT_EQ(box.size.y, 5);
  const client::Look& look = made.pieces[0].look;
  ExpectNear(Apply(look.transform, 1, 0, 0), 1, 3, 3);
  ExpectNear(Apply(look.transform, 0, 1, 0), 0, 2, 3);
  EXPECT_EQ(look.color.r, 128);
  EXPECT_EQ(look.color.g, 64);
  EXPECT_EQ(look.color.b, 0);
}

TEST(Markers, APoseThatIsNotSaidIsNone) {
  foxglove::SceneEntity entity;
  Set(entity.add_spheres()->mutable_size(), 2, 2, 2);
  const Pieces made = PiecesOf(entity);
  ASSERT_EQ(made.pieces.size(), 1u);
  EXPECT_EQ(made.pieces[0].look.transform, client::Affine());
  EXPECT_EQ(std::get<client::Sphere>(made.pieces[0].shape).radius, 1);
}

TEST(Markers, EachKindIsItsShape) {
  foxglove::SceneEntity entity;
  foxglove::ArrowPrimitive* arrow = entity.add_arrows();
  arrow->set_shaft_length(3);
  arrow->set_shaft_diameter(0.5);
  arrow->set_head_length(1);
  arrow->set_head_diameter(2);
  Set(entity.add_spheres()->mutable_size(), 2, 4, 6);
  foxglove::CylinderPrimitive* cylinder = entity.add_cylinders();
  Set(cylinder->mutable_size(), 2, 4, 8);
  cylinder->set_bottom_scale(1);
  cylinder->set_top_scale(0.5);
  foxglove::LinePrimitive* line = entity.add_lines();
  line->set_type(foxglove::LinePrimitive::LINE_LOOP);
  line->set_thickness(0.25);
  for (int i = 0; i < 3; ++i) {
    line->add_points()->set_x(i);
    Set(line->add_colors(), i == 0, i == 1, i == 2);
  }
  foxglove::TriangleListPrimitive* triangles = entity.add_triangles();
  for (int i = 0; i < 4; ++i) triangles->add_points()->set_y(i);
  for (const uint32_t index : {0u, 1u, 2u, 1u, 2u, 3u}) triangles->add_indices(index);
  Set(triangles->add_colors(), 1, 1, 1);  // one for four: not one each
  foxglove::TextPrimitive* text = entity.add_texts();
  text->set_text("hello");
  text->set_font_size(0.75);
  text->set_billboard(true);
  Set(text->mutable_pose()->mutable_position(), 1, 0, 0);
  entity.mutable_lifetime()->set_seconds(2);
  entity.mutable_lifetime()->set_nanos(5);

  const Pieces made = PiecesOf(entity);
  ASSERT_EQ(made.pieces.size(), 6u);
  EXPECT_EQ(made.left_out, "colors that are not as many as their points") << "of the triangles";
  for (const Piece& piece : made.pieces) EXPECT_EQ(piece.look.lifetime.count(), 2'000'000'005);
  const auto& drawn_arrow = std::get<client::Arrow>(made.pieces[0].shape);
  EXPECT_EQ(drawn_arrow.end.x, 4);
  EXPECT_EQ(drawn_arrow.shaft_radius, 0.25);
  EXPECT_EQ(drawn_arrow.head_length, 1);
  EXPECT_EQ(drawn_arrow.head_radius, 1);
  EXPECT_EQ(std::get<client::Ellipsoid>(made.pieces[1].shape).radii.z, 3);
  const auto& cone = std::get<client::Cone>(made.pieces[2].shape);
  EXPECT_EQ(cone.start_radius, 0.5);
  EXPECT_EQ(cone.end_radius, 0.25);
  ExpectNear(Apply(made.pieces[2].look.transform, 0.5, 0.5, 0.5), 1, 2, 4);
  const auto& segments = std::get<client::Segments>(made.pieces[3].shape);
  EXPECT_EQ(segments.topology, client::Segments::Topology::kLoop);
  EXPECT_THAT(segments.vertices.positions.view(), ElementsAre(0, 0, 0, 1, 0, 0, 2, 0, 0));
  EXPECT_THAT(segments.vertices.colors.view(), ElementsAre(255, 0, 0, 0, 255, 0, 0, 0, 255));
  EXPECT_EQ(segments.thickness.value, 0.25f);
  EXPECT_EQ(segments.thickness.unit, client::Thickness::Unit::kUnits);
  const auto& mesh = std::get<client::Mesh>(made.pieces[4].shape);
  EXPECT_THAT(mesh.vertices.indices.view(), ElementsAre(0, 1, 2, 1, 2, 3));
  EXPECT_THAT(mesh.vertices.colors.view(), IsEmpty());
  const auto& words = std::get<client::Text>(made.pieces[5].shape);
  EXPECT_EQ(words.text, "hello");
  EXPECT_EQ(words.height, 0.75);
  ExpectNear(Apply(made.pieces[5].look.transform, 0, 0, 0), 1, 0, 0);
}

TEST(Markers, WhatIsEmptyIsNoPieceAndModelsAreTold) {
  foxglove::SceneEntity entity;
  entity.add_arrows();
  entity.add_cylinders();
  entity.add_lines();
  entity.add_triangles();
  entity.add_texts();
  entity.add_models()->set_url("a.glb");
  const Pieces made = PiecesOf(entity);
  EXPECT_THAT(made.pieces, IsEmpty());
  EXPECT_EQ(made.left_out, "models");
}

TEST(Markers, ColoursOfAWrongCountAreTold) {
  const auto colored = [](int points, int colors) {
    foxglove::SceneEntity entity;
    foxglove::LinePrimitive* line = entity.add_lines();
    for (int i = 0; i < points; ++i) line->add_points()->set_x(i);
    for (int i = 0; i < colors; ++i) line->add_colors()->set_r(1);
    line->mutable_color()->set_g(1);
    line->mutable_color()->set_a(1);
    return PiecesOf(entity);
  };
  for (const int colors : {1, 2, 4}) {
    const Pieces made = colored(3, colors);
    EXPECT_EQ(made.left_out, "colors that are not as many as their points") << colors;
    ASSERT_EQ(made.pieces.size(), 1u);
    const auto& segments = std::get<client::Segments>(made.pieces[0].shape);
    EXPECT_THAT(segments.vertices.colors.view(), IsEmpty());
    EXPECT_EQ(made.pieces[0].look.color.g, 255) << "one for all";
    EXPECT_EQ(made.pieces[0].look.color.r, 0);
  }
  EXPECT_EQ(colored(3, 3).left_out, "");
  EXPECT_EQ(colored(3, 0).left_out, "");
}

TEST(Markers, ColoursBeyondTheirRangeAreItsEnds) {
  foxglove::SceneEntity entity;
  foxglove::CubePrimitive* cube = entity.add_cubes();
  Set(cube->mutable_color(), 7, -1, std::numeric_limits<double>::quiet_NaN());
  const Pieces made = PiecesOf(entity);
  EXPECT_EQ(made.pieces[0].look.color.r, 255);
  EXPECT_EQ(made.pieces[0].look.color.g, 0);
  EXPECT_EQ(made.pieces[0].look.color.b, 0);
}

TEST(ParseSceneUpdate, ReadsProtobufAndWords) {
  foxglove::SceneUpdate update;
  update.add_entities()->set_id("a");
  const auto bytes = ParseSceneUpdate(update.SerializeAsString(), Encoding::kProtobuf);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  EXPECT_EQ(bytes->entities(0).id(), "a");
  const auto words = ParseSceneUpdate(
      R"({"entities":[{"id":"b","timestamp":{"sec":1700000000,"nsec":7},"lifetime":{"sec":3,"nsec":500000000},
          "lines":[{"type":2,"points":[{"x":1,"y":2,"z":3}]}],"unknown":1}],
          "deletions":[{"type":1,"timestamp":{"sec":1,"nsec":0}}]})",
      Encoding::kJson);
  ASSERT_TRUE(words.ok()) << words.status();
  EXPECT_EQ(words->entities(0).timestamp().seconds(), 1'700'000'000);
  EXPECT_EQ(words->entities(0).timestamp().nanos(), 7);
  EXPECT_EQ(words->entities(0).lifetime().seconds(), 3);
  EXPECT_EQ(words->entities(0).lifetime().nanos(), 500'000'000);
  EXPECT_EQ(words->entities(0).lines(0).type(), foxglove::LinePrimitive::LINE_LIST);
  EXPECT_EQ(words->deletions(0).type(), foxglove::SceneEntityDeletion::ALL);
}

TEST(ParseSceneUpdate, RefusesWhatIsNone) {
  EXPECT_TRUE(
      absl::IsInvalidArgument(ParseSceneUpdate("\x0A\xFF\xFF", Encoding::kProtobuf).status()));
  for (const char* text :
       {"", "{", "[1]", "7", R"({"entities":"x"})", R"({"entities":[{"id":{}}]})"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseSceneUpdate(text, Encoding::kJson).status())) << text;
  }
}

TEST(FoxgloveUrl, HasHostPortAndPath) {
  const auto whole = ParseFoxgloveUrl("ws://[::1]:80/a/b");
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_EQ(whole->host, "::1");
  EXPECT_EQ(whole->port, "80");
  EXPECT_EQ(whole->path, "/a/b");
  const auto plain = ParseFoxgloveUrl("ws://robot");
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(plain->host, "robot");
  EXPECT_EQ(plain->port, "8765");
  EXPECT_EQ(plain->path, "/");
  EXPECT_EQ(ParseFoxgloveUrl("ws://[::1]")->host, "::1");
  for (const char* text : {"", "robot", "http://robot", "ws://", "ws://:80", "ws://a:0",
                           "ws://a:99999", "ws://[::1"}) {
    EXPECT_THAT(ParseFoxgloveUrl(text).status().message(), HasSubstr("ws://localhost:8765"))
        << text;
  }
}

foxglove::SceneUpdate Cubes(std::initializer_list<std::pair<const char*, int>> entities) {
  foxglove::SceneUpdate update;
  for (const auto& [id, cubes] : entities) {
    foxglove::SceneEntity* entity = update.add_entities();
    entity->set_id(id);
    for (int i = 0; i < cubes; ++i) entity->add_cubes();
  }
  return update;
}

std::vector<std::string> Ids(const MarkerScene::Changes& changes) {
  std::vector<std::string> ids;
  for (const auto& [id, piece] : changes.put) ids.push_back(id);
  return ids;
}

TEST(MarkerScene, PutsPiecesAndRemovesThoseThatAreNoMore) {
  MarkerScene scene;
  EXPECT_THAT(Ids(scene.Apply("/t", Cubes({{"a", 3}, {"b", 1}}), 0)),
              ElementsAre("/t a#0", "/t a#1", "/t a#2", "/t b#0"));
  const auto fewer = scene.Apply("/t", Cubes({{"a", 1}}), 0);
  EXPECT_THAT(Ids(fewer), ElementsAre("/t a#0"));
  EXPECT_THAT(fewer.remove, ElementsAre("/t a#1", "/t a#2"));
  EXPECT_EQ(scene.tally().entities, 3u);
}

TEST(MarkerScene, DeletionsAreOfTheirTopicAndOfWhatWasBefore) {
  MarkerScene scene;
  scene.Apply("/s", Cubes({{"a", 1}}), 0);
  scene.Apply("/t", Cubes({{"a", 1}, {"b", 1}}), 0);
  foxglove::SceneUpdate update = Cubes({{"a", 1}});
  update.add_deletions()->set_id("b");
  update.add_deletions()->set_id("nobody");
  const auto one = scene.Apply("/t", update, 0);
  EXPECT_THAT(one.remove, ElementsAre("/t b#0"));
  EXPECT_THAT(Ids(one), ElementsAre("/t a#0"));
  foxglove::SceneUpdate all = Cubes({{"c", 1}});
  all.add_deletions()->set_type(foxglove::SceneEntityDeletion::ALL);
  const auto anew = scene.Apply("/t", all, 0);
  EXPECT_THAT(anew.remove, ElementsAre("/t a#0"));
  EXPECT_THAT(Ids(anew), ElementsAre("/t c#0"));
  EXPECT_THAT(scene.Apply("/s", Cubes({}), 0).remove, IsEmpty());
}

TEST(MarkerScene, ForgetsWhatHasHadItsTimeAndWhatIsEmpty) {
  MarkerScene scene;
  foxglove::SceneUpdate update = Cubes({{"a", 1}, {"b", 1}, {"empty", 0}});
  update.mutable_entities(0)->mutable_lifetime()->set_seconds(2);
  scene.Apply("/t", update, 10);
  EXPECT_EQ(scene.size(), 2u);
  scene.Apply("/t", Cubes({}), 10 + 2 * sync::kSecond - 1);
  EXPECT_EQ(scene.size(), 2u);
  scene.Apply("/t", Cubes({}), 10 + 2 * sync::kSecond);
  EXPECT_EQ(scene.size(), 1u);
  for (int i = 0; i < 3; ++i) scene.Apply("/t", Cubes({{"empty", 0}}), 0);
  EXPECT_EQ(scene.size(), 1u);
}

TEST(ParseSceneUpdate, HasItsLimits) {
  foxglove::SceneUpdate update;
  foxglove::SceneEntity* entity = update.add_entities();
  for (int i = 0; i < kMostPieces; ++i) entity->add_cubes();
  EXPECT_THAT(ParseSceneUpdate(update.SerializeAsString(), Encoding::kProtobuf).status().message(),
              HasSubstr("100001 entities and pieces"));
  entity->mutable_cubes()->RemoveLast();
  EXPECT_TRUE(ParseSceneUpdate(update.SerializeAsString(), Encoding::kProtobuf).ok());
  const auto deep = [](int depth) {
    return "{\"x\":" + std::string(static_cast<size_t>(depth - 1), '[') +
           std::string(static_cast<size_t>(depth - 1), ']') + "}";
  };
  EXPECT_TRUE(ParseSceneUpdate(deep(kMaxJsonDepth), Encoding::kJson).ok());
  EXPECT_THAT(ParseSceneUpdate(deep(1'000'000), Encoding::kJson).status().message(),
              HasSubstr("1000000 deep"));
  EXPECT_TRUE(ParseSceneUpdate(R"({"x":"[[[[\"[[["})", Encoding::kJson).ok());
}

TEST(Markers, TimesThatNoClockHasAreTheMost) {
  foxglove::SceneEntity entity;
  entity.add_cubes();
  entity.mutable_lifetime()->set_seconds(std::numeric_limits<int64_t>::max());
  entity.mutable_lifetime()->set_nanos(-1);
  EXPECT_EQ(PiecesOf(entity).pieces[0].look.lifetime, std::chrono::seconds(int64_t{1} << 32));
}

}  // namespace
}  // namespace voxeld::markers
