// Reports of a conformance run for people, programs and build servers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "display/conformance/runner.h"
#include "display/conformance/suite.h"

namespace voxeld::voxelctl {

struct DeviceReport {
  std::string name, protocol, page;
  display::conformance::RunResult run;  // its cases belong to a suite that outlives it
};

struct VerifyReport {
  std::string display, driver;
  uint64_t seed = 0;
  std::vector<DeviceReport> devices;
  size_t Count(display::conformance::Verdict::Kind kind) const;
};

// Returns the result of one case: a line, and what was wrong on separate lines.
std::string CaseText(const display::conformance::CaseResult& result, const std::string& page);
// Returns "79 cases: 75 passed, 1 failed, 3 not applicable".
std::string SummaryText(const VerifyReport& report);

nlohmann::ordered_json ReportJson(const VerifyReport& report);

// Returns XML that Jenkins, GitLab and GitHub's actions read: a suite per device, a test per case.
// Cases that are not applicable are skipped.
std::string JunitXml(const VerifyReport& report);

}  // namespace voxeld::voxelctl
