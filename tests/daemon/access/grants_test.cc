#include "daemon/access/grants.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/daemon/access/certificates.h"

namespace voxeld::daemon::access {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// The hash of "abc" according to FIPS 180-2, appendix B.1.
constexpr char kHashOfAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

std::string Message(std::string_view text) {
  const absl::StatusOr<Grants> grants = ParseGrants(text, "grants.toml");
  EXPECT_FALSE(grants.ok());
  return std::string(grants.status().message());
}

TEST(Grants, HashesAreSha256) { EXPECT_EQ(HashOf("abc"), kHashOfAbc); }

TEST(Grants, AllThreeKindsAreRead) {
  const absl::StatusOr<Grants> grants = ParseGrants(absl::StrCat(R"(
[[token]]
name = "stage-left"
sha256 = ")",
                                                                 kHashOfAbc, R"("
scopes = ["view", "draw"]
expires = 2001-09-09T03:46:40+02:00

[[certificate]]
name = "cube"
subject = "cube.example"
scopes = ["control"]

[[user]]
name = "1234"
scopes = ["none"]
)"),
                                                    "grants.toml");
  ASSERT_TRUE(grants.ok()) << grants.status();
  const Grant& token = grants->tokens.at(kHashOfAbc);
  EXPECT_EQ(token.name, "stage-left");
  EXPECT_EQ(token.scopes.ToString(), "view draw");
  EXPECT_EQ(token.expires_s, 1'000'000'000);
  EXPECT_EQ(grants->certificates.at("cube.example").scopes.ToString(), "control");
  EXPECT_TRUE(grants->users.at(1234).scopes.empty());
}

TEST(Grants, EveryFaultIsNamedWithItsLine) {
  const std::string message = Message(R"([[token]]
name = "a"
sha256 = "123"
scopes = ["view"]
[[token]]
name = "b\n"
sha256 = "123"
scopes = ["view"]
[[certificate]]
name = "c"
subject = "c"
scopes = ["paint"]
[[user]]
name = "no-such-user-here"
scopes = ["view"]
[[tokn]]
[[certificate]]
name = "d"
scope = ["view"]
)");
  EXPECT_THAT(message, HasSubstr("grants.toml:1: sha256 is \"123\"; give the 64 digits"));
  EXPECT_THAT(message, HasSubstr("grants.toml:5: name is \"b\\n\""));
  EXPECT_THAT(message, HasSubstr("grants.toml:12: the scope \"paint\" is none"));
  EXPECT_THAT(message,
              HasSubstr("grants.toml:13: this machine knows no user \"no-such-user-here\""));
  EXPECT_THAT(message, HasSubstr("\"tokn\"; did you mean token?"));
  EXPECT_THAT(message, HasSubstr("\"scope\"; did you mean scopes?"));
}

TEST(Grants, WhatIsThereTwiceOrNoToml) {
  const std::string one =
      absl::StrCat("[[token]]\nname = \"a\"\nsha256 = \"", kHashOfAbc, "\"\nscopes = [\"view\"]\n");
  EXPECT_THAT(Message(one + one), HasSubstr("is there twice"));
  EXPECT_THAT(Message("[[token"), HasSubstr("grants.toml:1"));
  EXPECT_THAT(Message("token = 3"), HasSubstr("write [[token]]"));
  EXPECT_THAT(Message("[[token]]\nname = \"a\"\nscopes = [\"view\"]\n"),
              HasSubstr("sha256 is missing"));
  EXPECT_THAT(Message(absl::StrCat(one, "expires = \"tomorrow\"\n")),
              HasSubstr("grants.toml:5: expires is no date and time with its offset"));
  EXPECT_THAT(Message(absl::StrCat(one, "expires = 2027-01-01T00:00:00\n")),
              HasSubstr("its offset"));
}

TEST(Grants, EachKindOfFaultIsSaidOnceAndLeavesItsEntryOut) {
  const std::string good =
      absl::StrCat("[[token]]\nname = \"a\"\nsha256 = \"", kHashOfAbc, "\"\nscopes = [\"view\"]\n");
  const std::pair<std::string, const char*> cases[] = {
      {"token = [3]\n", "g:1: write [[token]]"},
      {"[[certificate]]\nsubject = \"s\"\nscopes = [\"view\"]\n",
       "g:1: name is missing; give a text"},
      {"[[certificate]]\nname = \"\"\nsubject = \"s\"\nscopes = [\"view\"]\n",
       "g:2: name is missing; give a text"},
      {"[[certificate]]\nname = 5\nsubject = \"s\"\nscopes = [\"view\"]\n",
       "g:2: name is missing; give a text"},
      {"[[certificate]]\nname = \"c\"\nscopes = [\"view\"]\n",
       "g:1: subject is missing; give a text"},
      {"[[certificate]]\nname = \"c\"\nsubject = \"s\"\n",
       "g:1: scopes is missing; give an array of view, draw, control"},
      {"[[certificate]]\nname = \"c\"\nsubject = \"s\"\nscopes = \"view\"\n",
       "g:1: scopes is missing; give an array of view, draw, control"},
      {"[[certificate]]\nname = \"c\"\nsubject = \"s\"\nscopes = [3]\n",
       "g:4: the scope \"?\" is none"},
      {"[[certificate]]\nname = \"c/d\"\nsubject = \"s\"\nscopes = [\"view\"]\n",
       "g:1: name is \"c/d\"; give 1 to 128 letters, digits, '-', '_', '.' or '@'"},
      {absl::StrCat("[[token]]\nname = \"a\"\nsha256 = \"g", std::string(kHashOfAbc).substr(1),
                    "\"\nscopes = [\"view\"]\n"),
       "g:1: sha256 is \"ga7816bf"},
      {absl::StrCat("[[token]]\nname = \"a\"\nsha256 = \"", kHashOfAbc,
                    "0\"\nscopes = [\"view\"]\n"),
       "0\"; give the 64 digits"},
      {"[[user]]\nname = \"1x\"\nscopes = [\"view\"]\n", "g:1: this machine knows no user \"1x\""},
      {"[[user]]\nname = \"4294967296\"\nscopes = [\"view\"]\n",
       "g:1: this machine knows no user \"4294967296\""},
      {"[[user]]\nname = \"7\"\nscopes = [\"view\"]\n[[user]]\nname = \"007\"\nscopes = "
       "[\"draw\"]\n",
       "g:4: user 7 is there twice"},
      {"[[certificate]]\nname = \"c\"\nsubject = \"s\"\nscopes = [\"view\"]\n"
       "[[certificate]]\nname = \"d\"\nsubject = \"s\"\nscopes = [\"draw\"]\n",
       "g:5: subject \"s\" is there twice"},
  };
  for (const auto& [text, message] : cases) {
    SCOPED_TRACE(text);
    const absl::StatusOr<Grants> grants = ParseGrants(text, "g");
    ASSERT_TRUE(absl::IsInvalidArgument(grants.status()));
    const std::string said(grants.status().message());
    EXPECT_THAT(said, HasSubstr(message));
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 0) << "one fault, one line: " << said;
    EXPECT_FALSE(ParseGrants(good + text, "g").ok()) << "however good the others are";
  }
}

TEST(Grants, NamesAreWhatTheyMayBe) {
  const auto read = [](const std::string& name) {
    return ParseGrants(absl::StrCat("[[certificate]]\nname = \"", name,
                                    "\"\nsubject = \"s\"\nscopes = [\"view\"]\n"),
                       "g");
  };
  for (const std::string& name : {std::string("a-b_c.d@E9"), std::string("-"), std::string("_"),
                                  std::string("."), std::string("@"), std::string(128, 'x')}) {
    const absl::StatusOr<Grants> grants = read(name);
    ASSERT_TRUE(grants.ok()) << grants.status();
    EXPECT_EQ(grants->certificates.at("s").name, name);
  }
  for (const std::string& name :
       {std::string(129, 'x'), std::string("a b"), std::string("a:b"), std::string("ä")})
    EXPECT_FALSE(read(name).ok()) << name;
}

TEST(Grants, HashesMayBeInCapitals) {
  std::string hash = kHashOfAbc;
  for (char& c : hash) c = static_cast<char>(std::toupper(c));
  const absl::StatusOr<Grants> grants = ParseGrants(
      absl::StrCat("[[token]]\nname = \"a\"\nsha256 = \"", hash, "\"\nscopes = [\"view\"]\n"), "g");
  ASSERT_TRUE(grants.ok()) << grants.status();
  EXPECT_TRUE(grants->tokens.contains(kHashOfAbc));
  EXPECT_FALSE(grants->tokens.at(kHashOfAbc).expires_s.has_value());
}

TEST(Grants, UsersMayBeCalledByTheirNames) {
  const absl::StatusOr<Grants> grants =
      ParseGrants("[[user]]\nname = \"root\"\nscopes = [\"view\"]\n", "g");
  ASSERT_TRUE(grants.ok()) << grants.status();
  EXPECT_EQ(grants->users.at(0).name, "root");
}

TEST(Grants, FaultsAreToldUpToALimit) {
  std::string text;
  for (int i = 0; i < 100; ++i) text += "[[user]]\n";
  const std::string said = Message(text);
  const auto lines = std::count(said.begin(), said.end(), '\n') + 1;
  EXPECT_GE(lines, 10);
  EXPECT_LT(lines, 100);
  EXPECT_THAT(said, ::testing::StartsWith("grants.toml:1: name is missing"));
}

class GrantsFile : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-grants-", getpid());
  const std::string path_ = folder_ + "/grants.toml";
};

