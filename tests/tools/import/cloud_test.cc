// Tests point clouds as text, PCD and LAS: every way to write them, and the errors for broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <liblzf/lzf.h>

#include <bit>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace cloud_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Clouds : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes) {
    return ReadHere(folder_.Write(name, bytes), {});
  }
  Part Points(const std::string& name, const std::string& bytes) {
    const auto model = Import(name, bytes);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->parts.at(0) : Part();
  }
  std::string Error(const std::string& name, const std::string& bytes) {
    return std::string(Import(name, bytes).status().message());
  }

  TempFolder folder_;
};

template <typename T>
void Put(std::string* out, size_t at, T value) {
  if (out->size() < at + sizeof(value)) out->resize(at + sizeof(value), '\0');
  std::memcpy(out->data() + at, &value, sizeof(value));
}
template <typename T>
std::string Bytes(T value) {
  std::string out;
  Put(&out, 0, value);
  return out;
}

TEST_F(Clouds, TextOfThreeNumbers) {
  const Part part = Points("a.xyz", "# a comment\n3\n1 2 3\n\n -1e3\t+2.5 0 // here\r\n4,5,6\n");
  EXPECT_THAT(part.positions, ElementsAre(Point3{1, 2, 3}, Point3{-1000, 2.5, 0}, Point3{4, 5, 6}));
  EXPECT_THAT(part.colors, IsEmpty());
  EXPECT_EQ(part.kind, Kind::kPoints);
}

TEST_F(Clouds, TextByTheNumberOfColumns) {
  EXPECT_THAT(Points("a.xyz", "0 0 0 10\n1 0 0 20\n2 0 0 15\n").colors,
              ElementsAre(Rgb{0, 0, 0}, Rgb{255, 255, 255}, Rgb{128, 128, 128}))
      << "intensities, stretched";
  EXPECT_THAT(Points("a.txt", "0 0 0 255 128 0\n").colors, ElementsAre(Rgb{255, 128, 0}));
  EXPECT_THAT(Points("a.asc", "0 0 0 1 0.5 0\n").colors, ElementsAre(Rgb{255, 128, 0}));
  const Part normals = Points("a.xyz", "0 0 0 0 0 -1\n1 1 1 0.6 0 0.8\n");
  EXPECT_THAT(normals.normals, ElementsAre(Point3{0, 0, -1}, Point3{0.6, 0, 0.8}));
  EXPECT_THAT(normals.colors, IsEmpty());
  EXPECT_THAT(Points("a.pts", "2\n0 0 0 -5 1 2 3\n1 1 1 9 4 5 6\n").colors,
              ElementsAre(Rgb{1, 2, 3}, Rgb{4, 5, 6}));
  const Part all = Points("a.xyz", "0 0 0 9 8 7 0 2 0\n");
  EXPECT_THAT(all.colors, ElementsAre(Rgb{9, 8, 7}));
  EXPECT_THAT(all.normals, ElementsAre(Point3{0, 1, 0}));
}

TEST_F(Clouds, TextByNames) {
  const Part part = Points("a.csv",
                           "\xef\xbb\xbfid;\"Z\";Y;X;red;Green;BLUE;remark\n"
                           "7;3;2;1;255;0;51;\n8;6;5;4;0;255;0;;\n");
  EXPECT_THAT(part.positions, ElementsAre(Point3{1, 2, 3}, Point3{4, 5, 6}));
  EXPECT_THAT(part.colors, ElementsAre(Rgb{255, 0, 51}, Rgb{0, 255, 0}));
  EXPECT_THAT(Points("b.csv", "lon,lat,height\n13.4,52.5,34\n").positions,
              ElementsAre(Point3{13.4, 52.5, 34}));
}

TEST_F(Clouds, TextWithDecimalCommasAndQuotes) {
  const auto two = ElementsAre(Point3{0.5, 1.5, -2}, Point3{3, 4.25, 5});
  EXPECT_THAT(Points("a.csv", "x;y;z\n0,5;1,5;-2\n3;4,25;5\n").positions, two);
  EXPECT_THAT(Points("a.txt", "0,5\t1,5\t-2\n3\t4,25\t5\n").positions, two);
  EXPECT_THAT(Points("a.xyz", "0,5 1,5 -2\n3 4,25 5\n").positions, two);
  EXPECT_THAT(
      Points("a.csv", "\"x\",\"y\",\"z\"\n\"0.5\", \"1.5\",-2\n3,\"4.25\",\"5\"\n").positions, two);
  EXPECT_THAT(
      Points("a.csv", "name,x,y,z\n\"a, b\",\"0,5\",\"1,5\",-2\nc,3,\"4,25\",5\n").positions, two);
  EXPECT_THAT(Error("a.csv", "x;y;z\n0,5;1;2\n0.5;1;2\n"),
              HasSubstr("line 3 has \"0.5\" in column 1, but the file has both decimal points"));
  EXPECT_THAT(Error("a.csv", "x;y;z\n1.234,5;1;2\n"), HasSubstr("line 2 has \"1.234,5\""));
}

TEST_F(Clouds, TextWhoseCommentNamesTheColumns) {
  const Part part =
      Points("a.txt", "//X Y Z Nx Ny Nz R G B\n0 0 0 0 0 1 255 0 0\n9 0 0 0 0 1 0 255 0\n");
  EXPECT_THAT(part.colors, ElementsAre(Rgb{255, 0, 0}, Rgb{0, 255, 0}));
  EXPECT_EQ(part.normals.at(0), (Point3{0, 0, 1}));
  EXPECT_THAT(Points("a.csv", "# made by hand\n# b,g,r,z,y,x\n1,2,3,6,5,4\n").positions,
              ElementsAre(Point3{4, 5, 6}));
  // A comment that names other columns, or not every column, is ignored.
  EXPECT_THAT(Points("a.txt", "# x y and z\n0 0 0 10 20 30\n").colors,
              ElementsAre(Rgb{10, 20, 30}));
  EXPECT_THAT(Points("a.txt", "# x y z\n0 0 0 10 20 30\n").colors, ElementsAre(Rgb{10, 20, 30}));
}

TEST_F(Clouds, TextThatIsWrong) {
  EXPECT_THAT(Error("a.xyz", "1 2\n"), HasSubstr("line 1 is text that begins with \"1 2\""));
  EXPECT_THAT(Error("a.xyz", "1 2 3\n4 five 6\n"),
              HasSubstr("line 2 has \"five\" in column 2; a number is expected"));
  EXPECT_THAT(Error("a.xyz", "1 2 3\n\n4 5\n"), HasSubstr("line 3 has nothing in column 3"));
  EXPECT_THAT(Error("a.xyz", "1 2 3\n1 2 inf\n"), HasSubstr("line 2 is (1, 2, inf)"));
  EXPECT_THAT(Error("a.csv", "x,y\n1,2\n"), HasSubstr("has no column z"));
  EXPECT_THAT(Error("a.csv", "X [m],Y [m],Z [m]\n1,2,3\n"),
              HasSubstr("its first line names X [m], Y [m], Z [m]; rename three columns to x, y"));
  EXPECT_THAT(Error("a.csv.gz", "\x1f\x8b"), HasSubstr("is compressed by gzip; unpack it"));
  EXPECT_THAT(Error("a.csv", "x,y,z\n"), HasSubstr("ends after its names"));
  EXPECT_THAT(Error("a.xyz", "# nothing\n"), HasSubstr("holds no line of numbers"));
  EXPECT_THAT(Error("a.xyz", "\x1b[31m 2 3\n1 2 3"), testing::Not(HasSubstr("\x1b")));
}

