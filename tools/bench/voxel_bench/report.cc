#include "tools/bench/voxel_bench/report.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "tools/child/child_process.h"

namespace voxeld::bench {
namespace {

nlohmann::json MachineFacts() {
  std::ifstream file("/proc/cpuinfo");
  std::ostringstream cpuinfo;
  cpuinfo << file.rdbuf();
  utsname system{};
  uname(&system);
  double load = 0;
  getloadavg(&load, 1);
  return {{"cpu", CpuModelIn(cpuinfo.str())},
          {"cores", std::thread::hardware_concurrency()},
          {"kernel", std::string(system.release)},
          {"load_before", load}};
}

// Returns the commit of the tree that contains this program, with "-dirty" if the tree has changed
// since; null if git is missing or knows no commit.
nlohmann::json Commit() {
  std::error_code error;
  const std::string folder =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path().string();
  const char* git = "/usr/bin/git";
  if (error || access(git, X_OK) != 0) return nullptr;
  auto child = child::ChildProcess::Start(
      {git, "-C", folder, "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"},
      {.errors = child::Errors::kApart});
  if (!child.ok() || (*child)->Wait() != 0) return nullptr;
  return std::string(absl::StripAsciiWhitespace((*child)->output()));
}

}  // namespace

std::string CpuModelIn(const std::string& cpuinfo) {
  for (absl::string_view line : absl::StrSplit(cpuinfo, '\n')) {
    if (!absl::ConsumePrefix(&line, "model name")) continue;
    line = absl::StripAsciiWhitespace(line);
    absl::ConsumePrefix(&line, ":");
    return std::string(absl::StripAsciiWhitespace(line));
  }
  return "unknown";
}

nlohmann::json ReportOf(const std::string& benchmark, nlohmann::json options) {
  return {{"benchmark", benchmark},
          {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%SZ", absl::Now(), absl::UTCTimeZone())},
          {"machine", MachineFacts()},
          {"build", {{"type", VOXELD_BUILD_TYPE}, {"compiler", __VERSION__}, {"commit", Commit()}}},
          {"options", std::move(options)},
          {"figures", nlohmann::json::array()}};
}

void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               const Spread& spread) {
  report["figures"].push_back({{"name", name},
                               {"unit", unit},
                               {"median", spread.median},
                               {"min", spread.least},
                               {"max", spread.greatest},
                               {"values", spread.values}});
}

void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               double value) {
  AddFigure(report, name, unit, SpreadOf({value}));
}

nlohmann::json ToJson(const Tally& tally) {
  return {{"sent", tally.sent},           {"accepted", tally.accepted},
          {"refused", tally.refused},     {"refused_operations", tally.refused_operations},
          {"issues", tally.issues},       {"dropped_frames", tally.dropped_frames},
          {"owed", tally.owed},           {"presented", tally.presented},
          {"unchanged", tally.unchanged}, {"superseded", tally.superseded},
          {"lost", tally.lost},           {"not_shown", tally.not_shown},
          {"pending", tally.pending()},   {"exact", tally.Settled() && tally.Sound()}};
}

std::string TextOf(const nlohmann::json& report) {
  std::string out = report.value("text", "");
  for (const nlohmann::json& figure : report["figures"]) {
    absl::StrAppendFormat(&out, "%-44s %12.5g %s", std::string(figure["name"]),
                          double(figure["median"]), std::string(figure["unit"]));
    if (figure["values"].size() > 1) {
      absl::StrAppendFormat(&out, "  (%.5g to %.5g, %d)", double(figure["min"]),
                            double(figure["max"]), figure["values"].size());
    }
    out += "\n";
  }
  return out;
}

}  // namespace voxeld::bench
