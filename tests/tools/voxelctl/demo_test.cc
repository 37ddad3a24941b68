// Tests the contents of the demo's scenes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/demo/clock_scene.h"
#include "tools/voxelctl/demo/data_files.h"
#include "tools/voxelctl/demo/earthquakes.h"
#include "tools/voxelctl/demo/galaxy.h"
#include "tools/voxelctl/demo/gyroid_scene.h"
#include "tools/voxelctl/demo/life.h"
#include "tools/voxelctl/demo/model_scenes.h"
#include "tools/voxelctl/demo/motion.h"
#include "tools/voxelctl/demo/scene.h"
#include "tools/voxelctl/demo/scene_names.h"

namespace voxeld::voxelctl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

struct Cell {
  int x, y, z;
  bool operator==(const Cell&) const = default;
};

std::vector<Cell> CellsOf(const Life& life, uint8_t state) {
  std::vector<Cell> cells;
  for (int z = 0; z < life.side(); ++z) {
    for (int y = 0; y < life.side(); ++y) {
      for (int x = 0; x < life.side(); ++x) {
        if (life.At(x, y, z) == state) cells.push_back({x, y, z});
      }
    }
  }
  return cells;
}

Life WithLiving(int side, const std::vector<Cell>& cells) {
  Life life(side);
  for (const Cell& cell : cells) life.Set(cell.x, cell.y, cell.z, Life::kAlive);
  return life;
}

// Each cell of the square has 3 around it, too few to stay; the places above and below it have 4,
// those beside it 2 at most.
TEST(LifeRule, ASquareBecomesTwoThatLeaveIt) {
  Life life = WithLiving(12, {{5, 5, 5}, {6, 5, 5}, {5, 6, 5}, {6, 6, 5}});
  life.Step();
  EXPECT_THAT(CellsOf(life, Life::kAlive),
              UnorderedElementsAre(Cell{5, 5, 4}, Cell{6, 5, 4}, Cell{5, 6, 4}, Cell{6, 6, 4},
                                   Cell{5, 5, 6}, Cell{6, 5, 6}, Cell{5, 6, 6}, Cell{6, 6, 6}));
  EXPECT_EQ(CellsOf(life, 3).size(), 4u) << "the square fades";
  life.Step();
  // They continue to both sides; and beside the fading square, two of each new one are around a
  // place, which makes four.
  EXPECT_THAT(CellsOf(life, Life::kAlive),
              UnorderedElementsAre(Cell{5, 5, 3}, Cell{6, 5, 3}, Cell{5, 6, 3}, Cell{6, 6, 3},
                                   Cell{5, 5, 7}, Cell{6, 5, 7}, Cell{5, 6, 7}, Cell{6, 6, 7},
                                   Cell{4, 5, 5}, Cell{4, 6, 5}, Cell{7, 5, 5}, Cell{7, 6, 5},
                                   Cell{5, 4, 5}, Cell{6, 4, 5}, Cell{5, 7, 5}, Cell{6, 7, 5}));
}

TEST(LifeRule, ASquareWithOneThatFadesBehindItGoesAheadForEver) {
  Life life = WithLiving(12, {{5, 5, 5}, {6, 5, 5}, {5, 6, 5}, {6, 6, 5}});
  for (const Cell& cell : CellsOf(life, Life::kAlive)) life.Set(cell.x, cell.y, 4, 3);
  for (int i = 1; i <= 5; ++i) {
    life.Step();
    const int z = 5 + i;
    EXPECT_THAT(CellsOf(life, Life::kAlive),
                UnorderedElementsAre(Cell{5, 5, z}, Cell{6, 5, z}, Cell{5, 6, z}, Cell{6, 6, z}));
  }
}

// The middle of a plus has 4 around it and stays; each arm has the middle and, diagonally, two
// other arms.
TEST(LifeRule, AMiddleWithFourStaysAndItsArmsFade) {
  Life life = WithLiving(12, {{5, 5, 5}, {4, 5, 5}, {6, 5, 5}, {5, 4, 5}, {5, 6, 5}});
  life.Step();
  EXPECT_EQ(life.At(5, 5, 5), Life::kAlive);
  for (const Cell& arm : {Cell{4, 5, 5}, Cell{6, 5, 5}, Cell{5, 4, 5}, Cell{5, 6, 5}})
    EXPECT_EQ(life.At(arm.x, arm.y, arm.z), 3);
  EXPECT_EQ(life.At(5, 5, 6), Life::kEmpty) << "all 5 of the plus are around it";
  EXPECT_EQ(life.At(4, 4, 6), Life::kEmpty) << "the middle and two arms";
  EXPECT_EQ(life.At(4, 5, 6), Life::kAlive) << "the middle, an arm below, and two across corners";
}

