// Tests point clouds: every way to write them, and every way in which they may be broken.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

template <typename T>
std::string Bytes(T value, bool big) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big) std::reverse(bytes, bytes + sizeof value);
  return {bytes, sizeof value};
}

std::string Header(const std::string& format, const std::string& count,
                   const std::string& properties) {
  return "ply\nformat " + format + " 1.0\nelement vertex " + count + "\n" + properties +
         "end_header\n";
}

std::string LittleXyz(float x, float y, float z) {
  return Bytes(x, false) + Bytes(y, false) + Bytes(z, false);
}

constexpr const char* kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(PlyPoints, AsciiWithListsAndOtherElements) {
  const absl::StatusOr<Model> model = ReadHere(DataFile("points.ply"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "PLY points");
  EXPECT_EQ(model->up, Up::kZ);
  EXPECT_TRUE(model->lit_already);
  ASSERT_EQ(model->parts.size(), 1u);
  const Part& part = model->parts[0];
  EXPECT_EQ(part.kind, Kind::kPoints);
  EXPECT_EQ(part.positions, (std::vector<Point3>{{0, 0, 0}, {1, 0, 0}, {0, 0, 2.5}}));
  EXPECT_EQ(part.colors, (std::vector<Rgb>{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}}));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"other properties of vertices", 1},
                                                   {"entries of other elements", 1}}));
}

class PlyBinary : public testing::TestWithParam<bool> {};

TEST_P(PlyBinary, EveryType) {
  const bool big = GetParam();
  TempFolder folder;
  std::string bytes =
      Header(big ? "binary_big_endian" : "binary_little_endian", "2",
             "property double x\nproperty short y\nproperty int z\nproperty ushort red\nproperty "
             "float green\n"
             "property uchar blue\nproperty list uchar short extra\nproperty char flag\n");
  for (int i = 0; i < 2; ++i) {
    bytes += Bytes<double>(1.25 + i, big) + Bytes<int16_t>(-300, big) + Bytes<int32_t>(70000, big) +
             Bytes<uint16_t>(65535, big) + Bytes<float>(0.5f, big) + Bytes<uint8_t>(7, big) +
             Bytes<uint8_t>(2, big) + Bytes<int16_t>(1, big) + Bytes<int16_t>(2, big) +
             Bytes<int8_t>(-1, big);
  }
  const absl::StatusOr<Model> model = ReadHere(folder.Write("cloud.ply", bytes), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].positions,
            (std::vector<Point3>{{1.25, -300, 70000}, {2.25, -300, 70000}}));
  EXPECT_EQ(model->parts[0].colors[1], (Rgb{255, 128, 7}));
}

INSTANTIATE_TEST_SUITE_P(BothEndians, PlyBinary, testing::Bool(),
                         [](const auto& info) { return info.param ? "big" : "little"; });

TEST(PlyPoints, SeventyThousandPoints) {
  constexpr int kCount = 70051;
  TempFolder folder;
  std::string bytes = Header(
      "binary_little_endian", std::to_string(kCount),
      std::string(kXyz) +
          "property float nx\nproperty float ny\nproperty float nz\nproperty uchar diffuse_red\n"
          "property uchar diffuse_green\nproperty uchar diffuse_blue\nproperty float psz\n");
  for (int i = 0; i < kCount; ++i) {
    for (const float value : {i * 0.5f, -i * 0.25f, 1.0f, 0.0f, 0.0f, 2.0f})
      bytes += Bytes(value, false);
    bytes += {static_cast<char>(i), static_cast<char>(i >> 8), 'z'};
    bytes += Bytes(0.0f, false);
  }
  const absl::StatusOr<Model> model = ReadHere(folder.Write("cloud.ply", bytes), {});
  ASSERT_THAT(model, IsOk());
  const Part& part = model->parts[0];
  ASSERT_EQ(part.positions.size(), 70051u);
  EXPECT_EQ(part.positions[70050], (Point3{35025, -17512.5, 1}));
  EXPECT_EQ(part.normals[3], (Point3{0, 0, 1}));
  EXPECT_EQ(part.colors[0x1234], (Rgb{0x34, 0x12, 'z'}));
}

