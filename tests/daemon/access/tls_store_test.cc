#include "daemon/access/tls_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <filesystem>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "daemon/log/logger.h"
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

TEST_F(TlsStoreTest, AFileIsOneAndNotTooLarge) {
  TlsFiles files = files_;
  files.certificate = folder_;
  const auto why = [&] { return std::string(ReadTls(files, now_).status().message()); };
  EXPECT_THAT(why(), HasSubstr("is no file of at most 1048576 bytes"));
  files.certificate = folder_ + "/great.pem";
  const std::string good = authority_.Issue("display.example").certificate;
  PutFile(files.certificate, good + std::string((1 << 20) - good.size(), '\n'));
  EXPECT_THAT(why(), HasSubstr("is not the key of the certificate")) << "it has been read";
  PutFile(files.certificate, good + std::string((1 << 20) + 1 - good.size(), '\n'));
  EXPECT_THAT(why(), HasSubstr("is no file of at most 1048576 bytes"));
}

TEST_F(TlsStoreTest, WhatCannotBeReadIsNotTakenForAnEmptyFile) {
  TlsFiles files = files_;
  files.client_ca = "/proc/self/mem";  // can be opened, but not read at its beginning
  EXPECT_TRUE(absl::IsUnavailable(ReadTls(files, now_).status()));
  rlimit limit;
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit none{0, limit.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
  const absl::Status status = ReadTls(files_, now_).status();
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &limit), 0);
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
}

TEST_F(TlsStoreTest, AKeyOfWhatAllMayDoAnythingWithIsRefused) {
  const Issued issued = authority_.Issue("display.example");
  PutFile(files_.certificate, issued.certificate);
  for (const unsigned mode : {0604u, 0602u, 0601u}) {
    PutFile(files_.key, issued.key, mode);
    EXPECT_TRUE(absl::IsFailedPrecondition(ReadTls(files_, now_).status())) << mode;
  }
  PutFile(files_.key, issued.key, 0640);
  // A certificate that is sent to every client is not a secret.
  PutFile(files_.certificate, issued.certificate, 0644);
  PutFile(files_.client_ca, authority_.certificate(), 0644);
  EXPECT_TRUE(ReadTls(files_, now_).ok());
}

TEST_F(TlsStoreTest, IsValidFromItsFirstSecondToBeforeItsLast) {
  Put(authority_.Issue("display.example", -3600, 3600));
  const int64_t expires = ReadTls(files_, now_)->expires_s, begins = expires - 7200;
  EXPECT_TRUE(ReadTls(files_, begins).ok());
  EXPECT_THAT(std::string(ReadTls(files_, begins - 1).status().message()),
              HasSubstr("is not valid yet"));
  EXPECT_TRUE(ReadTls(files_, expires - 1).ok());
  EXPECT_THAT(std::string(ReadTls(files_, expires).status().message()), HasSubstr("has expired"));
}

// A certificate whose end cannot be parsed is not treated as valid for long.
TEST_F(TlsStoreTest, OfATimeThatIsNoneHasExpired) {
  const Issued issued = authority_.Issue("display.example");
  std::string pem = issued.certificate;
  const size_t begin = pem.find('\n') + 1, end = pem.find("-----END");
  std::string der;
  ASSERT_TRUE(absl::Base64Unescape(
      absl::StrReplaceAll(pem.substr(begin, end - begin), {{"\n", ""}}), &der));
  const std::string utc_time("\x17\x0d", 2);  // X.690: tag and length
  const size_t second = der.find(utc_time, der.find(utc_time) + 1);
  ASSERT_NE(second, std::string::npos);
  der.replace(second + 2, 6, "xxxxxx");
  std::string lines;
  const std::string coded = absl::Base64Escape(der);
  for (size_t at = 0; at < coded.size(); at += 64) lines += coded.substr(at, 64) + "\n";
  PutFile(files_.certificate, pem.substr(0, begin) + lines + pem.substr(end));
  PutFile(files_.key, issued.key);
  EXPECT_THAT(Why(), HasSubstr("has expired"));
}

