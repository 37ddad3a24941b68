#include "tools/voxelctl/verify/report.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "common/text/printable.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

using display::conformance::CaseResult;
using display::conformance::RunResult;
using display::conformance::Verdict;
using display::conformance::VerdictName;
using VerdictKind = Verdict::Kind;

std::string SectionOf(const CaseResult& result) {
  return result.verdict.section.empty() ? result.what->section : result.verdict.section;
}

// Names and messages come from devices, so they are escaped and cannot break the document.
std::string Xml(const std::string& text) {
  return absl::StrReplaceAll(
      EscapeForTerminal(text),
      {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&apos;"}});
}

std::string Seconds(sync::TimeNs duration) {
  return absl::StrFormat("%.6f", static_cast<double>(duration) / sync::kSecond);
}

sync::TimeNs Took(const RunResult& run) {
  sync::TimeNs sum = 0;
  for (const CaseResult& result : run.results) sum += result.duration;
  return sum;
}

std::string Counts(size_t tests, size_t failures, size_t skipped, sync::TimeNs time) {
  return absl::StrFormat(R"(tests="%d" failures="%d" errors="0" skipped="%d" time="%s")", tests,
                         failures, skipped, Seconds(time));
}

nlohmann::ordered_json CaseJson(const CaseResult& result) {
  nlohmann::ordered_json json = {{"id", result.what->id},
                                 {"title", result.what->title},
                                 {"section", SectionOf(result)},
                                 {"result", VerdictName(result.verdict.kind)},
                                 {"duration_ns", result.duration}};
  if (result.verdict.kind == VerdictKind::kFailed) {
    json["expected"] = result.verdict.expected;
    json["seen"] = result.verdict.seen;
  }
  if (result.verdict.kind == VerdictKind::kNotApplicable) json["reason"] = result.verdict.reason;
  return json;
}

std::string CaseXml(const CaseResult& result, const DeviceReport& device,
                    const std::string& driver) {
  std::string xml = absl::StrFormat("    <testcase classname=\"%s\" name=\"%s\" time=\"%s\"",
                                    absl::StrCat("verify.", Xml(driver)), Xml(result.what->id),
                                    Seconds(result.duration));
  const Verdict& verdict = result.verdict;
  if (verdict.kind == VerdictKind::kFailed) {
    absl::StrAppend(&xml, ">\n      <failure message=\"expected ", Xml(verdict.expected), "; seen ",
                    Xml(verdict.seen), "\" type=\"conformance\">", Xml(result.what->title),
                    "\nexpected: ", Xml(verdict.expected), "\nseen: ", Xml(verdict.seen),
                    "\nsee: ", Xml(device.page), " §", Xml(SectionOf(result)),
                    "</failure>\n    </testcase>\n");
  } else if (verdict.kind == VerdictKind::kNotApplicable) {
    absl::StrAppend(&xml, ">\n      <skipped message=\"", Xml(verdict.reason),
                    "\"/>\n    </testcase>\n");
  } else {
    absl::StrAppend(&xml, "/>\n");
  }
  return xml;
}

}  // namespace

size_t VerifyReport::Count(VerdictKind kind) const {
  size_t count = 0;
  for (const DeviceReport& device : devices) count += device.run.Count(kind);
  return count;
}

std::string CaseText(const CaseResult& result, const std::string& page) {
  const Verdict& verdict = result.verdict;
  std::string text =
      absl::StrFormat("%-14s  %-28s  §%-4s %10s  %s\n", VerdictName(verdict.kind), result.what->id,
                      result.what->section, Duration(result.duration), result.what->title);
  if (verdict.kind == VerdictKind::kFailed) {
    absl::StrAppend(&text, "    expected: ", EscapeForTerminal(verdict.expected),
                    "\n    seen:     ", EscapeForTerminal(verdict.seen), "\n    see:      ", page,
                    " §", SectionOf(result), "\n");
  }
  if (verdict.kind == VerdictKind::kNotApplicable) {
    absl::StrAppend(&text, "    because:  ", EscapeForTerminal(verdict.reason), "\n");
  }
  return text;
}

std::string SummaryText(const VerifyReport& report) {
  size_t cases = 0;
  sync::TimeNs took = 0;
  for (const DeviceReport& device : report.devices) {
    cases += device.run.results.size();
    took += Took(device.run);
  }
  return absl::StrFormat("%s in %.1f s: %d passed, %d failed, %d not applicable",
                         Counted(cases, "case"), static_cast<double>(took) / sync::kSecond,
                         report.Count(VerdictKind::kPassed), report.Count(VerdictKind::kFailed),
                         report.Count(VerdictKind::kNotApplicable));
}

nlohmann::ordered_json ReportJson(const VerifyReport& report) {
  nlohmann::ordered_json devices = nlohmann::ordered_json::array();
  for (const DeviceReport& device : report.devices) {
    nlohmann::ordered_json cases = nlohmann::ordered_json::array();
    for (const CaseResult& result : device.run.results) cases.push_back(CaseJson(result));
    devices.push_back({{"name", device.name},
                       {"protocol", device.protocol},
                       {"page", device.page},
                       {"vendor_id", device.run.identity.vendor_id},
                       {"product_id", device.run.identity.product_id},
                       {"bcd_device", device.run.identity.bcd_device},
                       {"serial", device.run.identity.serial},
                       {"path", device.run.identity.path},
                       {"cases", std::move(cases)}});
  }
  return {{"display", report.display},
          {"driver", report.driver},
          {"seed", report.seed},
          {"passed", report.Count(VerdictKind::kPassed)},
          {"failed", report.Count(VerdictKind::kFailed)},
          {"not_applicable", report.Count(VerdictKind::kNotApplicable)},
          {"devices", std::move(devices)}};
}

std::string JunitXml(const VerifyReport& report) {
  std::string suites;
  size_t tests = 0;
  sync::TimeNs time = 0;
  for (const DeviceReport& device : report.devices) {
    const RunResult& run = device.run;
    absl::StrAppend(
        &suites, "  <testsuite name=\"", Xml(device.protocol), ": ", Xml(device.name), "\" ",
        Counts(run.results.size(), run.Count(VerdictKind::kFailed),
               run.Count(VerdictKind::kNotApplicable), Took(run)),
        ">\n    <properties>\n      <property name=\"serial\" value=\"", Xml(run.identity.serial),
        "\"/>\n      <property name=\"path\" value=\"", Xml(run.identity.path),
        "\"/>\n      <property name=\"firmware\" value=\"",
        absl::StrFormat("%04x", run.identity.bcd_device),
        "\"/>\n      <property name=\"seed\" value=\"", report.seed, "\"/>\n    </properties>\n");
    for (const CaseResult& result : run.results)
      absl::StrAppend(&suites, CaseXml(result, device, report.driver));
    absl::StrAppend(&suites, "  </testsuite>\n");
    tests += run.results.size();
    time += Took(run);
  }
  return absl::StrCat(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"voxelctl "
      "verify ",
      Xml(report.driver), "\" ",
      Counts(tests, report.Count(VerdictKind::kFailed), report.Count(VerdictKind::kNotApplicable),
             time),
      ">\n", suites, "</testsuites>\n");
}

}  // namespace voxeld::voxelctl