TEST(PlyPoints, PointsThatAreNotANumberAreLeftOutAndSaid) {
  TempFolder folder;
  const absl::StatusOr<Model> model =
      ReadHere(folder.Write("a.ply", Header("ascii", "3",
                                            absl::StrCat(kXyz,
                                                         "property uchar red\nproperty "
                                                         "uchar green\nproperty uchar "
                                                         "blue\n")) +
                                         "0 0 0 1 2 3\nnan nan nan 4 5 6\n9 9 9 7 8 9\n"),
               {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].positions, (std::vector<Point3>{{0, 0, 0}, {9, 9, 9}}));
  EXPECT_EQ(model->parts[0].colors, (std::vector<Rgb>{{1, 2, 3}, {7, 8, 9}}));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"points that are not a number", 1}}));
}

TEST(PlyPoints, FloatColorsGoTo255WhereOneIsGreaterThan1) {
  TempFolder folder;
  const std::string properties =
      absl::StrCat(kXyz, "property float red\nproperty float green\nproperty float blue\n");
  const auto colors = [&](const std::string& body) {
    return ReadHere(folder.Write("a.ply", Header("ascii", "2", properties) + body), {})
        ->parts.at(0)
        .colors;
  };
  EXPECT_EQ(colors("0 0 0 255 0 0\n1 1 1 64 1 0.5\n"), (std::vector<Rgb>{{255, 0, 0}, {64, 1, 1}}));
  EXPECT_EQ(colors("0 0 0 1 0 0\n1 1 1 0.5 1 0\n"), (std::vector<Rgb>{{255, 0, 0}, {128, 255, 0}}));
}

// Exporters write 0 to 255 in any type; the scale applies to the whole file.
TEST(PlyPoints, WholeColorsGoTo255WhereNoneIsGreater) {
  TempFolder folder;
  const auto colors = [&](const std::string& type, const std::string& body) {
    const std::string properties = absl::StrCat(kXyz, "property ", type, " red\nproperty ", type,
                                                " green\nproperty ", type, " blue\n");
    const absl::StatusOr<Model> model =
        ReadHere(folder.Write("a.ply", Header("ascii", "2", properties) + body), {});
    EXPECT_THAT(model, IsOk());
    return model.ok() ? model->parts.at(0).colors : std::vector<Rgb>();
  };
  const std::vector<Rgb> two = {{255, 0, 128}, {1, 64, 0}};
  for (const char* type : {"uchar", "uint8", "short", "ushort", "uint16", "int", "uint", "int32"}) {
    EXPECT_EQ(colors(type, "0 0 0 255 0 128\n1 1 1 1 64 0\n"), two) << type;
  }
  const std::string wide = "0 0 0 65535 0 32896\n1 1 1 257 16448 0\n";
  for (const char* type : {"ushort", "int", "uint"}) EXPECT_EQ(colors(type, wide), two) << type;
  EXPECT_EQ(colors("short", "0 0 0 32767 0 16448\n1 1 1 128 8224 0\n"), two);
  EXPECT_EQ(colors("uint", "0 0 0 4294967295 0 2155905152\n1 1 1 16843009 1077952576 0\n"), two);
  EXPECT_EQ(colors("ushort", "0 0 0 256 0 0\n1 1 1 255 0 0\n"),
            (std::vector<Rgb>{{1, 0, 0}, {1, 0, 0}}))
      << "dark";
  EXPECT_EQ(colors("int", "0 0 0 -5 300 0\n1 1 1 0 0 65535\n"),
            (std::vector<Rgb>{{0, 1, 0}, {0, 0, 255}}));
}

