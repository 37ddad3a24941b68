// Tests MetaImage, MRC and TIFF stacks: valid and broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"

namespace voxeld::voxelctl {
namespace stack_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Returns `numbers` as little-endian or big-endian values of type T.
template <typename T>
std::string Numbers(const std::vector<double>& numbers, bool big_endian = false) {
  std::string out;
  for (const double number : numbers) {
    std::string one;
    Put<T>(&one, 0, static_cast<T>(number));
    if (big_endian) std::reverse(one.begin(), one.end());
    out += one;
  }
  return out;
}

std::string Zlib(const std::string& bytes) {
  std::string out(compressBound(bytes.size()), '\0');
  uLongf size = out.size();
  compress(reinterpret_cast<Bytef*>(out.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  out.resize(size);
  return out;
}

// Two by one by two samples, as the lines say.
std::string Meta(const std::string& type, const std::string& lines, const std::string& samples,
                 const std::string& where = "LOCAL") {
  return absl::StrCat("ObjectType = Image\nNDims = 3\nDimSize = 2 1 2\n", lines,
                      "ElementType = ", type, "\nElementDataFile = ", where, "\n", samples);
}

TEST_F(Volumes, MetaImageOfEveryType) {
  const std::vector<double> numbers = {1, 2, 3, 100};
  for (const auto& [type, bytes] : std::initializer_list<std::pair<const char*, std::string>>{
           {"MET_CHAR", Numbers<int8_t>(numbers)},
           {"MET_UCHAR", Numbers<uint8_t>(numbers)},
           {"MET_SHORT", Numbers<int16_t>(numbers)},
           {"MET_USHORT", Numbers<uint16_t>(numbers)},
           {"MET_INT", Numbers<int32_t>(numbers)},
           {"MET_UINT", Numbers<uint32_t>(numbers)},
           {"MET_LONG", Numbers<int32_t>(numbers)},
           {"MET_ULONG", Numbers<uint32_t>(numbers)},
           {"MET_LONG_LONG", Numbers<int64_t>(numbers)},
           {"MET_ULONG_LONG", Numbers<uint64_t>(numbers)},
           {"MET_FLOAT", Numbers<float>(numbers)},
           {"MET_DOUBLE", Numbers<double>(numbers)},
           {"MET_SHORT_ARRAY", Numbers<int16_t>(numbers)}}) {
    EXPECT_THAT(Read("a.mha", Meta(type, "", bytes)).samples, ElementsAre(1, 2, 3, 100)) << type;
  }
  EXPECT_THAT(Read("s.mha", Meta("MET_CHAR", "", "\xff\x80\x7f\x01")).samples,
              ElementsAre(-1, -128, 127, 1));
  for (const char* name : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}) {
    EXPECT_THAT(Read("b.mha", Meta("MET_SHORT", absl::StrCat(name, " = True\n"),
                                   Numbers<int16_t>({258, -2, 3, 4}, true)))
                    .samples,
                ElementsAre(258, -2, 3, 4))
        << name;
  }
}

TEST_F(Volumes, MetaImageInItsWays) {
  const std::string bytes = Numbers<int16_t>({1, -2, 3, 4});
  EXPECT_THAT(Read("a.mha", Meta("MET_SHORT", "CompressedData = True\n", Zlib(bytes))).samples,
              ElementsAre(1, -2, 3, 4))
      << "CompressedDataSize may be missing";
  EXPECT_THAT(Read("g.mha", Meta("MET_SHORT", "CompressedData = True\n", Gzip(bytes))).samples,
              ElementsAre(1, -2, 3, 4));
  EXPECT_THAT(Read("t.mha", Meta("MET_SHORT", "BinaryData = False\n", "1 -2\n3 4.5")).samples,
              ElementsAre(1, -2, 3, 4.5));
  EXPECT_THAT(Read("h.mha", Meta("MET_SHORT", "HeaderSize = 3\n", "xyz" + bytes)).samples,
              ElementsAre(1, -2, 3, 4));
  EXPECT_THAT(Read("e.mha", Meta("MET_SHORT", "HeaderSize = -1\n", "junk!" + bytes)).samples,
              ElementsAre(1, -2, 3, 4));
  EXPECT_THAT(Read("i.mha", Meta("MET_SHORT",
                                 "ElementToIntensityFunctionSlope = 2\n"
                                 "ElementToIntensityFunctionOffset = -1\n",
                                 bytes))
                  .samples,
              ElementsAre(1, -5, 5, 7));
  folder_.Write("d.raw", bytes);
  EXPECT_THAT(Read("d.mhd", Meta("MET_SHORT", "", "", "d.raw")).samples, ElementsAre(1, -2, 3, 4));
  folder_.Write("s07.raw", bytes.substr(0, 4));
  folder_.Write("s09.raw", bytes.substr(4));
  EXPECT_THAT(Read("p.mhd", Meta("MET_SHORT", "", "", "s%02d.raw 7 9 2")).samples,
              ElementsAre(1, -2, 3, 4));
  EXPECT_THAT(Read("l.mhd", Meta("MET_SHORT", "", "s09.raw\r\ns07.raw\r\n", "LIST")).samples,
              ElementsAre(3, 4, 1, -2));
}

// Steps of 2, 3 and 4: the first axis points to the back, the second to the left, the third down.
TEST_F(Volumes, MetaImageLiesWhereItsMatrixSays) {
  const std::string lines =
      "TransformMatrix = 0 1 0 1 0 0 0 0 -1\nOffset = 10 20 30\nElementSpacing = 2 3 4\n";
  const SampledVolume volume = Read("a.mha", Meta("MET_UCHAR", lines, "1234"));
  EXPECT_EQ(volume.corners[0], (Point3{10 - 1.5, 20 - 1, 30 + 2}));
  EXPECT_EQ(volume.corners[7], (Point3{10 + 1.5, 20 + 3, 30 - 6}));
  // Rows are axes: a rotation by 90° about z, not its inverse.
  const SampledVolume turned =
      Read("b.mha", Meta("MET_UCHAR", "TransformMatrix = 0 1 0 -1 0 0 0 0 1\n", "1234"));
  EXPECT_EQ(turned.corners[1], (Point3{0.5, 1.5, -0.5}));
  const SampledVolume sized = Read("c.mha", Meta("MET_UCHAR", "ElementSize = 2 3 4\n", "1234"));
  EXPECT_EQ(sized.corners[7], (Point3{3, 1.5, 6}));
  const auto named = Import("d.mha", Meta("MET_UCHAR", "AnatomicalOrientation = LPS\n", "1234"));
  ASSERT_THAT(named, IsOk());
  EXPECT_THAT(named->note, HasSubstr("AnatomicalOrientation \"LPS\" is not followed"));
}

TEST_F(Volumes, MetaImageOfMoreThanOneNumber) {
  const SampledVolume colors = Read("a.mha", Meta("MET_UCHAR", "ElementNumberOfChannels = 3\n",
                                                  std::string("\xff\0\0abcdefghi", 12)));
  EXPECT_THAT(colors.colors, ElementsAre(Rgb{255, 0, 0}, Rgb{'a', 'b', 'c'}, Rgb{'d', 'e', 'f'},
                                         Rgb{'g', 'h', 'i'}));
  EXPECT_THAT(
      Read("w.mha", Meta("MET_USHORT", "ElementNumberOfChannels = 3\n",
                         Numbers<uint16_t>({65535, 0, 32896, 0, 65535, 0, 1, 2, 3, 0, 0, 0})))
          .colors,
      ElementsAre(Rgb{255, 0, 128}, Rgb{0, 255, 0}, Rgb{0, 0, 0}, Rgb{0, 0, 0}));
  EXPECT_THAT(Read("t.mha", Meta("MET_UCHAR", "ElementNumberOfChannels = 3\nBinaryData = False\n",
                                 "255 0 1 2 3 4 5 6 7 8 9 10"))
                  .colors,
              ElementsAre(Rgb{255, 0, 1}, Rgb{2, 3, 4}, Rgb{5, 6, 7}, Rgb{8, 9, 10}));
  // Signed numbers and floats are vectors.
  EXPECT_TRUE(Read("v.mha", Meta("MET_SHORT", "ElementNumberOfChannels = 3\n",
                                 Numbers<int16_t>({1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3})))
                  .colors.empty());
  const auto two = Import("b.mha", Meta("MET_UCHAR", "ElementNumberOfChannels = 2\n", "1a2b3c4d"));
  ASSERT_THAT(two, IsOk());
  EXPECT_THAT(two->volumes[0].samples, ElementsAre('1', '2', '3', '4'));
  EXPECT_THAT(two->left_out, ElementsAre(LeftOut{"further components", 1}));
  const auto times = Import("c.mha",
                            "NDims = 4\nDimSize = 2 1 1 3\nElementType = MET_UCHAR\n"
                            "ElementSpacing = 2 2 2 1\nElementDataFile = LOCAL\n12ab34");
  ASSERT_THAT(times, IsOk());
  EXPECT_THAT(times->volumes[0].samples, ElementsAre('1', '2'));
  EXPECT_THAT(times->left_out, ElementsAre(LeftOut{"further times", 2}));
}

TEST_F(Volumes, MetaImageThatIsWrong) {
  EXPECT_THAT(Error("a.mha", "hello"), HasSubstr("a header of MetaImage is expected"));
  EXPECT_THAT(Error("a.mha", "NDims = 3\n"), HasSubstr("has no ElementDataFile"));
  EXPECT_THAT(Error("a.mha", Meta("MET_SHORT", "", "1234567")),
              HasSubstr("has 7 bytes of samples; 4 of 2 bytes take 8"));
  EXPECT_THAT(Error("a.mha", Meta("MET_SHORT", "CompressedData = True\n",
                                  Zlib(Numbers<int16_t>({1, 2, 3, 4})).substr(0, 8))),
              HasSubstr("cut off"));
  EXPECT_THAT(Error("a.mha", Meta("MET_STRING", "", "1234")),
              HasSubstr("has \"MET_STRING\" for ElementType"));
  EXPECT_THAT(Error("a.mha", Meta("MET_UCHAR", "TransformMatrix = 1 0 0\n", "1234")),
              HasSubstr("9 numbers are expected"));
  EXPECT_THAT(Error("a.mha",
                    "NDims = 3\nDimSize = 60000 60000 60000\nElementType = "
                    "MET_DOUBLE\nElementDataFile = LOCAL\n12"),
              HasSubstr("at most 268435456"));
  for (const char* path : {"/etc/passwd", "../secret", "gone.raw"}) {
    EXPECT_THAT(
        Error("a.mhd", Meta("MET_UCHAR", "", "", path)),
        HasSubstr(absl::StrCat("has its samples in \"", path, "\"; a regular file in its")));
  }
  EXPECT_THAT(Error("a.mhd", Meta("MET_UCHAR", "", "", "s%s.raw 1 2 1")),
              HasSubstr("for ElementDataFile; a name, LOCAL, LIST or a pattern"));
  EXPECT_THAT(Error("a.mhd", Meta("MET_UCHAR", "", "", "s%d.raw 1 999999999 1")),
              HasSubstr("for ElementDataFile"));
}

// Words are numbered as in MRC2014, from 1 on.
struct Mrc {
  std::vector<int32_t> size = {2, 1, 2};
  int32_t mode = 0;
  bool big_endian = false;
  std::string samples;
  std::vector<std::pair<size_t, int32_t>> words = {};
  std::vector<std::pair<size_t, float>> floats = {};

  std::string Bytes() const {
    std::string out(1024, '\0');
    const auto put = [&](size_t word, auto value) {
      std::string one;
      Put(&one, 0, value);
      if (big_endian) std::reverse(one.begin(), one.end());
      out.replace(4 * (word - 1), 4, one);
    };
    for (size_t i = 0; i < 3; ++i) {
      put(1 + i, size[i]);
      put(8 + i, size[i]);
      put(11 + i, static_cast<float>(size[i]));
      put(14 + i, 90.0f);
      put(17 + i, static_cast<int32_t>(i + 1));
    }
    put(4, mode);
    out.replace(208, 4, "MAP ");
    out.replace(212, 2, big_endian ? "\x11\x11" : "\x44\x44");
    for (const auto& [word, value] : words) put(word, value);
    for (const auto& [word, value] : floats) put(word, value);
    return out + samples;
  }
};

TEST_F(Volumes, MrcOfEveryMode) {
  EXPECT_THAT(Read("a.mrc", Mrc{.mode = 0, .samples = "\xff\x01\x02\x03"}.Bytes()).samples,
              ElementsAre(-1, 1, 2, 3))
      << "MRC2014: signed";
  EXPECT_THAT(
      Read("u.mrc", Mrc{.mode = 0, .samples = "\xff\x01\x02\x03", .floats = {{21, 255}}}.Bytes())
          .samples,
      ElementsAre(255, 1, 2, 3))
      << "the header's greatest density";
  // IMOD's stamp and flags are words 39 and 40 of the header.
  EXPECT_THAT(
      Read("i.mrc",
           Mrc{.mode = 0, .samples = "\xff\x01\x02\x03", .words = {{39, 1146047817}, {40, 0}}}
               .Bytes())
          .samples,
      ElementsAre(255, 1, 2, 3));
  EXPECT_THAT(Read("j.mrc", Mrc{.mode = 0,
                                .samples = "\xff\x01\x02\x03",
                                .words = {{39, 1146047817}, {40, 1}},
                                .floats = {{21, 255}}}
                                .Bytes())
                  .samples,
              ElementsAre(-1, 1, 2, 3));
  for (const bool big : {false, true}) {
    EXPECT_THAT(
        Read("s.mrc",
             Mrc{.mode = 1, .big_endian = big, .samples = Numbers<int16_t>({-300, 1, 2, 3}, big)}
                 .Bytes())
            .samples,
        ElementsAre(-300, 1, 2, 3));
    EXPECT_THAT(
        Read("f.rec",
             Mrc{.mode = 2, .big_endian = big, .samples = Numbers<float>({-0.5, 1, 2, 3}, big)}
                 .Bytes())
            .samples,
        ElementsAre(-0.5, 1, 2, 3));
    EXPECT_THAT(
        Read("w.map",
             Mrc{.mode = 6, .big_endian = big, .samples = Numbers<uint16_t>({60000, 1, 2, 3}, big)}
                 .Bytes())
            .samples,
        ElementsAre(60000, 1, 2, 3));
    // According to IEEE 754: 1, -2, the greatest (65504) and the least above 0 (2 to the power of
    // -24).
    EXPECT_THAT(Read("h.mrc", Mrc{.mode = 12,
                                  .big_endian = big,
                                  .samples = Numbers<uint16_t>({0x3c00, 0xc000, 0x7bff, 1}, big)}
                                  .Bytes())
                    .samples,
                ElementsAre(1, -2, 65504, std::ldexp(1.0f, -24)));
  }
  EXPECT_THAT(
      Read("c.mrc", Mrc{.mode = 16, .samples = "abcdefghijkl"}.Bytes()).colors,
      ElementsAre(Rgb{'a', 'b', 'c'}, Rgb{'d', 'e', 'f'}, Rgb{'g', 'h', 'i'}, Rgb{'j', 'k', 'l'}));
  std::string unstamped =
      Mrc{.mode = 1, .big_endian = true, .samples = Numbers<int16_t>({5, 6, 7, 8}, true)}.Bytes();
  unstamped.replace(208, 6, 6, '\0');
  EXPECT_THAT(Read("n.mrc", unstamped).samples, ElementsAre(5, 6, 7, 8));
}

TEST_F(Volumes, MrcLiesWhereItsHeaderSays) {
  // Cells of 2 by 3 by 4, from (5, 6, 7) on; an extended header of 8 bytes.
  const Mrc plain{.samples =
                      "12345678"
                      "abcd",
                  .words = {{24, 8}},
                  .floats = {{11, 4}, {12, 3}, {13, 8}, {50, 5}, {51, 6}, {52, 7}}};
  const SampledVolume volume = Read("a.mrc", plain.Bytes());
  EXPECT_THAT(volume.samples, ElementsAre('a', 'b', 'c', 'd'));
  EXPECT_EQ(volume.corners[0], (Point3{4, 4.5, 5}));
  EXPECT_EQ(volume.corners[7], (Point3{8, 7.5, 13}));
  // Columns along z, rows along y, sections along x, from interval 3 of z on.
  const Mrc turned{.samples = "1234",
                   .words = {{5, 3}, {17, 3}, {18, 2}, {19, 1}},
                   .floats = {{11, 4}, {12, 3}, {13, 8}}};
  const SampledVolume other = Read("b.mrc", turned.Bytes());
  EXPECT_EQ(other.corners[0], (Point3{-1, -1.5, 3 * 4 - 2}));
  EXPECT_EQ(other.corners[1], (Point3{-1, -1.5, 3 * 4 + 6}));
  EXPECT_EQ(other.corners[4], (Point3{3, -1.5, 3 * 4 - 2}));
  // A cell with 60° between x and y: a step of rows moves to the right by half of its length.
  const SampledVolume skewed =
      Read("c.mrc", Mrc{.size = {2, 2, 2}, .samples = "12345678", .floats = {{16, 60}}}.Bytes());
  EXPECT_NEAR(skewed.corners[2].x - skewed.corners[0].x, 1, 1e-6);
  EXPECT_NEAR(skewed.corners[2].y - skewed.corners[0].y, std::sqrt(3), 1e-6);
}

TEST_F(Volumes, MrcOfSeveralVolumes) {
  const auto stack =
      Import("a.mrc",
             Mrc{.size = {2, 1, 4}, .samples = "12345678", .words = {{10, 2}, {23, 401}}}.Bytes());
  ASSERT_THAT(stack, IsOk());
  EXPECT_THAT(stack->volumes[0].samples, ElementsAre('1', '2', '3', '4'));
  EXPECT_THAT(stack->left_out, ElementsAre(LeftOut{"further volumes", 1}));
  EXPECT_THAT(
      Read("b.mrc", Mrc{.size = {2, 1, 4}, .samples = "12345678", .words = {{10, 2}}}.Bytes()).size,
      ElementsAre(2, 1, 4))
      << "one volume: space group 0";
}

TEST_F(Volumes, MrcThatIsWrong) {
  EXPECT_THAT(Error("a.mrc", "hello"), HasSubstr("an MRC header of 1024 bytes is expected"));
  EXPECT_THAT(Error("a.map", std::string(2000, 'x')), HasSubstr("an MRC header is expected"));
  EXPECT_THAT(Error("a.mrc", Mrc{.mode = 4, .samples = std::string(32, 'x')}.Bytes()),
              HasSubstr("has samples of mode 4"));
  EXPECT_THAT(Error("a.mrc", Mrc{.samples = "123"}.Bytes()),
              HasSubstr("has 3 bytes of samples; 4 of 1 bytes take 4"));
  EXPECT_THAT(Error("a.mrc", Mrc{.size = {2, -1, 2}, .samples = "1234"}.Bytes()),
              HasSubstr("has 0 samples along an axis"));
  EXPECT_THAT(Error("a.mrc", Mrc{.size = {30000, 30000, 30000}, .mode = 2}.Bytes()),
              HasSubstr("at most 268435456"));
  EXPECT_THAT(Error("a.mrc", Mrc{.samples = "1234", .words = {{24, -5}}}.Bytes()),
              HasSubstr("has an extended header of -5 bytes"));
}

// A page: its tags (TIFF 6.0, section 2), each a short (3) or a long (4), and its samples, which
// are one strip unless lists say otherwise.
struct Page {
  uint16_t width = 2, height = 1, bits = 8, channels = 1, photometric = 1;
  std::string samples;
  std::vector<std::tuple<uint16_t, uint16_t, uint32_t>> tags = {};  // and their values
  std::vector<std::tuple<uint16_t, uint16_t, std::vector<uint32_t>>> lists = {};
  std::string description = {};
  double per_unit[2] = {0, 0};
};

std::string Tiff(const std::vector<Page>& pages, bool big_endian = false) {
  const auto number = [big_endian](auto value) {
    std::string out;
    Put(&out, 0, value);
    if (big_endian) std::reverse(out.begin(), out.end());
    return out;
  };
  std::string out = big_endian ? std::string("MM\0*", 4) : std::string("II*\0", 4);
  size_t link = out.size();
  out += number(uint32_t{0});
  for (const Page& page : pages) {
    const auto samples_at = static_cast<uint32_t>(out.size());
    out += page.samples;
    std::vector<std::tuple<uint16_t, uint16_t, uint32_t, std::string>> tags = {
        {256, 3, 1, number(page.width)},
        {257, 3, 1, number(page.height)},
        {262, 3, 1, number(page.photometric)},
        {273, 4, 1, number(samples_at)},
        {277, 3, 1, number(page.channels)},
        {278, 3, 1, number(page.height)},
        {279, 4, 1, number(static_cast<uint32_t>(page.samples.size()))}};
    const auto place = [&](const std::string& bytes) {
      const auto at = static_cast<uint32_t>(out.size());
      out += bytes;
      return number(at);
    };
    std::string bits;
    for (uint16_t i = 0; i < page.channels; ++i) bits += number(page.bits);
    tags.emplace_back(258, 3, page.channels, bits.size() > 4 ? place(bits) : bits);
    if (!page.description.empty())
      tags.emplace_back(270, 2, static_cast<uint32_t>(page.description.size() + 1),
                        place(page.description + '\0'));
    for (size_t i = 0; i < 2; ++i) {
      if (page.per_unit[i] > 0)
        tags.emplace_back(
            282 + i, 5, 1,
            place(number(static_cast<uint32_t>(page.per_unit[i] * 1000)) + number(uint32_t{1000})));
    }
    for (const auto& [tag, type, value] : page.tags) {
      std::erase_if(tags, [tag = tag](const auto& one) { return std::get<0>(one) == tag; });
      tags.emplace_back(tag, type, 1,
                        type == 3 ? number(static_cast<uint16_t>(value)) : number(value));
    }
    for (const auto& [tag, type, values] : page.lists) {
      std::erase_if(tags, [tag = tag](const auto& one) { return std::get<0>(one) == tag; });
      std::string all;
      for (const uint32_t value : values)
        all += type == 3 ? number(static_cast<uint16_t>(value)) : number(value);
      tags.emplace_back(tag, type, static_cast<uint32_t>(values.size()), place(all));
    }
    std::sort(tags.begin(), tags.end());
    out.resize(out.size() + out.size() % 2);
    out.replace(link, 4, number(static_cast<uint32_t>(out.size())));
    out += number(static_cast<uint16_t>(tags.size()));
    for (const auto& [tag, type, count, value] : tags) {
      out += number(tag) + number(type) + number(count) + value;
      out.append(4 - std::min<size_t>(4, value.size()), '\0');
    }
    link = out.size();
    out += number(uint32_t{0});
  }
  return out;
}

TEST_F(Volumes, TiffOfEveryKindOfGrey) {
  for (const bool big : {false, true}) {
    const auto read = [&](uint16_t bits, uint32_t format, const std::string& samples) {
      return Read("a.tif",
                  Tiff({{.bits = bits, .samples = samples, .tags = {{339, 3, format}}}}, big))
          .samples;
    };
    EXPECT_THAT(read(8, 1, "\x01\xff"), ElementsAre(1, 255));
    EXPECT_THAT(read(8, 2, "\x01\xff"), ElementsAre(1, -1));
    EXPECT_THAT(read(16, 1, Numbers<uint16_t>({1, 60000}, big)), ElementsAre(1, 60000));
    EXPECT_THAT(read(16, 2, Numbers<int16_t>({1, -300}, big)), ElementsAre(1, -300));
    EXPECT_THAT(read(32, 1, Numbers<uint32_t>({1, 70000}, big)), ElementsAre(1, 70000));
    EXPECT_THAT(read(32, 2, Numbers<int32_t>({1, -70000}, big)), ElementsAre(1, -70000));
    EXPECT_THAT(read(64, 1, Numbers<uint64_t>({1, 5e9}, big)), ElementsAre(1, 5e9f));
    EXPECT_THAT(read(64, 2, Numbers<int64_t>({1, -5e9}, big)), ElementsAre(1, -5e9f));
    EXPECT_THAT(read(16, 3, Numbers<uint16_t>({0x3c00, 0xc000}, big)), ElementsAre(1, -2));
    EXPECT_THAT(read(32, 3, Numbers<float>({0.5, -1}, big)), ElementsAre(0.5, -1));
    EXPECT_THAT(read(64, 3, Numbers<double>({0.5, -1}, big)), ElementsAre(0.5, -1));
    EXPECT_THAT(read(1, 1, "\x40"), ElementsAre(0, 1));
    EXPECT_THAT(read(4, 1, "\x5f"), ElementsAre(5, 15));
    EXPECT_THAT(read(12, 1, "\xab\xc1\x23"), ElementsAre(0xabc, 0x123));
  }
  EXPECT_THAT(Read("w.tiff", Tiff({{.photometric = 0, .samples = "\x01\xff"}})).samples,
              ElementsAre(254, 0))
      << "white is zero";
  EXPECT_THAT(Read("z.tif", Tiff({{.samples = Zlib("\x05\x06"), .tags = {{259, 3, 8}}}})).samples,
              ElementsAre(5, 6))
      << "deflated";
  EXPECT_THAT(Error("a.tif", Tiff({{.bits = 24, .samples = "123456"}})),
              HasSubstr("has samples of 24 bits in format 1"));
}

TEST_F(Volumes, TiffOfColours) {
  EXPECT_THAT(Read("a.tif", Tiff({{.channels = 3,
                                   .photometric = 2,
                                   .samples = std::string("\xff\0\0\x01\x02\x03", 6)}}))
                  .colors,
              ElementsAre(Rgb{255, 0, 0}, Rgb{1, 2, 3}));
  EXPECT_THAT(
      Read("b.tif", Tiff({{.bits = 16,
                           .channels = 3,
                           .photometric = 2,
                           .samples = Numbers<uint16_t>({0xffff, 0, 0, 0, 0x8080, 0xffff})}}))
          .colors,
      ElementsAre(Rgb{255, 0, 0}, Rgb{0, 128, 255}));
  // A palette of two: all of red, all of green, all of blue, in 16 bits.
  EXPECT_THAT(Read("p.tif", Tiff({{.bits = 1,
                                   .photometric = 3,
                                   .samples = "\x40",
                                   .lists = {{320, 3, {0xffff, 0, 0, 0x8080, 0, 0xffff}}}}}))
                  .colors,
              ElementsAre(Rgb{255, 0, 0}, Rgb{0, 128, 255}));
  // An opacity that is not premultiplied (ExtraSamples 2): half of it.
  EXPECT_THAT(Read("c.tif", Tiff({{.width = 1,
                                   .channels = 4,
                                   .photometric = 2,
                                   .samples = "\xff\x64\x32\x80",
                                   .tags = {{338, 3, 2}}}}))
                  .colors,
              ElementsAre(Rgb{128, 50, 25}));
  const auto two = Import("d.tif", Tiff({{.channels = 2, .samples = "1a2b"}}));
  ASSERT_THAT(two, IsOk());
  EXPECT_THAT(two->volumes[0].samples, ElementsAre('1', '2'));
  EXPECT_THAT(two->left_out, ElementsAre(LeftOut{"further components", 1}));
}

TEST_F(Volumes, TiffStacks) {
  const auto pages = Import("a.tif", Tiff({{.samples = "12"},
                                           {.samples = "34"},
                                           {.width = 1, .samples = "x", .tags = {{254, 4, 1}}},
                                           {.width = 3, .samples = "xyz"},
                                           {.samples = "56"}}));
  ASSERT_THAT(pages, IsOk());
  EXPECT_EQ(pages->format, "TIFF");
  EXPECT_THAT(pages->volumes[0].size, ElementsAre(2, 1, 3));
  EXPECT_THAT(pages->volumes[0].samples, ElementsAre('1', '2', '3', '4', '5', '6'));
  EXPECT_THAT(pages->left_out, ElementsAre(LeftOut{"pages of another size or type", 1},
                                           LeftOut{"previews and masks", 1}));
  // Tiles of 16 by 16 for a picture of 17 by 2: the second has one column of it.
  std::string tiles(512, '\0');
  for (size_t row = 0; row < 2; ++row) {
    for (size_t x = 0; x < 17; ++x)
      tiles[(x < 16 ? 0 : 256) + row * 16 + x % 16] = static_cast<char>(1 + row * 17 + x);
  }
  const SampledVolume volume =
      Read("t.tif", Tiff({{.width = 17,
                           .height = 2,
                           .samples = tiles,
                           .tags = {{322, 3, 16}, {323, 3, 16}},
                           .lists = {{324, 4, {8, 8 + 256}}, {325, 4, {256, 256}}}}}));
  for (size_t i = 0; i < 34; ++i) ASSERT_EQ(volume.samples[i], static_cast<float>(i + 1));
  // One strip for each row.
  EXPECT_THAT(Read("s.tif", Tiff({{.height = 2,
                                   .samples = "12xx34",
                                   .tags = {{278, 3, 1}},
                                   .lists = {{273, 4, {8, 12}}, {279, 4, {2, 2}}}}}))
                  .samples,
              ElementsAre('1', '2', '3', '4'));
}

// Channels change first, then slices, then times: pages 1 and 3 of 8 are the first channel's at the
// first time.
TEST_F(Volumes, TiffStacksOfChannelsAndTimes) {
  const auto stack = [](const std::string& description) {
    std::vector<Page> pages;
    for (char c = 'a'; c < 'i'; ++c) pages.push_back({.width = 1, .samples = std::string(1, c)});
    pages[0].description = description;
    pages[0].per_unit[0] = 4;
    pages[0].per_unit[1] = 2;
    return Tiff(pages);
  };
  const auto image_j = Import(
      "a.tif",
      stack("ImageJ=1.53\nimages=8\nchannels=2\nslices=2\nframes=2\nunit=micron\nspacing=0.5\n"));
  ASSERT_THAT(image_j, IsOk());
  EXPECT_THAT(image_j->volumes[0].samples, ElementsAre('a', 'c'));
  EXPECT_THAT(image_j->left_out,
              ElementsAre(LeftOut{"further channels", 1}, LeftOut{"further times", 1}));
  EXPECT_EQ(image_j->volumes[0].corners[7], (Point3{0.125, 0.25, 0.75}));
  const auto ome = Import(
      "b.tif",
      stack("<?xml version=\"1.0\"?><OME><Image><Pixels DimensionOrder=\"XYZTC\" SizeZ=\"2\" "
            "SizeC=\"2\" SizeT=\"2\" PhysicalSizeX=\"100\" PhysicalSizeXUnit=\"nm\" "
            "PhysicalSizeY=\"0.1\" PhysicalSizeZ=\"0.3\"></Pixels></Image></OME>"));
  ASSERT_THAT(ome, IsOk());
  EXPECT_THAT(ome->volumes[0].samples, ElementsAre('a', 'b'));
  EXPECT_NEAR(ome->volumes[0].corners[7].x, 0.05, 1e-9);
  EXPECT_NEAR(ome->volumes[0].corners[7].z, 0.45, 1e-9);
  const auto wrong = Import("c.tif", stack("ImageJ=1.53\nimages=8\nchannels=3\nslices=2\n"));
  ASSERT_THAT(wrong, IsOk());
  EXPECT_THAT(wrong->volumes[0].size, ElementsAre(1, 1, 8));
  EXPECT_THAT(wrong->note,
              HasSubstr("counts 2 slices, 3 channels and 1 times, and it has 8 pages"));
}

// OME's elements say where each page is; the order of the pages does not.
TEST_F(Volumes, TiffPagesWhereOmePutsThem) {
  const auto stack = [this](const std::string& elements, const std::string& sizes) {
    std::vector<Page> pages;
    for (char c = 'a'; c < 'e'; ++c) pages.push_back({.width = 1, .samples = std::string(1, c)});
    pages[0].description =
        absl::StrCat("<?xml version=\"1.0\"?><OME><Image><Pixels DimensionOrder=\"XYZCT\" ", sizes,
                     ">", elements, "</Pixels></Image></OME>");
    const auto model = Import("a.tif", Tiff(pages));
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->volumes[0].samples : std::vector<float>();
  };
  const std::string deep = "SizeZ=\"4\" SizeC=\"1\" SizeT=\"1\"",
                    times = "SizeZ=\"2\" SizeC=\"1\" SizeT=\"2\"";
  EXPECT_THAT(stack("<TiffData IFD=\"0\" FirstZ=\"2\" PlaneCount=\"2\"/>"
                    "<TiffData IFD=\"2\" FirstZ=\"0\" PlaneCount=\"2\"></TiffData>",
                    deep),
              ElementsAre('c', 'd', 'a', 'b'));
  EXPECT_THAT(stack("<TiffData FirstT=\"1\" IFD=\"0\"/><TiffData IFD=\"1\" FirstZ=\"1\"/>"
                    "<TiffData IFD=\"2\" FirstZ=\"1\" FirstT=\"1\"/><TiffData IFD=\"3\"/>",
                    times),
              ElementsAre('d', 'b'));
  EXPECT_THAT(stack("<TiffData/>", times), ElementsAre('a', 'b'));
  // Elements may name pages in any order, and one without a page continues the element before.
  EXPECT_THAT(stack("<TiffData IFD=\"2\" FirstZ=\"0\" PlaneCount=\"2\"/>"
                    "<TiffData IFD=\"0\" FirstZ=\"2\"/><TiffData FirstZ=\"3\"/>",
                    deep),
              ElementsAre('c', 'd', 'a', 'b'));
  // A text that does not name all pages, or names a slice that does not exist, is ignored.
  EXPECT_THAT(stack("<TiffData IFD=\"0\" FirstZ=\"3\"/>", deep), ElementsAre('a', 'b', 'c', 'd'));
  EXPECT_THAT(stack("<TiffData IFD=\"0\" FirstZ=\"9\"/>", deep), ElementsAre('a', 'b', 'c', 'd'));
}

TEST_F(Volumes, TiffWithFewerPagesThanItsDescriptionCounts) {
  const auto model = Import(
      "a.tif",
      Tiff({{.width = 1, .samples = "a", .description = "ImageJ=1.53\nimages=4\nslices=4\n"}}));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->note, HasSubstr("counts 4"));
}

TEST_F(Volumes, TiffTurnedByItsOrientation) {
  const auto corner = [&](uint32_t orientation) {
    return Read("a.tif", Tiff({{.width = 4,
                                .height = 2,
                                .samples = "12345678",
                                .tags = {{274, 3, orientation}}}}))
        .corners[3];
  };
  EXPECT_EQ(corner(1).x, 3.5);
  EXPECT_EQ(corner(1).y, 1.5);
  EXPECT_EQ(corner(2).x, -3.5);
  EXPECT_EQ(corner(4).y, -1.5);
  EXPECT_EQ(corner(6).x, -1.5) << "rows go to the left";
  EXPECT_EQ(corner(6).y, 3.5) << "columns go to the back";
}

TEST_F(Volumes, TiffThatIsWrong) {
  EXPECT_THAT(Error("a.tif", "hello"), HasSubstr("TIFF is expected"));
  const std::string good = Tiff({{.samples = "12"}, {.samples = "34"}});
  EXPECT_THAT(Error("a.tif", good.substr(0, 20)),
              HasSubstr("could not be decoded (the first page"));
  EXPECT_THAT(Error("a.tif", good.substr(0, good.size() - 20)), HasSubstr("could not be decoded"));
  EXPECT_THAT(Error("a.tif", Tiff({{.samples = Zlib("12").substr(0, 4), .tags = {{259, 3, 8}}}})),
              HasSubstr("could not be decoded (page 1 from row 0"));
  EXPECT_THAT(Error("a.tif", Tiff({{.width = 65000, .height = 65000, .samples = "12"}})),
              HasSubstr("at most 268435456"));
  EXPECT_THAT(Error("a.tif", Tiff({{.samples = "12", .tags = {{259, 3, 34676}}}})),
              testing::AnyOf(HasSubstr("could not be decoded"), HasSubstr("has samples")));
  // A page that follows itself: its directory is at the end, before the link to the next one.
  std::string loop = Tiff({{.samples = "12"}});
  uint32_t first = 0;
  std::memcpy(&first, loop.data() + 4, 4);
  Put<uint32_t>(&loop, loop.size() - 4, first);
  EXPECT_THAT(Read("a.tif", loop).size, ElementsAre(2, 1, 1));
}

// Bit flips and truncations of each format: the result is an error or a model, never a crash.
TEST_F(Volumes, DamagedStacks) {
  const std::vector<std::pair<const char*, std::string>> files = {
      {"a.mha", Meta("MET_SHORT", "TransformMatrix = 0 1 0 1 0 0 0 0 -1\nOffset = 10 20 30\n",
                     Numbers<int16_t>({1, 2, 3, 4}))},
      {"b.mha", Meta("MET_SHORT", "CompressedData = True\n", Zlib(Numbers<int16_t>({1, 2, 3, 4})))},
      {"c.mha", Meta("MET_SHORT", "BinaryData = False\n", "1 2 3 4")},
      {"a.mrc", Mrc{.mode = 2, .samples = Numbers<float>({1, 2, 3, 4})}.Bytes()},
      {"a.tif", Tiff({{.samples = "12", .description = "ImageJ=1\nslices=2\nspacing=2\n"},
                      {.samples = "34"}})},
      {"b.tif", Tiff({{.samples = Zlib("12"), .tags = {{259, 3, 8}}}}, true)},
      {"c.tif", Tiff({{.channels = 3, .photometric = 2, .samples = "123456"}})}};
  std::mt19937 random(43);
  for (const auto& [name, good] : files) {
    ASSERT_THAT(Import(name, good), IsOk()) << name;
    for (int i = 0; i < 2000; ++i) {
      std::string bytes = good;
      if (i % 5 == 0) bytes.resize(random() % bytes.size());
      for (uint32_t k = random() % 5; k > 0 && !bytes.empty(); --k) {
        char& byte = bytes[random() % bytes.size()];
        byte = static_cast<char>(random() % 2 == 0 ? byte ^ 1 << random() % 8 : random());
      }
      const std::string extension = std::string(name).substr(2);
      const auto model =
          ReadAndCheck({.path = name, .extension = extension, .bytes = std::move(bytes)}, {});
      if (!model.ok()) {
        EXPECT_THAT(std::string(model.status().message()), HasSubstr(name));
      }
    }
  }
}

}  // namespace stack_test
}  // namespace voxeld::voxelctl
