// Volumes: NIfTI, NRRD, raw samples and DICOM, real and broken ones, and what is sent of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/placement.h"
#include "tools/voxelctl/scene/volume.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kTemplates[] = "/usr/share/mricron/templates/";
constexpr char kSlice[] = "/usr/share/doc/libgdcm3.0/examples/00191113.dcm";

std::string Gzip(const std::string& bytes) {
  z_stream stream = {};
  deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY);
  std::string out(compressBound(bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

template <typename T>
void Put(std::string* out, size_t at, T value) {
  if (out->size() < at + sizeof(value)) out->resize(at + sizeof(value), '\0');
  std::memcpy(out->data() + at, &value, sizeof(value));
}

class Volumes : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes,
                               const ImportOptions& options = {}) {
    return ImportFile(folder_.Write(name, bytes), options);
  }
  SampledVolume Read(const std::string& name, const std::string& bytes,
                     const ImportOptions& options = {}) {
    const auto model = Import(name, bytes, options);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->volumes.at(0) : SampledVolume();
  }
  std::string Error(const std::string& name, const std::string& bytes,
                    const ImportOptions& options = {}) {
    return std::string(Import(name, bytes, options).status().message());
  }

  TempFolder folder_;
};

// Bytes as the standard numbers them: dim at 40, datatype at 70, pixdim at 76, vox_offset at 108, scl_slope at 112.
std::string Nifti(const std::vector<int16_t>& dim, int16_t type, const std::string& samples) {
  std::string out(352, '\0');
  Put<int32_t>(&out, 0, 348);
  for (size_t i = 0; i < dim.size(); ++i) Put<int16_t>(&out, 40 + 2 * i, dim[i]);
  Put<int16_t>(&out, 70, type);
  for (size_t i = 0; i < 4; ++i) Put<float>(&out, 76 + 4 * i, i == 0 ? 1 : static_cast<float>(i));
  Put<float>(&out, 108, 352);
  std::memcpy(out.data() + 344, "n+1", 4);
  return out + samples;
}

TEST_F(Volumes, NiftiOfEveryKind) {
  std::string good = Nifti({3, 2, 2, 1}, 2, "\x01\x02\x03\xff");
  EXPECT_THAT(Read("a.nii", good).samples, ElementsAre(1, 2, 3, 255));
  EXPECT_THAT(Read("a.nii.gz", Gzip(good)).samples, ElementsAre(1, 2, 3, 255));
  Put<float>(&good, 112, 2);
  Put<float>(&good, 116, -1);
  EXPECT_THAT(Read("b.nii", good).samples, ElementsAre(1, 3, 5, 509));
  std::string floats(8, '\0');
  Put<float>(&floats, 0, 0.5f);
  Put<float>(&floats, 4, INFINITY);
  const SampledVolume two = Read("c.nii", Nifti({1, 2}, 16, floats));
  EXPECT_EQ(two.samples[0], 0.5f);
  EXPECT_TRUE(std::isnan(two.samples[1])) << "the wire has no infinity";
}

// As the standard numbers them: dim at 16, datatype at 12, pixdim at 104, vox_offset at 168.
std::string Nifti2(const std::vector<int64_t>& dim, int16_t type, const std::string& samples) {
  std::string out(544, '\0');
  Put<int32_t>(&out, 0, 540);
  std::memcpy(out.data() + 4, "n+2\0\r\n\032\n", 8);
  Put<int16_t>(&out, 12, type);
  for (size_t i = 0; i < dim.size(); ++i) Put<int64_t>(&out, 16 + 8 * i, dim[i]);
  for (size_t i = 0; i < 4; ++i)
    Put<double>(&out, 104 + 8 * i, i == 0 ? 1 : static_cast<double>(i));
  Put<int64_t>(&out, 168, 544);
  return out + samples;
}