std::string PcdHeader(const std::string& points, const std::string& data) {
  return absl::StrCat(
      "# .PCD v.7\nVERSION 0.7\nFIELDS x y z rgb intensity\nSIZE 4 4 4 4 2\nTYPE F F F F U\n"
      "COUNT 1 1 1 1 2\nWIDTH ",
      points, "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS ", points, "\nDATA ", data, "\n");
}
std::string PcdPoint(float x, float y, float z, uint32_t rgb) {
  return Bytes(x) + Bytes(y) + Bytes(z) + Bytes(rgb) + Bytes<uint16_t>(1) + Bytes<uint16_t>(2);
}

TEST_F(Clouds, PcdInItsThreeWays) {
  const float packed = std::bit_cast<float>(0x00102030u);
  const std::vector<Point3> positions = {{1, 2, 3}, {-4, 0.5, 6}};
  const std::vector<Rgb> colors = {{0x10, 0x20, 0x30}, {0, 0, 255}};

  const Part ascii = Points(
      "a.pcd", PcdHeader("2", "ascii") + absl::StrCat("1 2 3 ", packed, " 1 2\n-4 .5 6 ",
                                                      std::bit_cast<float>(0xFFu), " 1 2\n"));
  EXPECT_EQ(ascii.positions, positions);

  const std::string binary = PcdPoint(1, 2, 3, 0x102030) + PcdPoint(-4, 0.5, 6, 0xFF);
  const Part rows = Points("b.pcd", PcdHeader("2", "binary") + binary);
  EXPECT_EQ(rows.positions, positions);
  EXPECT_EQ(rows.colors, colors);

  std::string columns;
  for (const auto& [at, size] : {std::pair(0, 4), {4, 4}, {8, 4}, {12, 4}, {16, 4}}) {
    for (const int point : {0, 20}) columns += binary.substr(point + at, size);
  }
  columns.resize(40);
  std::string squeezed(100, '\0');
  const unsigned size = lzf_compress(columns.data(), 40, squeezed.data(), 100);
  // Forty bytes cannot be compressed to fewer: as one literal run of 32 and one of 8.
  if (size == 0) {
    squeezed = absl::StrCat(std::string(1, 31), columns.substr(0, 32), std::string(1, 7),
                            columns.substr(32));
  } else {
    squeezed.resize(size);
  }
  const Part compressed = Points("c.pcd", PcdHeader("2", "binary_compressed") +
                                              Bytes(static_cast<uint32_t>(squeezed.size())) +
                                              Bytes(uint32_t{40}) + squeezed);
  EXPECT_EQ(compressed.positions, positions);
  EXPECT_EQ(compressed.colors, colors);
}

// Two points whose fields have 4 bytes each.
std::string AsciiPcd(const std::string& fields, const std::string& types,
                     const std::string& points) {
  std::string sizes, counts;
  for (size_t i = 0; i < types.size(); i += 2) {
    sizes += " 4";
    counts += " 1";
  }
  return absl::StrCat("VERSION 0.7\nFIELDS ", fields, "\nSIZE", sizes, "\nTYPE ", types, "\nCOUNT",
                      counts, "\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n", points);
}

TEST_F(Clouds, PcdPackedColoursWhateverTheirTypeSays) {
  const auto colors = [&](const std::string& type, const std::string& first,
                          const std::string& second) {
    return Points("a.pcd", AsciiPcd("x y z rgba", "F F F " + type,
                                    absl::StrCat("0 0 0 ", first, "\n1 0 0 ", second, "\n")))
        .colors;
  };
  const auto two = ElementsAre(Rgb{255, 0, 0}, Rgb{0, 128, 255});
  EXPECT_THAT(colors("I", "-65536", "-16744193"), two);
  EXPECT_THAT(colors("U", "4294901760", "4278223103"), two);
  EXPECT_THAT(colors("U", "16711680", "33023"), two);
  EXPECT_THAT(colors("F", "nan", "2.3418052e-38"), ElementsAre(Rgb{255, 255, 255}, Rgb{255, 0, 0}))
      << "\"nan\" does not identify the element";
}

TEST_F(Clouds, PcdColoursByTheirGreatestValue) {
  const auto colors = [&](const std::string& types, const std::string& first,
                          const std::string& second) {
    return Points("a.pcd", AsciiPcd("x y z r g b", "F F F " + types,
                                    absl::StrCat("0 0 0 ", first, "\n1 0 0 ", second, "\n")))
        .colors;
  };
  EXPECT_THAT(colors("F F F", "255 128 0", "0 64 1"), ElementsAre(Rgb{255, 128, 0}, Rgb{0, 64, 1}));
  EXPECT_THAT(colors("F F F", "1 0.5 0", "0 0.25 1"),
              ElementsAre(Rgb{255, 128, 0}, Rgb{0, 64, 255}));
  EXPECT_THAT(colors("U U U", "1 0 0", "0 1 1"), ElementsAre(Rgb{1, 0, 0}, Rgb{0, 1, 1}))
      << "whole numbers count to 255";
  EXPECT_THAT(colors("U U U", "65535 0 32896", "0 257 65535"),
              ElementsAre(Rgb{255, 0, 128}, Rgb{0, 1, 255}))
      << "or to 65535";
  // As bytes, and as numbers of 16 bits.
  const auto binary = [&](const std::string& each, const std::string& rgb) {
    return Points("b.pcd",
                  absl::StrCat("FIELDS x y z r g b\nSIZE 4 4 4 ", each, " ", each, " ", each,
                               "\nTYPE F F F U U U\nWIDTH 1\nHEIGHT 1\nDATA binary\n", Bytes(0.f),
                               Bytes(0.f), Bytes(0.f), rgb))
        .colors;
  };
  EXPECT_THAT(binary("1", "\xff\x80\x01"), ElementsAre(Rgb{255, 128, 1}));
  EXPECT_THAT(binary("2", std::string("\xff\0\x80\0\x01\0", 6)), ElementsAre(Rgb{255, 128, 1}));
  EXPECT_THAT(binary("2", std::string("\xff\xff\x80\x80\x01\x01", 6)),
              ElementsAre(Rgb{255, 128, 1}));
}

