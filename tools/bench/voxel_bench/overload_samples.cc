#include "tools/bench/voxel_bench/overload_samples.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/statistics.h"
#include "tools/bench/voxel_bench/svg_plot.h"

namespace voxeld::bench {

void TakeStats(const v1::Stats& stats, OverloadSample& sample) {
  const v1::MemoryUse& memory = stats.memory();
  sample.held_bytes = memory.scene_bytes() + memory.staged_bytes() + memory.waiting_bytes() +
                      memory.answers_bytes() + memory.owed_bytes() + memory.engine_bytes() +
                      memory.local_bytes() + memory.arriving_bytes();
  if (stats.displays().empty()) return;
  const v1::DisplayStats& display = stats.displays(0);
  sample.owed = display.commits_owed();
  sample.presented = display.commits_presented();
  sample.unchanged = display.commits_unchanged();
  sample.superseded = display.commits_superseded();
  sample.lost = display.commits_lost();
  sample.not_shown = display.commits_not_shown();
  sample.pending = display.commits_pending();
}

std::string CsvOf(const std::vector<OverloadSample>& samples) {
  std::string out =
      "time_s,frames_due,commits_sent,frames_dropped,owed,presented,unchanged,superseded,lost,"
      "not_shown,pending,exact,latency_median_volumes,latency_max_volumes,resident_bytes,"
      "held_bytes\n";
  for (const OverloadSample& sample : samples) {
    absl::StrAppendFormat(&out, "%.3f,%d,%d,%d,%d,%d,%d,%d,%d,%d,%d,%d,", sample.time_s,
                          sample.frames_due, sample.commits_sent, sample.frames_dropped,
                          sample.owed, sample.presented, sample.unchanged, sample.superseded,
                          sample.lost, sample.not_shown, sample.pending, sample.Exact() ? 1 : 0);
    if (sample.latency_volumes.empty()) {
      out += ",,";
    } else {
      const Spread latency = SpreadOf(sample.latency_volumes);
      absl::StrAppendFormat(&out, "%.3f,%.3f,", latency.median, latency.greatest);
    }
    absl::StrAppendFormat(&out, "%d,%d\n", sample.resident_bytes, sample.held_bytes);
  }
  return out;
}

std::string PlotOf(const std::string& title, const std::vector<OverloadSample>& samples) {
  Series median{"median of 100 ms", {}}, greatest{"greatest", {}}, resident{"resident", {}};
  for (const OverloadSample& sample : samples) {
    resident.points.emplace_back(sample.time_s, static_cast<double>(sample.resident_bytes) / 1e6);
    if (sample.latency_volumes.empty()) continue;
    const Spread latency = SpreadOf(sample.latency_volumes);
    median.points.emplace_back(sample.time_s, latency.median);
    greatest.points.emplace_back(sample.time_s, latency.greatest);
  }
  return SvgOf(title, "seconds",
               {{"latency of presented commits, volumes", {median, greatest}},
                {"memory of the daemon, MB", {resident}}});
}

std::vector<double> LatenciesOf(const std::vector<OverloadSample>& samples, size_t begin,
                                size_t end) {
  std::vector<double> out;
  for (size_t i = begin; i < std::min(end, samples.size()); ++i) {
    const std::vector<double>& latency = samples[i].latency_volumes;
    out.insert(out.end(), latency.begin(), latency.end());
  }
  return out;
}

}  // namespace voxeld::bench