TEST_F(GrantsFile, OthersMayNotWriteIt) {
  PutFile(path_, "", 0620);
  EXPECT_TRUE(absl::IsFailedPrecondition(ReadGrants(path_).status()));
  EXPECT_THAT(std::string(ReadGrants(path_).status().message()), HasSubstr("chmod go-w"));
  PutFile(path_, "", 0644);
  const absl::StatusOr<Grants> empty = ReadGrants(path_);
  ASSERT_TRUE(empty.ok()) << empty.status();
  EXPECT_TRUE(empty->tokens.empty());
}

TEST_F(GrantsFile, ThatIsMissingOrTooLargeIsAnError) {
  EXPECT_TRUE(absl::IsNotFound(ReadGrants(path_).status()));
  PutFile(path_, std::string(kGreatestGrantsBytes + 1, '\n'));
  EXPECT_THAT(std::string(ReadGrants(path_).status().message()),
              AllOf(HasSubstr("4194305 bytes"), HasSubstr("4194304 is the most")));
  EXPECT_TRUE(absl::IsFailedPrecondition(ReadGrants(folder_).status()));
}

TEST_F(GrantsFile, OfTheGreatestSizeIsRead) {
  PutFile(path_, std::string(kGreatestGrantsBytes, '\n'));
  EXPECT_TRUE(ReadGrants(path_).ok());
}