TEST(LifeRule, OneAloneFadesInThreeStepsAndTheEndsOfTheCubeMeet) {
  Life life = WithLiving(8, {{0, 0, 0}});
  for (const uint8_t state : {3, 2, 1, 0}) {
    life.Step();
    EXPECT_EQ(life.At(0, 0, 0), state);
  }
  Life across = WithLiving(8, {{0, 0, 0}, {7, 0, 0}, {0, 7, 0}, {7, 7, 0}});
  across.Step();
  EXPECT_EQ(across.At(0, 0, 7), Life::kAlive) << "a square over the corner";
  EXPECT_EQ(across.At(7, 7, 1), Life::kAlive);
  EXPECT_EQ(across.living(), 8u);
}

TEST(LifeSeed, SowsTheSameForTheSameSeedAndMirrored) {
  Life a(16), b(16), c(16);
  a.Sow(7);
  b.Sow(7);
  c.Sow(8);
  EXPECT_TRUE(std::ranges::equal(a.cells(), b.cells()));
  EXPECT_FALSE(std::ranges::equal(a.cells(), c.cells()));
  EXPECT_GT(a.living(), 20u);
  for (int i = 0; i < 6; ++i) a.Step();
  for (const Cell& cell : CellsOf(a, Life::kAlive)) {
    EXPECT_EQ(a.At(15 - cell.x, cell.y, cell.z), Life::kAlive);
    EXPECT_EQ(a.At(cell.x, 15 - cell.y, 15 - cell.z), Life::kAlive);
  }
}

TEST(LifeSeed, IsOverWhenNothingLivesOrAllIsAsItWas) {
  LifeWatch dead, still, lively;
  EXPECT_TRUE(dead.IsOver(Life(8)));
  const Life same = WithLiving(8, {{1, 1, 1}});
  EXPECT_FALSE(still.IsOver(same));
  EXPECT_TRUE(still.IsOver(same));
  Life life = WithLiving(16, {{5, 5, 5}, {6, 5, 5}, {5, 6, 5}, {6, 6, 5}});
  for (int i = 0; i < 5; ++i) {
    EXPECT_FALSE(lively.IsOver(life));
    life.Step();
  }
}

TEST(Galaxy, IsTheSameForTheSameSeedAndFits) {
  const Model a = GalaxyModel(1, 4000), b = GalaxyModel(1, 4000), c = GalaxyModel(2, 4000);
  ASSERT_EQ(a.parts.size(), 1u);
  EXPECT_EQ(a.parts[0].positions, b.parts[0].positions);
  EXPECT_EQ(a.parts[0].colors, b.parts[0].colors);
  EXPECT_NE(a.parts[0].positions, c.parts[0].positions);
  ASSERT_EQ(a.parts[0].positions.size(), 4000u);
  ASSERT_EQ(a.parts[0].colors.size(), 4000u);
  for (const Point3& p : a.parts[0].positions) {
    EXPECT_LE(std::hypot(p.x, p.y), 1);
    EXPECT_LE(std::abs(p.z), kGalaxyHeight);
  }
}

TEST(Galaxy, BeginsWithTheseStarsOnEveryMachine) {
  const Model model = GalaxyModel(1, 3);
  const std::vector<Point3>& stars = model.parts[0].positions;
  ASSERT_EQ(stars.size(), 3u);
  EXPECT_NEAR(stars[0].x, -0.061331274409, 1e-9);
  EXPECT_NEAR(stars[2].y, 0.409693257913, 1e-9);
}

TEST(Clock, SaysHoursMinutesAndSeconds) {
  std::tm time{};
  EXPECT_EQ(ClockText(time), "00:00\n00");
  time.tm_hour = 9, time.tm_min = 5, time.tm_sec = 7;
  EXPECT_EQ(ClockText(time), "09:05\n07");
  time.tm_hour = 23, time.tm_min = 59, time.tm_sec = 60;
  EXPECT_EQ(ClockText(time), "23:59\n60") << "a leap second";
}

