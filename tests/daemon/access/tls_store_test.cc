#include "daemon/access/tls_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <ctime>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "tests/daemon/access/certificates.h"

namespace voxeld::daemon::access {
namespace {

using ::testing::HasSubstr;

class TlsStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder_);
    Put(authority_.Issue("display.example", -3600, 30 * 86400));
    PutFile(files_.client_ca, authority_.certificate());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Put(const Issued& issued) {
    PutFile(files_.certificate, issued.certificate);
    PutFile(files_.key, issued.key);
  }
  std::string Why() const { return std::string(ReadTls(files_, now_).status().message()); }

  const std::string folder_ = absl::StrCat(::testing::TempDir(), "/voxeld-tls-", getpid());
  const TlsFiles files_{folder_ + "/cert.pem", folder_ + "/key.pem", folder_ + "/ca.pem"};
  TestAuthority authority_{"authority"};
  int64_t now_ = std::time(nullptr);
};

TEST_F(TlsStoreTest, ReadsWhatIsRight) {
  const absl::StatusOr<TlsMaterial> material = ReadTls(files_, now_);
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_THAT(material->certificate, HasSubstr("BEGIN CERTIFICATE"));
  EXPECT_NEAR(static_cast<double>(material->expires_s), static_cast<double>(now_ + 30 * 86400), 60);
}

TEST_F(TlsStoreTest, SaysWhatIsWrong) {
  PutFile(files_.key, authority_.Issue("other").key);
  EXPECT_THAT(Why(), HasSubstr("is not the key of the certificate"));
  PutFile(files_.key, "nothing");
  EXPECT_THAT(Why(), HasSubstr("has no private key in PEM without a password"));
  Put(authority_.Issue("display.example"));
  PutFile(files_.key, authority_.Issue("display.example").key, 0644);
  EXPECT_THAT(Why(), HasSubstr("may be read by everybody; chmod o="));
  Put(authority_.Issue("display.example", -7200, -3600));
  EXPECT_THAT(Why(), HasSubstr("has expired"));
  Put(authority_.Issue("display.example", 3600, 7200));
  EXPECT_THAT(Why(), HasSubstr("is not valid yet"));
  PutFile(files_.certificate, "");
  EXPECT_THAT(Why(), HasSubstr("tls_certificate"));
  Put(authority_.Issue("display.example"));
  PutFile(files_.client_ca, "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n");
  EXPECT_THAT(Why(), HasSubstr("tls_client_ca"));
  std::filesystem::remove(files_.client_ca);
  EXPECT_TRUE(absl::IsNotFound(ReadTls(files_, now_).status()));
  TlsFiles two = files_;
  two.client_ca.clear();
  EXPECT_THAT(std::string(ReadTls(two, now_).status().message()),
              HasSubstr("TLS needs tls_certificate, tls_key and tls_client_ca"));
}

TEST_F(TlsStoreTest, TheLastThatWasRightStays) {
  auto store = TlsStore::Open(
      files_, [this] { return now_; }, nullptr);
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_EQ((*store)->trouble(), "");
  const TlsStore::Current first = (*store)->current();
  EXPECT_EQ((*store)->counts().taken, 1u);
  EXPECT_EQ((*store)->counts().refused, 0u);

  // In the middle of an exchange: a certificate whose key has not come yet.
  const Issued next = authority_.Issue("display.example", -3600, 40 * 86400);
  PutFile(files_.certificate, next.certificate);
  EXPECT_FALSE((*store)->Look().ok());
  EXPECT_EQ((*store)->current().generation, first.generation);
  EXPECT_THAT((*store)->trouble(), HasSubstr("is not the key"));
  PutFile(files_.key, next.key);
  EXPECT_TRUE((*store)->Look().ok());
  EXPECT_EQ((*store)->current().generation, first.generation + 1);
  EXPECT_EQ((*store)->current().material->certificate, next.certificate);
  EXPECT_EQ((*store)->trouble(), "");
  EXPECT_TRUE((*store)->Look().ok());
  EXPECT_EQ((*store)->current().generation, first.generation + 1);

  std::filesystem::remove(files_.key);
  EXPECT_FALSE((*store)->Look().ok());
  EXPECT_EQ((*store)->current().material->certificate, next.certificate);
  EXPECT_EQ((*store)->counts().taken, 2u);
  EXPECT_EQ((*store)->counts().refused, 2u);
}

TEST_F(TlsStoreTest, TellsOfTheEndBeforeItComes) {
  auto store = TlsStore::Open(
      files_, [this] { return now_; }, nullptr);
  ASSERT_TRUE(store.ok());
  now_ += 20 * 86400;
  EXPECT_THAT((*store)->trouble(),
              HasSubstr("expires in 2"));  // 240 hours, less what the test takes
  now_ += 20 * 86400;
  EXPECT_THAT((*store)->trouble(), HasSubstr("has expired"));
}

TEST_F(TlsStoreTest, DoesNotOpenWithoutWhatIsRight) {
  PutFile(files_.key, "nothing");
  EXPECT_FALSE(TlsStore::Open(
                   files_, [this] { return now_; }, nullptr)
                   .ok());
}

}  // namespace
}  // namespace voxeld::daemon::access