TEST_F(Volumes, Nifti2) {
  std::string bytes = Nifti2({3, 2, 2, 1}, 4, std::string("\x01\x00\x02\x00\x03\x00\xff\xff", 8));
  EXPECT_THAT(Read("a.nii", bytes).samples, ElementsAre(1, 2, 3, -1));
  Put<double>(&bytes, 176, 2);
  Put<double>(&bytes, 184, -1);
  Put<double>(&bytes, 192, 500);
  Put<double>(&bytes, 200, 100);
  Put<int32_t>(&bytes, 348, 1);  // sform_code
  const double rows[12] = {2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  for (size_t i = 0; i < 12; ++i) Put<double>(&bytes, 400 + 8 * i, rows[i]);
  const SampledVolume placed = Read("a.nii.gz", Gzip(bytes));
  EXPECT_THAT(placed.samples, ElementsAre(1, 3, 5, -3));
  EXPECT_THAT(*placed.window, ElementsAre(100, 500));
  EXPECT_EQ(placed.corners[0], (Point3{-9, -18.5, 28}));
  EXPECT_THAT(Error("b.nii", Nifti2({3, int64_t{1} << 40, 2, 1}, 2, "1234")),
              HasSubstr("has 1099511627776 samples along an axis"));
  EXPECT_THAT(
      Error("b.nii", Nifti2({7, 2, 2, 1, int64_t{1} << 62, int64_t{1} << 62, 4, 4}, 2, "1234")),
      HasSubstr("samples along axis 4; at most"));
  EXPECT_THAT(Error("b.nii", Nifti2({3, 2, 2, 1}, 2, "1234").substr(0, 500)),
              HasSubstr("a header of NIfTI is expected"));
}

// Every number of a big-endian header and of its samples lies the other way.
TEST_F(Volumes, NiftiOfTheOtherEnd) {
  const auto turn = [](std::string* bytes, size_t at, size_t each, size_t count) {
    for (size_t i = 0; i < count; ++i)
      std::reverse(bytes->begin() + static_cast<std::ptrdiff_t>(at + i * each),
                   bytes->begin() + static_cast<std::ptrdiff_t>(at + (i + 1) * each));
  };
  std::string one = Nifti({3, 2, 1, 1}, 4, std::string("\x01\x02\xff\xfe", 4));
  turn(&one, 0, 4, 1);
  turn(&one, 40, 2, 8);
  turn(&one, 70, 2, 1);
  turn(&one, 76, 4, 9);
  EXPECT_THAT(Read("a.nii", one).samples, ElementsAre(258, -2));
  std::string two = Nifti2({3, 2, 1, 1}, 4, std::string("\x01\x02\xff\xfe", 4));
  turn(&two, 0, 4, 1);
  turn(&two, 12, 2, 1);
  turn(&two, 16, 8, 8);
  turn(&two, 104, 8, 9);
  EXPECT_THAT(Read("a.nii", two).samples, ElementsAre(258, -2));
}

TEST_F(Volumes, NiftiInTwoFiles) {
  std::string header = Nifti({3, 2, 2, 1}, 2, "");
  std::memcpy(header.data() + 344, "ni1", 4);
  Put<float>(&header, 108, 1);
  EXPECT_THAT(Error("a.hdr", header),
              HasSubstr("has its samples in another file, and there is none"));
  EXPECT_THAT(Error("b.img", "x1234"), HasSubstr("has no header beside it"));
  folder_.Write("a.img", "x1234");
  EXPECT_THAT(Read("a.hdr", header).samples, ElementsAre('1', '2', '3', '4'));
  EXPECT_THAT(Read("a.img", "x5678").samples, ElementsAre('5', '6', '7', '8'));
  EXPECT_THAT(Error("a.img", "x56"), HasSubstr("a.img: has 2 bytes of samples"));
  folder_.Write("c.img.gz", Gzip("x5678"));
  EXPECT_THAT(Read("c.hdr", header).samples, ElementsAre('5', '6', '7', '8'));
}

TEST_F(Volumes, NiftiOfColours) {
  const SampledVolume three =
      Read("a.nii", Nifti({3, 2, 1, 1}, 128, std::string("\xff\0\0\x0a\x14\x1e", 6)));
  EXPECT_THAT(three.colors, ElementsAre(Rgb{255, 0, 0}, Rgb{10, 20, 30}));
  EXPECT_NEAR(three.samples[0], 0.299 * 255, 1e-4) << "brightness";
  const SampledVolume four =
      Read("a.nii", Nifti({3, 2, 1, 1}, 2304, "\x64\xc8\xff\xff\x64\xc8\xff\x80"));
  EXPECT_THAT(four.colors, ElementsAre(Rgb{100, 200, 255}, Rgb{50, 100, 128}));
}

TEST_F(Volumes, NiftiLiesWhereItsMatrixSays) {
  std::string bytes = Nifti({3, 2, 2, 2}, 2, "12345678");
  Put<int16_t>(&bytes, 254, 1);  // sform_code
  const float rows[12] = {2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  for (size_t i = 0; i < 12; ++i) Put<float>(&bytes, 280 + 4 * i, rows[i]);
  const SampledVolume volume = Read("a.nii", bytes);
  // Samples lie in the middle of their cells; x and y are turned so that the face is to the viewer.
  EXPECT_EQ(volume.corners[0], (Point3{-9, -18.5, 28}));
  EXPECT_EQ(volume.corners[7], (Point3{-13, -24.5, 36}));
  EXPECT_EQ(volume.corners[1], (Point3{-13, -18.5, 28}));
}

TEST_F(Volumes, NiftiThatIsWrong) {
  const std::string good = Nifti({3, 2, 2, 1}, 2, "1234");
  EXPECT_THAT(Error("a.nii", "hello"), HasSubstr("has 5 bytes; a NIfTI header of 348"));
  EXPECT_THAT(Error("a.nii", std::string(400, 'x')), HasSubstr("a header of NIfTI is expected"));
  EXPECT_THAT(Error("a.nii", good.substr(0, 355)),
              HasSubstr("has 3 bytes of samples; 2 by 2 by 1"));
  EXPECT_THAT(Error("a.nii.gz", Gzip(good).substr(0, 40)), HasSubstr("cut off"));
  EXPECT_THAT(Error("a.nii.gz", Gzip(good.substr(0, 355))), HasSubstr("has 3 bytes of samples"));
  EXPECT_THAT(Error("a.nii", Nifti({3, 2, -2, 1}, 2, "1234")),
              HasSubstr("has -2 samples along axis 2"));
  EXPECT_THAT(Error("a.nii", Nifti({9, 2, 2, 1}, 2, "1234")), HasSubstr("has 9 dimensions"));
  EXPECT_THAT(Error("a.nii", Nifti({3, 32767, 32767, 32767}, 64, "1234")),
              HasSubstr("has 32767 by 32767 by 32767 samples; at most 268435456"));
  EXPECT_THAT(Error("a.nii", Nifti({3, 2, 2, 1}, 32, "1234")), HasSubstr("datatype 32"));
  std::string far = good;
  Put<float>(&far, 108, 1e30f);
  EXPECT_THAT(Error("a.nii", far), HasSubstr("vox_offset"));
  std::string flat = good;
  Put<int16_t>(&flat, 254, 1);
  EXPECT_THAT(Error("a.nii", flat), HasSubstr("that span a volume"));
  const std::string nothing(4, '\xff');
  EXPECT_THAT(Error("a.nii", Nifti({1, 1}, 16, nothing)), HasSubstr("no sample that is a number"));
}

// What a small file decompresses to beyond the samples is not even looked at.
TEST_F(Volumes, BombsTakeNoMemory) {
  const std::string bomb =
      Gzip(Nifti({3, 2, 2, 1}, 2, "1234") + std::string(size_t{200} << 20, '\0'));
  ASSERT_LT(bomb.size(), size_t{1} << 20);
  EXPECT_THAT(Read("a.nii.gz", bomb).samples.size(), 4);
}

TEST_F(Volumes, RealBrains) {
  const auto brain = ImportFile(absl::StrCat(kTemplates, "ch2bet.nii.gz"), {});
  ASSERT_THAT(brain, IsOk()) << "tools/setup installs mricron-data";
  EXPECT_EQ(brain->format, "NIfTI, compressed");
  EXPECT_THAT(brain->volumes.at(0).size, ElementsAre(181, 217, 181));
  for (const char* name : {"aal.nii.gz", "ch2.nii.gz", "inia19-t1-brain.nii.gz", "brodmann.nii.gz"})
    EXPECT_THAT(ImportFile(absl::StrCat(kTemplates, name), {}), IsOk()) << name;
}

TEST_F(Volumes, NrrdInItsWays) {
  const std::string head = "NRRD0004\n# c\ntype: unsigned char\ndimension: 3\nsizes: 2 1 2\n";
  EXPECT_THAT(Read("a.nrrd", head + "encoding: raw\n\n\x01\x02\x03\x04").samples,
              ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(Read("b.nrrd", head + "encoding: gzip\n\n" + Gzip("\x01\x02\x03\x04")).samples,
              ElementsAre(1, 2, 3, 4));
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

TEST_F(Volumes, NrrdThatIsWrong) {
  const std::string head = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 1 2\n";
  EXPECT_THAT(Error("a.nrrd", "hello"), HasSubstr("a header that begins with \"NRRD000\""));
  EXPECT_THAT(Error("a.nrrd", head), HasSubstr("header that does not end"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: raw\n\n123"), HasSubstr("has 3 bytes of samples"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: bzip2\n\n123"),
              HasSubstr("has \"bzip2\" for \"encoding\"; raw, gzip and ascii are read"));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: ascii\n\n1 2 x 4"), HasSubstr("sample 2 is \"x\""));
  EXPECT_THAT(Error("a.nrrd", head + "encoding: ascii\n\n1 2 3"), HasSubstr("has 3 samples of 4"));
  EXPECT_THAT(Error("a.nrrd", "NRRD0004\ntype: uchar\ndimension: 4\n\n"),
              HasSubstr("has \"4\" for \"dimension\""));
  EXPECT_THAT(Error("a.nrrd", "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 65536 65536 65536\n\n"),
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
              HasSubstr("No such file"));
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

TEST_F(Volumes, ARealSlice) {
  // Images of Debian without documentation lack it.
  ASSERT_TRUE(std::filesystem::exists(kSlice)) << "libgdcm3.0's example is not installed";
  const auto model = ImportFile(kSlice, {});
  ASSERT_THAT(model, IsOk());
  EXPECT_EQ(model->format, "DICOM");
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(512, 512, 4)) << "JPEG, lossless";
  const Point3 &from = model->volumes[0].corners[0], &to = model->volumes[0].corners[7];
  EXPECT_NEAR((to.z - from.z) / (to.x - from.x), 0.05, 1e-9) << "four layers can be seen";
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
  // High bytes in a run of six, low ones as they are; a table of offsets before them.
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
  EXPECT_THAT(Error("a.dcm", head + item("") + item(std::string(70, '\0')) + end),
              testing::AnyOf(HasSubstr("could not be decoded"), HasSubstr("crashed")));
  std::mt19937 random(9);
  for (int i = 0; i < 60; ++i) {
    std::string damaged = rle;
    damaged[random() % damaged.size()] = static_cast<char>(random());
    (void)Import("a.dcm", head + item("") + item(damaged) + end);
  }
}

// Of python3-pydicom, which tools/setup installs.
const std::string kDicoms = "/usr/lib/python3/dist-packages/pydicom/data/test_files/";

SampledVolume ReadReal(const std::string& name) {
  const auto model = ImportFile(kDicoms + name, {});
  EXPECT_TRUE(model.ok()) << model.status();
  return model.ok() ? model->volumes.at(0) : SampledVolume();
}

// One picture in every way to write it.
TEST_F(Volumes, RealSlicesHoweverTheyAreWritten) {
  const SampledVolume plain = ReadReal("MR_small.dcm");
  ASSERT_THAT(plain.size, ElementsAre(64, 64, 1));
  // As the file has them, from its end: 64 by 64 numbers of 16 bits before 126 bytes of padding.
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

// A test card of ten bars; what is compressed with a loss is near.
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
  EXPECT_THAT(std::string(ImportFile(kDicoms + "SC_rgb_rle_16bit.dcm", {}).status().message()),
              HasSubstr("has colours of 16 bits, compressed by run lengths"));
  EXPECT_THAT(std::string(ImportFile(kDicoms + "SC_rgb_rle_32bit.dcm", {}).status().message()),
              HasSubstr("has 32 bits for each colour"));
}

TEST_F(Volumes, RealSlicesInAFolder) {
  const auto model = ImportFile(kDicoms + "dicomdirtests/98892001/CT5N", {});
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
  EXPECT_THAT(Error("a.dcm", picture("")), HasSubstr("has no palette of red"));
  EXPECT_THAT(Error("a.dcm", picture(palette(16, "\x10\x20"))),
              HasSubstr("has 2 bytes for 2 entries of 16 bits"));
  EXPECT_THAT(Error("a.dcm", picture(palette(8, "\x10\x20", 0))),
              HasSubstr("has 2 bytes for 65536 entries"));
}

TEST_F(Volumes, AFolderOfOneFileIsThatFile) {
  // Images of Debian without documentation lack it.
  ASSERT_TRUE(std::filesystem::exists(kSlice)) << "libgdcm3.0's example is not installed";
  folder_.Write("a", ReadAll(kSlice));
  const auto model = ImportFile(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->volumes.at(0).size, ElementsAre(512, 512, 4));
}

TEST_F(Volumes, AFolderOfSlicesInTheirOrder) {
  // By name the order would be another; a third has another series, a fourth is no DICOM.
  folder_.Write("1", Dicom("7", 9, 600));
  folder_.Write("2.dcm", Dicom("7", 3, 500));
  folder_.Write("3.dcm", Dicom("8", 5, 0));
  folder_.Write("notes.txt", "hello");
  const auto model = ImportFile(folder_.Path(""), {});
  ASSERT_THAT(model, IsOk());
  const SampledVolume& volume = model->volumes.at(0);
  EXPECT_THAT(volume.size, ElementsAre(3, 2, 2));
  EXPECT_EQ(volume.samples.front(), 0) << "500 times 2 less 1000";
  EXPECT_EQ(volume.samples[6], 200);
  EXPECT_EQ(volume.corners[0], (Point3{0.875, 1.75, 0}));
  EXPECT_EQ(volume.corners[7], (Point3{1.625, 2.75, 12}));
  EXPECT_THAT(*volume.window, ElementsAre(-160, 240));
  EXPECT_THAT(model->note, HasSubstr("of its 2 series the one with the most slices, 2"));
  EXPECT_THAT(model->note, HasSubstr("1 files that hold no image"));
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
  EXPECT_THAT(std::string(ImportFile(folder_.Path("empty"), {}).status().message()),
              HasSubstr("none of its 0 files is DICOM"));
}

TEST_F(Volumes, DamagedOnesEndWell) {
  const std::string goods[] = {
      Dicom("7", 0, 1, Element(8, 0x1140, "SQ", "")), Nifti({3, 2, 2, 1}, 2, "1234"),
      "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 1 2\nspace directions: "
      "(1,0,0) (0,1,0) (0,0,1)\nencoding: raw\n\n1234"};
  const char* const names[] = {"a.dcm", "a.nii", "a.nrrd"};
  std::mt19937 random(5);
  for (size_t kind = 0; kind < 3; ++kind) {
    ASSERT_THAT(Import(names[kind], goods[kind]), IsOk());
    for (int i = 0; i < 500; ++i) {
      std::string bytes = goods[kind];
      bytes[random() % bytes.size()] = static_cast<char>(random());
      if (i % 4 == 0) bytes.resize(1 + random() % bytes.size());
      const auto model = Import(names[kind], bytes);
      if (!model.ok()) {
        EXPECT_THAT(std::string(model.status().message()), HasSubstr(names[kind]));
      }
    }
  }
}

// ------------------------------------------------------------------------------- what is sent

SampledVolume Ramp(uint32_t nx, uint32_t ny, uint32_t nz) {
  SampledVolume volume{.size = {nx, ny, nz}, .samples = {}};
  for (uint32_t i = 0; i < nx * ny * nz; ++i) volume.samples.push_back(static_cast<float>(i % nx));
  EXPECT_TRUE(
      PlaceVolume({}, {0.5, 0.5, 0.5}, {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}}, &volume)
          .ok());
  return volume;
}

TEST(PackedVolumes, AreBytesWithinTheWindow) {
  const auto packed = PackVolume(Ramp(5, 1, 1), {.window = {{1, 3}}}, {});
  ASSERT_THAT(packed, IsOk());
  const auto& volume = std::get<client::Volume>(packed->part.shape);
  const auto bytes = std::get<client::Array<uint8_t>>(volume.grid.samples).view();
  EXPECT_THAT(std::vector<int>(bytes.begin(), bytes.end()), ElementsAre(0, 0, 128, 255, 255));
  EXPECT_EQ(volume.grid.edge_a.x, 5);
  EXPECT_EQ(packed->note, "");
}

TEST(PackedVolumes, AreReducedToWhatTheServerTakes) {
  client::Limits limits;
  limits.max_message_bytes = 8192;  // less 4096 for all else
  const auto packed = PackVolume(Ramp(33, 16, 16), {}, limits);
  ASSERT_THAT(packed, IsOk());
  const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
  EXPECT_LE(packed->samples, 4096u);
  EXPECT_EQ(uint64_t{grid.size_a} * grid.size_b * grid.size_c, packed->samples);
  EXPECT_EQ(grid.size_a * 2u, 34u);
  EXPECT_EQ(grid.edge_a.x, 34) << "a cell that is cut by the end keeps its length";
  EXPECT_THAT(packed->note, HasSubstr("33 by 16 by 16 samples are more than the server takes"));
}

TEST(PackedVolumes, ColoursAsTheyAre) {
  SampledVolume volume = Ramp(2, 1, 1);
  volume.colors = {{1, 2, 3}, {0, 0, 0}};
  const auto bytes_of = [](const absl::StatusOr<PackedVolume>& packed) {
    EXPECT_THAT(packed, IsOk());
    const auto& shown = std::get<client::Volume>(packed->part.shape);
    EXPECT_EQ(shown.colors, !shown.transfer.has_value());
    const auto bytes = std::get<client::Array<uint8_t>>(shown.grid.samples).view();
    return std::vector<int>(bytes.begin(), bytes.end());
  };
  EXPECT_THAT(bytes_of(PackVolume(volume, {}, {})), ElementsAre(1, 2, 3, 255, 0, 0, 0, 0));
  EXPECT_THAT(bytes_of(PackVolume(volume, {.colormap = "inferno", .window = {{0, 1}}}, {})),
              ElementsAre(0, 255))
      << "their brightness";
  client::Limits limits;
  limits.max_indices_per_entity = 1;
  EXPECT_THAT(bytes_of(PackVolume(volume, {}, limits)), ElementsAre(1, 1, 2, 255)) << "averaged";
}

TEST(PackedVolumes, AsASurface) {
  const auto packed = PackVolume(Ramp(5, 1, 1), {.level = 1}, {});
  ASSERT_THAT(packed, IsOk());
  EXPECT_EQ(std::get<client::Isosurface>(packed->part.shape).level, 65535 / 4.0);
  EXPECT_THAT(std::string(PackVolume(Ramp(5, 1, 1), {.level = 9}, {}).status().message()),
              HasSubstr("--level is 9, and the samples go from 0 to 4"));
}

TEST(PackedVolumes, AWindowIsFound) {
  // Air at 0 and a body at 100, and one sample that is far off.
  SampledVolume volume = Ramp(20, 20, 20);
  for (size_t i = 0; i < volume.samples.size(); ++i) volume.samples[i] = i % 4 == 0 ? 100 : 0;
  volume.samples[5] = 5000;
  const auto packed = PackVolume(volume, {}, {});
  ASSERT_THAT(packed, IsOk());
  const auto& grid = std::get<client::Volume>(packed->part.shape).grid;
  const auto bytes = std::get<client::Array<uint8_t>>(grid.samples).view();
  EXPECT_EQ(bytes[1], 0);
  EXPECT_GT(bytes[0], 200);
}

TEST(PackedVolumes, ArePlacedByTheirCorners) {
  Model model;
  model.volumes.push_back(Ramp(4, 2, 2));
  PlaceModels({&model, 1}, DisplaySpace(), {});
  EXPECT_NEAR(model.volumes[0].corners[7].x, 0.97, 1e-9);
  EXPECT_NEAR(model.volumes[0].corners[0].y, -0.485, 1e-9);
}

}  // namespace
}  // namespace voxeld::voxelctl
