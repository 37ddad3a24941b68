#include "daemon/access/access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <filesystem>
#include <set>

#include "absl/strings/str_cat.h"
#include "daemon/log/logger.h"
#include "tests/daemon/access/certificates.h"

namespace voxeld::daemon::access {
namespace {

using ::testing::HasSubstr;

std::string Token(const std::string& name, const std::string& token, const std::string& scopes,
                  const std::string& more = "") {
  return absl::StrCat("[[token]]\nname = \"", name, "\"\nsha256 = \"", HashOf(token),
                      "\"\nscopes = [", scopes, "]\n", more, "\n");
}

class AccessTest : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<Access> Make(AccessOptions options = {}) {
    options.grants = path_;
    options.trusted = {7};
    auto made = std::make_unique<Access>(
        options, [this] { return now_; }, nullptr);
    made->SetOnChange([this] { ++changes_; });
    return made;
  }
  // A file whose size differs each time counts as changed, whatever the clock of the file system
  // does.
  void Put(const std::string& text) { PutFile(path_, text + std::string(++put_, '\n')); }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-access-", getpid());
  const std::string path_ = folder_ + "/grants.toml";
  int64_t now_ = 1'000'000;
  int changes_ = 0;
  size_t put_ = 0;
};

TEST_F(AccessTest, EachIsKnownByWhatItShows) {
  Put(Token("left", "secret", "\"view\", \"draw\"") +
      "[[certificate]]\nname = \"cube\"\nsubject = \"cube.example\"\nscopes = [\"view\"]\n"
      "[[user]]\nname = \"1234\"\nscopes = [\"draw\"]\n");
  const auto access = Make({.anonymous = *ParseScopes("none"),
                            .certificate = *ParseScopes("none"),
                            .unix_users = *ParseScopes("view")});
  ASSERT_TRUE(access->Look().ok());

  const auto by_token = access->Identify({.token = "secret", .certificate = "x", .user = 7});
  ASSERT_TRUE(by_token.ok()) << by_token.status();
  EXPECT_EQ(by_token->principal, "left");
  EXPECT_EQ(by_token->who, "token left");
  EXPECT_EQ(by_token->scopes.ToString(), "view draw");
  EXPECT_EQ(by_token->key.find("secret"), std::string::npos);

  const auto by_certificate = access->Identify({.certificate = "cube.example", .user = 7});
  EXPECT_EQ(by_certificate->principal, "cube");
  EXPECT_EQ(by_certificate->scopes.ToString(), "view");
  EXPECT_TRUE(access->Identify({.certificate = "other.example"})->scopes.empty());

  EXPECT_EQ(access->Identify({.user = 7})->scopes, Scopes::All());
  EXPECT_EQ(access->Identify({.user = 1234})->scopes.ToString(), "draw");
  EXPECT_EQ(access->Identify({.user = 1234})->principal, "");
  EXPECT_EQ(access->Identify({.user = 99})->scopes.ToString(), "view");
  EXPECT_TRUE(access->Identify({})->scopes.empty());

  // A caller with a wrong token is not identified by other means.
  EXPECT_TRUE(absl::IsUnauthenticated(access->Identify({.token = "guess", .user = 7}).status()));
  EXPECT_TRUE(absl::IsUnauthenticated(access->Identify({.token = ""}).status()));
}

TEST_F(AccessTest, TokensExpireAndSayThatTheyChanged) {
  Put(Token("left", "secret", "\"draw\"", "expires = 1970-01-12T13:46:45Z"));  // 1,000,005
  const auto access = Make();
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 1);
  const auto caller = access->Identify({.token = "secret"});
  ASSERT_TRUE(caller.ok());
  now_ += 4;
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 1);
  EXPECT_TRUE(access->Recheck(*caller).ok());
  now_ += 1;
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 2);
  EXPECT_TRUE(absl::IsUnauthenticated(access->Recheck(*caller)));
  EXPECT_THAT(std::string(access->Identify({.token = "secret"}).status().message()),
              HasSubstr("has expired"));
  now_ -= 100;  // a clock that is set back
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 2);
  EXPECT_TRUE(access->Recheck(*caller).ok());
  now_ += 1'000'000;  // and one that jumps
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 3);
}

TEST_F(AccessTest, WhatIsTakenAwayIsGoneFromCallsUnderWay) {
  Put(Token("left", "secret", "\"view\", \"draw\"") + Token("right", "other", "\"view\""));
  const auto access = Make();
  ASSERT_TRUE(access->Look().ok());
  const auto left = access->Identify({.token = "secret"});
  const auto right = access->Identify({.token = "other"});
  const auto trusted = access->Identify({.user = 7});
  Put(Token("left", "secret", "\"view\""));
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 2);
  EXPECT_TRUE(absl::IsPermissionDenied(access->Recheck(*left)));
  EXPECT_THAT(std::string(access->Recheck(*left).message()),
              HasSubstr("token left has the scopes view now, and had view and draw"));
  EXPECT_TRUE(absl::IsUnauthenticated(access->Recheck(*right)));
  EXPECT_TRUE(access->Recheck(*trusted).ok());
  Put(Token("somebody", "secret", "\"view\", \"draw\""));
  ASSERT_TRUE(access->Look().ok());
  EXPECT_THAT(std::string(access->Recheck(*left).message()), HasSubstr("token somebody now"));
}

