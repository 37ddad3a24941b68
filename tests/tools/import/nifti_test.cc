// Tests NIfTI: volumes of either version, in one file and two, real and broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/import/volume_files.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tools/import/inflate.h"

namespace voxeld::voxelctl {
namespace nifti_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kTemplates[] = "/usr/share/mricron/templates/";

// Byte offsets as in the standard: dim at 40, datatype at 70, pixdim at 76, vox_offset at 108,
// scl_slope at 112.
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

// Reverses the bytes of `count` numbers of `each` bytes.
void Turn(std::string* bytes, size_t at, size_t each, size_t count) {
  for (size_t i = 0; i < count; ++i)
    std::reverse(bytes->begin() + static_cast<std::ptrdiff_t>(at + i * each),
                 bytes->begin() + static_cast<std::ptrdiff_t>(at + (i + 1) * each));
}

// The numbers of NIfTI-1's header that the reader uses.
void TurnHeader(std::string* bytes) {
  Turn(bytes, 0, 4, 1);
  Turn(bytes, 40, 2, 8);
  Turn(bytes, 70, 2, 1);
  Turn(bytes, 76, 4, 11);  // pixdim, vox_offset, scl_slope, scl_inter
  Turn(bytes, 124, 4, 2);
  Turn(bytes, 252, 2, 2);
  Turn(bytes, 256, 4, 18);
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

TEST_F(Volumes, NiftiWithoutAPlaceHasItsSamplesBehindTheHeader) {
  std::string one = Nifti({3, 2, 2, 1}, 2, "\x01\x02\x03\xff");
  Put<float>(&one, 108, 0);
  EXPECT_THAT(Read("a.nii", one).samples, ElementsAre(1, 2, 3, 255));
  Put<float>(&one, 108, 340);
  EXPECT_THAT(Error("a.nii", one), HasSubstr("from byte 340 on (vox_offset)"))
      << "within the header";
}

// Byte offsets as in the standard: dim at 16, datatype at 12, pixdim at 104, vox_offset at 168.
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

// Every number of a big-endian header and of its samples is reversed.
TEST_F(Volumes, NiftiOfTheOtherEnd) {
  std::string one = Nifti({3, 2, 1, 1}, 4, std::string("\x01\x02\xff\xfe", 4));
  TurnHeader(&one);
  EXPECT_THAT(Read("a.nii", one).samples, ElementsAre(258, -2));
  std::string scaled = Nifti({3, 2, 1, 1}, 4, std::string("\x01\x02\xff\xfe", 4));
  Put<float>(&scaled, 112, 2);
  Put<float>(&scaled, 116, -5);
  TurnHeader(&scaled);
  EXPECT_THAT(Read("a.nii", scaled).samples, ElementsAre(511, -9));
  std::string two = Nifti2({3, 2, 1, 1}, 4, std::string("\x01\x02\xff\xfe", 4));
  Turn(&two, 0, 4, 1);
  Turn(&two, 12, 2, 1);
  Turn(&two, 16, 8, 8);
  Turn(&two, 104, 8, 9);
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

// The header from which NIfTI's was made: without a magic number, with other fields in the places
// of the slope, the rotation and the matrix.
TEST_F(Volumes, Analyze) {
  std::string header = Nifti({4, 2, 2, 2, 1}, 4, "").substr(0, 348);
  Put<float>(&header, 76, 0);
  Put<float>(&header, 108, 0);
  Put<float>(&header, 112, 7);
  Put<float>(&header, 116, 9);
  header.replace(252, 96, std::string(96, '\x01'));
  header.replace(344, 4, std::string(4, '\0'));
  header[252] = '\0';  // transverse
  std::string samples;
  for (int16_t i = 0; i < 8; ++i)
    Put<int16_t>(&samples, samples.size(), static_cast<int16_t>(i - 4));
  const std::string big_endian_samples = [&] {
    std::string bytes = samples;
    Turn(&bytes, 0, 2, 8);
    return bytes;
  }();
  folder_.Write("a.img", samples);
  folder_.Write("b.img.gz", Gzip(big_endian_samples));
  std::string turned = header;
  Turn(&turned, 0, 4, 1);
  Turn(&turned, 40, 2, 8);
  Turn(&turned, 70, 2, 2);
  Turn(&turned, 76, 4, 8);
  for (const auto& [name, bytes, format] :
       {std::tuple("a.hdr", header, "ANALYZE 7.5, two files"),
        {"b.hdr", turned, "ANALYZE 7.5, two files, compressed"}}) {
    const auto model = Import(name, bytes);
    ASSERT_THAT(model, IsOk()) << name;
    EXPECT_EQ(model->format, format);
    const SampledVolume& volume = model->volumes[0];
    EXPECT_THAT(volume.samples, ElementsAre(-4, -3, -2, -1, 0, 1, 2, 3));
    // x points to the left of the head, which is to the viewer's right.
    EXPECT_EQ(volume.corners[0], (Point3{-0.5, 1, -1.5}));
    EXPECT_EQ(volume.corners[7], (Point3{1.5, -3, 4.5}));
  }
  EXPECT_THAT(Read("a.img", samples).samples, ElementsAre(-4, -3, -2, -1, 0, 1, 2, 3));
  // Coronal, sagittal, and transverse with rows from the back. Cells are 1, 2 and 3 long.
  const std::tuple<char, Point3, Point3> orientations[] = {
      {'\1', {-0.5, 1.5, -1}, {1.5, -4.5, 3}},
      {'\2', {-1.5, 0.5, -1}, {4.5, -1.5, 3}},
      {'\3', {-0.5, -3, -1.5}, {1.5, 1, 4.5}},
      {'\4', {-0.5, 1.5, 3}, {1.5, -4.5, -1}},
      {'\x20', {-0.5, 1, -1.5}, {1.5, -3, 4.5}}};  // an unknown value: transverse
  for (const auto& [orient, first, last] : orientations) {
    header[252] = orient;
    const SampledVolume volume = Read("a.hdr", header);
    EXPECT_EQ(volume.corners[0], first) << int{orient};
    EXPECT_EQ(volume.corners[7], last) << int{orient};
  }
  EXPECT_THAT(Error("a.nii", header), HasSubstr("a header of NIfTI is expected"));
  Put<int16_t>(&header, 40, 9);
  EXPECT_THAT(Error("a.hdr", header), HasSubstr("has 9 dimensions"));
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

// Colours as vectors (intents 2003 and 2004): all of red comes before all of green.
TEST_F(Volumes, NiftiOfColourVectors) {
  std::string three = Nifti({5, 2, 1, 1, 1, 3}, 2, "\xff\x0a\x01\x14\x02\x1e");
  Put<int16_t>(&three, 68, 2003);
  for (const std::string& bytes : {three, Gzip(three)}) {
    const auto model = Import("a.nii.gz", bytes);
    ASSERT_THAT(model, IsOk());
    EXPECT_THAT(model->volumes[0].colors, ElementsAre(Rgb{255, 1, 2}, Rgb{10, 20, 30}));
    EXPECT_TRUE(model->left_out.empty());
  }
  EXPECT_THAT(Error("a.nii", three.substr(0, three.size() - 1)), HasSubstr("bytes of samples"));
  // 16 bits: the greatest value of the type is brightest.
  std::string wide =
      Nifti({5, 1, 1, 1, 1, 4}, 512, std::string("\xff\xff\x00\x80\x00\x00\xff\xff", 8));
  Put<int16_t>(&wide, 68, 2004);
  EXPECT_THAT(Read("a.nii", wide).colors, ElementsAre(Rgb{255, 128, 0}));
  // Vectors with another intent are not colours.
  Put<int16_t>(&three, 68, 1007);
  const auto vector = Import("a.nii", three);
  ASSERT_THAT(vector, IsOk());
  EXPECT_TRUE(vector->volumes[0].colors.empty());
  EXPECT_EQ(vector->left_out, (std::vector<LeftOut>{{"further components", 2}}));
}

TEST_F(Volumes, NiftiLiesWhereItsMatrixSays) {
  std::string bytes = Nifti({3, 2, 2, 2}, 2, "12345678");
  Put<int16_t>(&bytes, 254, 1);  // sform_code
  const float rows[12] = {2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  for (size_t i = 0; i < 12; ++i) Put<float>(&bytes, 280 + 4 * i, rows[i]);
  const SampledVolume volume = Read("a.nii", bytes);
  // Samples are in the middle of their cells; x and y are reversed so that the face is to the
  // viewer.
  EXPECT_EQ(volume.corners[0], (Point3{-9, -18.5, 28}));
  EXPECT_EQ(volume.corners[7], (Point3{-13, -24.5, 36}));
  EXPECT_EQ(volume.corners[1], (Point3{-13, -18.5, 28}));
}

// The standard's three methods: the steps alone, a rotation as a quaternion, a matrix. Corners 0
// and 7 of a volume of two samples an axis.
TEST_F(Volumes, NiftiLiesWhereEachMethodSays) {
  struct Method {
    const char* name;
    int16_t qform = 0, sform = 0;
    float qfac = 1;
    std::array<float, 3> quaternion = {}, offset = {};
    std::array<float, 12> rows = {};
    Point3 first, last;
  };
  const std::array<float, 12> matrix = {2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  const std::array<float, 12> mirrored = {-2, 0, 0, 10, 0, 3, 0, 20, 0, 0, 4, 30};
  for (const Method& method : {
           // Steps of 1, 2 and 3. The reader reverses x and y.
           Method{.name = "steps", .first = {0.5, 1, -1.5}, .last = {-1.5, -3, 4.5}},
           Method{.name = "steps, without a qfac",
           .qfac = 0,
           .first = {0.5, 1, -1.5},
           .last = {-1.5, -3, 4.5}},
           // Method 1 has no offset.
           Method{.name = "steps beside an offset that has no code",
           .offset = {10, 20, 30},
           .first = {0.5, 1, -1.5},
           .last = {-1.5, -3, 4.5}},
           Method{.name = "a turn by nothing",
           .qform = 1,
           .offset = {10, 20, 30},
           .first = {-9.5, -19, 28.5},
           .last = {-11.5, -23, 34.5}},
           Method{.name = "without a qfac",
           .qform = 1,
           .qfac = 0,
           .offset = {10, 20, 30},
           .first = {-9.5, -19, 28.5},
           .last = {-11.5, -23, 34.5}},
           Method{.name = "a third axis turned round",
           .qform = 2,
           .qfac = -1,
           .offset = {10, 20, 30},
           .first = {-9.5, -19, 31.5},
           .last = {-11.5, -23, 25.5}},
           // Half a turn about x: y and z are reversed.
           Method{.name = "half a turn",
           .qform = 1,
           .quaternion = {1, 0, 0},
           .offset = {10, 20, 30},
           .first = {-9.5, -21, 31.5},
           .last = {-11.5, -17, 25.5}},
           Method{.name = "half a turn, a third axis turned round",
           .qform = 1,
           .qfac = -1,
           .quaternion = {1, 0, 0},
           .offset = {10, 20, 30},
           .first = {-9.5, -21, 28.5},
           .last = {-11.5, -17, 34.5}},
           Method{.name = "a matrix",
           .sform = 1,
           .rows = matrix,
           .first = {-9, -18.5, 28},
           .last = {-13, -24.5, 36}},
           Method{.name = "a mirror",
           .sform = 1,
           .rows = mirrored,
           .first = {-11, -18.5, 28},
           .last = {-7, -24.5, 36}},
           Method{.name = "a matrix before a turn",
           .qform = 1,
           .sform = 4,
           .offset = {1, 2, 3},
           .rows = matrix,
           .first = {-9, -18.5, 28},
           .last = {-13, -24.5, 36}},
       }) {
    std::string bytes = Nifti({3, 2, 2, 2}, 2, "12345678");
    Put<float>(&bytes, 76, method.qfac);
    Put<int16_t>(&bytes, 252, method.qform);
    Put<int16_t>(&bytes, 254, method.sform);
    for (size_t i = 0; i < 3; ++i) {
      Put<float>(&bytes, 256 + 4 * i, method.quaternion[i]);
      Put<float>(&bytes, 268 + 4 * i, method.offset[i]);
    }
    for (size_t i = 0; i < 12; ++i) Put<float>(&bytes, 280 + 4 * i, method.rows[i]);
    for (const bool big_endian : {false, true}) {
      if (big_endian) TurnHeader(&bytes);
      const SampledVolume volume = Read("a.nii", bytes);
      EXPECT_EQ(volume.corners[0], method.first) << method.name << " " << big_endian;
      EXPECT_EQ(volume.corners[7], method.last) << method.name << " " << big_endian;
      EXPECT_THAT(volume.samples, ElementsAre('1', '2', '3', '4', '5', '6', '7', '8'));
    }
  }
}

// For axes that do not exist, the step is unknown; some programs write 0.
TEST_F(Volumes, NiftiOfOneSliceNeedsNoThirdStep) {
  for (const bool both : {false, true}) {
    std::string bytes = Nifti({2, 2, 2}, 2, "1234");
    Put<float>(&bytes, 88, 0);
    Put<int16_t>(&bytes, 252, both ? 1 : 0);
    const SampledVolume volume = Read("a.nii", bytes);
    EXPECT_THAT(volume.size, ElementsAre(2, 2, 1));
    EXPECT_EQ(volume.corners[7].y - volume.corners[0].y, -4);
    std::string second = Nifti2({1, 4}, 2, "1234");
    Put<double>(&second, 120, 0);
    Put<double>(&second, 128, 0);
    Put<int32_t>(&second, 344, both ? 1 : 0);
    EXPECT_THAT(Read("b.nii", second).samples, ElementsAre('1', '2', '3', '4'));
  }
}

TEST_F(Volumes, NiftiOfSeveralVolumes) {
  const auto model = Import("a.nii", Nifti({5, 2, 1, 1, 3, 2}, 2, "12abcdefghij"));
  ASSERT_THAT(model, IsOk());
  EXPECT_THAT(model->volumes[0].samples, ElementsAre('1', '2'));
  EXPECT_THAT(model->left_out,
              ElementsAre(LeftOut{"further times", 2}, LeftOut{"further components", 1}));
}

// A background of not-a-number stays one: 0 is an ordinary number here.
TEST_F(Volumes, NiftiKeepsWhatIsNoNumber) {
  std::string floats;
  for (const float number : {-1.0f, NAN, 0.0f}) Put<float>(&floats, floats.size(), number);
  const SampledVolume volume = Read("a.nii", Nifti({3, 3, 1, 1}, 16, floats));
  EXPECT_EQ(volume.samples[0], -1);
  EXPECT_TRUE(std::isnan(volume.samples[1]));
  EXPECT_EQ(volume.samples[2], 0);
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

// The data to which a small file expands beyond the samples is not even read.
TEST_F(Volumes, BombsTakeNoMemory) {
  const std::string bomb =
      Gzip(Nifti({3, 2, 2, 1}, 2, "1234") + std::string(size_t{200} << 20, '\0'));
  ASSERT_LT(bomb.size(), size_t{1} << 20);
  EXPECT_THAT(Read("a.nii.gz", bomb).samples.size(), 4);
}

// Nor does the earlier data cost again for each of many empty streams: a hundred thousand times 32
// MiB takes minutes, and one time takes no measurable time.
TEST_F(Volumes, ManyEmptyStreamsTakeNoTime) {
  const std::string zeros(size_t{32} << 20, '\0'), empty = Gzip("");
  std::string packed = Gzip(zeros);
  for (int i = 0; i < 100'000; ++i) packed += empty;
  packed += Gzip("end");
  const SourceFile file{.path = "p", .extension = {}, .bytes = {}};
  const pid_t child = ::fork();
  if (child == 0) {
    const rlimit core = {0, 0}, seconds = {60, 60};
    ::setrlimit(RLIMIT_CORE, &core);
    ::setrlimit(RLIMIT_CPU, &seconds);
    const auto plain = Inflate(file, packed, uint64_t{1} << 30);
    ::_exit(plain.ok() && *plain == zeros + "end" ? 0 : 1);
  }
  int state = 0;
  ASSERT_EQ(::waitpid(child, &state, 0), child);
  EXPECT_FALSE(WIFSIGNALED(state)) << "it took a minute";
  EXPECT_EQ(WEXITSTATUS(state), 0);
}

TEST_F(Volumes, RealBrains) {
  const auto brain = ReadHere(absl::StrCat(kTemplates, "ch2bet.nii.gz"), {});
  ASSERT_THAT(brain, IsOk()) << "tools/setup --import installs mricron-data";
  EXPECT_EQ(brain->format, "NIfTI, compressed");
  EXPECT_THAT(brain->volumes.at(0).size, ElementsAre(181, 217, 181));
  for (const char* name : {"aal.nii.gz", "ch2.nii.gz", "inia19-t1-brain.nii.gz", "brodmann.nii.gz"})
    EXPECT_THAT(ReadHere(absl::StrCat(kTemplates, name), {}), IsOk()) << name;
}

}  // namespace nifti_test
}  // namespace voxeld::voxelctl
