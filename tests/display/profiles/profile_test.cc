#include "display/profiles/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "display/drivers/options.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

class Profiles : public testing::Test {
 protected:
  Profiles() { std::filesystem::create_directories(folder_); }
  ~Profiles() override { std::filesystem::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& text) {
    const std::filesystem::path path = folder_ / name;
    std::ofstream(path) << text;
    return path.string();
  }
  std::string ErrorOf(const std::string& text) {
    const auto profile = ReadProfile(Write("wrong.toml", text));
    EXPECT_EQ(profile.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(profile.status().message());
  }
  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("voxeld-profiles-" + std::to_string(getpid()));
};

TEST_F(Profiles, AreOptionsAsTheCommandLineHasThem) {
  const auto profile =
      ReadProfile(Write("a.toml",
                        "title = \"a rotor\"\ndriver = \"simulated\"\neccentricity = [13.5, "
                        "2]\nslices = 90\nclockwise = true\n"));
  ASSERT_TRUE(profile.ok()) << profile.status();
  EXPECT_EQ(profile->title, "a rotor");
  EXPECT_EQ(profile->driver, "simulated");
  EXPECT_THAT(profile->options, ElementsAre(Pair("clockwise", "true"),
                                            Pair("eccentricity", "13.5;2"), Pair("slices", "90")));
}

TEST_F(Profiles, SayWhatIsWrongAndWhere) {
  EXPECT_THAT(ErrorOf("size = \"1x1\"\nslices = \n"), HasSubstr("wrong.toml:2:"));
  EXPECT_THAT(ErrorOf("[size]\na = 1\n"), HasSubstr("size is no text, number, boolean"));
  EXPECT_THAT(ErrorOf("name = \"x\"\n"), HasSubstr("name has no place in a profile"));
  EXPECT_EQ(ReadProfile("/nowhere/x.toml").status().code(), absl::StatusCode::kNotFound);
}

TEST_F(Profiles, OfTextAreTheSame) {
  const char* const text = "driver = \"simulated\"\nsize = \"8x8x8\"\n";
  const auto read = ReadProfile(Write("text.toml", text)), parsed = ParseProfile(text, "text");
  ASSERT_TRUE(read.ok() && parsed.ok());
  EXPECT_EQ(read->options, parsed->options);
  EXPECT_THAT(std::string(ParseProfile("a = ", "here").status().message()),
              testing::StartsWith("here:1:"));
  EXPECT_THAT(ErrorOf("\"a\\u0007\" = {}\n"), HasSubstr("a\\x07 is no text"));
}

TEST_F(Profiles, AreFoundByNameOrPath) {
  const std::string path = Write("mine.toml", "slices = 3\n");
  EXPECT_EQ(*FindProfile("mine", {"/nowhere", folder_.string()}), path);
  EXPECT_EQ(*FindProfile("./other.toml", {}), "./other.toml");
  const absl::Status none = FindProfile("min", {folder_.string()}).status();
  EXPECT_EQ(none.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(none.message()), HasSubstr("there are mine"));
  const auto environment = [](const char*) -> std::string { return "/a"; };
  EXPECT_THAT(ProfilePlaces(environment, "/opt/bin"),
              ElementsAre("/a", "/opt/bin/../share/voxeld/profiles", "/usr/share/voxeld/profiles"));
}

TEST_F(Profiles, ProgramOfASourceTreeFindsThoseOfTheTree) {
  std::filesystem::create_directories(folder_ / "build/any/bin");
  std::ofstream(folder_ / "build/any/CMakeCache.txt") << "#\n";
  const std::string program_folder = (folder_ / "build/any/bin").string();
  const auto environment = [](const char*) -> std::string { return ""; };
  EXPECT_THAT(ProfilePlaces(environment, program_folder),
              ElementsAre(program_folder + "/../share/voxeld/profiles",
                          (folder_ / "display/profiles").string(), "/usr/share/voxeld/profiles"));
}

TEST_F(Profiles, FileWithoutItsFolderIsNamed) {
  std::ofstream("here.txt") << "driver = \"simulated\"\n";
  EXPECT_EQ(FindProfile("here.txt", {folder_.string()}).status().message(),
            "no profile is named \"here.txt\"; to read the file, write ./here.txt");
  std::filesystem::remove("here.txt");
}

TEST(ShippedProfiles, AreDisplaysThatCanBe) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(VOXELD_PROFILES_DIR)) {
    if (entry.path().extension() != ".toml") continue;
    SCOPED_TRACE(entry.path());
    ++count;
    const auto profile = ReadProfile(entry.path().string());
    ASSERT_TRUE(profile.ok()) << profile.status();
    EXPECT_FALSE(profile->title.empty());
    const DisplayOptions options{.name = "d", .driver = "simulated", .options = profile->options};
    OptionReader reader(options);
    const auto info = ReadDisplayInfo(options, reader);
    ASSERT_TRUE(info.ok()) << info.status();
    EXPECT_EQ(ValidateGeometry(info->geometry), absl::OkStatus());
  }
  EXPECT_EQ(count, 8);
}

}  // namespace
}  // namespace voxeld::display