// Padding that PCL calls "_", of one byte and of many, at every place in a point and in every way
// to write the data.
TEST_F(Clouds, PcdPaddingIsPassedOver) {
  const std::vector<Point3> positions = {{1, 2, 3}, {4, 5, 6}};
  const std::vector<Rgb> colors = {{255, 0, 0}, {0, 128, 255}};
  const std::string head =
      "FIELDS _ x y z _ rgb _\nSIZE 1 4 4 4 1 4 2\nTYPE I F F F U U F\nCOUNT 3 1 1 1 4 1 6\nWIDTH "
      "2\nHEIGHT 1\nPOINTS 2\nDATA ";
  const auto expect = [&](const std::string& text) {
    const auto model = Import("a.pcd", text);
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts[0].positions, positions);
    EXPECT_EQ(model->parts[0].colors, colors);
    EXPECT_THAT(model->left_out, IsEmpty());
    const auto attributes = ReadHere(folder_.Path("a.pcd"), {.attributes = true});
    ASSERT_THAT(attributes, IsOk());
    EXPECT_THAT(attributes->parts[0].attributes, IsEmpty());
  };
  expect(head +
         "ascii\n9 9 9 1 2 3 7 7 7 7 16711680 0 0 0 0 0 nan\n9 9 9 4 5 6 7 7 7 7 33023 1 1 1 1 1 "
         "1\n");
  const std::string before(3, '\x11'), between(4, '\x22'), behind(12, '\x33');
  const std::vector<std::vector<std::string>> fields = {
      {before, before},         {Bytes(1.f), Bytes(4.f)},
      {Bytes(2.f), Bytes(5.f)}, {Bytes(3.f), Bytes(6.f)},
      {between, between},       {Bytes(uint32_t{0xffff0000}), Bytes(uint32_t{0xff0080ff})},
      {behind, behind}};
  std::string rows, columns;
  for (size_t point = 0; point < 2; ++point) {
    for (const auto& field : fields) rows += field[point];
  }
  for (const auto& field : fields) columns += field[0] + field[1];
  expect(head + "binary\n" + rows);
  ASSERT_EQ(columns.size(), 70u);
  // Uncompressed runs of at most 32 bytes.
  const std::string packed =
      absl::StrCat(std::string(1, 31), columns.substr(0, 32), std::string(1, 31),
                   columns.substr(32, 32), std::string(1, 5), columns.substr(64));
  expect(head + "binary_compressed\n" + Bytes(static_cast<uint32_t>(packed.size())) +
         Bytes(uint32_t{70}) + packed);
}

TEST_F(Clouds, PcdPackedColoursOfEveryTypeInBinary) {
  for (const char* type : {"I", "U", "F"}) {
    for (const char* name : {"rgb", "rgba"}) {
      const Part part = Points(
          "a.pcd", absl::StrCat("FIELDS x y z ", name, "\nSIZE 8 8 8 4\nTYPE F F F ", type,
                                "\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nDATA binary\n", Bytes(1.5),
                                Bytes(-2.0), Bytes(1e9), Bytes(uint32_t{0xffff8000})));
      EXPECT_THAT(part.positions, ElementsAre(Point3{1.5, -2, 1e9})) << type;
      EXPECT_THAT(part.colors, ElementsAre(Rgb{255, 128, 0})) << name << " " << type;
    }
  }
}

TEST_F(Clouds, PcdPointsThatAreNowhereAreLeftOut) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto model =
      Import("a.pcd", PcdHeader("2", "binary") + PcdPoint(nan, 0, 0, 0) + PcdPoint(1, 1, 1, 0));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].positions, ElementsAre(Point3{1, 1, 1}));
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"points that are not finite", 1}, {"other fields", 1}}));
}

// Returns the attributes with which a file is read, as "NAME: NUMBERS" each.
std::vector<std::string> AttributesOf(const std::string& path) {
  const absl::StatusOr<Model> model = ReadHere(path, {.attributes = true});
  EXPECT_THAT(model, IsOk());
  std::vector<std::string> texts;
  if (!model.ok()) return texts;
  EXPECT_TRUE(model->left_out.empty());
  for (const Attribute& one : model->parts.at(0).attributes)
    texts.push_back(absl::StrCat(one.name, ": ", absl::StrJoin(one.values, " ")));
  return texts;
}

TEST_F(Clouds, TextColumnsAreAttributesOnlyIfTheyAreWanted) {
  const std::string path =
      folder_.Write("a.csv", "x,y,z,Temp,i,name\n0,0,0,1.5,7,anna\n1,0,0,,8,bob\n0,1,0,-3,9,eve\n");
  EXPECT_THAT(AttributesOf(path), ElementsAre("Temp: 1.5 nan -3", "i: 7 8 9", "name: nan nan nan"));
  const auto plain = ReadHere(path);
  ASSERT_THAT(plain, IsOk());
  EXPECT_TRUE(plain->parts[0].attributes.empty());
  EXPECT_EQ(plain->left_out, (std::vector<LeftOut>{{"other columns", 2}}));
}

TEST_F(Clouds, QuotedWordsMayHaveMarksAndComments) {
  const auto model = Import(
      "a.csv", "name,x,y,z\n\"a, b\",1,2,3\n\"say \"\"hi\"\", x\",4,5,6\n\"http://h/#a\",7,8,9\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].positions,
              ElementsAre(Point3{1, 2, 3}, Point3{4, 5, 6}, Point3{7, 8, 9}));
}

TEST_F(Clouds, WordsBeyondTheColumnsAreCounted) {
  const auto model = Import("a.csv", "x,y,z\n1,2,3,4,5\n6,7,8\n9,9,9,9\n");
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"words beyond the columns", 3}}));
}

TEST_F(Clouds, TextColumnsWithoutNamesHaveNumbers) {
  EXPECT_THAT(AttributesOf(folder_.Write("a.xyz", "0 0 0 5 6\n1 0 0 7 8\n")),
              ElementsAre("intensity: 5 7", "column 5: 6 8"));
  EXPECT_THAT(AttributesOf(folder_.Write("b.txt",
                                         "//X Y Z R G B Scalar_field\n0 0 0 1 2 3 4\n1 "
                                         "1 1 5 6 7 8\n")),
              ElementsAre("Scalar_field: 4 8"));
}

TEST_F(Clouds, PropertiesOfPlyAreAttributes) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float quality\nproperty list uchar int around\nproperty uchar red\n";
  const std::string body = "0 0 0 1 1 9 1\n1 0 0 2 0 2\nnan 1 0 3 0 3\n0 1 0 4 0 4\n";
  const auto cloud =
      ReadHere(folder_.Write("a.ply", head + "end_header\n" + body), {.attributes = true});
  ASSERT_THAT(cloud, IsOk());
  ASSERT_EQ(cloud->parts[0].attributes.size(), 2u);
  EXPECT_EQ(cloud->parts[0].attributes[0], (Attribute{"quality", {1, 2, 4}}));
  EXPECT_EQ(cloud->parts[0].attributes[1], (Attribute{"red", {1, 2, 4}}))
      << "the file has no green";
  EXPECT_EQ(cloud->left_out, (std::vector<LeftOut>{{"points that are not a number", 1},
                                                   {"other properties of vertices", 1}}));
  // Two vertices at one place have different values.
  const auto mesh = ReadHere(
      folder_.Write(
          "b.ply",
          "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float "
          "y\nproperty float z\nproperty int part\nelement face 2\nproperty list uchar int "
          "vertex_index\nend_header\n0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 0 4\n3 0 1 2\n3 3 2 "
          "1\n"),
      {.attributes = true});
  ASSERT_THAT(mesh, IsOk());
  const Part& part = mesh->parts[0];
  ASSERT_EQ(part.attributes.size(), 1u);
  std::vector<double> at_corners;
  for (const uint32_t v : part.indices) at_corners.push_back(part.attributes[0].values.at(v));
  EXPECT_THAT(at_corners, ElementsAre(1, 2, 3, 4, 3, 2));
}

