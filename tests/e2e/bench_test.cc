// Tests the real voxel-bench with the real voxeld: that each benchmark reports what it promises and
// that the sums are right, but never how fast.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_split.h"
#include "tests/programs.h"
#include "tools/child/child_process.h"

namespace voxeld::e2e {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::StartsWith;

// Runs it and returns its output, which must be only JSON, with a valid head and plausible numbers.
nlohmann::json RunBench(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), ProgramBeside("voxel-bench"));
  arguments.emplace_back("--json");
  const auto child = child::ChildProcess::Start(
      arguments, {.errors = child::Errors::kApart, .patience = std::chrono::seconds(200)});
  if (!child.ok()) {
    ADD_FAILURE() << child.status();
    return {};
  }
  EXPECT_EQ((*child)->Wait(), 0) << (*child)->errors();
  nlohmann::json report = nlohmann::json::parse((*child)->output(), nullptr, false);
  if (!report.is_object()) {
    ADD_FAILURE() << (*child)->output();
    return {};
  }
  EXPECT_EQ(report["benchmark"], arguments[1]);
  EXPECT_GE(report["machine"]["cores"], 1);
  EXPECT_TRUE(report["machine"]["cpu"].is_string());
  EXPECT_TRUE(report["build"]["type"].is_string());
  for (const nlohmann::json& figure : report["figures"]) {
    EXPECT_LE(figure["min"], figure["median"]) << figure;
    EXPECT_LE(figure["median"], figure["max"]) << figure;
  }
  return report;
}

std::vector<std::string> NamesOf(const nlohmann::json& report) {
  std::vector<std::string> names;
  for (const nlohmann::json& figure : report["figures"]) names.push_back(figure["name"]);
  return names;
}

const nlohmann::json& Figure(const nlohmann::json& report, const std::string& name) {
  for (const nlohmann::json& figure : report["figures"]) {
    if (figure["name"] == name) return figure;
  }
  static const nlohmann::json none;
  ADD_FAILURE() << "no metric " << name << " in " << report;
  return none;
}

void ExpectExact(const nlohmann::json& commits) {
  EXPECT_EQ(commits["exact"], true) << commits;
  EXPECT_GT(commits["sent"], 0) << commits;
  EXPECT_EQ(commits["accepted"], commits["sent"]) << commits;
  const auto count = [&](const char* name) { return commits[name].get<uint64_t>(); };
  EXPECT_EQ(count("owed"), count("presented") + count("unchanged") + count("superseded") +
                               count("lost") + count("not_shown"))
      << commits;
}

TEST(Bench, IngestComparesEveryCaseWithTheSink) {
  const nlohmann::json report = RunBench({"ingest", "--rounds", "2", "--seconds", "0.1", "--batch",
                                          "2", "--display", "size=16x16x8,rate=60"});
  for (const char* name : {"batch_unix", "batch_tcp", "batch_unix_display", "upsert_unix"}) {
    const nlohmann::json& ratio = Figure(report, std::string(name) + ".ratio");
    const nlohmann::json& daemon = Figure(report, std::string(name) + ".daemon");
    const nlohmann::json& sink = Figure(report, std::string(name) + ".sink");
    ASSERT_EQ(ratio["values"].size(), 2u) << name;
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_GT(daemon["values"][i], 0);
      EXPECT_NEAR(ratio["values"][i],
                  daemon["values"][i].get<double>() / sink["values"][i].get<double>(), 1e-9);
    }
  }
  // Over TLS and recorded: compared with a daemon without these.
  for (const std::string name : {"batch_tls", "batch_unix_recorded"}) {
    const nlohmann::json& daemon = Figure(report, name + ".daemon");
    const nlohmann::json& without = Figure(report, name + ".without");
    for (size_t i = 0; i < 2; ++i) {
      EXPECT_GT(without["values"][i], 0);
      EXPECT_NEAR(Figure(report, name + ".ratio")["values"][i],
                  daemon["values"][i].get<double>() / without["values"][i].get<double>(), 1e-9);
    }
  }
  EXPECT_GT(report["recorded"]["batch_unix_recorded"]["change_sets"], 0);
  // Two entities of 4096 lines of 28 bytes, and their heads.
  EXPECT_GT(report["message_bytes"]["batch_unix"], 2 * 4096 * 28);
  EXPECT_LT(report["message_bytes"]["batch_unix"], 2 * 4096 * 28 + 1000);
}

TEST(Bench, LatencyIsOfWhatWasPresented) {
  const nlohmann::json report =
      RunBench({"latency", "--rounds", "2", "--seconds", "0.4", "--lines", "50", "--rate", "50",
                "--display", "size=16x16x8,rate=100"});
  ExpectExact(report["commits"]);
  // Two rounds of 0.4 s at 50 a second; the warm-up does not count.
  EXPECT_EQ(report["commits"]["sent"], 40);
  EXPECT_GT(Figure(report, "commit_to_last_byte.p50")["median"], 0);
  EXPECT_LE(Figure(report, "commit_to_last_byte.p50")["median"],
            Figure(report, "commit_to_last_byte.p99")["median"]);
  const nlohmann::json& presented = Figure(report, "presented");
  EXPECT_GT(presented["median"], 0);
  EXPECT_LE(presented["max"], 1);
}