void ExpectAt(const Earthquake& quake, const Point3& place) {
  const Point3 p = Hypocentre(quake);
  EXPECT_NEAR(p.x, place.x, 1e-12);
  EXPECT_NEAR(p.y, place.y, 1e-12);
  EXPECT_NEAR(p.z, place.z, 1e-12);
}

TEST(Earthquakes, LieAsDeepAsTheyWere) {
  ExpectAt({0, 0, 0, 5}, {0, -1, 0});
  ExpectAt({90, 0, 637.1, 5}, {0.9, 0, 0});
  ExpectAt({180, 0, 3185.5, 5}, {0, 0.5, 0});
  ExpectAt({-90, 0, 63.71, 5}, {-0.99, 0, 0});
  ExpectAt({17, 90, 637.1, 5}, {0, 0, 0.9});
  ExpectAt({17, -90, 6371, 5}, {0, 0, 0});
  // 45° north on the Greenwich meridian, 600 km deep: 5771 km from the middle.
  ExpectAt({0, 45, 600, 5}, {0, -5771 / 6371.0 * std::sqrt(0.5), 5771 / 6371.0 * std::sqrt(0.5)});
  ExpectAt({0, 0, -6.371, 1}, {0, -1.001, 0});
}

TEST(Earthquakes, AreColouredByDepthAndThickByMagnitude) {
  EXPECT_EQ(DepthColor(-2), (Rgb{255, 230, 70}));
  EXPECT_EQ(DepthColor(100), (Rgb{255, 45, 45}));
  EXPECT_EQ(DepthColor(200), (Rgb{233, 53, 150})) << "halfway from 100 km to 300 km";
  EXPECT_EQ(DepthColor(700), (Rgb{70, 110, 255}));
  const Model model = EarthquakeModel({{0, 0, 0, 1}, {0, 0, 0, 4.5}, {0, 0, 0, 6}, {0, 0, 0, 2.4}});
  ASSERT_EQ(model.parts.size(), 3u);
  EXPECT_TRUE(model.globe);
  EXPECT_EQ(model.parts[0].positions.size(), 2u);
  EXPECT_EQ(model.parts[0].thickness, 0) << "a voxel";
  EXPECT_LT(model.parts[1].thickness, model.parts[2].thickness);
}

absl::StatusOr<std::vector<Earthquake>> Quakes(const std::string& json) {
  return ReadEarthquakes({"week.json", "json", json});
}

TEST(Earthquakes, AreReadFromGeoJson) {
  const auto quakes = Quakes(R"({"features": [
    {"properties": {"mag": 4.5}, "geometry": {"coordinates": [10, -20.5, 33.25]}},
    {"properties": {"mag": null}, "geometry": {"coordinates": [1, 2, 3]}}]})");
  ASSERT_TRUE(quakes.ok()) << quakes.status();
  ASSERT_EQ(quakes->size(), 1u) << "one has no magnitude";
  EXPECT_EQ((*quakes)[0].longitude, 10);
  EXPECT_EQ((*quakes)[0].latitude, -20.5);
  EXPECT_EQ((*quakes)[0].depth_km, 33.25);
  EXPECT_EQ((*quakes)[0].magnitude, 4.5);
}

TEST(Earthquakes, WhatIsWrongIsTold) {
  for (
      const auto& [json, words] : std::vector<std::pair<std::string, std::string>>{
          {"[1", "week.json"},
          {"[]", "no list \"features\""},
          {R"({"features": 3})", "no list \"features\""},
          {R"({"features": []})", "no earthquake"},
          {R"({"features": [3]})", "no earthquake"},
          {R"({"features": [{"properties": {"mag": 3}, "geometry": {"coordinates": [1, 2]}}]})",
           "features[0] is no earthquake"},
          {R"({"features": [{"properties": {"mag": 3}, "geometry": {"coordinates": [1, 95, 2]}}]})",
           "latitudes to 90"},
          {R"({"features": [{"properties": {"mag": "x"}, "geometry": {"coordinates": [1, 5, 2]}}]})",
           "features[0] is no earthquake"}}) {
    const auto quakes = Quakes(json);
    EXPECT_TRUE(absl::IsInvalidArgument(quakes.status())) << json;
    EXPECT_THAT(quakes.status().message(), HasSubstr(words)) << json;
  }
}