TEST_F(Clouds, FieldsOfPcdAreAttributes) {
  const std::string path =
      folder_.Write("a.pcd", AsciiPcd("x y z label intensity rgb", "F F F U F U",
                                      "0 0 0 3 0.5 16711680\n1 0 0 4 nan 255\n"));
  EXPECT_THAT(AttributesOf(path), ElementsAre("label: 3 4", "intensity: 0.5 nan"));
  EXPECT_EQ(ReadHere(path)->left_out, (std::vector<LeftOut>{{"other fields", 2}}))
      << "the intensity is not shown beside a colour";
}

TEST_F(Clouds, PcdThatIsWrong) {
  const std::string point = PcdPoint(1, 2, 3, 4);
  EXPECT_THAT(Error("a.pcd", "hello"), HasSubstr("a PCD header is expected"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("2", "binary") + point),
              HasSubstr("has 20 bytes of data for 2 points of 20"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("99999999999", "binary") + point),
              HasSubstr("has 99999999999 points"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("0", "binary")), HasSubstr("has 0 points"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("1", "morse") + point),
              HasSubstr("line 11 has DATA \"morse\""));
  EXPECT_THAT(Error("a.pcd", PcdHeader("1", "ascii") + "1 2 three"),
              HasSubstr("point 0 of 1 has \"three\" for z"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("1", "ascii") + "1 2 3"),
              HasSubstr("point 0 of 1 has nothing for rgb"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("1", "binary_compressed") + "1234"),
              HasSubstr("the file is truncated or damaged"));
  EXPECT_THAT(Error("a.pcd", PcdHeader("1", "binary_compressed") + Bytes(uint32_t{3}) +
                                 Bytes(uint32_t{20}) + "\xff\xff\xff"),
              HasSubstr("compressed data that do not decompress"));
  EXPECT_THAT(Error("a.pcd", "FIELDS x y\nSIZE 4\nDATA ascii\n"),
              HasSubstr("line 2 has 1 values of SIZE; there are 2 FIELDS"));
  EXPECT_THAT(Error("a.pcd", "FIELDS x y\nSIZE 4 3\nDATA ascii\n"), HasSubstr("SIZE \"3\""));
  EXPECT_THAT(Error("a.pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n"),
              HasSubstr("has no column z"));
}

struct LasPoint {
  int32_t x, y, z;
  uint16_t intensity;
  uint8_t flags;
  uint16_t rgb[3];
};

// Returns the public header block and records, with offsets as in the specification.
std::string Las(uint8_t minor, uint8_t format, uint16_t record, size_t color,
                const std::vector<LasPoint>& points) {
  const size_t header = minor >= 4 ? 375 : 227;
  std::string out = "LASF";
  out.resize(header, '\0');
  Put<uint8_t>(&out, 24, 1);
  Put<uint8_t>(&out, 25, minor);
  Put<uint32_t>(&out, 96, static_cast<uint32_t>(header));
  Put<uint8_t>(&out, 104, format);
  Put<uint16_t>(&out, 105, record);
  if (minor >= 4) {
    Put<uint64_t>(&out, 247, points.size());
  } else {
    Put<uint32_t>(&out, 107, static_cast<uint32_t>(points.size()));
  }
  for (int a = 0; a < 3; ++a) {
    Put<double>(&out, 131 + 8 * a, 0.5);
    Put<double>(&out, 155 + 8 * a, 100.0 * (a + 1));
  }
  for (const LasPoint& p : points) {
    std::string bytes(record, '\0');
    Put(&bytes, 0, p.x);
    Put(&bytes, 4, p.y);
    Put(&bytes, 8, p.z);
    Put(&bytes, 12, p.intensity);
    Put(&bytes, 15, p.flags);
    for (size_t c = 0; color != 0 && c < 3; ++c) Put(&bytes, color + 2 * c, p.rgb[c]);
    out += bytes;
  }
  return out;
}

TEST_F(Clouds, LasInEveryPointFormat) {
  const std::vector<LasPoint> points = {{2, -4, 6, 10, 0, {65535, 32768, 0}},
                                        {0, 0, 0, 20, 0, {0, 0, 65535}}};
  const std::vector<Point3> positions = {{101, 198, 303}, {100, 200, 300}};
  const struct {
    uint8_t minor, format;
    uint16_t record;
    size_t color;
  } cases[] = {{2, 0, 20, 0},  {2, 1, 28, 0},  {2, 2, 26, 20},  {2, 3, 34, 28},
               {3, 4, 57, 0},  {3, 5, 63, 28}, {4, 6, 30, 0},   {4, 7, 36, 30},
               {4, 8, 38, 30}, {4, 9, 59, 0},  {4, 10, 67, 30}, {4, 7, 50, 30}};
  for (const auto& c : cases) {
    const Part part = Points("a.las", Las(c.minor, c.format, c.record, c.color, points));
    EXPECT_EQ(part.positions, positions) << int{c.format};
    if (c.color != 0) {
      EXPECT_THAT(part.colors, ElementsAre(Rgb{255, 128, 0}, Rgb{0, 0, 255})) << int{c.format};
    } else {
      EXPECT_THAT(part.colors, ElementsAre(Rgb{0, 0, 0}, Rgb{255, 255, 255})) << int{c.format};
    }
  }
}

// Whether colours have 8 or 16 bits is decided for the whole file: a dark point of 16 bits stays
// dark.
TEST_F(Clouds, LasColoursHaveTheBitsOfTheBrightest) {
  const auto colors = [&](std::vector<LasPoint> points) {
    return Points("a.las", Las(2, 2, 26, 20, points)).colors;
  };
  EXPECT_THAT(colors({{0, 0, 0, 1, 0, {65535, 0, 0}}, {1, 0, 0, 1, 0, {255, 200, 0}}}),
              ElementsAre(Rgb{255, 0, 0}, Rgb{1, 1, 0}));
  EXPECT_THAT(colors({{0, 0, 0, 1, 0, {255, 200, 0}}, {1, 0, 0, 1, 0, {0, 256, 0}}}),
              ElementsAre(Rgb{1, 1, 0}, Rgb{0, 1, 0}))
      << "one above 8 bits is enough, anywhere";
  EXPECT_THAT(colors({{0, 0, 0, 1, 0, {255, 200, 0}}, {1, 0, 0, 1, 0, {0, 64, 1}}}),
              ElementsAre(Rgb{255, 200, 0}, Rgb{0, 64, 1}));
}

TEST_F(Clouds, LasColoursOfEightBitsAndPointsThatAreWithheld) {
  const auto model = Import(
      "a.las", Las(2, 2, 26, 20, {{0, 0, 0, 1, 0, {255, 16, 0}}, {1, 0, 0, 1, 0x80, {1, 1, 1}}}));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].colors, ElementsAre(Rgb{255, 16, 0}));
  EXPECT_EQ(model->left_out,
            (std::vector<LeftOut>{{"points marked as withheld", 1}, {"other dimensions", 1}}));
  const auto newer =
      Import("b.las", Las(4, 6, 30, 0, {{0, 0, 0, 1, 4, {}}, {1, 0, 0, 1, 0x80, {}}}));
  ASSERT_THAT(newer, IsOk());
  EXPECT_EQ(newer->parts[0].positions.size(), 1u) << "the flag moved with format 6";
}