TEST(Bench, FairnessSaysWhatEachGot) {
  const nlohmann::json report =
      RunBench({"fairness", "--rounds", "2", "--seconds", "0.5", "--clients", "10", "--layers", "3",
                "--display", "size=16x16x8,rate=60"});
  ExpectExact(report["commits"]);
  ASSERT_EQ(report["clients_commits_per_s"].size(), 2u);
  double sum = 0;
  for (const nlohmann::json& rate : report["clients_commits_per_s"][1]) sum += rate.get<double>();
  EXPECT_EQ(report["clients_commits_per_s"][1].size(), 10u);
  EXPECT_NEAR(sum, Figure(report, "commits")["values"][1], 1e-6 * sum);
  EXPECT_GT(Figure(report, "jain_index")["median"], 0.1 - 1e-9);
  EXPECT_LE(Figure(report, "jain_index")["median"], 1 + 1e-9);
  EXPECT_LE(Figure(report, "slowest_of_mean")["max"], 1);
}

TEST(Bench, BesideMeasuresAloneAndBesideAnUpload) {
  const nlohmann::json report =
      RunBench({"beside", "--rounds", "1", "--seconds", "1", "--rate", "10", "--entities", "20000",
                "--display", "size=16x16x8"});
  ExpectExact(report["commits"]);
  EXPECT_EQ(report["commits"]["sent"], 20);
  EXPECT_GT(report["uploads"], 0);
  for (const char* name : {"alone.accepted.p99", "beside.accepted.p99", "alone.lit.p99"}) {
    EXPECT_GT(Figure(report, name)["median"], 0) << name;
  }
}

TEST(Bench, OverloadCountsEveryFrameAndEveryOutcome) {
  const absl::StatusOr<child::TemporaryFolder> folder = child::TemporaryFolder::Make("voxeld-e2e");
  ASSERT_TRUE(folder.ok()) << folder.status();
  const std::string csv = folder->path() + "/samples.csv", svg = folder->path() + "/plot.svg";
  const nlohmann::json report =
      RunBench({"overload", "--seconds", "1.5", "--lines", "50", "--clients", "2", "--display",
                "size=16x16x8", "--csv", csv, "--svg", svg});
  ExpectExact(report["commits"]);
  EXPECT_EQ(report["daemon_agrees"], true);
  EXPECT_GT(report["samples"], 0);
  EXPECT_EQ(report["samples_exact"], report["samples"]);
  // 1.5 s of ten times 60 volumes a second; each was sent or dropped.
  EXPECT_EQ(report["frames_due"], 900);
  EXPECT_EQ(report["frames_dropped"].get<int>() + report["commits"]["sent"].get<int>(), 900);
  std::ifstream file(csv);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  EXPECT_THAT(text, StartsWith("time_s,"));
  const std::vector<std::string> rows = absl::StrSplit(text, '\n', absl::SkipEmpty());
  EXPECT_EQ(rows.size(), report["samples"].get<size_t>() + 1);
  std::ifstream plot(svg);
  EXPECT_THAT(std::string(std::istreambuf_iterator<char>(plot), {}), StartsWith("<svg "));
}

TEST(Bench, IdleHoldsItsStreamsAndTheNormalClientGoesOn) {
  const nlohmann::json report = RunBench({"idle", "--streams", "60", "--rounds", "1", "--seconds",
                                          "0.5", "--display", "size=16x16x8,rate=100"});
  ExpectExact(report["commits"]);
  // On shared connections, and on their own beside the normal client.
  EXPECT_EQ(report["sessions"], (std::vector<int>{60, 61}));
  const std::vector<std::string> names = NamesOf(report);
  for (const char* name :
       {"resident_per_stream.shared_connections", "resident_per_stream.own_connections",
        "normal.p99.alone", "normal.p99.beside_slow_readers", "normal.p99.beside_idle_streams"}) {
    EXPECT_THAT(names, Contains(name));
  }
}

TEST(Bench, WithoutADaemonItSaysSo) {
  const auto child = child::ChildProcess::Start(
      {ProgramBeside("voxel-bench"), "latency", "--daemon", "/nowhere/voxeld", "--json"},
      {.errors = child::Errors::kApart});
  ASSERT_TRUE(child.ok()) << child.status();
  EXPECT_EQ((*child)->Wait(), 1);
  EXPECT_EQ((*child)->output(), "");
  EXPECT_THAT((*child)->errors(), HasSubstr("/nowhere/voxeld"));
}

}  // namespace
}  // namespace voxeld::e2e
