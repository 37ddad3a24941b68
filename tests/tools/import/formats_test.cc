// Tests the list of formats, and that every format in it is read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/import/read_any.h"
#include "tools/voxelctl/import/format.h"

namespace voxeld::voxelctl {
namespace formats_test {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Formats, EveryExtensionHasOneReader) {
  std::set<std::string> seen;
  for (const Format& format : AllFormats()) {
    for (const absl::string_view extension : absl::StrSplit(format.extensions, ' ')) {
      EXPECT_EQ(extension[0], '.');
      EXPECT_TRUE(seen.insert(std::string(extension)).second) << extension;
    }
    EXPECT_FALSE(format.read.empty() || format.not_read.empty()) << format.name;
  }
  EXPECT_GT(seen.size(), 40u);
}

TEST(Formats, WhatIsListedIsNotRefusedByItsName) {
  const TempFolder folder;
  for (const Format& format : AllFormats()) {
    for (const absl::string_view extension : absl::StrSplit(format.extensions, ' ')) {
      const auto model = ReadApart(folder.Write(absl::StrCat("a", extension), "?"));
      EXPECT_THAT(std::string(model.status().message()), Not(HasSubstr("are not read")))
          << extension;
    }
  }
}

TEST(Formats, TheDocumentationHasThemAll) {
  std::ifstream file(VOXELD_SOURCE_DIR "/docs/files.md");
  std::ostringstream text;
  text << file.rdbuf();
  for (const Format& format : AllFormats()) {
    const auto cell = [](absl::string_view value) { return value.empty() ? "–" : value; };
    const std::string row = absl::StrCat("| ", cell(format.what), " | ", cell(format.name), " | ",
                                         cell(format.extensions), " | ", cell(format.read), " | ",
                                         cell(format.not_read), " | ", cell(format.library), " | ",
                                         cell(format.tried), " |\n");
    EXPECT_THAT(text.str(), HasSubstr(row));
  }
}

}  // namespace formats_test
}  // namespace voxeld::voxelctl
