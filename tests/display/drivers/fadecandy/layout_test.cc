#include "display/drivers/wiring/wiring.h"

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include "display/drivers/fadecandy/boards.h"
#include "gtest/gtest.h"

namespace voxeld::display::fadecandy {
namespace layout_test {

using Values = std::map<std::string, std::string>;

absl::StatusOr<Lattice> Read(Values values, int32_t boards = 1) {
  const DisplayOptions options{.name = "d", .driver = "fadecandy", .options = std::move(values)};
  OptionReader reader(options);
  absl::StatusOr<Lattice> lattice = wiring::ReadLattice(reader, PixelsOf(boards));
  if (absl::Status status = reader.Finish(); !status.ok()) return status;
  return lattice;
}

std::string Refusal(Values values, int32_t boards = 1) {
  const auto lattice = Read(std::move(values), boards);
  if (lattice.ok()) return "accepted";
  EXPECT_EQ(lattice.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(lattice.status().message());
}

std::string Wrong(std::string_view json, int32_t boards = 1) {
  const auto lattice = wiring::ParseLayout(json, PixelsOf(boards), 1);
  return lattice.ok() ? "accepted" : std::string(lattice.status().message());
}

// Returns "x,y,z" of the lights of consecutive pixels, '-' for pixels without a light.
std::string Points(const Lattice& lattice, size_t first, size_t count) {
  std::string text;
  for (size_t i = first; i < first + count; ++i) {
    char point[64] = "-";
    if (lattice.points_mm[i].has_value()) {
      const Vec3& p = *lattice.points_mm[i];
      std::snprintf(point, sizeof(point), "%g,%g,%g", p.x, p.y, p.z);
    }
    if (i > first) text.push_back(' ');
    text.append(point);
  }
  return text;
}

size_t Lights(const Lattice& lattice) {
  size_t count = 0;
  for (const auto& point : lattice.points_mm) count += point.has_value() ? 1 : 0;
  return count;
}

TEST(FadecandyLayout, ACubeOfEightIsABoardWithAStripASlice) {
  const auto lattice = Read({});
  ASSERT_TRUE(lattice.ok()) << lattice.status();
  EXPECT_EQ(lattice->width_px, 512);
  EXPECT_EQ(lattice->points_mm.size(), 512u);
  EXPECT_EQ(Points(*lattice, 0, 2), "-3.5,-3.5,-3.5 -2.5,-3.5,-3.5");
  EXPECT_EQ(Points(*lattice, 7, 2), "3.5,-3.5,-3.5 -3.5,-2.5,-3.5");
  EXPECT_EQ(Points(*lattice, 63, 2), "3.5,3.5,-3.5 -3.5,-3.5,-2.5");
  EXPECT_EQ(Points(*lattice, 511, 1), "3.5,3.5,3.5");
  EXPECT_EQ(lattice->cell_mm, (Vec3{1, 1, 1}));
}

TEST(FadecandyLayout, PitchAndCell) {
  const auto lattice = Read({{"cube", "2x1x1"}, {"pitch_mm", "30"}});
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(Points(*lattice, 0, 3), "-15,0,0 15,0,0 -");
  EXPECT_EQ(lattice->cell_mm, (Vec3{30, 30, 30}));
  EXPECT_EQ(Read({{"cell_mm", "4"}})->cell_mm, (Vec3{4, 4, 4}));
  EXPECT_EQ(Read({{"cell_mm", "4;5;6"}})->cell_mm, (Vec3{4, 5, 6}));
}

TEST(FadecandyLayout, SerpentineRows) {
  const auto lattice = Read({{"cube", "3x2x2"}, {"serpentine", "rows"}, {"per_strip", "6"}});
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(Points(*lattice, 0, 7),
            "-1,-0.5,-0.5 0,-0.5,-0.5 1,-0.5,-0.5 1,0.5,-0.5 0,0.5,-0.5 -1,0.5,-0.5 -");
  EXPECT_EQ(Points(*lattice, 64, 7),
            "-1,-0.5,0.5 0,-0.5,0.5 1,-0.5,0.5 1,0.5,0.5 0,0.5,0.5 -1,0.5,0.5 -");
  EXPECT_EQ(Lights(*lattice), 12u);
}

TEST(FadecandyLayout, SerpentineRowsAndSlices) {
  const auto lattice = Read({{"cube", "2x3x2"}, {"serpentine", "rows_and_slices"}});
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(Points(*lattice, 0, 12),
            "-0.5,-1,-0.5 0.5,-1,-0.5 0.5,0,-0.5 -0.5,0,-0.5 -0.5,1,-0.5 0.5,1,-0.5 "
            "0.5,1,0.5 -0.5,1,0.5 -0.5,0,0.5 0.5,0,0.5 0.5,-1,0.5 -0.5,-1,0.5");
}

TEST(FadecandyLayout, ASnakeNeverJumps) {
  for (const char* cube : {"2x2x2", "3x3x3", "2x3x4", "4x3x2", "5x4x3", "1x5x2", "5x1x3"}) {
    for (const char* order : {"xyz", "xzy", "yxz", "yzx", "zxy", "zyx"}) {
      const auto lattice =
          Read({{"cube", cube}, {"order", order}, {"serpentine", "rows_and_slices"}});
      ASSERT_TRUE(lattice.ok());
      const size_t lights = Lights(*lattice);
      for (size_t i = 1; i < lights; ++i) {
        const Vec3 a = *lattice->points_mm[i - 1], b = *lattice->points_mm[i];
        ASSERT_EQ(std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z), 1)
            << cube << " " << order << " light " << i;
      }
    }
  }
}

TEST(FadecandyLayout, OrderFlipRotateReverse) {
  const Values cube = {{"cube", "3x2x2"}};
  const auto with = [&](Values more) {
    more.insert(cube.begin(), cube.end());
    const auto lattice = Read(more);
    EXPECT_TRUE(lattice.ok()) << lattice.status();
    return Points(*lattice, 0, 3);
  };
  EXPECT_EQ(with({}), "-1,-0.5,-0.5 0,-0.5,-0.5 1,-0.5,-0.5");
  EXPECT_EQ(with({{"order", "zyx"}}), "-1,-0.5,-0.5 -1,-0.5,0.5 -1,0.5,-0.5");
  EXPECT_EQ(with({{"flip", "x"}}), "1,-0.5,-0.5 0,-0.5,-0.5 -1,-0.5,-0.5");
  EXPECT_EQ(with({{"flip", "y;z"}}), "-1,0.5,0.5 0,0.5,0.5 1,0.5,0.5");
  // Counter-clockwise as seen from above: +x becomes +y.
  EXPECT_EQ(with({{"rotate", "90"}}), "0.5,-1,-0.5 0.5,0,-0.5 0.5,1,-0.5");
  EXPECT_EQ(with({{"rotate", "180"}}), "1,0.5,-0.5 0,0.5,-0.5 -1,0.5,-0.5");
  EXPECT_EQ(with({{"rotate", "270"}}), "-0.5,1,-0.5 -0.5,0,-0.5 -0.5,-1,-0.5");
  EXPECT_EQ(with({{"flip", "x"}, {"rotate", "90"}}), "0.5,1,-0.5 0.5,0,-0.5 0.5,-1,-0.5");
  EXPECT_EQ(with({{"reverse", "true"}}), "1,0.5,0.5 0,0.5,0.5 -1,0.5,0.5");
}

TEST(FadecandyLayout, EveryWiringLightsEveryPlaceOnce) {
  for (const char* order : {"xyz", "zxy", "yzx"}) {
    for (const char* serpentine : {"none", "rows", "rows_and_slices"}) {
      for (const char* rotate : {"0", "90"}) {
        for (const char* reverse : {"true", "false"}) {
          const auto lattice = Read({{"cube", "5x4x3"},
                                     {"order", order},
                                     {"serpentine", serpentine},
                                     {"rotate", rotate},
                                     {"reverse", reverse},
                                     {"flip", "y"},
                                     {"per_strip", "10"}});
          ASSERT_TRUE(lattice.ok());
          std::set<std::tuple<double, double, double>> places;
          for (const auto& p : lattice->points_mm) {
            if (p.has_value()) places.emplace(p->x, p->y, p->z);
          }
          EXPECT_EQ(places.size(), 60u);
        }
      }
    }
  }
}

TEST(FadecandyLayout, FirstAndPerStrip) {
  const auto lattice = Read({{"cube", "5x5x5"}, {"per_strip", "25"}, {"first", "128"}});
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(Points(*lattice, 127, 2), "- -2,-2,-2");
  EXPECT_EQ(Points(*lattice, 128 + 24, 2), "2,2,-2 -");
  EXPECT_EQ(Points(*lattice, 192, 1), "-2,-2,-1");
  EXPECT_EQ(Points(*lattice, 384 + 24, 2), "2,2,2 -");
  EXPECT_EQ(Lights(*lattice), 125u);
}

TEST(FadecandyLayout, ACubeOverTwoBoards) {
  const auto lattice = Read({{"cube", "8x8x16"}}, 2);
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(lattice->points_mm.size(), 1024u);
  EXPECT_EQ(Points(*lattice, 512, 1), "-3.5,-3.5,0.5");
  EXPECT_EQ(Refusal({{"cube", "8x8x17"}}, 2),
            "a cube of 8x8x17 lights, 64 on a strip, from pixel 0 on, ends at pixel 1087; the last "
            "one there is, with 512 a board, is 1023");
  EXPECT_NE(Refusal({{"first", "1"}}).find("ends at pixel 512"), std::string::npos);
  EXPECT_NE(Refusal({{"cube", "16384x16384x16384"}}).find("16384x16384"), std::string::npos);
}

TEST(FadecandyLayout, BadOptionsAreToldWhatIsRight) {
  EXPECT_EQ(Refusal({{"order", "xxz"}}),
            "display \"d\": order is \"xxz\"; it must be x, y and z in some order, the one that "
            "runs fastest first");
  EXPECT_NE(Refusal({{"flip", "x;x"}}).find("each once"), std::string::npos);
  EXPECT_NE(Refusal({{"flip", "w"}}).find("each once"), std::string::npos);
  EXPECT_NE(Refusal({{"rotate", "45"}}).find("one of 0, 90, 180, 270"), std::string::npos);
  EXPECT_NE(Refusal({{"per_strip", "65"}}).find("from 1 to 64"), std::string::npos);
  EXPECT_NE(Refusal({{"cell_mm", "1;2"}}).find("one length, or three"), std::string::npos);
  EXPECT_NE(Refusal({{"cell_mm", "0"}}).find("at least"), std::string::npos);
  EXPECT_NE(Refusal({{"cube", "8x8"}}).find("WxHxS"), std::string::npos);
}

TEST(FadecandyLayout, BoardsByNumberOrSerial) {
  const auto read = [](std::string text) -> absl::StatusOr<std::vector<std::string>> {
    const DisplayOptions options{.name = "d", .driver = "x", .options = {{"boards", text}}};
    OptionReader reader(options);
    const Boards boards = ReadBoards(reader);
    if (absl::Status status = reader.Finish(); !status.ok()) return status;
    return boards.serials;
  };
  EXPECT_EQ(*read("2"), (std::vector<std::string>{"", ""}));
  EXPECT_EQ(*read("ENICCULV;ABC"), (std::vector<std::string>{"ENICCULV", "ABC"}));
  EXPECT_EQ(read("64")->size(), 64u);
  for (const char* bad : {"0", "65", "-1", "", "A;A", "A;;B"}) {
    EXPECT_EQ(read(bad).status().code(), absl::StatusCode::kInvalidArgument) << bad;
  }
}

TEST(FadecandyLayout, PointsOfAFile) {
  const auto lattice = wiring::ParseLayout(
      R"([{"point": [0, 0, 0]}, null, {"point": [1, 2.5, -4]}, {}])", PixelsOf(1), 10);
  ASSERT_TRUE(lattice.ok()) << lattice.status();
  EXPECT_EQ(Points(*lattice, 0, 5), "-5,-12.5,20 - 5,12.5,-20 - -");
  EXPECT_EQ(lattice->cell_mm, (Vec3{10, 10, 10}));
}

TEST(FadecandyLayout, BadFilesAreToldWhatIsRight) {
  EXPECT_NE(Wrong("[").find("not JSON"), std::string::npos);
  EXPECT_NE(Wrong(R"([{"point": [1e999, 0, 0]}])").find("not JSON"), std::string::npos);
  EXPECT_NE(Wrong("{}").find("not an array"), std::string::npos);
  EXPECT_EQ(Wrong("[null]"), "there is no light; there must be one");
  EXPECT_EQ(Wrong(R"([null, {"points": 1}])"),
            "entry 1 is {\"points\":1}; it must be {\"point\": [x, y, z]}, or null where there is "
            "no light");
  EXPECT_NE(Wrong(R"([{"point": [1, 2]}])").find("entry 0"), std::string::npos);
  EXPECT_NE(Wrong("[7]").find("entry 0 is 7"), std::string::npos);
  EXPECT_NE(Wrong(R"([{"point": [1, 2, "3"]}])").find("numbers"), std::string::npos);
  EXPECT_NE(Wrong(R"([{"point": [1, 2, 1e300]}])").find("at most 1e+06 mm"), std::string::npos);
  EXPECT_EQ(Wrong(R"([{"point": [1, 2, 3]}, {}, {"point": [1.0, 2, 3]}])"),
            "entries 0 and 2 are both at 1, 2, 3 mm; each light must have a place of its own");
  std::string many = "[null";
  for (int i = 0; i < 512; ++i) many += ",null";
  EXPECT_EQ(Wrong(many + "]"), "it has 513 entries; there are 512 pixels, 512 a board");
  const std::string deep = std::string(100'000, '[') + std::string(100'000, ']');
  EXPECT_EQ(Wrong("[" + deep + "]"),
            "its arrays and objects are nested 100001 levels deep; at most 64 are allowed");
  EXPECT_NE(Wrong(R"([{"point": )" + std::string(62, '[') + std::string(62, ']') + "}]")
                .find("entry 0 is"),
            std::string::npos);
}

TEST(FadecandyLayout, ReadsTheFile) {
  const std::string path = testing::TempDir() + "/fadecandy_layout.json";
  std::ofstream(path) << R"([{"point": [0, 0, 1]}, {"point": [0, 0, -1]}])";
  const auto lattice = Read({{"layout", path}, {"pitch_mm", "2"}});
  ASSERT_TRUE(lattice.ok()) << lattice.status();
  EXPECT_EQ(Points(*lattice, 0, 3), "0,0,2 0,0,-2 -");
  EXPECT_NE(Refusal({{"layout", path}, {"cube", "2x2x2"}}).find("left out"), std::string::npos);
  EXPECT_NE(Refusal({{"layout", path}, {"order", "xyz"}}).find("unknown option order"),
            std::string::npos);
  EXPECT_EQ(Refusal({{"layout", "/nonexistent/file"}}),
            "layout \"/nonexistent/file\": it cannot be opened");
  EXPECT_EQ(Refusal({{"layout", testing::TempDir()}}),
            "layout \"" + testing::TempDir() + "\": it cannot be read");
  std::remove(path.c_str());
}

}  // namespace layout_test
}  // namespace voxeld::display::fadecandy
