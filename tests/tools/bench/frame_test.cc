// Tests whole frames: the contents of scenes, the report of a run, and the errors.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "tools/bench/frame/frame_bench.h"
#include "tools/bench/frame/plain_lines.h"
#include "tools/bench/frame/resolution_figure.h"
#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

struct Counted {
  uint64_t lines = 0, voxels = 0;
};

// Counts the voxels of THIN lines; vertices are taken in pairs.
Counted CountLines(const std::vector<Content>& contents) {
  Counted out;
  for (const Content& content : contents) {
    EXPECT_EQ(content.record.kind, gpu::PrimitiveKind::kSegments);
    EXPECT_EQ(content.positions.size(), content.colors.size() * 3);
    for (size_t vertex = 0; vertex < content.colors.size(); vertex += 2) {
      EXPECT_EQ(content.colors[vertex], content.colors[vertex + 1]) << "a line of one colour";
      double steps = 0;
      for (size_t a = 0; a < 3; ++a) {
        const double s = content.positions[vertex * 3 + a];
        const double e = content.positions[vertex * 3 + 3 + a];
        EXPECT_EQ(s * 256, std::floor(s * 256)) << "the engine would snap it";
        steps = std::max(steps, std::abs(std::floor(e) - std::floor(s)));
      }
      ++out.lines;
      out.voxels += static_cast<uint64_t>(steps) + 1;
    }
  }
  return out;
}

void ExpectInside(const std::vector<Content>& contents, const double (&least)[3],
                  const double (&size)[3]) {
  for (const Content& content : contents) {
    for (size_t i = 0; i < content.positions.size(); ++i) {
      ASSERT_GE(content.positions[i], least[i % 3]) << "axis " << i % 3;
      ASSERT_LT(content.positions[i], size[i % 3]) << "axis " << i % 3;
    }
  }
}

Scene Only(const std::string& name, uint64_t seed, double share) {
  std::vector<MakeScene> rows = ScenesOf(name, seed, share);
  EXPECT_THAT(rows, SizeIs(1));
  return rows.at(0)().value();
}

TEST(FrameScenes, LinesHaveAsManyVoxelsAsTheySay) {
  for (const auto& [name, voxels] :
       {std::pair("lines1g", 1e9), {"lines100m", 1e8}, {"lines30m", 3e7}}) {
    const Scene scene = Only(name, 3, 1e-3);
    const Counted counted = CountLines(scene.contents);
    EXPECT_EQ(counted.voxels, scene.voxels) << name;
    EXPECT_GE(static_cast<double>(scene.voxels), voxels * 1e-3);
    EXPECT_LT(static_cast<double>(scene.voxels), voxels * 1e-3 + 1024) << "the last line";
    const display::VoxelGrid& grid = scene.target.geometry.grid;
    ExpectInside(scene.contents, {0, 0, 0},
                 {grid.nx - 1.0, static_cast<double>(grid.ny), static_cast<double>(grid.nz)});
    EXPECT_EQ(scene.target.layout.slices, 256);
    EXPECT_EQ(scene.target.layout.width, grid.nx) << "pixels are voxels";
    EXPECT_EQ(scene.target.layout.format, display::PixelFormat::kBitPlanes);
  }
}

// The greater of two distances of random places on an edge of length L is 7/15 of L on average; the third edge is short.
TEST(FrameScenes, AGigavoxelIsAsManyLinesAsRandomEndsGive) {
  const Scene scene = Only("lines1g", 1, 0.01);
  const double mean = 1024.0 * 7 / 15;
  EXPECT_NEAR(static_cast<double>(CountLines(scene.contents).lines), 1e7 / mean, 0.02 * 1e7 / mean);
}

