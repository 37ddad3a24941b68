#include "daemon/access/audit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::access {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

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
  std::string Logged() {
    std::string text = std::move(logged_).str();
    logged_.str("");
    return text;
  }
  const std::string path_ = absl::StrCat(::testing::TempDir(), "/voxeld-audit-", getpid());
  std::ostringstream logged_;
  Logger log_{Logger::Level::kInfo, Logger::Format::kJson,
              std::make_shared<spdlog::sinks::ostream_sink_mt>(logged_, true)};
};

// As long as it exists, files of this process are limited to that many bytes.
class SmallFiles {
 public:
  explicit SmallFiles(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    EXPECT_EQ(getrlimit(RLIMIT_FSIZE, &before_), 0);
    const rlimit small{bytes, before_.rlim_max};
    EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  }
  ~SmallFiles() { EXPECT_EQ(setrlimit(RLIMIT_FSIZE, &before_), 0); }
  SmallFiles(const SmallFiles&) = delete;
  SmallFiles& operator=(const SmallFiles&) = delete;

 private:
  rlimit before_;
};

TEST_F(AuditTest, OneObjectALineWhateverTheWordsAre) {
  auto audit = Audit::Open({.path = path_}, nullptr);
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
  auto audit = Audit::Open({.path = path_}, nullptr);
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

TEST_F(AuditTest, WithoutAFileItIsLinesOfTheLog) {
  auto audit = Audit::Open({}, &log_);
  ASSERT_TRUE(audit.ok());
  (*audit)->Record("token a\"\n", "unix:", "ClearLayer", "layer", absl::NotFoundError("none"));
  (*audit)->Reopen();
  const json line = json::parse(Logged());
  EXPECT_EQ(line["event"], "audit");
  EXPECT_EQ(line["who"], "token a\"\n");
  EXPECT_EQ(line["peer"], "unix:");
  EXPECT_EQ(line["method"], "ClearLayer");
  EXPECT_EQ(line["what"], "layer");
  EXPECT_EQ(line["result"], "NOT_FOUND: none");
  auto none = Audit::Open({}, nullptr);
  ASSERT_TRUE(none.ok());
  (*none)->Record("a", "", "First", "", absl::OkStatus());
}

TEST_F(AuditTest, EntriesWaitInOrderWhileTheFileCannotBeWritten) {
  auto audit = Audit::Open({.path = path_}, &log_);
  ASSERT_TRUE(audit.ok());
  std::vector<std::string> wanted;
  const auto record = [&](const char* method) {
    (*audit)->Record("a", "", method, "", absl::OkStatus());
    wanted.emplace_back(method);
  };
  record("First");
  EXPECT_EQ(Logged(), "");
  for (const char* again : {"Second", "Third"}) {
    {
      const SmallFiles full(std::filesystem::file_size(path_));
      record("Waits");
      const std::string logged = Logged();
      EXPECT_THAT(logged, HasSubstr("the audit log cannot be written"));
      EXPECT_THAT(logged, HasSubstr(path_));
      EXPECT_THAT(logged, HasSubstr("File too large"));
      EXPECT_EQ((*audit)->stats().pending, 1u);
      EXPECT_EQ((*audit)->stats().error, "File too large");
      record("WaitsToo");
      EXPECT_EQ(Logged(), "") << "once is enough";
      EXPECT_EQ((*audit)->stats().pending, 2u);
    }
    record(again);
    EXPECT_THAT(Logged(), HasSubstr("the audit log is written again"));
    EXPECT_EQ((*audit)->stats().pending, 0u);
    EXPECT_EQ((*audit)->stats().error, "");
  }
  std::vector<std::string> methods;
  for (const json& line : Lines(path_)) methods.push_back(line["method"]);
  EXPECT_EQ(methods, wanted);
  EXPECT_EQ((*audit)->stats().lost, 0u);
}

TEST_F(AuditTest, RetryWritesWhatIsPending) {
  auto audit = Audit::Open({.path = path_}, nullptr);
  ASSERT_TRUE(audit.ok());
  {
    const SmallFiles full(0);
    (*audit)->Record("a", "", "First", "", absl::OkStatus());
    (*audit)->Retry();
    EXPECT_EQ((*audit)->stats().pending, 1u);
  }
  (*audit)->Retry();
  EXPECT_EQ((*audit)->stats().pending, 0u);
  ASSERT_EQ(Lines(path_).size(), 1u);
}

TEST_F(AuditTest, ABufferThatIsFullCountsWhatItLoses) {
  auto audit = Audit::Open({.path = path_, .max_pending_bytes = 400}, &log_);
  ASSERT_TRUE(audit.ok());
  uint64_t lost = 0;
  {
    const SmallFiles full(0);
    for (int i = 0; i < 20; ++i) {
      (*audit)->Record("a", "", absl::StrCat("Entry", i), "", absl::OkStatus());
    }
    const AuditStats stats = (*audit)->stats();
    EXPECT_GE(stats.pending, 1u);
    EXPECT_EQ(stats.pending + stats.lost, 20u);
    EXPECT_GT(stats.lost, 0u);
    EXPECT_THAT(Logged(), HasSubstr("audit entries are lost"));
    lost = stats.lost;
  }
  // An entry that is larger than the buffer is written all the same if the file has room.
  (*audit)->Record("a", "", "Large", std::string(1000, 'x'), absl::OkStatus());
  const std::vector<json> lines = Lines(path_);
  ASSERT_EQ(lines.size(), 20 - lost + 1);
  for (size_t i = 0; i + 1 < lines.size(); ++i)
    EXPECT_EQ(lines[i]["method"], absl::StrCat("Entry", i));
  EXPECT_EQ(lines.back()["method"], "Large");
  EXPECT_EQ((*audit)->stats().lost, lost);
  Logged();
  // The next failure is logged again, and counted in addition.
  const SmallFiles full(std::filesystem::file_size(path_));
  for (int i = 0; i < 20; ++i) (*audit)->Record("a", "", "Again", "", absl::OkStatus());
  EXPECT_THAT(Logged(), HasSubstr("audit entries are lost"));
  EXPECT_GT((*audit)->stats().lost, lost);
}

TEST_F(AuditTest, WhereItIsRequiredNobodyMayActWhileItCannotBeWritten) {
  auto required = Audit::Open({.path = path_, .required = true}, nullptr);
  auto optional = Audit::Open({.path = path_ + ".1"}, nullptr);
  auto none = Audit::Open({.required = true}, nullptr);
  ASSERT_TRUE(required.ok() && optional.ok() && none.ok());
  EXPECT_TRUE((*required)->MayAct().ok());
  {
    const SmallFiles full(0);
    for (Audit* audit : {required->get(), optional->get(), none->get()}) {
      audit->Record("a", "", "First", "", absl::OkStatus());
    }
    const absl::Status may = (*required)->MayAct();
    EXPECT_TRUE(absl::IsUnavailable(may)) << may;
    EXPECT_THAT(std::string(may.message()), HasSubstr("File too large"));
    EXPECT_THAT(std::string(may.message()), HasSubstr("log.audit_required"));
    EXPECT_TRUE((*optional)->MayAct().ok());
    EXPECT_TRUE((*none)->MayAct().ok());
  }
  EXPECT_TRUE((*required)->MayAct().ok()) << "it is retried at once";
  EXPECT_EQ(Lines(path_).size(), 1u);
}

TEST_F(AuditTest, ALineThatIsCutSpoilsNoOther) {
  auto audit = Audit::Open({.path = path_}, &log_);
  ASSERT_TRUE(audit.ok());
  const auto record = [&](const char* method) {
    (*audit)->Record("a", "", method, "", absl::OkStatus());
  };
  {
    const SmallFiles full(10);
    record("Cut");
    EXPECT_THAT(Logged(), HasSubstr("the disk is full"));
    record("Waits");
    EXPECT_EQ(std::filesystem::file_size(path_), 10u);
  }
  record("Second");
  record("Third");
  std::ifstream file(path_);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(lines[0].size(), 10u);
  EXPECT_EQ(json::parse(lines[1])["method"], "Cut");
  EXPECT_EQ(json::parse(lines[2])["method"], "Waits");
  EXPECT_EQ(json::parse(lines[3])["method"], "Second");
  EXPECT_EQ(json::parse(lines[4])["method"], "Third");
  {
    const SmallFiles full(std::filesystem::file_size(path_) + 10);
    record("Cut");
  }
  std::filesystem::rename(path_, path_ + ".1");
  (*audit)->Reopen();
  record("Fourth");
  ASSERT_EQ(Lines(path_).size(), 2u) << "a new file begins with the waiting line";
}

TEST_F(AuditTest, ALineThatWasCutBeforeTheFileWasOpenedSpoilsNoOther) {
  const auto cut = [](Audit& audit, const std::string& path) {
    const SmallFiles full(std::filesystem::exists(path) ? std::filesystem::file_size(path) + 10
                                                        : 10);
    audit.Record("a", "", "Cut", "", absl::OkStatus());
  };
  const auto last = [this] {
    std::ifstream file(path_);
    std::string line, found;
    while (std::getline(file, line)) found = line;
    return json::parse(found);
  };
  auto audit = Audit::Open({.path = path_}, nullptr);
  ASSERT_TRUE(audit.ok());
  cut(**audit, path_);
  (*audit)->Reopen();
  (*audit)->Record("a", "", "Second", "", absl::OkStatus());
  EXPECT_EQ(last()["method"], "Second");
  cut(**audit, path_);
  audit = Audit::Open({.path = path_}, nullptr);
  ASSERT_TRUE(audit.ok());
  (*audit)->Record("a", "", "Third", "", absl::OkStatus());
  EXPECT_EQ(last()["method"], "Third");
}

TEST_F(AuditTest, WithoutALogItGoesOnAllTheSame) {
  auto full = Audit::Open({.path = "/dev/full"}, nullptr);
  ASSERT_TRUE(full.ok()) << full.status();
  (*full)->Record("a", "", "First", "", absl::OkStatus());
  auto audit = Audit::Open({.path = path_}, nullptr);
  ASSERT_TRUE(audit.ok());
  std::filesystem::rename(path_, path_ + ".1");
  std::filesystem::create_symlink("/tmp/elsewhere", path_);
  (*audit)->Reopen();
  (*audit)->Record("a", "", "First", "", absl::OkStatus());
  EXPECT_EQ(Lines(path_ + ".1").size(), 1u);
}

TEST_F(AuditTest, WhatCannotBeOpenedAnewStaysWhereItWas) {
  auto audit = Audit::Open({.path = path_}, &log_);
  ASSERT_TRUE(audit.ok());
  std::filesystem::rename(path_, path_ + ".1");
  std::filesystem::create_directory(path_);
  (*audit)->Reopen();
  const std::string told = Logged();
  EXPECT_THAT(told, HasSubstr("the audit log stays where it was"));
  EXPECT_THAT(told, HasSubstr(path_));
  (*audit)->Record("a", "", "First", "", absl::OkStatus());
  EXPECT_EQ(Lines(path_ + ".1").size(), 1u);
}

TEST_F(AuditTest, AFileThatCannotBeIsAnErrorAtOnce) {
  EXPECT_FALSE(Audit::Open({.path = "/nonexistent/audit"}, nullptr).ok());
  std::filesystem::create_symlink("/tmp/elsewhere", path_);
  EXPECT_FALSE(Audit::Open({.path = path_}, nullptr).ok());
}

}  // namespace
}  // namespace voxeld::daemon::access