TEST_F(Clouds, LasThatIsWrong) {
  const std::string good = Las(2, 0, 20, 0, {{0, 0, 0, 1, 0, {}}, {1, 0, 0, 1, 0, {}}});
  EXPECT_THAT(Error("a.las", "hello"), HasSubstr("a LAS file is expected"));
  EXPECT_THAT(Error("a.las", good.substr(0, good.size() - 1)),
              HasSubstr("tells of 2 points of 20 bytes, and has room for 1"));
  std::string bad = good;
  Put<uint8_t>(&bad, 104, 0x80);
  EXPECT_THAT(Error("a.laz", bad), HasSubstr("is compressed (LAZ)"));
  bad = good;
  Put<uint8_t>(&bad, 104, 11);
  EXPECT_THAT(Error("a.las", bad), HasSubstr("has point format 11; 0 to 10 are read"));
  bad = good;
  Put<uint16_t>(&bad, 105, 19);
  EXPECT_THAT(Error("a.las", bad), HasSubstr("of 19 bytes"));
  bad = good;
  Put<uint32_t>(&bad, 107, 0xFFFFFFFF);
  EXPECT_THAT(Error("a.las", bad), HasSubstr("tells of 4294967295 points"));
  bad = good;
  Put<uint32_t>(&bad, 96, 0xFFFFFFFF);
  EXPECT_THAT(Error("a.las", bad), HasSubstr("has room for 0"));
  bad = good;
  Put<double>(&bad, 131, 0);
  EXPECT_THAT(Error("a.las", bad), HasSubstr("has scale 0"));
}

// For any value of a byte, the result is an error, or points; never more than the file has room
// for.
TEST_F(Clouds, DamagedOnesEndWell) {
  const std::string files[] = {
      PcdHeader("2", "binary") + PcdPoint(1, 2, 3, 4) + PcdPoint(5, 6, 7, 8),
      Las(4, 7, 36, 30, {{0, 0, 0, 1, 0, {1, 2, 3}}, {1, 0, 0, 1, 0, {4, 5, 6}}}),
      "x,y,z,r,g,b\n1,2,3,4,5,6\n7,8,9,10,11,12\n"};
  const char* names[] = {"a.pcd", "a.las", "a.csv"};
  std::mt19937 random(11);
  for (int f = 0; f < 3; ++f) {
    for (int i = 0; i < 400; ++i) {
      std::string bytes = files[f];
      bytes[random() % bytes.size()] = static_cast<char>(random());
      if (i % 3 == 0) bytes.resize(1 + random() % bytes.size());
      const auto model = Import(names[f], bytes);
      if (model.ok()) {
        EXPECT_LE(model->parts.at(0).positions.size(), bytes.size());
      } else {
        EXPECT_THAT(std::string(model.status().message()), HasSubstr(names[f]));
      }
    }
  }
}

TEST_F(Clouds, FieldsOfLasAreAttributes) {
  // LAS 1.4, tables 7 and 10: in formats before 6, bits 0 to 2 of byte 14 are the return and bits 0
  // to 4 of byte 15 the class, and the source is at 18; from 6 on, they are bits 0 to 3, byte 16,
  // and 20.
  std::string before = Las(2, 0, 20, 0, {{0, 0, 0, 77, 0, {}}});
  before[227 + 14] = '\x0a';  // the second of one
  before[227 + 15] = '\x46';  // class 6, key point
  before[227 + 18] = '\x05';
  EXPECT_THAT(AttributesOf(folder_.Write("a.las", before)),
              ElementsAre("intensity: 77", "classification: 6", "return: 2", "source: 5",
                          "returns: 1", "scan_direction: 0", "edge: 0", "synthetic: 0",
                          "key_point: 1", "scan_angle: 0", "user_data: 0"));
  std::string from = Las(4, 6, 30, 0, {{0, 0, 0, 78, 0, {}}});
  const size_t at = from.size() - 30;
  from[at + 14] = '\x29';  // the ninth of two
  from[at + 16] = '\x88';
  from[at + 20] = '\x07';
  from[at + 15] = '\xe9';  // an edge, backwards, channel 2, overlap, synthetic
  from[at + 17] = '\x11';
  from[at + 19] = '\xff';  // an angle of -256 times 0.006°
  Put<double>(&from, at + 22, 25.25);
  EXPECT_THAT(AttributesOf(folder_.Write("b.las", from)),
              ElementsAre("intensity: 78", "classification: 136", "return: 9", "source: 7",
                          "returns: 2", "synthetic: 1", "key_point: 0", "overlap: 1",
                          "scanner_channel: 2", "scan_direction: 1", "edge: 1", "user_data: 17",
                          "scan_angle: -1.536", "gps_time: 25.25"));
  const auto plain = ReadHere(folder_.Path("b.las"));
  ASSERT_THAT(plain, IsOk());
  // Intensity is shown; two others are 0.
  EXPECT_EQ(plain->left_out, (std::vector<LeftOut>{{"other dimensions", 12}}));
}

// A descriptor of extra bytes (LAS 1.4, table 24).
std::string ExtraBytes(uint8_t type, uint8_t options, const std::string& name, double scale = 0,
                       double offset = 0, int64_t no_data = 0) {
  std::string out(192, '\0');
  Put(&out, 2, type);
  Put(&out, 3, options);
  out.replace(4, name.size(), name);
  Put(&out, 40, no_data);
  Put(&out, 112, scale);
  Put(&out, 136, offset);
  return out;
}

// A LAS file of format 0 with one point, which has `extra` bytes that `descriptors` describe.
std::string LasWithExtraBytes(const std::string& descriptors, const std::string& extra) {
  std::string las = Las(2, 0, static_cast<uint16_t>(20 + extra.size()), 0, {{0, 0, 0, 1, 0, {}}});
  std::string record(54, '\0');
  record.replace(2, 9, "LASF_Spec");
  Put<uint16_t>(&record, 18, 4);
  Put(&record, 20, static_cast<uint16_t>(descriptors.size()));
  record += descriptors;
  Put<uint16_t>(&las, 94, 227);
  Put<uint32_t>(&las, 96, static_cast<uint32_t>(227 + record.size()));
  Put<uint32_t>(&las, 100, 1);
  las.replace(las.size() - extra.size(), extra.size(), extra);
  las.insert(227, record);
  return las;
}

