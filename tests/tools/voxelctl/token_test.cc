#include "tools/voxelctl/token/token.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "daemon/access/grants.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;

class TokenTest : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }

  absl::Status Make(const TokenOptions& options, bool json = false) {
    out_.str("");
    err_.str("");
    Console console(out_, err_, json, false);
    return MakeToken(options, console);
  }

  const std::string path_ = absl::StrCat(::testing::TempDir(), "/voxeld-token-", getpid());
  std::ostringstream out_, err_;
};

TEST_F(TokenTest, TheEntryLetsTheTokenIn) {
  ASSERT_TRUE(Make({.name = "stage", .scopes = "view,draw", .days = 2}, true).ok());
  const nlohmann::json made = nlohmann::json::parse(out_.str());
  const auto grants = daemon::access::ParseGrants(made["entry"].get<std::string>(), "entry");
  ASSERT_TRUE(grants.ok()) << grants.status();
  const daemon::access::Grant& grant =
      grants->tokens.at(daemon::access::HashOf(made["token"].get<std::string>()));
  EXPECT_EQ(grant.name, "stage");
  EXPECT_EQ(grant.scopes.ToString(), "view draw");
  EXPECT_NEAR(static_cast<double>(*grant.expires_s),
              static_cast<double>(std::time(nullptr) + 2 * 86400), 60);
}

TEST_F(TokenTest, GoesIntoTheFileBesideThoseThatAreThere) {
  ASSERT_TRUE(Make({.name = "a", .scopes = "view", .grants = path_}).ok());
  const std::string first = out_.str();
  struct stat found;
  ASSERT_EQ(stat(path_.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 0777, 0600u);
  ASSERT_TRUE(Make({.name = "b", .scopes = "all", .grants = path_}).ok());
  EXPECT_NE(out_.str(), first);
  const auto grants = daemon::access::ReadGrants(path_);
  ASSERT_TRUE(grants.ok()) << grants.status();
  EXPECT_EQ(grants->tokens.size(), 2u);
  EXPECT_EQ(grants->tokens.at(daemon::access::HashOf(first.substr(0, first.size() - 1))).name, "a");
  EXPECT_THAT(err_.str(), HasSubstr("added to"));
}

TEST_F(TokenTest, OneMoreOfANameIsAddedAndTheOthersAreTold) {
  ASSERT_TRUE(Make({.name = "a", .scopes = "view", .grants = path_}).ok());
  EXPECT_THAT(err_.str(), ::testing::Not(HasSubstr("stay valid")));
  ASSERT_TRUE(Make({.name = "a", .scopes = "view", .grants = path_}).ok());
  EXPECT_THAT(err_.str(), HasSubstr("tokens of the name a that were there stay valid: 1; take"));
  EXPECT_EQ(daemon::access::ReadGrants(path_)->tokens.size(), 2u);
}

TEST_F(TokenTest, AFileThatIsWrongIsNotMadeWorse) {
  std::ofstream(path_) << "[[token";
  const std::uintmax_t before = std::filesystem::file_size(path_);
  EXPECT_FALSE(Make({.name = "a", .scopes = "view", .grants = path_}).ok());
  EXPECT_EQ(std::filesystem::file_size(path_), before);
  EXPECT_EQ(out_.str(), "");
}

TEST_F(TokenTest, SaysWhatIsWrong) {
  EXPECT_THAT(std::string(Make({.name = "a", .scopes = "paint"}).message()),
              HasSubstr("the scope \"paint\" is none"));
  EXPECT_THAT(std::string(Make({.name = "a b\"", .scopes = "view"}).message()),
              HasSubstr("letters, digits"));
}

}  // namespace
}  // namespace voxeld::voxelctl