TEST_F(TlsStoreTest, TheLastThatWasRightStays) {
  auto store = TlsStore::Open(
      files_, [this] { return now_; }, nullptr);
  ASSERT_TRUE(store.ok()) << store.status();
  EXPECT_EQ((*store)->trouble(), "");
  const TlsStore::Current first = (*store)->current();
  EXPECT_EQ((*store)->counts().taken, 1u);
  EXPECT_EQ((*store)->counts().refused, 0u);

  // In the middle of an exchange: a certificate whose key has not been written yet.
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
  const int64_t end = (*store)->current().material->expires_s;
  now_ = end - 3600;
  EXPECT_THAT((*store)->trouble(), HasSubstr("expires in 1 hours"));
  now_ = end - 3599;
  EXPECT_THAT((*store)->trouble(), HasSubstr("expires in 0 hours"));
  now_ = end - 1;
  EXPECT_THAT((*store)->trouble(), HasSubstr("expires in 0 hours"));
  now_ = end;
  EXPECT_THAT((*store)->trouble(), HasSubstr("has expired"));
}

TEST_F(TlsStoreTest, EachThingIsLoggedOnce) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  Logger log(Logger::Level::kInfo, Logger::Format::kText, fileno(file.get()));
  const auto count = [&](const std::string& what) {
    size_t found = 0;
    char part[1 << 14];
    const ssize_t got = pread(fileno(file.get()), part, sizeof(part), 0);
    const std::string all(part, got < 0 ? 0 : static_cast<size_t>(got));
    for (size_t at = all.find(what); at != std::string::npos; at = all.find(what, at + 1)) ++found;
    return found;
  };
  auto store = TlsStore::Open(
      files_, [this] { return now_; }, &log);
  ASSERT_TRUE(store.ok());
  EXPECT_EQ(count("TLS"), 0u);
  PutFile(files_.key, "nothing");
  EXPECT_FALSE((*store)->Look(true).ok());
  EXPECT_FALSE((*store)->Look(true).ok());
  EXPECT_EQ(count("TLS files are wrong"), 1u);
  PutFile(files_.key, authority_.Issue("other").key);
  EXPECT_FALSE((*store)->Look(true).ok());
  EXPECT_EQ(count("TLS files are wrong"), 2u) << "another fault";
  Put(authority_.Issue("display.example", -3600, 30 * 86400));
  EXPECT_TRUE((*store)->Look(true).ok());
  EXPECT_EQ(count("TLS files were read again"), 1u);
  EXPECT_EQ(count("expires soon"), 0u);
  const int64_t warns = (*store)->current().material->expires_s - TlsStore::kWarnSeconds;
  now_ = warns - 1;
  EXPECT_TRUE((*store)->Look().ok());
  EXPECT_EQ((*store)->trouble(), "");
  EXPECT_EQ(count("expires soon"), 0u);
  now_ = warns;
  EXPECT_TRUE((*store)->Look().ok());
  EXPECT_TRUE((*store)->Look().ok());
  EXPECT_EQ(count("expires soon"), 1u);
  EXPECT_EQ(count(absl::StrCat("seconds=", TlsStore::kWarnSeconds)), 1u);
  EXPECT_THAT((*store)->trouble(), HasSubstr("expires in 336 hours"));
  // Another certificate is reported again.
  Put(authority_.Issue("display.example", -3600, 20 * 86400));
  EXPECT_TRUE((*store)->Look(true).ok());
  EXPECT_EQ(count("expires soon"), 2u);
}

TEST_F(TlsStoreTest, WhatExpiresSoonIsTakenWithoutALogToo) {
  auto store = TlsStore::Open(
      files_, [this] { return now_; }, nullptr);
  ASSERT_TRUE(store.ok());
  now_ += 20 * 86400;
  EXPECT_TRUE((*store)->Look().ok());
}

TEST_F(TlsStoreTest, DoesNotOpenWithoutWhatIsRight) {
  PutFile(files_.key, "nothing");
  EXPECT_FALSE(TlsStore::Open(
                   files_, [this] { return now_; }, nullptr)
                   .ok());
}

}  // namespace
}  // namespace voxeld::daemon::access
