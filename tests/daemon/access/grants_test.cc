#include "daemon/access/grants.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "absl/strings/str_cat.h"
#include "tests/daemon/access/certificates.h"

namespace voxeld::daemon::access {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Of "abc", by FIPS 180-2, appendix B.1.
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
  EXPECT_TRUE(absl::IsInvalidArgument(ParseScopes("").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(ParseScopes("view none").status()));
  EXPECT_TRUE(Scopes::All().Hold(*ParseScopes("draw")));
  EXPECT_FALSE(ParseScopes("draw")->Hold(*ParseScopes("view draw")));
}

TEST(Grants, WhatTheParserQuotesIsPrintable) {
  const std::string message(ParseGrants("a = t\x1c", "file").status().message());
  EXPECT_EQ(message.rfind("file:1: ", 0), 0u) << message;
  for (const char c : message) EXPECT_FALSE(c >= 0 && c < 32) << message;
}

TEST(Scopes, AMessageIsPrintable) {
  EXPECT_EQ(ParseScopes("vi\x1bw").status().message(),
            "the scope \"vi\\x1bw\" is none; there are view, draw, control, and all or none alone");
}

}  // namespace
}  // namespace voxeld::daemon::access
