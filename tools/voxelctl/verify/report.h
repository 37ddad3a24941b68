// What a conformance run found, for people, programs and build servers.
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
  display::conformance::RunResult run;  // its cases belong to a suite that lives on
};

struct VerifyReport {
  std::string display, driver;
  uint64_t seed = 0;
  std::vector<DeviceReport> devices;
  size_t Count(display::conformance::Verdict::Kind kind) const;
};

// One case as it ended: a line, and what was wrong in lines of their own.
std::string CaseText(const display::conformance::CaseResult& result, const std::string& page);
// "79 cases: 75 passed, 1 failed, 3 not applicable".
std::string SummaryText(const VerifyReport& report);

nlohmann::ordered_json ReportJson(const VerifyReport& report);

// As Jenkins, GitLab and GitHub's actions read it: a suite a device, a test a case. What was not
// applicable is skipped.
std::string JunitXml(const VerifyReport& report);

}  // namespace voxeld::voxelctl
