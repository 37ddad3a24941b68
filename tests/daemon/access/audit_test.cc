#include "daemon/access/audit.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::access {
namespace {

using nlohmann::json;

class AuditTest : public ::testing::Test {
 protected:
  void TearDown() override {
    std::filesystem::remove(path_);
    std::filesystem::remove(path_ + ".1");
  }
  static std::vector<json> Lines(const std::string& path) {
    std::ifstream file(path);
    std::vector<json> out;
    for (std::string line; std::getline(file, line);) out.push_back(json::parse(line));
    return out;
  }
  const std::string path_ = absl::StrCat(::testing::TempDir(), "/voxeld-audit-", getpid());
};

TEST_F(AuditTest, OneObjectALineWhateverTheWordsAre) {
  auto audit = Audit::Open(path_, nullptr);
  ASSERT_TRUE(audit.ok()) << audit.status();
  (*audit)->Record("token a\"\n{", "unix:", "UpdateDisplay", "name: \"\x1b[31m\xff\"",
                   absl::OkStatus());
  (*audit)->Record("anonymous", "ipv4:1.2.3.4:5", "ClearLayer", "",
                   absl::PermissionDeniedError("no"));
  const std::vector<json> lines = Lines(path_);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["who"], "token a\"\n{");
  EXPECT_EQ(lines[0]["result"], "OK");
  EXPECT_EQ(lines[1]["method"], "ClearLayer");
  EXPECT_EQ(lines[1]["result"], "PERMISSION_DENIED: no");
  std::ifstream raw(path_);
  std::string text((std::istreambuf_iterator<char>(raw)), std::istreambuf_iterator<char>());
  for (const char c : text) EXPECT_TRUE(c == '\n' || (c >= ' ' && c <= '~')) << int{c};
  struct stat found;
  ASSERT_EQ(stat(path_.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 07, 0u);
}

TEST_F(AuditTest, GoesOnInANewFileWhenAsked) {
  auto audit = Audit::Open(path_, nullptr);
  ASSERT_TRUE(audit.ok());
  (*audit)->Record("a", "", "First", "", absl::OkStatus());
  std::filesystem::rename(path_, path_ + ".1");
  (*audit)->Record("a", "", "Second", "", absl::OkStatus());
  (*audit)->Reopen();
  (*audit)->Record("a", "", "Third", "", absl::OkStatus());
  EXPECT_EQ(Lines(path_ + ".1").size(), 2u);
  ASSERT_EQ(Lines(path_).size(), 1u);
  EXPECT_EQ(Lines(path_)[0]["method"], "Third");
}

TEST_F(AuditTest, AFileThatCannotBeIsAnErrorAtOnce) {
  EXPECT_FALSE(Audit::Open("/nonexistent/audit", nullptr).ok());
  std::filesystem::create_symlink("/tmp/elsewhere", path_);
  EXPECT_FALSE(Audit::Open(path_, nullptr).ok());
}

}  // namespace
}  // namespace voxeld::daemon::access