// All in one file: bytes, integers up to 255, fractions.
TEST(PlyPoints, EachChannelHasTheScaleOfItsType) {
  TempFolder folder;
  const absl::StatusOr<Model> model =
      ReadHere(folder.Write("a.ply", Header("ascii", "2",
                                            absl::StrCat(kXyz,
                                                         "property int red\nproperty double "
                                                         "green\nproperty uchar blue\n")) +
                                         "0 0 0 255 0.5 7\n1 1 1 0 1 255\n"),
               {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->parts[0].colors, (std::vector<Rgb>{{255, 128, 7}, {0, 255, 255}}));
}

// NaN in every spelling and byte order.
TEST(PlyPoints, NotANumberInEverySpelling) {
  TempFolder folder;
  for (const char* nan : {"nan", "NaN", "-nan", "-nan(ind)", "nan(0x400)"}) {
    const absl::StatusOr<Model> model = ReadHere(
        folder.Write("a.ply", Header("ascii", "2", kXyz) + absl::StrCat("0 ", nan, " 0\n1 2 3\n")),
        {});
    ASSERT_THAT(model, IsOk()) << nan;
    EXPECT_EQ(model->parts[0].positions, (std::vector<Point3>{{1, 2, 3}})) << nan;
  }
  for (const bool big : {false, true}) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::string bytes = Header(big ? "binary_big_endian" : "binary_little_endian", "2",
                               "property double x\nproperty double y\nproperty double z\n");
    for (const double value : {1.0, 2.0, 3.0, 1.0, 2.0, nan}) bytes += Bytes(value, big);
    const absl::StatusOr<Model> model = ReadHere(folder.Write("a.ply", bytes), {});
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts[0].positions, (std::vector<Point3>{{1, 2, 3}}));
    EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"points that are not a number", 1}}));
  }
}

std::string Lines(int count, const std::string& line) {
  std::string lines;
  for (int i = 0; i < count; ++i) absl::StrAppend(&lines, line, "\n");
  return lines;
}

struct BadFile {
  const char* name;
  std::string bytes;
  Words words;
};

class BadPly : public testing::TestWithParam<BadFile> {};

TEST_P(BadPly, IsRefusedWithWords) {
  TempFolder folder;
  const std::string path = folder.Write("bad.ply", GetParam().bytes);
  Words words = GetParam().words;
  words.push_back(path);
  EXPECT_THAT(ReadHere(path, {}), Fails(words));
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadPly,
    testing::Values(
        BadFile{"empty", "", {"empty"}},
        BadFile{"picture", "\x89PNG\r\n\x1a\n", {"PNG picture", "\"ply\""}},
        BadFile{
            "text", "hello world\nsecond\n", {"text that begins with \"hello world\"", "\"ply\""}},
        BadFile{"header_stops",
                "ply\nformat ascii 1.0\nelement vertex 3\nprop",
                {"line 4", "end_header", "truncated"}},
        BadFile{"format", Header("EBCDIC", "1", kXyz), {"header line 2", "binary_little_endian"}},
        BadFile{"no_format",
                "ply\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
                "z\nend_header\n0 0 0\n",
                {"no format"}},
        BadFile{"type",
                Header("ascii", "1", "property quaternion x\n"),
                {"property quaternion x", "TYPE NAME"}},
        BadFile{"no_z",
                Header("ascii", "1", "property float x\nproperty float y\n") + "0 0\n",
                {"no z"}},
        BadFile{"no_vertices", Header("ascii", "0", kXyz), {"no vertices"}},
        BadFile{
            "no_vertices_copied_as_text",
            Header("binary_little_endian", "0",
                   absl::StrCat(kXyz, "property float nx\nproperty float ny\nproperty float nz\n",
                                Lines(100, "comment"))),
            {"no vertices"}},
        BadFile{"negative_count", Header("ascii", "-5", kXyz), {"element vertex -5", "COUNT"}},
        BadFile{"absurd_count",
                Header("binary_little_endian", "4000000000", kXyz) + LittleXyz(0, 0, 0),
                {"4000000000 vertices", "at most"}},
        BadFile{"huge_count",
                Header("binary_little_endian", "99999999999999999999", kXyz),
                {"element vertex", "COUNT"}},
        BadFile{"count_beyond_file",
                Header("binary_little_endian", "1000", kXyz) + LittleXyz(0, 0, 0),
                {"1000", "12 bytes each", "has 12 bytes", "truncated"}},
        BadFile{"cut_in_vertex",
                Header("binary_little_endian", "2", kXyz) + LittleXyz(0, 0, 0) +
                    LittleXyz(1, 2, 3).substr(0, 11),
                {"truncated"}},
        BadFile{"list_without_end",
                Header("binary_little_endian", "1",
                       std::string(kXyz) + "property list uint uchar l\n") +
                    LittleXyz(0, 0, 0) + Bytes<uint32_t>(0xffffffff, false) + "abc",
                {"vertex 0 of 1", "cut off"}},
        BadFile{"ascii_cut",
                Header("ascii", "3", kXyz) + "0.5 0.5 0.5\n1 1 1\n2 2",
                {"vertex 2 of 3", "cut off"}},
        BadFile{"ascii_word",
                Header("ascii", "1", kXyz) + "0 zero 0\n",
                {"vertex 0 of 1", "no number"}},
        BadFile{"ascii_nan",
                Header("ascii", "2", kXyz) + "nan nan nan\n0 nan 0\n",
                {"all of its 2 points", "NaN"}},
        BadFile{"infinite",
                Header("binary_little_endian", "1", kXyz) +
                    LittleXyz(0, std::numeric_limits<float>::infinity(), 0),
                {"vertex 0", "inf", "finite"}}),
    [](const auto& info) { return info.param.name; });

