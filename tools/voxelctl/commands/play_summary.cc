#include "tools/voxelctl/commands/play_summary.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

uint64_t EntitiesOf(const PlaySummary& summary) {
  uint64_t entities = 0;
  for (const PlayedFile& file : summary.files) entities += file.entities;
  return entities;
}

using nlohmann::ordered_json;

struct Quantiles {
  uint64_t count = 0;
  int64_t p50_ns = 0, p99_ns = 0, max_ns = 0;
};

Quantiles Measure(std::vector<int64_t> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  // The nearest-rank percentile: the smallest value that at least that share of the values do not
  // exceed.
  const auto rank = [&](size_t percent) {
    return values[(values.size() * percent + 99) / 100 - 1];
  };
  return {values.size(), rank(50), rank(99), values.back()};
}

ordered_json Json(const PlaySummary& s, const Quantiles& latency) {
  ordered_json files = ordered_json::array(), displays = ordered_json::array(),
               issues = ordered_json::array();
  for (const PlayedFile& f : s.files) {
    ordered_json left_out = ordered_json::array();
    for (const LeftOut& one : f.left_out)
      left_out.push_back({{"kind", one.kind}, {"count", one.count}});
    files.push_back({{"path", f.path},
                     {"format", f.format},
                     {"note", f.note},
                     {"left_out", left_out},
                     {"vertices", f.vertices},
                     {"indices", f.indices},
                     {"samples", f.samples},
                     {"objects", f.objects},
                     {"bytes", f.bytes}});
  }
  for (const auto& [name, counts] : s.tally.displays) {
    displays.push_back({{"display", name},
                        {"presented", counts.presented},
                        {"unchanged", counts.unchanged},
                        {"superseded", counts.superseded},
                        {"lost", counts.lost},
                        {"not_shown", counts.not_shown}});
  }
  for (const client::Issue& issue : s.tally.issues) {
    issues.push_back({{"sequence", issue.sequence},
                      {"layer", issue.layer},
                      {"id", issue.id},
                      {"field", issue.field},
                      {"reason", client::ReasonName(issue.reason)},
                      {"message", issue.message},
                      {"applied", issue.applied}});
  }
  const ordered_json legend = s.legend ? ordered_json{{"attribute", s.legend->attribute},
                                                      {"colormap", s.legend->colormap},
                                                      {"low", s.legend->low},
                                                      {"high", s.legend->high},
                                                      {"without", s.legend->without}}
                                       : ordered_json(nullptr);
  return {{"layer", s.layer},
          {"owner", s.owner},
          {"entities", EntitiesOf(s)},
          {"files", files},
          {"legend", legend},
          {"duration_ns", s.duration_ns},
          {"frames", s.frames},
          {"frames_skipped", s.frames_skipped},
          {"still_up", s.still_up},
          {"commits", s.tally.commits},
          {"accepted", s.tally.accepted},
          {"refused", s.tally.refused},
          {"refused_operations", s.tally.refused_operations},
          {"unanswered", s.tally.unsettled + s.tally.lost},
          {"displays", displays},
          {"latency",
           {{"count", latency.count},
            {"p50_ns", latency.p50_ns},
            {"p99_ns", latency.p99_ns},
            {"max_ns", latency.max_ns}}},
          {"issue_count", s.tally.issue_count},
          {"issues", issues}};
}

}  // namespace

void Report(PlaySummary summary, Console& console) {
  const Quantiles latency = Measure(std::move(summary.latencies_ns));
  if (console.json()) {
    console.Data(JsonText(Json(summary, latency), false));
    return;
  }
  uint64_t vertices = 0, samples = 0, bytes = 0;
  for (const PlayedFile& file : summary.files) {
    vertices += file.vertices;
    samples += file.samples;
    bytes += file.bytes;
  }
  std::string line =
      absl::StrCat(Counted(EntitiesOf(summary), "entity", "entities"), ", ",
                   samples > 0 && vertices == 0 ? Counted(samples, "sample")
                                                : Counted(vertices, "vertex", "vertices"),
                   ", ", Bytes(bytes));
  if (summary.frames > 0) {
    absl::StrAppendFormat(&line, "; %s in %s", Counted(summary.frames, "frame"),
                          Duration(summary.duration_ns));
    if (summary.frames_skipped > 0)
      absl::StrAppend(&line, " (", Grouped(summary.frames_skipped),
                      " left out while a display was behind)");
  }
  for (const auto& [name, counts] : summary.tally.displays) {
    absl::StrAppend(&line, "; ", EscapeForTerminal(name), ": ", Grouped(counts.presented),
                    " presented, ", Grouped(counts.superseded), " superseded, ",
                    Grouped(counts.lost), " lost");
    if (counts.unchanged > 0) absl::StrAppend(&line, ", ", Grouped(counts.unchanged), " unchanged");
    if (counts.not_shown > 0) absl::StrAppend(&line, ", ", Grouped(counts.not_shown), " not shown");
  }
  if (latency.count > 0)
    absl::StrAppend(&line, "; latency p50 ", Duration(latency.p50_ns), ", p99 ",
                    Duration(latency.p99_ns));
  console.Say(line);
  for (const auto& [name, counts] : summary.tally.displays) {
    if (!counts.last_lost_reason.empty()) {
      console.Say(absl::StrCat(EscapeForTerminal(name),
                               " lost a volume: ", EscapeForTerminal(counts.last_lost_reason)));
    }
  }
  for (const client::Issue& issue : summary.tally.issues)
    console.Say(absl::StrCat(issue.applied ? "note: " : "issue: ", IssueForTerminal(issue)));
  if (summary.still_up) {
    const size_t files = summary.files.size();  // several files are referred to by number
    console.Say(absl::StrCat("it stays up in the layer ", summary.layer, ", called \"play 1\"",
                             files > 1 ? absl::StrCat(" to \"play ", files, "\"") : "",
                             ", until `voxelctl clear`"));
  }
}

}  // namespace voxeld::voxelctl
