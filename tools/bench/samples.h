// Repeated measurements of one operation, and a table of several operations.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace voxeld::bench {

// The median and the quartiles of a set of times. Each is a measured time or the mean of two
// neighbours (Tukey's hinges; the median counts in both halves).
struct Quartiles {
  int64_t low_ns = 0, median_ns = 0, high_ns = 0;
};

// Requires: `times_ns` is not empty.
Quartiles QuartilesOf(std::vector<int64_t> times_ns);

struct Row {
  std::string scene, engine;
  std::string baseline;  // the engine to compare with; its own name: none
  std::vector<int64_t> times_ns;
};

// Returns the median of a row divided by the median of its baseline for the same scene; nothing
// without a baseline.
std::optional<double> RatioOf(const Row& row, const std::vector<Row>& rows);

// Returns the rows as a Markdown table, in milliseconds.
std::string TableOf(const std::vector<Row>& rows);
// Returns the rows as a JSON array of objects: scene, engine, baseline, times_ns, low_ns,
// median_ns, high_ns, ratio.
std::string JsonOf(const std::vector<Row>& rows);

// Splits "a,b" into {"a", "b"}; empty parts are left out.
std::vector<std::string> SplitList(const std::string& list);

}  // namespace voxeld::bench