TEST_F(Clouds, ExtraBytesOfLas) {
  std::string extra;
  Put<int16_t>(&extra, 0, -200);
  Put<float>(&extra, 2, 1.5f);
  Put<uint8_t>(&extra, 6, 255);
  Put<uint16_t>(&extra, 7, 3);
  Put<uint16_t>(&extra, 9, 4);
  extra += "??";
  const std::string descriptors = ExtraBytes(4, 0x18, "range", 0.01, 5) +
                                  ExtraBytes(9, 0, "width") + ExtraBytes(1, 1, "class", 0, 0, 255) +
                                  ExtraBytes(13, 0, "pair") + ExtraBytes(0, 1, "");
  const std::string path = folder_.Write("a.las", LasWithExtraBytes(descriptors, extra));
  const auto all = ReadHere(path, {.attributes = true});
  ASSERT_THAT(all, IsOk());
  std::vector<std::string> texts;
  for (const Attribute& one : all->parts.at(0).attributes)
    texts.push_back(absl::StrCat(one.name, ": ", absl::StrJoin(one.values, " ")));
  EXPECT_THAT(std::vector<std::string>(texts.end() - 5, texts.end()),
              ElementsAre("range: 3", "width: 1.5", "class: nan", "pair_1: 3", "pair_2: 4"));
  EXPECT_EQ(all->left_out,
            (std::vector<LeftOut>{{"bytes of each point that nothing describes", 1}}));
  const auto plain = ReadHere(path);
  ASSERT_THAT(plain, IsOk());
  EXPECT_EQ(plain->left_out,
            (std::vector<LeftOut>{{"other dimensions", 5},
                                  {"bytes of each point that nothing describes", 1}}));
}

TEST_F(Clouds, DescriptorsOfLasThatAreWrong) {
  for (const std::string& descriptors :
       {ExtraBytes(10, 0, "too long"), ExtraBytes(31, 0, "no type"), ExtraBytes(0, 255, ""),
        std::string(100, '\x01')}) {
    const auto model = ReadHere(folder_.Write("a.las", LasWithExtraBytes(descriptors, "abcd")),
                                {.attributes = true});
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->parts.at(0).attributes.size(), 11u);
  }
  std::string far = LasWithExtraBytes(ExtraBytes(1, 0, "a"), "a");
  Put<uint16_t>(&far, 227 + 20, 65535);  // the record's length
  EXPECT_THAT(ReadHere(folder_.Write("a.las", far), {.attributes = true}), IsOk());
  Put<uint16_t>(&far, 94, 65535);  // the header's
  EXPECT_THAT(ReadHere(folder_.Write("a.las", far), {.attributes = true}), IsOk());
}

// The first byte of a wave packet is the number of its descriptor; 0: no descriptor.
TEST_F(Clouds, WaveformsOfLasAreCounted) {
  for (const auto& [format, record, at] : {std::array{4, 57, 28}, std::array{5, 63, 34},
                                           std::array{9, 59, 30}, std::array{10, 67, 38}}) {
    std::string las = Las(4, static_cast<uint8_t>(format), static_cast<uint16_t>(record), 0,
                          {{0, 0, 0, 1, 0, {}}, {1, 0, 0, 1, 0, {}}});
    las[las.size() - static_cast<size_t>(record - at)] = '\1';
    const auto model = ReadHere(folder_.Write("a.las", las));
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"waveforms", 1}})) << format;
  }
}

// Single precision could not distinguish the first two of these times.
TEST_F(Clouds, TimesKeepTheirPrecision) {
  const auto model =
      ReadHere(folder_.Write("a.csv", "x,y,z,time\n0,0,0,1764500000\n1,0,0,1764500001\n"),
               {.attributes = true});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts.at(0).attributes.at(0).values, ElementsAre(1764500000, 1764500001));
}

TEST_F(Clouds, LinesEndAsEverySystemEndsThem) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    EXPECT_THAT(Points("a.csv", absl::StrCat("x,y,z", end, "1,2,3", end, "4,5,6", end)).positions,
                ElementsAre(Point3{1, 2, 3}, Point3{4, 5, 6}));
    EXPECT_THAT(Error("a.csv", absl::StrCat("x,y,z", end, end, "1,2,3", end, "4,b,6", end)),
                HasSubstr("line 4 has \"b\""));
    const auto water = ReadHere(folder_.Write(
        "a.xyz", absl::StrCat("2", end, "water", end, "O 0 0 0", end, "H 0 0 1", end)));
    ASSERT_THAT(water, IsOk());
    EXPECT_TRUE(water->molecule);
  }
  EXPECT_THAT(Error("a.csv", std::string("\xff\xfex\0,\0y\0,\0z\0", 12)),
              HasSubstr("is UTF-16 text; UTF-8 is expected"));
}

// Every way in which a table writes a missing number.
TEST_F(Clouds, PointsWhoseNumbersAreMissing) {
  for (const std::string none : {"", "nan", "NaN", "NA", "n/a", "null", "None", "-"}) {
    const auto model = ReadHere(
        folder_.Write("a.csv", absl::StrCat("x,y,z,r,g,b\n1,", none, ",3,9,9,9\n1,2,3,255,", none,
                                            ",0\n4,5,6,0,255,0\n")));
    ASSERT_THAT(model, IsOk()) << none;
    EXPECT_THAT(model->parts.at(0).positions, ElementsAre(Point3{1, 2, 3}, Point3{4, 5, 6}))
        << none;
    EXPECT_THAT(model->parts[0].colors, ElementsAre(Rgb{255, 255, 255}, Rgb{0, 255, 0})) << none;
    EXPECT_EQ(
        model->left_out,
        (std::vector<LeftOut>{{"points that are not a number", 1},
                              {"colours and intensities that are not a number (shown white)", 1}}))
        << none;
  }
  // Nor are they part of the range of intensities.
  const auto grey = ReadHere(folder_.Write("a.csv", "x,y,z,i\n1,2,3,10\n1,2,4,nan\n1,2,5,20\n"));
  ASSERT_THAT(grey, IsOk());
  EXPECT_THAT(grey->parts.at(0).colors,
              ElementsAre(Rgb{0, 0, 0}, Rgb{255, 255, 255}, Rgb{255, 255, 255}));
  // If they are in the first line, it does not name columns.
  EXPECT_THAT(Points("a.xyz", "nan nan nan\n1 2 3\n").positions, ElementsAre(Point3{1, 2, 3}));
  EXPECT_THAT(Error("a.csv", "x,y,z\nNA,NA,NA\n"),
              HasSubstr("no point whose x, y and z are numbers"));
}

// A cloud of two points in each format that has names for its numbers.
struct NamedCloud {
  const char* file;
  const char* others;  // what numbers that are not shown are counted as
  std::string (*bytes)(const std::vector<std::string>& names, const std::vector<std::string>& first,
                       const std::vector<std::string>& second);
};
const NamedCloud kNamedClouds[] = {
    {"a.csv", "other columns",
     [](const auto& names, const auto& first, const auto& second) {
       return absl::StrCat(absl::StrJoin(names, ","), "\n", absl::StrJoin(first, ","), "\n",
                           absl::StrJoin(second, ","), "\n");
     }},
    {"a.pcd", "other fields",
     [](const auto& names, const auto& first, const auto& second) {
       std::string types = "F";
       for (size_t i = 1; i < names.size(); ++i) types += " F";
       return AsciiPcd(absl::StrJoin(names, " "), types,
                       absl::StrCat(absl::StrJoin(first, " "), "\n", absl::StrJoin(second, " ")));
     }},
    {"a.ply", "other properties of vertices",
     [](const auto& names, const auto& first, const auto& second) {
       return absl::StrCat("ply\nformat ascii 1.0\nelement vertex 2\nproperty float ",
                           absl::StrJoin(names, "\nproperty float "), "\nend_header\n",
                           absl::StrJoin(first, " "), "\n", absl::StrJoin(second, " "), "\n");
     }},
};

