// Tests which of the files that a file names are read, and that messages do not reveal the others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// A triangle whose positions are in the file `name`.
std::string Gltf(const std::string& name) {
  return absl::StrCat(
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)",
      R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],)",
      R"("bufferViews":[{"buffer":0,"byteLength":36}],)",
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)",
      R"("buffers":[{"byteLength":36,"uri":")", name, R"("}]})");
}

std::string Triangle() {
  const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::string bytes(sizeof(positions), '\0');
  std::memcpy(bytes.data(), positions, sizeof(positions));
  return bytes;
}

std::string Obj(const std::string& library) {
  return absl::StrCat("mtllib ", library, "\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
}

std::string Nrrd(const std::string& name) {
  return absl::StrCat(
      "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 6 6 1\nencoding: raw\ndata file: ", name, "\n");
}

// A folder "own", with the file, beside a folder "private" whose files no other user may see.
class OtherFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"own", "own/below", "private"}) {
      std::filesystem::create_directory(folder_.Path(name));
    }
    for (const char* name : {"own/a.bin", "own/below/b.bin", "private/key.bin"}) {
      folder_.Write(name, Triangle());
    }
    const std::string red = "newmtl m\nKd 1 0 0\n";
    for (const char* name : {"own/a.mtl", "own/below/b.mtl", "private/key.mtl"}) {
      folder_.Write(name, red);
    }
    for (const char* end : {"bin", "mtl"}) {
      std::filesystem::create_symlink(absl::StrCat("below/b.", end),
                                      folder_.Path(absl::StrCat("own/inside.", end)));
      std::filesystem::create_symlink(absl::StrCat("../private/key.", end),
                                      folder_.Path(absl::StrCat("own/out.", end)));
      std::filesystem::create_symlink(folder_.Path(absl::StrCat("own/a.", end)),
                                      folder_.Path(absl::StrCat("own/absolute.", end)));
      std::filesystem::create_symlink("/dev/zero", folder_.Path(absl::StrCat("own/device.", end)));
      std::filesystem::create_directory(folder_.Path(absl::StrCat("own/folder.", end)));
      ASSERT_EQ(::mkfifo(folder_.Path(absl::StrCat("own/fifo.", end)).c_str(), 0600), 0);
    }
    std::filesystem::create_symlink("../private", folder_.Path("own/door"));
  }

  absl::StatusOr<Model> Import(const std::string& name, const std::string& text,
                               OtherFiles allowed) {
    return ImportFile(folder_.Write(absl::StrCat("own/", name), text), {.other_files = allowed});
  }

  // Names without their extension: in the folder or below; outside it; not regular files.
  const std::vector<std::string> below_ = {"a", "below/b", "./a", "below/../a", "inside"};
  std::vector<std::string> outside() const {
    return {"../private/key",
            folder_.Path("private/key"),
            folder_.Path("own/a"),
            "out",
            "door/key",
            "below/../../private/key",
            "absolute",
            "/proc/self/root" + folder_.Path("own/a")};
  }
  const std::vector<std::string> never_ = {
      "device", "fifo", "folder", "missing", "../private/missing", "/dev/zero"};

  TempFolder folder_;
};

TEST_F(OtherFilesTest, ABufferOfGltfIsReadWithinTheFolder) {
  for (const std::string& name : below_) {
    const auto model = Import("a.gltf", Gltf(name + ".bin"), OtherFiles::kBelow);
    EXPECT_TRUE(model.ok()) << name << model.status();
  }
  const std::string missing = absl::StrReplaceAll(
      std::string(Import("a.gltf", Gltf("missing.bin"), OtherFiles::kBelow).status().message()),
      {{"missing.bin", "NAME"}});
  EXPECT_THAT(missing, HasSubstr("a regular file in its folder or below is expected"));
  std::vector<std::string> refused = outside();
  refused.insert(refused.end(), never_.begin(), never_.end());
  for (const std::string& name : refused) {
    const auto model = Import("a.gltf", Gltf(name + ".bin"), OtherFiles::kBelow);
    ASSERT_FALSE(model.ok()) << name;
    EXPECT_EQ(absl::StrReplaceAll(std::string(model.status().message()), {{name + ".bin", "NAME"}}),
              missing)
        << "one message for missing and for forbidden files";
  }
}

TEST_F(OtherFilesTest, WhereNoneAreAllowedNotEvenNeighboursAreRead) {
  for (const std::string& name : {std::string("a"), std::string("missing"), outside()[0]}) {
    const auto gltf = Import("a.gltf", Gltf(name + ".bin"), OtherFiles::kNone);
    EXPECT_THAT(std::string(gltf.status().message()), HasSubstr("are not read here")) << name;
    const auto nrrd = Import("a.nhdr", Nrrd(name + ".bin"), OtherFiles::kNone);
    EXPECT_THAT(std::string(nrrd.status().message()), HasSubstr("are not read here")) << name;
  }
  const auto obj = Import("model.obj", Obj("a.mtl"), OtherFiles::kNone);
  ASSERT_TRUE(obj.ok()) << obj.status();
  for (const Rgb& color : obj->parts[0].colors) EXPECT_NE(color, (Rgb{255, 0, 0}));
}

TEST_F(OtherFilesTest, WhereAnyAreAllowedRegularFilesAreRead) {
  for (const std::string& name : outside()) {
    if (name.starts_with("/proc")) continue;
    EXPECT_TRUE(Import("a.gltf", Gltf(name + ".bin"), OtherFiles::kAny).ok()) << name;
    EXPECT_TRUE(Import("a.nhdr", Nrrd(name + ".bin"), OtherFiles::kAny).ok()) << name;
  }
  for (const std::string& name : never_) {
    EXPECT_FALSE(Import("a.gltf", Gltf(name + ".bin"), OtherFiles::kAny).ok()) << name;
  }
}

TEST_F(OtherFilesTest, SamplesOfNrrdAreReadWithinTheFolder) {
  for (const std::string& name : below_) {
    EXPECT_TRUE(Import("a.nhdr", Nrrd(name + ".bin"), OtherFiles::kBelow).ok()) << name;
  }
  for (const std::string& name : outside()) {
    EXPECT_FALSE(Import("a.nhdr", Nrrd(name + ".bin"), OtherFiles::kBelow).ok()) << name;
  }
  for (const std::string& name : never_) {
    EXPECT_FALSE(Import("a.nhdr", Nrrd(name + ".bin"), OtherFiles::kBelow).ok()) << name;
  }
}

TEST_F(OtherFilesTest, MaterialsOfObjAreReadWithinTheFolder) {
  const auto is_red = [](const Model& model) {
    return !model.parts[0].colors.empty() && model.parts[0].colors[0] == Rgb{255, 0, 0};
  };
  for (const char* name : {"a.mtl", "below/b.mtl", "inside.mtl"}) {
    const auto model = Import("model.obj", Obj(name), OtherFiles::kBelow);
    ASSERT_TRUE(model.ok()) << name << model.status();
    EXPECT_TRUE(is_red(*model)) << name;
  }
  std::vector<std::string> refused = outside();
  refused.insert(refused.end(), never_.begin(), never_.end());
  for (const std::string& name : refused) {
    const auto model = Import("model.obj", Obj(name + ".mtl"), OtherFiles::kBelow);
    ASSERT_TRUE(model.ok()) << name << model.status();
    EXPECT_FALSE(is_red(*model)) << name;
  }
}

}  // namespace
}  // namespace voxeld::voxelctl