client::Vec3 Mapped(const client::Affine& a, const Point3& p) {
  const auto& m = a.m;
  return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
          m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
}

TEST(Motion, TurnsAboutTheMiddleOfTheSpace) {
  const DisplaySpace space{.center = {10, 20, 30}};
  const client::Vec3 quarter = Mapped(PoseAt({.turn_s = 8}, space, 2), {1, 0, 0.5});
  EXPECT_NEAR(quarter.x, 10, 1e-12);
  EXPECT_NEAR(quarter.y, 21, 1e-12);
  EXPECT_NEAR(quarter.z, 30.5, 1e-12);
  const client::Vec3 pole = Mapped(PoseAt({.turn_s = 8, .tilt_degrees = 30}, space, 3), {0, 0, 1});
  EXPECT_NEAR(pole.x, 10.5, 1e-12) << "the axis leans to the right, and stays";
  EXPECT_NEAR(pole.y, 20, 1e-12);
  EXPECT_EQ(PoseAt({.turn_s = 0}, space, 5), PoseAt({.turn_s = 0}, space, 0));
}

TEST(Motion, ACutTurnsWithWhatItCutsAndComesBack) {
  const DisplaySpace space{.center = {0, 0, 5}};
  Motion motion{.turn_s = 8,
                .cut = Cut{.toward = {0, -1, 0}, .deepest = 0.25, .outermost = 1, .period_s = 4}};
  const auto left = [&](double seconds, const Point3& p) {
    const auto plane = CutAt(motion, space, seconds);
    const client::Vec3 q = Mapped(PoseAt(motion, space, seconds), p);
    return plane->a * q.x + plane->b * q.y + plane->c * q.z + plane->d;
  };
  EXPECT_GT(left(0, {0.3, -0.999, 0.1}), 0) << "all of it";
  EXPECT_LT(left(0, {0.3, -1.001, 0.1}), 0);
  EXPECT_GT(left(2, {0.3, -0.249, 0.1}), 0) << "two seconds later a quarter turn, and deepest";
  EXPECT_LT(left(2, {0.3, -0.251, 0.1}), 0);
  EXPECT_GT(left(4, {0.3, -0.999, 0.1}), 0);
  EXPECT_GT(left(1, {0, -0.624, 0}), 0) << "halfway";
  EXPECT_LT(left(1, {0, -0.626, 0}), 0);
  motion.cut.reset();
  EXPECT_FALSE(CutAt(motion, space, 1).has_value());
}

TEST(Motion, FitsWhatIsFlatAndWhatIsHigh) {
  const DisplaySpace flat{.half = {1, 2, 0.5}};
  EXPECT_DOUBLE_EQ(FitRadius(flat, 1), 0.97 * 0.5);
  EXPECT_DOUBLE_EQ(FitRadius(flat, 0.25), 0.97 * 1);
}

TEST(Gyroid, NeverComesApart) {
  for (double t = 0; t < 20; t += 0.05) EXPECT_LE(std::abs(GyroidLevel(t)), 1);
  EXPECT_EQ(GyroidLevel(0), 0);
  EXPECT_DOUBLE_EQ(GyroidLevel(2), 1);
}

TEST(Volumes, AreCroppedToWhatIsSeenOfThem) {
  SampledVolume volume;
  volume.size = {4, 3, 2};
  volume.samples.assign(24, 0);
  volume.samples[1 + 4 * (1 + 3 * 0)] = 5;
  volume.samples[2 + 4 * (2 + 3 * 0)] = 7;
  for (size_t c = 0; c < 8; ++c)
    volume.corners[c] = {(c & 1) * 4.0, (c >> 1 & 1) * 3.0 + 10, (c >> 2 & 1) * 2.0};
  const SampledVolume cropped = Cropped(volume, 1);
  EXPECT_THAT(cropped.size, ElementsAre(2, 2, 1));
  EXPECT_THAT(cropped.samples, ElementsAre(5, 0, 0, 7));
  EXPECT_EQ(cropped.corners[0], (Point3{1, 11, 0}));
  EXPECT_EQ(cropped.corners[7], (Point3{3, 13, 1}));
  EXPECT_EQ(Cropped(volume, 100).samples.size(), 24u) << "nothing is visible: all of it stays";
}