TEST(PlyPoints, SaysWhenACopyAsTextHasDamagedIt) {
  TempFolder folder;
  // 200 random line feeds in what should be binary, none of them after a carriage return, and some
  // missing bytes.
  std::string data;
  for (int i = 0; i < 200; ++i) {
    data += '\n';
    data.append(11, '\1');
  }
  const std::string path =
      folder.Write("cloud.ply", Header("binary_little_endian", "201", kXyz) + data);
  EXPECT_THAT(ReadHere(path, {}), Fails(Words{"no CR LF at all", "copied as text"}));
}

TEST(PlyPoints, MendsACloudWithNormalsThatWasCopiedAsText) {
  constexpr int kCount = 5000;
  TempFolder folder;
  std::string body;
  std::vector<Point3> positions;
  for (int i = 0; i < kCount; ++i) {
    const double angle = i * 0.7;
    float x = static_cast<float>(5 * std::cos(angle)), y = static_cast<float>(i * 0.001), z = 1.5f;
    // Every hundredth has a carriage return and a line feed in its y.
    if (i % 100 == 50) std::memcpy(&y, "\x0d\x0a\x80\x40", 4);
    positions.push_back({x, y, z});
    body += LittleXyz(x, y, z);
    body += LittleXyz(static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 0);
  }
  std::string damaged;
  size_t lost = 0;
  for (size_t i = 0; i < body.size(); ++i) {
    const bool pair = body[i] == '\r' && i + 1 < body.size() && body[i + 1] == '\n';
    lost += pair ? 1 : 0;
    if (!pair) damaged += body[i];
  }
  ASSERT_GE(lost, 50u);
  const std::string header =
      Header("binary_little_endian", std::to_string(kCount),
             std::string(kXyz) + "property float nx\nproperty float ny\nproperty float nz\n");
  const absl::StatusOr<Model> model = ReadHere(folder.Write("cloud.ply", header + damaged), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->note, testing::HasSubstr("lost " + std::to_string(lost) + " bytes"));
  ASSERT_EQ(model->parts[0].positions.size(), positions.size());
  size_t elsewhere = 0;
  for (size_t i = 0; i < positions.size(); ++i)
    elsewhere += model->parts[0].positions[i] == positions[i] ? 0 : 1;
  // It is not always clear which of two adjacent bytes is missing.
  EXPECT_LE(elsewhere, 2 * lost);
}

TEST(PlyPoints, AMissingFileIsNamed) {
  TempFolder folder;
  EXPECT_THAT(ReadHere(folder.Path("none.ply"), {}), Fails(Words{"none.ply", "No such file"}));
}

}  // namespace
}  // namespace voxeld::voxelctl