TEST(FrameScenes, ShortLinesHaveTwentyVoxelsEach) {
  const Scene scene = Only("short", 5, 1e-4);
  const Counted counted = CountLines(scene.contents);
  EXPECT_EQ(counted.lines, 1000u);
  EXPECT_EQ(counted.voxels, 20'000u);
  EXPECT_EQ(scene.voxels, 20'000u);
  ExpectInside(scene.contents, {0, 0, 0}, {511, 512, 256});
}

TEST(FrameScenes, OneSeedOneSceneAnotherAnother) {
  setenv("VOXELD_PROFILES", VOXELD_PROFILES_DIR, 1);
  for (const std::string& name : SceneNames()) {
    if (name == "mesh" || name == "gyroid" || name == "implicit" || name == "volume" ||
        name == "isosurface" || name == "filled") {
      continue;  // nothing is random
    }
    const auto first = ScenesOf(name, 5, 1e-4), again = ScenesOf(name, 5, 1e-4);
    const auto other = ScenesOf(name, 6, 1e-4);
    ASSERT_EQ(first.size(), again.size());
    for (size_t row = 0; row < first.size(); ++row) {
      const Scene a = first[row]().value(), b = again[row]().value(), c = other[row]().value();
      EXPECT_EQ(a.name, b.name);
      ASSERT_EQ(a.contents.size(), b.contents.size()) << a.name;
      bool differs = false;
      const auto compare = [&](const std::vector<Content>& x, const std::vector<Content>& y,
                               const std::vector<Content>& z) {
        for (size_t i = 0; i < x.size(); ++i) {
          EXPECT_EQ(x[i].positions, y[i].positions) << a.name;
          EXPECT_EQ(x[i].colors, y[i].colors) << a.name;
          EXPECT_EQ(x[i].transform, y[i].transform) << a.name;
          differs |= i >= z.size() || x[i].positions != z[i].positions ||
                     x[i].colors != z[i].colors || !(x[i].transform == z[i].transform);
        }
      };
      compare(a.contents, b.contents, c.contents);
      for (size_t set = 0; set < 2; ++set) {
        compare(a.changing[set], b.changing[set], c.changing[set]);
      }
      EXPECT_TRUE(differs) << a.name;
    }
  }
}

TEST(FrameScenes, OfWhatMovesTheStatedPartIsNew) {
  const auto rows = ScenesOf("moving", 2, 0.1);
  ASSERT_THAT(rows, SizeIs(6));
  const Scene cube = rows[0]().value();
  const Counted inside = CountLines(cube.changing[0]);
  EXPECT_GT(inside.lines, 50u) << "of 100,000 / 512 that begin in it";
  EXPECT_LE(inside.lines, 1000u);
  EXPECT_THAT(cube.name, HasSubstr(std::to_string(inside.lines)));
  for (const auto& set : cube.changing) {
    ExpectInside(set, {0, 0, 0}, {64, 64, 32});
    EXPECT_EQ(CountLines(set).lines, inside.lines);
  }
  EXPECT_EQ(CountLines(cube.contents).lines + inside.lines, 100'000u);
  const double shares[] = {0, 0.01, 0.05, 0.2, 0.5, 1};
  for (size_t row = 1; row < rows.size(); ++row) {
    const Scene scene = rows[row]().value();
    // Lines that extend beyond their part of the volume stay.
    const uint64_t changed = CountLines(scene.changing[0]).lines;
    EXPECT_LE(static_cast<double>(changed), shares[row] * 100'000 * 1.2) << scene.name;
    EXPECT_GE(static_cast<double>(changed), shares[row] * 100'000 * 0.6) << scene.name;
    const double side = std::cbrt(shares[row]);
    for (const auto& set : scene.changing) {
      ExpectInside(
          set, {0, 0, 0},
          {static_cast<float>(std::lround(512 * side)), static_cast<float>(std::lround(512 * side)),
           static_cast<float>(std::lround(256 * side))});
      EXPECT_EQ(CountLines(set).lines, changed);
      EXPECT_EQ(CountLines(set).voxels, scene.voxels);
    }
    EXPECT_NE(scene.changing[0][0].positions, scene.changing[1][0].positions);
    EXPECT_EQ(CountLines(scene.contents).lines, 100'000 - changed);
    EXPECT_EQ(scene.scene_voxels, 2'000'000u);
  }
}

TEST(FrameScenes, DisplaysAreThoseThatAreNamed) {
  const Scene vx1 = Only("vx1", 1, 0.01);
  EXPECT_EQ(vx1.target.layout.bytes(), 192u * 912 / 8 * 1140) << "192 one-bit frames";
  EXPECT_EQ(vx1.volumes_per_second, 15);
  EXPECT_EQ(CountLines(vx1.changing[0]).lines, 200u);
  EXPECT_EQ(CountLines(vx1.changing[0]).voxels, 200u * 100);
  EXPECT_THAT(vx1.contents, IsEmpty());
  const Scene rgb3 = Only("rgb3", 1, 0.01);
  EXPECT_EQ(rgb3.target.layout.bytes(), 64u * 64 * 64 * 3);
  EXPECT_TRUE(std::holds_alternative<display::Lattice>(rgb3.target.geometry.shape));
  EXPECT_EQ(CountLines(rgb3.changing[1]).voxels, 100u * 20);
  const Scene rotor = Only("rotor", 1, 1);
  EXPECT_EQ(rotor.target.layout.bytes(), 360u * 2 * 128 * 64);
  EXPECT_EQ(rotor.voxels, 128u * 128 * 64);
}

TEST(FrameScenes, ProfilesAreTheShippedOnes) {
  setenv("VOXELD_PROFILES", VOXELD_PROFILES_DIR, 1);
  const auto rows = ScenesOf("profiles", 1, 0.01);
  ASSERT_THAT(rows, SizeIs(8));
  const Scene vortex = rows[0]().value();
  EXPECT_EQ(vortex.name, "slicing, vortex");
  EXPECT_EQ(vortex.target.layout.bytes(), 720u * 128 * 64);
  EXPECT_EQ(vortex.target.tone.density, display::Density::kEven);
  EXPECT_TRUE(vortex.slicing_only);
}

// Every edge has two triangles, one in each direction.
TEST(FrameScenes, TheMeshIsClosed) {
  const auto rows = ScenesOf("mesh", 1, 1);
  ASSERT_THAT(rows, SizeIs(2));
  const Scene thin = rows[0]().value(), cover = rows[1]().value();
  EXPECT_EQ(thin.contents[0].record.rule, gpu::SurfaceRule::kThin);
  EXPECT_EQ(cover.contents[0].record.rule, gpu::SurfaceRule::kCover);
  const std::vector<uint32_t>& indices = thin.contents[0].indices;
  EXPECT_EQ(indices.size(), 101'120u * 3);
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (size_t i = 0; i < indices.size(); i += 3) {
    for (size_t k = 0; k < 3; ++k) ++edges[{indices[i + k], indices[i + (k + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
  }
  ExpectInside(thin.contents, {5, 5, 5}, {506, 506, 506});
}

TEST(FrameScenes, MixedHasEverything) {
  const Scene scene = Only("mixed", 1, 0.1);
  std::set<gpu::PrimitiveKind> kinds;
  bool erases = false;
  for (const Content& content : scene.contents) {
    kinds.insert(content.record.kind);
    erases |= content.erase != 0;
  }
  EXPECT_THAT(kinds, SizeIs(6));
  EXPECT_TRUE(erases);
  std::set<gpu::BlendMode> modes;
  for (const gpu::LayerRecord& layer : scene.layers) modes.insert(layer.blend);
  EXPECT_THAT(modes, SizeIs(3));
}

// Compared with the definition in integers, for lines along an axis, where no rounding is in doubt.
TEST(PlainLines, DrawsTheVoxelsOfALine) {
  constexpr int kSize = 8;
  const std::vector<float> positions = {1.5F, 2.5F, 3.5F, 6.5F, 2.5F, 3.5F,   // along x
                                        4.5F, 7.5F, 0.5F, 4.5F, 0.5F, 0.5F};  // back along y
  const std::vector<uint32_t> colors = {7, 7, 9, 9};
  const size_t room = PlainLinesRoom(kSize, kSize);
  std::vector<uint32_t> volume(room + kSize * kSize * kSize, 0);
  DrawPlainLines(positions.data(), colors.data(), 0, 2, kSize, kSize, volume.data() + room);
  std::vector<uint32_t> want(volume.size(), 0);
  for (size_t x = 1; x <= 6; ++x) want[room + (3 * kSize + 2) * kSize + x] = 7;
  for (size_t y = 0; y <= 7; ++y) want[room + y * kSize + 4] = 9;
  EXPECT_EQ(volume, want);
}

absl::StatusOr<nlohmann::json> Measured(FrameOptions options) {
  return MeasureFrames(
      options, [](const std::string&) {}, [] { return true; });
}

TEST(FrameBench, RowsHaveTheirFields) {
  int lines = 0;
  const auto report = MeasureFrames(
      {.scene = "lines30m", .rounds = 3, .share = 1e-6}, [&](const std::string&) { ++lines; },
      [] { return true; });
  ASSERT_TRUE(report.ok()) << report.status();
  const nlohmann::json& rows = (*report)["rows"];
  ASSERT_THAT(rows, SizeIs(2)) << "with one thread and with two";
  EXPECT_EQ(lines, 2);
  for (const nlohmann::json& row : rows) {
    EXPECT_EQ(row["scene"], "lines30m");
    EXPECT_EQ(row["engine"], "cpu");
    EXPECT_EQ(row["grid"], (nlohmann::json{512, 512, 256}));
    EXPECT_EQ(row["gpus"], 0);
    EXPECT_EQ(row["rounds"], 3);
    EXPECT_EQ(row["voxels_are"], "drawn");
    EXPECT_EQ(row["lit_voxels"], row["voxels"]) << "one line, in either place";
    EXPECT_GE(row["voxels"], 30);
    for (const char* times : {"device_ms", "host_ms", "apply_ms"}) {
      EXPECT_GT(double(row[times]["least"]), 0) << times;
      EXPECT_LE(double(row[times]["least"]), double(row[times]["median"])) << times;
      EXPECT_LE(double(row[times]["median"]), double(row[times]["greatest"])) << times;
    }
    EXPECT_NEAR(double(row["gvoxel_per_s"]) * double(row["device_ms"]["median"]) * 1e6,
                double(row["voxels"]), 1e-6 * double(row["voxels"]));
    EXPECT_LE(double(row["device_ms"]["least"]), double(row["host_ms"]["least"]));
    EXPECT_THAT(std::string(row["ceiling"]["name"]), HasSubstr("memcpy of 25165824 bytes"));
    EXPECT_GT(double(row["ceiling"]["ms"]), 0);
    EXPECT_GT(double(row["ratio"]), 0);
    ASSERT_THAT(row["peers"], SizeIs(1));
    EXPECT_GT(double(row["peers"][0]["ratio"]), 0);
    EXPECT_TRUE(row["volumes_per_s"].is_null());
    ASSERT_THAT(row["stages"], SizeIs(5));
    for (const auto& [stage, share] : row["stages"].items()) {
      EXPECT_GE(double(share), 0) << stage;
      EXPECT_LE(double(share), 1) << stage;
    }
  }
  EXPECT_EQ(rows[0]["threads"], 1);
  EXPECT_EQ(rows[1]["threads"], 2);
  const std::string text = FrameText(*report);
  EXPECT_THAT(text, HasSubstr("lines30m, CPU, 1 thread: "));
  EXPECT_THAT(text, HasSubstr("plain loop"));
}

// Moving items stay in the volume, so each frame is as full as the last, and all of it is drawn.
TEST(FrameBench, EveryVoxelInReachOfTheRotorIsLitInEveryFrame) {
  for (const int rounds : {1, 2}) {
    const auto report = Measured({.scene = "rotor", .threads = 2, .rounds = rounds});
    ASSERT_TRUE(report.ok()) << report.status();
    ASSERT_THAT((*report)["rows"], SizeIs(1)) << "as many threads as requested";
    const nlohmann::json& row = (*report)["rows"][0];
    EXPECT_EQ(row["lit_voxels"], 128 * 128 * 64 - 4 * 16 * 16 * 64)
        << "except the tiles in the corners, which no pixel reaches";
    EXPECT_TRUE(row["slicing_only"]);
    EXPECT_THAT(std::string(row["ceiling"]["name"]), HasSubstr("memcpy of 5046272 bytes"))
        << "half of what is read and written";
  }
}

TEST(FrameBench, RanksStandBesideOneOfThem) {
  const auto report =
      Measured({.scene = "vx1", .threads = 1, .rounds = 2, .share = 0.01, .gpus = 3});
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_THAT((*report)["rows"], SizeIs(1));
  const nlohmann::json& row = (*report)["rows"][0];
  EXPECT_EQ(row["gpus"], 3);
  EXPECT_EQ(row["same_bytes"], true);
  EXPECT_THAT(std::string(row["device"]), HasSubstr("rank 2: CPU, 1 thread"));
  for (const char* clock : {"device", "host"}) EXPECT_GT(double(row["speedup"][clock]), 0);
  EXPECT_GT(double(row["one_gpu"]["host_ms"]["median"]), 0);
  EXPECT_THAT(FrameText(*report), HasSubstr("the same bytes"));
}

TEST(FrameScenes, HugeLinesAreLongInTwoThousandCubed) {
  const Scene scene = Only("huge", 1, 0.001);
  EXPECT_EQ(scene.target.layout.bytes(), uint64_t{2048} * 2048 * 2048 / 8 * 3);
  const Counted counted = CountLines(scene.contents);
  EXPECT_EQ(counted.lines, 1000u);
  EXPECT_EQ(counted.voxels, scene.voxels);
  // The greatest of three distances of random places is 0.54 of the edge on average.
  EXPECT_NEAR(static_cast<double>(counted.voxels) / 1000, 0.54 * 2048, 60);
  ExpectInside(scene.contents, {0, 0, 0}, {2047, 2048, 2048});
}

TEST(FrameBench, TellsWhetherADisplayIsKeptUpWith) {
  const auto report = Measured({.scene = "vx1", .rounds = 1, .share = 0.01});
  ASSERT_TRUE(report.ok()) << report.status();
  const nlohmann::json& row = (*report)["rows"][0];
  EXPECT_EQ(row["volumes_per_s"]["asked"], 15);
  EXPECT_GT(double(row["volumes_per_s"]["reached"]), 0);
  EXPECT_THAT(FrameText(*report), HasSubstr("the display shows 15"));
}

std::string Refusal(const FrameOptions& options) {
  const auto report = Measured(options);
  EXPECT_EQ(report.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(report.status().message());
}

TEST(FrameBench, SaysWhatIsWrongWithTheOptions) {
  EXPECT_THAT(Refusal({.scene = "lines2g"}), HasSubstr("'lines2g'; give one of lines1g, "));
  EXPECT_THAT(Refusal({.scene = "short", .engine = "gpu"}), HasSubstr("'gpu'; give cpu or cuda"));
  EXPECT_THAT(Refusal({.scene = "short", .engine = "cuda", .threads = 2}), HasSubstr("--threads"));
  EXPECT_THAT(Refusal({.scene = "short", .threads = -1}), HasSubstr("--threads is -1"));
  EXPECT_THAT(Refusal({.scene = "short", .gpus = -1}), HasSubstr("--gpus is -1"));
  EXPECT_THAT(Refusal({.scene = "short", .rounds = 0}), HasSubstr("--rounds is 0"));
  EXPECT_THAT(Refusal({.scene = "short", .share = 0}), HasSubstr("--share is 0"));
  EXPECT_THAT(Refusal({.scene = "short", .share = 1.5}), HasSubstr("--share is 1.5"));
}

nlohmann::json Row(const char* scene, int side, const char* engine, double ms) {
  return {{"scene", scene}, {"grid", {side, side, side}},   {"engine", engine}, {"device", "a GPU"},
          {"threads", 1},   {"device_ms", {{"median", ms}}}};
}

TEST(ResolutionFigure, HasACurveForEachMachineAndTheSquareBesideTheSlowest) {
  const nlohmann::json rows = {Row("implicit sphere, 256\xC2\xB3", 256, "cpu", 40),
                               Row("lines1g", 512, "cpu", 1),
                               Row("implicit sphere, 128\xC2\xB3", 128, "cpu", 10),
                               Row("implicit sphere, 128\xC2\xB3", 128, "cuda", 1),
                               Row("implicit sphere, 512\xC2\xB3", 512, "cpu", 100),
                               Row("implicit sphere, 512\xC2\xB3", 512, "cuda", 10)};
  const std::string svg = ResolutionSvg(rows);
  EXPECT_THAT(svg, HasSubstr("CPU, 1 thread<"));
  EXPECT_THAT(svg, HasSubstr("a GPU<"));
  for (const char* side : {">128<", ">256<", ">512<"}) EXPECT_THAT(svg, HasSubstr(side));
  // 560 by 410 pixels from the lower left: two doublings, and from 1 to 100 ms.
  EXPECT_THAT(svg, HasSubstr("points=\"90.0,255.0 370.0,131.6 650.0,50.0 \""))
      << "in order of sides";
  EXPECT_THAT(svg, HasSubstr("points=\"90.0,460.0 650.0,255.0 \""));
  // 60, 15 and 3.75 ms.
  EXPECT_THAT(svg, HasSubstr("points=\"90.0,342.3 370.0,218.9 650.0,95.5 \""));
  EXPECT_EQ(ResolutionSvg(nlohmann::json::array({Row("lines1g", 512, "cpu", 1)})), "");
}

TEST(FrameBench, EndsWhenItIsInterrupted) {
  const auto report = MeasureFrames(
      {.scene = "rgb3", .share = 1e-3}, [](const std::string&) {}, [] { return false; });
  EXPECT_EQ(report.status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace voxeld::bench::frame