TEST_F(AccessTest, AFileThatIsWrongLetsNobodyNewIn) {
  Put(Token("left", "secret", "\"draw\""));
  const auto access = Make({.anonymous = *ParseScopes("view")});
  ASSERT_TRUE(access->Look().ok());
  const auto caller = access->Identify({.token = "secret"});
  ASSERT_TRUE(caller.ok());

  Put("[[token]]\nname = ");
  EXPECT_FALSE(access->Look().ok());
  EXPECT_THAT(access->trouble(), HasSubstr("grants.toml"));
  // Calls under way go on; new callers are refused if only the unreadable file could identify them.
  EXPECT_TRUE(access->Recheck(*caller).ok());
  EXPECT_TRUE(absl::IsUnavailable(access->Identify({.token = "secret"}).status()));
  EXPECT_TRUE(absl::IsUnavailable(access->Identify({.token = "guess"}).status()));
  EXPECT_TRUE(absl::IsUnavailable(access->Identify({.user = 99}).status()));
  EXPECT_TRUE(access->Identify({.user = 7}).ok());
  EXPECT_EQ(access->Identify({})->scopes.ToString(), "view");

  std::filesystem::remove(path_);
  EXPECT_FALSE(access->Look().ok());
  EXPECT_TRUE(absl::IsUnavailable(access->Identify({.token = "secret"}).status()));
  PutFile(path_, Token("left", "secret", "\"draw\""), 0666);  // another user may have written it
  EXPECT_FALSE(access->Look().ok());
  EXPECT_TRUE(absl::IsUnavailable(access->Identify({.token = "secret"}).status()));

  Put(Token("left", "secret", "\"draw\""));
  EXPECT_TRUE(access->Look().ok());
  EXPECT_EQ(access->trouble(), "");
  EXPECT_TRUE(access->Identify({.token = "secret"}).ok());
}

TEST_F(AccessTest, ATokenExpiredBeforeItWasLookedAtChangesNothing) {
  Put(Token("left", "secret", "\"draw\"", "expires = 1970-01-12T13:46:45Z") +  // 1,000,005
      Token("right", "other", "\"draw\""));
  now_ = 1'000'005;
  const auto access = Make();
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 1);
  EXPECT_FALSE(access->Identify({.token = "secret"}).ok()) << "to the second";
  EXPECT_TRUE(access->Identify({.token = "other"}).ok()) << "which never expires";
  ASSERT_TRUE(access->Look().ok());
  now_ += 5;
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 1) << "no caller lost scopes since the first look";
}

TEST_F(AccessTest, TheFileIsReadWhenItChangesOrWhenAskedTo) {
  Put(Token("left", "secret", "\"draw\""));
  const auto access = Make();
  ASSERT_TRUE(access->Look().ok());
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 1) << "unchanged";
  ASSERT_TRUE(access->Look(true).ok());
  EXPECT_EQ(changes_, 2) << "whatever it looks like";
  Put(Token("right", "secret", "\"draw\""));
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 3);
  EXPECT_EQ(access->Identify({.token = "secret"})->principal, "right");
}

TEST_F(AccessTest, OthersOptionsAreInForceAtOnceOrNotAtAll) {
  Put(Token("left", "secret", "\"draw\""));
  const auto access = Make();
  ASSERT_TRUE(access->Look().ok());
  const auto caller = access->Identify({.token = "secret"});
  const std::string other = folder_ + "/other.toml";
  PutFile(other, "[[token]]\n");
  EXPECT_FALSE(access->Change({.grants = other, .anonymous = *ParseScopes("none")}).ok());
  EXPECT_EQ(access->Identify({.token = "secret"})->principal, "left") << "the previous tokens stay";
  EXPECT_EQ(access->Identify({})->scopes, Scopes::All());
  EXPECT_EQ(changes_, 1);

  PutFile(other, Token("right", "secret", "\"view\"", "expires = 1970-01-12T13:46:45Z"));
  ASSERT_TRUE(
      access->Change({.grants = other, .anonymous = *ParseScopes("none"), .trusted = {8}}).ok());
  EXPECT_EQ(changes_, 2);
  EXPECT_EQ(access->Identify({.token = "secret"})->principal, "right");
  EXPECT_TRUE(access->Identify({})->scopes.empty());
  EXPECT_EQ(access->Identify({.user = 8})->scopes, Scopes::All());
  EXPECT_FALSE(access->Recheck(*caller).ok());
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 2) << "it has been read";
  now_ = 1'000'006;
  ASSERT_TRUE(access->Look().ok());
  EXPECT_EQ(changes_, 3) << "expired since";

  // Without a file there are neither tokens nor an error about one.
  PutFile(other, "wrong");
  ASSERT_FALSE(access->Look().ok());
  ASSERT_NE(access->trouble(), "");
  ASSERT_TRUE(access->Change({}).ok());
  EXPECT_EQ(access->trouble(), "");
  EXPECT_TRUE(absl::IsUnauthenticated(access->Identify({.token = "secret"}).status()));
  EXPECT_TRUE(access->Look().ok());
}