TEST(Data, IsLookedForWhereItMayBe) {
  const std::vector<std::string> roots = DataRoots("/mine", "/src/build/release/bin/voxelctl");
  EXPECT_THAT(roots,
              ElementsAre("/mine", "/src/build/data", "/src/build/release/share/voxeld/data",
                          "/src/build/release/data", "/usr/share/voxeld/data", "/usr/share"));
  EXPECT_THAT(DataRoots("", "/usr/bin/voxelctl"), testing::Contains("/usr/share/voxeld/data"));
}

TEST(Data, TheFirstThatIsThereIsTaken) {
  const TempFolder folder;
  const std::filesystem::path first = folder.Path("first"), second = folder.Path("second");
  const auto make = [](const std::filesystem::path& path) {
    std::filesystem::create_directories(path.parent_path());
    std::ofstream(path) << "x";
    return path.string();
  };
  const SceneFile file{{"atlas/fine.json", "atlas/coarse.json"}, "the package atlas"};
  const std::vector<std::string> roots = {first.string(), second.string()};
  const auto missing = FindSceneFile(file, roots);
  EXPECT_TRUE(absl::IsNotFound(missing.status()));
  EXPECT_THAT(missing.status().message(),
              testing::AllOf(HasSubstr("atlas/fine.json or atlas/coarse.json"),
                             HasSubstr(second.string()), HasSubstr("the package atlas brings ")));
  EXPECT_EQ(std::count(missing.status().message().begin(), missing.status().message().end(), '\n'),
            0);
  const std::string coarse = make(second / "node_modules/atlas/coarse.json");
  EXPECT_EQ(*FindSceneFile(file, roots), coarse);
  const std::string other = make(second / "fine.json");
  EXPECT_EQ(*FindSceneFile(file, roots), other) << "the better one, by its last part alone";
  const std::string fine = make(first / "fine.json");
  EXPECT_EQ(*FindSceneFile(file, roots), fine);
  std::filesystem::create_directories(first / "atlas/fine.json");
  EXPECT_EQ(*FindSceneFile(file, roots), fine) << "a folder is not a file";
}

TEST(Scenes, AreTheOnesThatAreNamed) {
  ASSERT_EQ(Scenes().size(), kSceneNames.size());
  std::set<std::string> names;
  size_t by_code = 0;
  for (size_t i = 0; i < Scenes().size(); ++i) {
    const SceneAbout& scene = Scenes()[i];
    EXPECT_STREQ(scene.name, kSceneNames[i]);
    EXPECT_TRUE(names.insert(scene.name).second);
    EXPECT_STRNE(scene.seen, "");
    EXPECT_STRNE(scene.source, "");
    by_code += scene.needs.empty() ? 1 : 0;
  }
  EXPECT_GE(by_code, 4u) << "they play wherever voxelctl is";
}

TEST(Scenes, OfCodeAreMadeForAnyRoom) {
  for (const DisplaySpace& space :
       {DisplaySpace{}, DisplaySpace{.half = {1, 1, 0.3}, .round = true},
        DisplaySpace{.center = {5, 0, -3}, .half = {0.2, 4, 9}}}) {
    for (const SceneAbout& scene : Scenes()) {
      if (!scene.needs.empty()) continue;
      for (const int side : {1, 8, 64, 512}) {
        EXPECT_TRUE(scene.make({.space = space, .least_side = side, .files = {}}).ok());
      }
    }
  }
}

TEST(Scenes, AFileThatIsNotWhatItShouldBeIsToldByItsPath) {
  const TempFolder folder;
  for (const SceneAbout& scene : Scenes()) {
    if (scene.needs.empty()) continue;
    SceneSettings settings;
    for (const SceneFile& file : scene.needs) {
      settings.files.push_back(folder.Write(
          std::filesystem::path(file.names[0]).filename().string(), "nothing of the kind"));
    }
    const auto made = scene.make(settings);
    EXPECT_FALSE(made.ok()) << scene.name;
    EXPECT_THAT(made.status().message(), HasSubstr(folder.Path(""))) << scene.name;
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
