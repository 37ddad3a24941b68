// Tests files that voxelctl passes to voxeld-import, with and without that program beside it.
#include "tools/voxelctl/import/import_program.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace import_program_test {

using ::testing::HasSubstr;

TEST(OwnFormats, AreReadWithoutTheProgram) {
  EXPECT_THAT(ImportFile(DataFile("points.ply"), {}), IsOk());
  EXPECT_THAT(ImportFile(DataFile("quad.topojson"), {}), IsOk());
}

TEST(OwnFormats, HaveNoAnimations) {
  EXPECT_THAT(OpenAnimation(DataFile("points.ply"), 1, 20),
              Fails(Words{"points.ply", "which has no animations", ".glb"}));
}

class ImportProgram : public ::testing::Test {
 protected:
  // A build without importers (-DVOXELD_IMPORTERS=OFF) has no program to test. The default build has it.
  void SetUp() override {
    if (const absl::Status status = CheckImporters("play"); !status.ok())
      GTEST_SKIP() << status.message();
  }
  TempFolder folder_;
};

TEST_F(ImportProgram, ReadsAMesh) {
  const auto model = ImportFile(DataFile("arrow.obj"), {});
  ASSERT_THAT(model, IsOk());
  EXPECT_FALSE(model->parts.empty());
}

TEST_F(ImportProgram, TakesEveryOption) {
  ImportOptions options;
  options.raw = RawLayout{.size = {2, 1, 3}, .type = SampleType::kU16, .big_endian = true};
  const auto model =
      ImportFile(folder_.Write("a.raw", std::string("\0\1\0\2\0\3\1\0\0\5\0\6", 12)), options);
  ASSERT_THAT(model, IsOk());
  ASSERT_EQ(model->volumes.size(), 1u);
  EXPECT_EQ(model->volumes[0].size, (std::array<uint32_t, 3>{2, 1, 3}));
  EXPECT_EQ(model->volumes[0].samples, (std::vector<float>{1, 2, 3, 256, 5, 6}));
}

TEST_F(ImportProgram, TakesEveryTypeOfSamples) {
  // One sample is 0, the other 1; IEEE 754 has 0x3c00, 0x3f800000 and 0x3ff0000000000000 for 1.
  const std::pair<SampleType, std::string> cases[] = {
      {SampleType::kI8, std::string("\0\1", 2)},
      {SampleType::kU8, std::string("\0\1", 2)},
      {SampleType::kI16, std::string("\0\0\1\0", 4)},
      {SampleType::kU16, std::string("\0\0\1\0", 4)},
      {SampleType::kI32, std::string("\0\0\0\0\1\0\0\0", 8)},
      {SampleType::kU32, std::string("\0\0\0\0\1\0\0\0", 8)},
      {SampleType::kF16, std::string("\0\0\0\x3c", 4)},
      {SampleType::kF32, std::string("\0\0\0\0\0\0\x80\x3f", 8)},
      {SampleType::kF64, std::string("\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xf0\x3f", 16)}};
  for (const auto& [type, bytes] : cases) {
    ImportOptions options;
    options.raw = RawLayout{.size = {2, 1, 1}, .type = type};
    const auto model = ImportFile(folder_.Write("a.raw", bytes), options);
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->volumes[0].samples, (std::vector<float>{0, 1})) << static_cast<int>(type);
  }
}

TEST_F(ImportProgram, ASequenceIsReadWithoutOtherFiles) {
  const std::string triangle = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  folder_.Write("a.mtl", "newmtl m\n");
  const std::vector<std::string> paths = {folder_.Write("1.obj", triangle),
                                          folder_.Write("2.obj", triangle)};
  const auto frames = OpenSequence(paths, {.other_files = OtherFiles::kNone}, nullptr);
  ASSERT_THAT(frames, IsOk());
  for (const int64_t frame : {0, 1}) EXPECT_THAT((*frames)->Read(frame), IsOk());
}

TEST_F(ImportProgram, AFileWhoseNameLooksLikeAnOptionIsAFile) {
  const std::string path = folder_.Write("--help", "x");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(std::filesystem::path(path).parent_path());
  EXPECT_THAT(ImportFile("--help", {}), Fails(Words{"--help", "its name has no extension"}));
  std::filesystem::current_path(before);
}

TEST_F(ImportProgram, ErrorsAreItsOwn) {
  EXPECT_THAT(ImportFile(folder_.Path("missing.obj"), {}),
              Fails(Words{"missing.obj", "No such file"}));
  EXPECT_THAT(ImportFile(folder_.Write("a.docx", "PK\x03\x04"), {}),
              Fails(Words{"files of type .docx are not read", ".obj"}));
}

TEST_F(ImportProgram, ASequenceIsReadByOneProgram) {
  std::vector<std::string> paths;
  for (const char* name : {"a.obj", "b.obj", "c.ply"}) paths.push_back(folder_.Path(name));
  const std::string triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  folder_.Write("a.obj", triangle);
  folder_.Write("b.obj", "f 1 2 3\n");
  folder_.Write("c.ply",
                "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty "
                "float y\nproperty float z\nend_header\n1 2 3\n");
  const auto frames = OpenSequence(paths, {}, nullptr);
  ASSERT_THAT(frames, IsOk());
  EXPECT_EQ((*frames)->count(), 3);
  EXPECT_THAT((*frames)->Read(2), IsOk());
  EXPECT_THAT(std::string((*frames)->Read(1).status().message()), HasSubstr("b.obj"));
  EXPECT_THAT((*frames)->Read(0), IsOk());
}

}  // namespace import_program_test
}  // namespace voxeld::voxelctl