TEST_F(AccessTest, NobodyNeedHearOfChanges) {
  Put(Token("left", "secret", "\"draw\""));
  Access access(
      {.grants = path_}, [this] { return now_; }, nullptr);
  EXPECT_TRUE(access.Look().ok());
  EXPECT_TRUE(access.Change({.grants = path_}).ok());
  EXPECT_TRUE(access.Identify({.token = "secret"}).ok());
}

TEST_F(AccessTest, TheSystemsClockIsUnixTime) {
  const int64_t before = std::time(nullptr);
  const int64_t told = Access::SystemWallClock()();
  EXPECT_GE(told, before);
  EXPECT_LE(told, std::time(nullptr));
}

TEST_F(AccessTest, TrustedAreRootAndTheDaemonsOwn) {
  EXPECT_EQ(AccessOptions::TrustedUsers(), (std::set<uint32_t>{0, geteuid()}));
  Access access(
      {}, [this] { return now_; }, nullptr);
  ASSERT_TRUE(access.Look().ok());
  EXPECT_EQ(access.Identify({.user = 0})->who, "user 0");
}

// Tests what is logged about the file: its events, with their values.
class AccessLogTest : public AccessTest {
 protected:
  AccessLogTest()
      : file_(std::tmpfile()), log_(Logger::Level::kDebug, Logger::Format::kText, fileno(file_)) {
    EXPECT_EQ(std::fflush(file_), 0);
  }
  ~AccessLogTest() override { std::fclose(file_); }
  // Returns what was logged since the last call.
  std::string Said() {
    std::string text;
    char part[4096];
    for (ssize_t got; (got = pread(fileno(file_), part, sizeof(part), at_)) > 0; at_ += got)
      text.append(part, static_cast<size_t>(got));
    return text;
  }

  std::FILE* const file_;
  Logger log_;
  off_t at_ = 0;
};

TEST_F(AccessLogTest, SaysWhatBecameOfTheFile) {
  Put(Token("left", "secret", "\"draw\"") + "[[user]]\nname = \"7\"\nscopes = [\"draw\"]\n");
  Access access(
      {.grants = path_}, [this] { return now_; }, &log_);
  ASSERT_TRUE(access.Look().ok());
  const std::string first = Said();
  EXPECT_THAT(first, HasSubstr("grants"));
  EXPECT_THAT(first, ::testing::Not(HasSubstr("again")));
  EXPECT_THAT(first, HasSubstr("tokens=1"));
  EXPECT_THAT(first, HasSubstr("users=1"));
  EXPECT_THAT(first, HasSubstr("certificates=0"));
  ASSERT_TRUE(access.Look().ok());
  EXPECT_EQ(Said(), "") << "nothing new was logged";
  Put(Token("left", "secret", "\"view\""));
  ASSERT_TRUE(access.Look().ok());
  EXPECT_THAT(Said(), HasSubstr("the grants file was read again"));
  Put("[[token]]\n");
  ASSERT_FALSE(access.Look().ok());
  EXPECT_THAT(Said(), HasSubstr("the grants file is wrong: nobody new is let in by it"));
  ASSERT_FALSE(access.Look(true).ok());
  EXPECT_EQ(Said(), "") << "as before";
  Put(Token("left", "secret", "\"view\""));
  ASSERT_TRUE(access.Look().ok());
  EXPECT_THAT(Said(), HasSubstr("the grants file is right again"));
}

TEST_F(AccessLogTest, SaysThatTheFirstFileIsRightAfterAll) {
  Put("[[token]]\n");
  Access access(
      {.grants = path_}, [this] { return now_; }, &log_);
  ASSERT_FALSE(access.Look().ok());
  EXPECT_THAT(Said(), HasSubstr("the grants file is wrong"));
  Put("");
  ASSERT_TRUE(access.Look().ok());
  EXPECT_THAT(Said(), HasSubstr("the grants file is right again"));
}

TEST_F(AccessTest, WithoutAFileThereAreNoTokens) {
  Access access(
      {}, [] { return 0; }, nullptr);
  ASSERT_TRUE(access.Look().ok());
  EXPECT_EQ(access.Identify({})->scopes, Scopes::All());
  EXPECT_THAT(std::string(access.Identify({.token = "x"}).status().message()),
              HasSubstr("no grants file"));
}

}  // namespace
}  // namespace voxeld::daemon::access
