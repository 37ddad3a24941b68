// The course of an overload over time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"

namespace voxeld::bench {

struct OverloadSample {
  double time_s = 0;
  // Counted by the clients since the beginning.
  uint64_t frames_due = 0, commits_sent = 0, frames_dropped = 0;
  // Counted by the daemon for the one display.
  uint64_t owed = 0, presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0,
           pending = 0;
  // Latencies of the commits that were presented since the previous sample: from the first byte
  // sent until they were shown, in volumes. Empty if there were none.
  std::vector<double> latency_volumes;
  uint64_t resident_bytes = 0, held_bytes = 0;  // the daemon's, and the part it accounts for

  bool Exact() const {
    return owed == presented + unchanged + superseded + lost + not_shown + pending;
  }
};

// Copies the statistics of the display and of the memory into a sample.
void TakeStats(const v1::Stats& stats, OverloadSample& sample);

// Returns a header and one row per sample; a missing latency is empty.
std::string CsvOf(const std::vector<OverloadSample>& samples);

// Plots latency (median and greatest of each sample) and memory over time.
std::string PlotOf(const std::string& title, const std::vector<OverloadSample>& samples);

// Returns all latencies of the samples [begin, end).
std::vector<double> LatenciesOf(const std::vector<OverloadSample>& samples, size_t begin,
                                size_t end);

}  // namespace voxeld::bench