// Text, PCD and PLY decide alike what is shown and what is a number for --color-by.
TEST_F(Clouds, NumbersThatAreNotShownAreAttributesInEveryFormat) {
  const struct {
    std::vector<std::string> names, first, second;
    std::vector<std::string> attributes;
    uint64_t others;
  } cases[] = {
      {{"x", "y", "z", "r"}, {"0", "0", "0", "7"}, {"1", "0", "0", "9"}, {"r: 7 9"}, 1},
      {{"x", "y", "z", "red", "blue"},
       {"0", "0", "0", "7", "8"},
       {"1", "0", "0", "9", "6"},
       {"red: 7 9", "blue: 8 6"},
       2},
      {{"x", "y", "z", "ny", "nz"},
       {"0", "0", "0", "1", "0"},
       {"1", "0", "0", "0", "1"},
       {"ny: 1 0", "nz: 0 1"},
       2},
      {{"x", "y", "z", "intensity", "r", "g", "b"},
       {"0", "0", "0", "5", "1", "1", "0"},
       {"1", "0", "0", "6", "0", "1", "1"},
       {"intensity: 5 6"},
       1},
      {{"x", "y", "z", "intensity"},
       {"0", "0", "0", "5"},
       {"1", "0", "0", "6"},
       {"intensity: 5 6"},
       0},
      // A radius beside a colour that is complete without it.
      {{"r", "x", "y", "z", "red", "green", "blue"},
       {"3", "0", "0", "0", "1", "1", "0"},
       {"4", "1", "0", "0", "0", "1", "1"},
       {"r: 3 4"},
       1},
      {{"height", "x", "y", "z"}, {"5", "0", "0", "0"}, {"6", "1", "0", "0"}, {"height: 5 6"}, 1},
      {{"lat", "z", "elevation", "x", "y"},
       {"50", "0", "7", "0", "0"},
       {"51", "0", "8", "1", "0"},
       {"lat: 50 51", "elevation: 7 8"},
       2},
  };
  for (const NamedCloud& cloud : kNamedClouds) {
    for (const auto& one : cases) {
      const std::string path =
          folder_.Write(cloud.file, cloud.bytes(one.names, one.first, one.second));
      EXPECT_EQ(AttributesOf(path), one.attributes) << cloud.file;
      const auto plain = ReadHere(path);
      ASSERT_THAT(plain, IsOk());
      EXPECT_THAT(plain->parts.at(0).positions, ElementsAre(Point3{0, 0, 0}, Point3{1, 0, 0}));
      const std::vector<LeftOut> others = {{cloud.others, one.others}};
      EXPECT_EQ(plain->left_out, one.others > 0 ? others : std::vector<LeftOut>()) << cloud.file;
      if (one.names.size() == 7) {
        EXPECT_THAT(plain->parts[0].colors, ElementsAre(Rgb{255, 255, 0}, Rgb{0, 255, 255}));
      } else if (one.others == 0) {
        EXPECT_THAT(plain->parts[0].colors, ElementsAre(Rgb{0, 0, 0}, Rgb{255, 255, 255}));
      } else {
        EXPECT_THAT(plain->parts[0].colors, IsEmpty()) << cloud.file;
      }
      EXPECT_THAT(plain->parts[0].normals, IsEmpty());
    }
  }
}

TEST_F(Clouds, ColoursThatAreNotFiniteAreWhiteInEveryFormat) {
  for (const NamedCloud& cloud : kNamedClouds) {
    for (const char* bad : {"nan", "inf", "-inf"}) {
      const auto model = Import(cloud.file, cloud.bytes({"x", "y", "z", "red", "green", "blue"},
                                                        {"0", "0", "0", "1", bad, "0"},
                                                        {"1", "0", "0", "0", "0.5", "1"}));
      ASSERT_THAT(model, IsOk()) << cloud.file << " " << bad;
      EXPECT_THAT(model->parts[0].colors, ElementsAre(Rgb{255, 255, 255}, Rgb{0, 128, 255}))
          << cloud.file << " " << bad;
      EXPECT_EQ(model->left_out,
                (std::vector<LeftOut>{
                    {"colours and intensities that are not a number (shown white)", 1}}));
      const auto grey = Import(cloud.file, cloud.bytes({"x", "y", "z", "intensity"},
                                                       {"0", "0", "0", bad}, {"1", "0", "0", "3"}));
      ASSERT_THAT(grey, IsOk());
      EXPECT_EQ(grey->left_out, model->left_out);
    }
    // A point that is nowhere has no colour to count.
    const auto nowhere = Import(cloud.file, cloud.bytes({"x", "y", "z", "red", "green", "blue"},
                                                        {"nan", "0", "0", "nan", "0", "0"},
                                                        {"1", "0", "0", "1", "0", "0"}));
    ASSERT_THAT(nowhere, IsOk());
    EXPECT_THAT(nowhere->parts[0].colors, ElementsAre(Rgb{255, 0, 0}));
    EXPECT_EQ(nowhere->left_out.size(), 1u);
  }
}

TEST_F(Clouds, NumbersMayHaveAPlusInEveryFormat) {
  for (const NamedCloud& cloud : kNamedClouds) {
    EXPECT_THAT(
        Points(cloud.file, cloud.bytes({"x", "y", "z"}, {"+1", "-2", "+3e+1"}, {"+.5", "0", "+0"}))
            .positions,
        ElementsAre(Point3{1, -2, 30}, Point3{0.5, 0, 0}));
    EXPECT_THAT(
        Import(cloud.file, cloud.bytes({"x", "y", "z"}, {"+-1", "0", "0"}, {"1", "0", "0"})),
        testing::Not(IsOk()));
  }
}

TEST_F(Clouds, PcdColoursThatAreNotKnownAreCounted) {
  const auto model = Import("a.pcd", AsciiPcd("x y z rgb", "F F F F", "0 0 0 nan\n1 0 0 0\n"));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->parts[0].colors, ElementsAre(Rgb{255, 255, 255}, Rgb{0, 0, 0}));
  EXPECT_EQ(
      model->left_out,
      (std::vector<LeftOut>{{"colours and intensities that are not a number (shown white)", 1}}));
}

TEST_F(Clouds, PcdNumbersOfNoTypeAreRefused) {
  const auto binary = [](const std::string& fields, const std::string& sizes, size_t bytes) {
    return absl::StrCat("FIELDS ", fields, "\nSIZE ", sizes,
                        "\nTYPE F F F F\nPOINTS 1\nDATA binary\n", std::string(bytes, '\0'));
  };
  EXPECT_THAT(Error("a.pcd", binary("x y z w", "4 4 2 4", 14)),
              HasSubstr("has field z of TYPE F and SIZE 2; floating-point numbers have 4 or 8"));
  EXPECT_THAT(Error("a.pcd", binary("x y z w", "4 4 4 1", 13)), HasSubstr("has field w of TYPE F"));
  EXPECT_THAT(Import("a.pcd", binary("x y z _", "4 8 4 2", 18)), IsOk())
      << "padding has no numbers";
}

