// What an overload looks like over time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"

namespace voxeld::bench {

struct OverloadSample {
  double time_s = 0;
  // By the clients, since the beginning.
  uint64_t frames_due = 0, commits_sent = 0, frames_dropped = 0;
  // By the daemon, of the one display.
  uint64_t owed = 0, presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0,
           pending = 0;
  // Of the commits that were presented since the sample before: from the first byte sent until they
  // were shown, in volumes. Without any: none.
  std::vector<double> latency_volumes;
  uint64_t resident_bytes = 0, held_bytes = 0;  // of the daemon; that it accounts for

  bool Exact() const {
    return owed == presented + unchanged + superseded + lost + not_shown + pending;
  }
};

// The display's figures and the memory's into a sample.
void TakeStats(const v1::Stats& stats, OverloadSample& sample);

// One row each, with a head; a latency that there is not is empty.
std::string CsvOf(const std::vector<OverloadSample>& samples);

// Latency (median and greatest of each sample) and memory over time.
std::string PlotOf(const std::string& title, const std::vector<OverloadSample>& samples);

// All latencies of the samples [begin, end).
std::vector<double> LatenciesOf(const std::vector<OverloadSample>& samples, size_t begin,
                                size_t end);

}  // namespace voxeld::bench
