#include "tools/bench/samples.h"

#include <algorithm>
#include <cstdio>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace voxeld::bench {
namespace {

// Returns the median of the sorted times [begin, end).
int64_t Middle(const std::vector<int64_t>& times, size_t begin, size_t end) {
  const size_t last = begin + end - 1;
  return (times[last / 2] + times[last - last / 2]) / 2;
}

std::string Milliseconds(int64_t ns) {
  return absl::StrFormat("%.3g", static_cast<double>(ns) / 1e6);
}

}  // namespace

Quartiles QuartilesOf(std::vector<int64_t> times_ns) {
  std::sort(times_ns.begin(), times_ns.end());
  const size_t count = times_ns.size(), half = (count + 1) / 2;
  return {Middle(times_ns, 0, half), Middle(times_ns, 0, count),
          Middle(times_ns, count - half, count)};
}

std::optional<double> RatioOf(const Row& row, const std::vector<Row>& rows) {
  if (row.baseline == row.engine) return std::nullopt;
  for (const Row& other : rows) {
    if (other.engine != row.baseline || other.scene != row.scene) continue;
    return static_cast<double>(QuartilesOf(row.times_ns).median_ns) /
           static_cast<double>(QuartilesOf(other.times_ns).median_ns);
  }
  return std::nullopt;
}

std::string TableOf(const std::vector<Row>& rows) {
  std::string table = "| frame | engine | median ms | quartiles ms | times its baseline |\n";
  table += "|---|---|---|---|---|\n";
  for (const Row& row : rows) {
    const Quartiles q = QuartilesOf(row.times_ns);
    const std::optional<double> ratio = RatioOf(row, rows);
    absl::StrAppend(&table, "| ", row.scene, " | ", row.engine, " | ", Milliseconds(q.median_ns),
                    " | ", Milliseconds(q.low_ns), " to ", Milliseconds(q.high_ns), " | ",
                    ratio ? absl::StrFormat("%.2f of %s", *ratio, row.baseline) : "–", " |\n");
  }
  return table;
}

std::string JsonOf(const std::vector<Row>& rows) {
  std::vector<std::string> objects;
  for (const Row& row : rows) {
    const Quartiles q = QuartilesOf(row.times_ns);
    const std::optional<double> ratio = RatioOf(row, rows);
    objects.push_back(absl::StrFormat(
        R"( {"scene": "%s", "engine": "%s", "baseline": "%s", "low_ns": %d, "median_ns": %d, )"
        R"("high_ns": %d, "ratio": %s, "times_ns": [%s]})",
        row.scene, row.engine, row.baseline, q.low_ns, q.median_ns, q.high_ns,
        ratio ? absl::StrFormat("%.4f", *ratio) : "null", absl::StrJoin(row.times_ns, ", ")));
  }
  return absl::StrCat("[\n", absl::StrJoin(objects, ",\n"), "\n]\n");
}

std::vector<std::string> SplitList(const std::string& list) {
  return absl::StrSplit(list, ',', absl::SkipEmpty());
}

}  // namespace voxeld::bench