TEST_F(Clouds, PcdCountsWhatItsDataHaveBeside) {
  const auto left_out = [&](const std::string& bytes) {
    const auto model = Import("a.pcd", bytes);
    EXPECT_THAT(model, IsOk());
    if (!model.ok()) return std::vector<LeftOut>();
    EXPECT_EQ(model->parts.at(0).positions.size(), 2u);
    return model->left_out;
  };
  const std::string two = AsciiPcd("x y z", "F F F", "0 0 0\n\n  1 0 0 \n");
  EXPECT_EQ(left_out(two + "\n \n"), (std::vector<LeftOut>{}));
  EXPECT_EQ(left_out(two + "2 0 0\n\n3 0 0"),
            (std::vector<LeftOut>{{"points beyond the header's number", 2}}));
  // A word too many does not move the points that follow.
  EXPECT_EQ(left_out(AsciiPcd("x y z", "F F F", "0 0 0 9 9\n1 0 0 9\n")),
            (std::vector<LeftOut>{{"words beyond the fields", 3}}));
  EXPECT_THAT(Error("a.pcd", AsciiPcd("x y z", "F F F", "0 0\n1 0 0\n")),
              HasSubstr("point 0 of 2 has nothing for z"));
  EXPECT_EQ(left_out(PcdHeader("2", "binary") + PcdPoint(0, 0, 0, 0) + PcdPoint(1, 0, 0, 0) +
                     PcdPoint(2, 0, 0, 0)),
            (std::vector<LeftOut>{{"other fields", 1}, {"points beyond the header's number", 1}}));
  // The first of two fields with one name.
  const auto twice = Import("a.pcd", AsciiPcd("x y z z", "F F F F", "0 0 1 5\n0 0 2 5\n"));
  ASSERT_THAT(twice, IsOk());
  EXPECT_THAT(twice->parts[0].positions, ElementsAre(Point3{0, 0, 1}, Point3{0, 0, 2}));
  EXPECT_EQ(twice->left_out, (std::vector<LeftOut>{{"other fields", 1}}));
  // Values after the first, also of a field that is an attribute.
  const auto several =
      ReadHere(folder_.Write("a.pcd",
                             "FIELDS x y z n\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 3\nPOINTS "
                             "1\nDATA ascii\n0 0 0 1 2 3\n"),
               {.attributes = true});
  ASSERT_THAT(several, IsOk());
  EXPECT_EQ(several->left_out, (std::vector<LeftOut>{{"further values of fields", 2}}));
}

// Points stay where the file has them.
TEST_F(Clouds, PcdViewpointsAreCounted) {
  const auto count = [&](const std::string& viewpoint) {
    const auto model = Import("a.pcd", absl::StrCat("VIEWPOINT ", viewpoint, "\n",
                                                    AsciiPcd("x y z", "F F F", "0 0 0\n1 0 0\n")));
    EXPECT_THAT(model, IsOk());
    return model.ok() ? model->left_out : std::vector<LeftOut>();
  };
  const std::vector<LeftOut> one = {{"viewpoints", 1}};
  EXPECT_THAT(count("0 0 0 1 0 0 0"), IsEmpty());
  EXPECT_THAT(count("0.0 -0 0 -1 0 0 0"), IsEmpty()) << "the same turn";
  EXPECT_EQ(count("0 0 0 0.70710678 0 -0.70710678 0"), one);
  EXPECT_EQ(count("0 0 2 1 0 0 0"), one);
  EXPECT_EQ(count("0 0 0 1 0 0"), one);
}

// "#" and "//" are comments at the beginning of a line and after a blank, but not in a word, and not in place of one.
TEST_F(Clouds, WordsOfTextMayLookLikeComments) {
  const auto numbers = [&](const std::string& text) {
    const auto model = ReadHere(folder_.Write("a.csv", text), {.attributes = true});
    EXPECT_THAT(model, IsOk()) << text;
    if (!model.ok()) return std::string();
    EXPECT_TRUE(model->left_out.empty()) << text;
    EXPECT_THAT(model->parts.at(0).positions, ElementsAre(Point3{0, 0, 0}, Point3{9, 0, 0}))
        << text;
    return absl::StrJoin(model->parts[0].attributes.back().values, " ");
  };
  EXPECT_EQ(numbers("x,y,z,color,temp\n0,0,0,#ff0000,1\n9,0,0,#0f0,2\n"), "1 2");
  EXPECT_EQ(numbers("x,y,z,url,t\n0,0,0,http://a/b,1\n9,0,0,//a/c,2\n"), "1 2");
  EXPECT_EQ(numbers("x;y;z;tag;t\n0;0;0;#one;1\n9;0;0; #two;2\n"), "1 2");
  EXPECT_EQ(numbers("x\ty\tz\ttag\tt\n0\t0\t0\t#one\t1\n9\t0\t0\t//h/two\t2\n"), "1 2");
  EXPECT_EQ(numbers("x y z color t\n0 0 0 #ff8000 1\n9 0 0 #08f 2 # the last\n"), "1 2");
  EXPECT_EQ(numbers("color,x,y,z,t\n#ff0000,0,0,0,1\n#00FF00,9,0,0,2\n"), "1 2");
  EXPECT_EQ(numbers("x,y,z,apt #1,t\n0,0,0,a #1,1\n9,0,0,b,2\n"), "1 2");
  EXPECT_EQ(numbers("// tag x y z t\na 0 0 0 1\n#ff00ff 9 0 0 2\n"), "1 2");
  EXPECT_EQ(numbers("x,y,z,temp#1\n0,0,0,1 # a comment\n9,0,0,2 // another\n"), "1 2");
  // Whether the first word of a line belongs to a comment is not clear here.
  const auto points = Import("a.csv", "id,x,y,z\n1,0,0,0\n#2,1,1,1\n//3,2,2,2\n# two more\n");
  ASSERT_THAT(points, IsOk());
  EXPECT_THAT(points->parts[0].positions, ElementsAre(Point3{0, 0, 0}));
  EXPECT_EQ(points->left_out,
            (std::vector<LeftOut>{{"other columns", 1}, {"points in comments", 2}}));
}

TEST_F(Clouds, TextSaysIfItsCountIsAnother) {
  const auto note = [&](const std::string& text) {
    const auto model = Import("a.pts", text);
    EXPECT_THAT(model, IsOk());
    return model.ok() ? model->note : "";
  };
  EXPECT_EQ(note("2\n0 0 0\n1 0 0\n"), "");
  EXPECT_EQ(note("2\n0 0 0\nnan nan nan\n"), "");
  EXPECT_EQ(note("8\n0 0 0\n1 0 0\n"), "its first line announces 8 points, but it has 2");
  EXPECT_EQ(note("1\n0 0 0\n1 0 0\n"), "its first line announces 1 points, but it has 2");
  EXPECT_THAT(Error("a.pts", "1.5\n0 0 0\n"), HasSubstr("line 1 is text that begins with"));
}

}  // namespace cloud_test
}  // namespace voxeld::voxelctl