TEST_F(GrantsFile, OfAnybodyElseIsNotTrusted) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  PutFile(path_, "");
  ASSERT_EQ(chown(path_.c_str(), 12345, gid_t(-1)), 0);
  const absl::Status status = ReadGrants(path_).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status));
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("belongs to user 12345; it must be root's or the daemon's own"));
}

TEST_F(GrantsFile, OfTheDaemonsOwnUserIsTrusted) {
  PutFile(path_, "");
  ASSERT_EQ(chmod(folder_.c_str(), 0755), 0);
  const bool root = geteuid() == 0;
  if (root) {
    ASSERT_EQ(chown(path_.c_str(), 12345, gid_t(-1)), 0);
    ASSERT_EQ(seteuid(12345), 0);
  }
  const absl::Status status = ReadGrants(path_).status();
  if (root) {
    ASSERT_EQ(seteuid(0), 0);
  }
  EXPECT_TRUE(status.ok()) << status;
}

TEST_F(GrantsFile, ThatCannotBeReadIsAnError) {
  PutFile(path_, "# nothing\n", 0200);
  ASSERT_EQ(chmod(folder_.c_str(), 0755), 0);
  // Root can read every file, so the test runs as another user for a moment, for whom root's file
  // is as good as their own.
  const bool root = geteuid() == 0;
  if (root) {
    ASSERT_EQ(seteuid(12345), 0);
  }
  const absl::Status status = ReadGrants(path_).status();
  if (root) {
    ASSERT_EQ(seteuid(0), 0);
  }
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("cannot be read"));
}

// A process' own memory is a file that can be opened, but not read at its beginning.
TEST_F(GrantsFile, ThatFailsAsItIsReadIsAnError) {
  const absl::StatusOr<Grants> grants = ReadGrants("/proc/self/mem");
  EXPECT_TRUE(absl::IsUnavailable(grants.status())) << grants.status();
}

TEST(Scopes, ReadBackAsTheyAreWritten) {
  for (const char* text :
       {"view", "draw", "control", "view draw", "view control", "view draw control"}) {
    const absl::StatusOr<Scopes> scopes = ParseScopes(text);
    ASSERT_TRUE(scopes.ok());
    EXPECT_EQ(scopes->ToString(), text);
  }
  EXPECT_EQ(ParseScopes("draw,view")->ToString(), "view draw");
  EXPECT_EQ(ParseScopes("draw,view")->Sentence(), "view and draw");
  EXPECT_EQ(ParseScopes("all")->Sentence(), "view, draw and control");
  EXPECT_EQ(ParseScopes("draw")->Sentence(), "draw");
  EXPECT_EQ(ParseScopes("none")->Sentence(), "none");
  EXPECT_EQ(*ParseScopes("all"), Scopes::All());
  EXPECT_TRUE(ParseScopes("none")->empty());
  EXPECT_EQ(ParseScopes("none")->ToString(), "none");
  EXPECT_TRUE(absl::IsInvalidArgument(ParseScopes("").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(ParseScopes("view none").status()));
  EXPECT_TRUE(Scopes::All().Hold(*ParseScopes("draw")));
  EXPECT_FALSE(ParseScopes("draw")->Hold(*ParseScopes("view draw")));
}

TEST(Grants, WhatTheParserQuotesIsPrintable) {
  const std::string message(ParseGrants("a = t\x1c", "file").status().message());
  EXPECT_EQ(message.rfind("file:1:", 0), 0u) << message;
  for (const char c : message) EXPECT_FALSE(c >= 0 && c < 32) << message;
}

TEST(Scopes, AMessageIsPrintable) {
  EXPECT_EQ(ParseScopes("vi\x1bw").status().message(),
            "the scope \"vi\\x1bw\" is none; there are view, draw, control, and all or none alone");
}

}  // namespace
}  // namespace voxeld::daemon::access
