// Tests access control as a whole, opened and checked together: it never starts with less than was
// configured.
#include "daemon/access/security.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "daemon/log/logger.h"
#include "tests/daemon/access/certificates.h"

namespace voxeld::daemon::access {
namespace {

using ::testing::HasSubstr;

class SecurityTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder_);
    PutFile(options_.grants, Token("left"));
    const Issued issued = authority_.Issue("display.example", -3600, 30 * 86400);
    PutFile(files_.certificate, issued.certificate);
    PutFile(files_.key, issued.key);
    PutFile(files_.client_ca, authority_.certificate());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  static std::string Token(const std::string& name) {
    return absl::StrCat("[[token]]\nname = \"", name, "\"\nsha256 = \"", HashOf("secret"),
                        "\"\nscopes = [\"draw\"]\n");
  }
  absl::StatusOr<std::unique_ptr<Security>> Open(const TlsFiles& files) {
    return Security::Open(options_, files, {.path = audit_}, log_);
  }
  size_t AuditLines() const {
    std::ifstream file(audit_);
    size_t lines = 0;
    for (std::string line; std::getline(file, line);) ++lines;
    return lines;
  }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-security-", getpid());
  const std::string audit_ = folder_ + "/audit";
  AccessOptions options_{.grants = folder_ + "/grants.toml"};
  const TlsFiles files_{folder_ + "/cert.pem", folder_ + "/key.pem", folder_ + "/ca.pem"};
  TestAuthority authority_{"authority"};
  Logger log_{Logger::Level::kOff, Logger::Format::kText};
};

TEST_F(SecurityTest, OpensAllThree) {
  const auto security = Open(files_);
  ASSERT_TRUE(security.ok()) << security.status();
  EXPECT_TRUE((*security)->access().Identify({.token = "secret"}).ok());
  ASSERT_NE((*security)->tls(), nullptr);
  EXPECT_THAT((*security)->tls()->current().material->certificate, HasSubstr("BEGIN CERTIFICATE"));
  (*security)->audit().Record("token left", "", "ClearLayer", "", absl::OkStatus());
  EXPECT_EQ(AuditLines(), 1u);
  EXPECT_EQ((*security)->trouble(), "");
}

TEST_F(SecurityTest, WithoutFilesOfTlsThereIsNone) {
  const auto security = Open({});
  ASSERT_TRUE(security.ok()) << security.status();
  EXPECT_EQ((*security)->tls(), nullptr);
  EXPECT_EQ((*security)->tls_counts().taken, 0u);
  EXPECT_EQ((*security)->trouble(), "");
  (*security)->Look();
  PutFile(options_.grants, "wrong");
  (*security)->Look();
  EXPECT_THAT((*security)->trouble(), HasSubstr("grants.toml"));
}

TEST_F(SecurityTest, NothingBeginsWithLessThanWasAskedFor) {
  std::string old = options_.grants;
  options_.grants = folder_ + "/none.toml";
  EXPECT_THAT(std::string(Open(files_).status().message()), HasSubstr("none.toml"));
  options_.grants = old;
  TlsFiles files = files_;
  files.key = folder_ + "/none.pem";
  EXPECT_THAT(std::string(Open(files).status().message()), HasSubstr("none.pem"));
  std::filesystem::create_directory(audit_);  // which is not a writable file
  EXPECT_THAT(std::string(Open(files_).status().message()), HasSubstr("audit"));
}

TEST_F(SecurityTest, TroubleIsThatOfAll) {
  const auto security = Open(files_);
  ASSERT_TRUE(security.ok()) << security.status();
  PutFile(files_.key, "nothing at all");
  (*security)->Look();
  const std::string of_tls = (*security)->trouble();
  EXPECT_THAT(of_tls, HasSubstr("private key"));
  EXPECT_EQ(of_tls.find("; "), std::string::npos) << "one error";
  PutFile(options_.grants, "also wrong");
  (*security)->Look();
  EXPECT_THAT((*security)->trouble(), HasSubstr("grants.toml"));
  EXPECT_THAT((*security)->trouble(), HasSubstr("; " + of_tls));
}

TEST_F(SecurityTest, AReloadReadsEverythingAndWritesAnew) {
  const auto security = Open(files_);
  ASSERT_TRUE(security.ok()) << security.status();
  int changes = 0;
  (*security)->access().SetOnChange([&] { ++changes; });
  (*security)->Look();
  EXPECT_EQ(changes, 0) << "the file is unchanged";
  (*security)->Reload();
  EXPECT_EQ(changes, 1) << "read again, whatever it looks like";
  std::filesystem::rename(audit_, audit_ + ".1");
  (*security)->audit().Record("a", "", "First", "", absl::OkStatus());
  EXPECT_FALSE(std::filesystem::exists(audit_));
  (*security)->Reload();
  (*security)->audit().Record("a", "", "Second", "", absl::OkStatus());
  EXPECT_EQ(AuditLines(), 1u);
}

}  // namespace
}  // namespace voxeld::daemon::access
