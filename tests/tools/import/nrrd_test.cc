// Tests NRRD, and raw samples: real and broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <initializer_list>
#include <string>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"

namespace voxeld::voxelctl {
namespace nrrd_test {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST_F(Volumes, NrrdInItsWays) {
  const std::string head = "NRRD0004\n# c\ntype: unsigned char\ndimension: 3\nsizes: 2 1 2\n";
  EXPECT_THAT(Read("a.nrrd", head + "encoding: raw\n\n\x01\x02\x03\x04").samples,
              ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Read("b.nrrd", head + "encoding: gzip\n\n" + Gzip("\x01\x02\x03\x04")).samples,
              ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(
      Read("bs.nrrd", head + "encoding: gzip\nbyte skip: 3\n\n" + Gzip("xyz\x01\x02\x03\x04"))
          .samples,
      ElementsAre(1, 2, 3, 4))
      << "bytes are skipped after decompression";
  EXPECT_THAT(
      Read("bl.nrrd", head + "encoding: gzip\nline skip: 1\n\njunk\n" + Gzip("\x01\x02\x03\x04"))
          .samples,
      ElementsAre(1, 2, 3, 4))
      << "lines are skipped before";
  for (const char* type :
       {"long long", "long long int", "signed long long", "signed long long int", "longlong",
        "int64", "unsigned long long", "unsigned long long int", "uint64_t"}) {
    EXPECT_THAT(Read("t.nrrd", absl::StrCat("NRRD0001\ntype: ", type,
                                            "\ndimension: 3\nsizes: 1 1 1\nendian: little\n"
                                            "encoding: raw\n\n") +
                                   std::string("\x07\0\0\0\0\0\0\0", 8))
                    .samples,
                ElementsAre(7))
        << type;
    EXPECT_THAT(Read("t.nrrd", absl::StrCat("NRRD0001\nType: ", type,
                                            "\ndimension: 3\nsizes: 1 1 1\nendian: big\n"
                                            "encoding: raw\n\n") +
                                   std::string("\0\0\0\0\0\0\1\7", 8))
                    .samples,
                ElementsAre(263))
        << type;
  }
  EXPECT_THAT(Read("c.nrrd", head + "encoding: ascii\n\n1 2\n3  4\n").samples,
              ElementsAre(1, 2, 3, 4));
  folder_.Write("d.raw", "junk\nxx\x05\x06\x07\x08");
  EXPECT_THAT(
      Read("d.nhdr", head + "encoding: raw\nline skip: 1\nbyteskip: 2\ndata file: d.raw\n").samples,
      ElementsAre(5, 6, 7, 8));
  EXPECT_THAT(Read("e.nhdr", head + "encoding: raw\nbyte skip: -1\ndatafile: d.raw\n").samples,
              ElementsAre(5, 6, 7, 8));
  EXPECT_THAT(Read("f.nrrd",
                   "NRRD0001\r\ntype: short\r\ndimension: 2\r\nsizes: 2 1\r\nendian: big\r\n"
                   "spacings: 2 nan\r\nencoding: raw\r\n\r\n\x01\x02\xff\xff")
                  .samples,
              ElementsAre(258, -1));
  const SampledVolume placed = Read(
      "g.nrrd", head +
                    "space: right-anterior-superior\nspace directions: (0,2,0) (3,0,0) (0,0,1)\n"
                    "space origin: (1,1,1)\nencoding: ascii\n\n1 2 3 4");
  EXPECT_EQ(placed.corners[0], (Point3{0.5, 0, 0.5}));
  EXPECT_EQ(placed.corners[1], (Point3{0.5, -4, 0.5}));
}

TEST_F(Volumes, NrrdInHexAndBetweenAxisEnds) {
  const std::string head = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 1 2\n";
  EXPECT_THAT(Read("h.nrrd", head + "encoding: hex\n\n01 ff\n0A0b").samples,
              ElementsAre(1, 255, 10, 11));
  EXPECT_THAT(Error("h.nrrd", head + "encoding: hex\n\n01 fg"),
              HasSubstr("has \"g\" behind 1 bytes of samples in hex"));
  // Two cells from 0 to 4; two nodes, at 0 and 3. The format has two names for the field.
  for (const char* name : {"centers", "centerings"}) {
    const SampledVolume volume =
        Read("m.nrrd", absl::StrCat(head, "axis mins: 0 0 0\naxis maxs: 4 1 3\n", name,
                                    ": cell cell node\nencoding: ascii\n\n1 2 3 4"));
    EXPECT_EQ(volume.corners[7].x - volume.corners[0].x, 4) << name;
    EXPECT_EQ(volume.corners[7].z - volume.corners[0].z, 6) << name;
  }
}

TEST_F(Volumes, NrrdOfMoreThanOneNumber) {
  const std::string head = "NRRD0004\ntype: uchar\nencoding: raw\n";
  const SampledVolume colors =
      Read("a.nrrd", head + "dimension: 3\nsizes: 3 2 1\nkinds: RGB-color domain domain\n\n123456");
  EXPECT_THAT(colors.size, ElementsAre(2, 1, 1));
  EXPECT_THAT(colors.colors, ElementsAre(Rgb{'1', '2', '3'}, Rgb{'4', '5', '6'}));
  // All of red, then green, then blue; and numbers of 16 bits.
  EXPECT_THAT(
      Read("p.nrrd",
           head + "dimension: 3\nsizes: 2 1 3\nkinds: domain domain RGB-color\n\n" + "1a2b3c")
          .colors,
      ElementsAre(Rgb{'1', '2', '3'}, Rgb{'a', 'b', 'c'}));
  EXPECT_THAT(
      Read("w.nrrd", std::string("NRRD0004\ntype: ushort\nendian: big\nencoding: raw\n"
                                 "dimension: 3\nsizes: 3 1 1\nkinds: RGB-color domain domain\n\n") +
                         std::string("\xff\xff\x80\x80\0\0", 6))
          .colors,
      ElementsAre(Rgb{255, 128, 0}));
  // As text, in both orders.
  EXPECT_THAT(Read("t.nrrd",
                   "NRRD0004\ntype: ushort\nencoding: ascii\ndimension: 3\nsizes: 3 2 1\n"
                   "kinds: RGB-color domain domain\n\n65535 0 0 0 32896 65535")
                  .colors,
              ElementsAre(Rgb{255, 0, 0}, Rgb{0, 128, 255}));
  EXPECT_THAT(Read("t.nrrd",
                   "NRRD0004\ntype: uchar\nencoding: text\ndimension: 3\nsizes: 2 1 3\n"
                   "kinds: domain domain RGB-color\n\n255 0 1 2 3 4")
                  .colors,
              ElementsAre(Rgb{255, 1, 3}, Rgb{0, 2, 4}));
  const auto hsv =
      Import("h.nrrd", head + "dimension: 3\nsizes: 3 1 1\nkinds: HSV-color domain domain\n\n123");
  ASSERT_THAT(hsv, IsOk());
  EXPECT_TRUE(hsv->volumes[0].colors.empty());
  EXPECT_THAT(hsv->left_out, ElementsAre(LeftOut{"further components", 2}));
  const auto vectors =
      Import("a.nrrd", head +
                           "dimension: 4\nsizes: 2 1 2 1\nspace: left-posterior-superior\n"
                           "space directions: none (2,0,0) (0, 3, 0) (0,0,4)\n\n1a2b");
  ASSERT_THAT(vectors, IsOk());
  EXPECT_THAT(vectors->volumes[0].samples, ElementsAre('1', '2'));
  EXPECT_EQ(vectors->volumes[0].corners[7], (Point3{1, 4.5, 2}));
  EXPECT_THAT(vectors->left_out, ElementsAre(LeftOut{"further components", 1}));
  const auto times =
      Import("a.nrrd", head + "dimension: 4\nsizes: 2 1 1 3\nbyteskip: -1\n\n__12ab34");
  ASSERT_THAT(times, IsOk());
  EXPECT_THAT(times->volumes[0].samples, ElementsAre('1', '2'));
  EXPECT_THAT(times->left_out, ElementsAre(LeftOut{"further times", 2}));
  EXPECT_THAT(Error("a.nrrd", head + "dimension: 3\nsizes: 1 2 1\nkinds: space vector space\n\n12"),
              HasSubstr("one more at the most, the first or the last"));
  EXPECT_THAT(Error("a.nrrd", head + "dimension: 4\nsizes: 1 2 1 99999999999\n\n12"),
              HasSubstr("numbers in all are read"));
}

// A step of 1, 2 and 3 along each axis, in spaces whose axes go to the patient's right or left, front or back.
TEST_F(Volumes, NrrdOfEitherHand) {
  for (const auto& [space, x, y] : std::initializer_list<std::tuple<const char*, double, double>>{
           {"right-anterior-superior", -1, -1},
           {"RAS", -1, -1},
           {"left-anterior-superior", 1, -1},
           {"LAS", 1, -1},
           {"left-posterior-superior", 1, 1},
           {"LPS", 1, 1},
           {"right-anterior-superior-time", -1, -1},
           {"3D-right-handed", 1, 1}}) {
    const SampledVolume volume =
        Read("a.nrrd",
             absl::StrCat(
                 "NRRD0005\ntype: uchar\nencoding: raw\ndimension: 3\nsizes: 1 1 1\nspace: ", space,
                 "\nspace directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)\n\n1"));
    EXPECT_EQ(volume.corners[0], (Point3{x * 9.5, y * 19, 28.5})) << space;
    EXPECT_EQ(volume.corners[7], (Point3{x * 10.5, y * 21, 31.5})) << space;
  }
}

// Files of npm's nrrd-js, which tools/setup fetches.
TEST_F(Volumes, RealNrrd) {
  const std::string folder = absl::StrCat(VOXELD_DATA_DIR, "/nrrd-js/");
  const auto picture = ReadHere(folder + "example1.nrrd", {});
  ASSERT_THAT(picture, IsOk());
  const SampledVolume& raw = picture->volumes[0];
  EXPECT_THAT(raw.size, ElementsAre(3, 512, 512));
  const std::string bytes = ReadAll(folder + "example1.nrrd");
  for (size_t i = 1; i < raw.samples.size(); i += 1001)
    ASSERT_EQ(raw.samples[raw.samples.size() - i], static_cast<uint8_t>(bytes[bytes.size() - i]));
  const auto text = ReadHere(folder + "example2.nrrd", {});
  ASSERT_THAT(text, IsOk());
  EXPECT_THAT(text->volumes[0].samples,
              ElementsAre(1, 2, 3, 65000, 64000, 63000, 10000, 11000, 12000, 4, 5, 6));
  const auto four = ReadHere(folder + "example4.nrrd", {});
  ASSERT_THAT(four, IsOk());
  EXPECT_THAT(four->volumes[0].size, ElementsAre(4, 3, 2));
  EXPECT_EQ(four->volumes[0].samples[23], 24);
  EXPECT_THAT(four->left_out, ElementsAre(LeftOut{"further times", 1}));
}

TEST_F(Volumes, NrrdThatIsWrong) {
  const std::string head = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 1 2\n";
  EXPECT_THAT(Error("a.nrrd", "hello"), HasSubstr("a header that begins with \"NRRD000\""));
  EXPECT_THAT(Error("a.nrrd", head), HasSubstr("header that does not end"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: raw\n\n123"), HasSubstr("has 3 bytes of samples"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: bzip2\n\n123"),
              HasSubstr("has \"bzip2\" for \"encoding\"; raw, gzip, hex and ascii are read"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: ascii\n\n1 2 x 4"), HasSubstr("sample 2 is \"x\""));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: ascii\n\n1 2 3"), HasSubstr("has 3 samples of 4"));
  EXPECT_THAT(Error("a.nrrd", "NRRD0004\ntype: uchar\nencoding: raw\ndimension: 5\n\n"),
              HasSubstr("has \"5\" for \"dimension\""));
  EXPECT_THAT(
      Error("a.nrrd",
            "NRRD0004\ntype: uchar\nencoding: raw\ndimension: 3\nsizes: 65536 65536 65536\n\n"),
      HasSubstr("at most 268435456"));
  EXPECT_THAT(Error("a.nrrd", "NRRD0004\ntype: block\ndimension: 3\nsizes: 1 1 1\n\n"),
              HasSubstr("has \"block\" for \"type\""));
  EXPECT_THAT(
      Error("a.nrrd", "NRRD0004\ntype: short\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\n"),
      HasSubstr("says nothing of \"endian\""));
  for (const char* path : {"/etc/passwd", "../secret", "LIST", "a%03d.raw 1 2 1"}) {
    EXPECT_THAT(Error("a.nhdr", absl::StrCat(head, "encoding: raw\ndata file: ", path, "\n")),
                HasSubstr("for \"datafile\""));
  }
  EXPECT_THAT(Error("a.nhdr", head + "encoding: raw\ndata file: gone.raw\n"),
              HasSubstr("a.nhdr: has \"gone.raw\" for \"datafile\"; a regular file in its folder"));
}

// Steps that span a volume, and steps that are so long that its end overflows.
TEST_F(Volumes, NrrdThatEndsNowhere) {
  const auto place = [](const char* directions, const char* origin) {
    return absl::StrCat(
        "NRRD0004\ntype: uchar\nencoding: raw\ndimension: 3\nsizes: 2 1 2\nspace: LPS\n",
        "space directions: ", directions, "\nspace origin: ", origin, "\n\n1234");
  };
  EXPECT_THAT(
      Error("a.nrrd", place("(5e307,0,0) (0,1,0) (0,0,1)", "(1.2e308,0,0)")),
      AllOf(HasSubstr("a.nrrd: has a corner at (inf, "), HasSubstr("by steps of (5e+307, 0, 0), "),
            HasSubstr("corners at finite places are expected")));
  EXPECT_THAT(Error("a.nrrd", place("(1e200,0,0) (0,1e-200,0) (0,0,1)", "(0,0,0)")),
              HasSubstr("corners at finite places are expected"));
  EXPECT_THAT(Read("a.nrrd", place("(1e150,0,0) (0,1e150,0) (0,0,1)", "(0,0,0)")).size,
              ElementsAre(2, 1, 2));
}

TEST_F(Volumes, RawAsItIsTold) {
  const ImportOptions options = {
      .raw = RawLayout{.size = {2, 1, 1}, .type = SampleType::kI16, .big_endian = true}};
  EXPECT_THAT(Read("a.raw", std::string("\xff\xfe\x00\x05", 4), options).samples,
              ElementsAre(-2, 5));
  EXPECT_THAT(Error("a.raw", "1234"), HasSubstr("say it: --size"));
  EXPECT_THAT(Error("a.raw", "12345", options),
              HasSubstr("has 5 bytes; 2 by 1 by 1 samples of 2 take 4"));
  EXPECT_THAT(Error("a.raw", "1234", {.raw = RawLayout{.size = {1 << 20, 1, 1}}}),
              HasSubstr("has 1048576 samples along an axis"));
}

}  // namespace nrrd_test
}  // namespace voxeld::voxelctl
