// Times of one thing done several times, and a table of several such things.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace voxeld::bench {

// Of a set of times: the median and the quartiles, each a time that was measured or the mean of two
// neighbours (Tukey's hinges, the median counted with both halves).
struct Quartiles {
  int64_t low_ns = 0, median_ns = 0, high_ns = 0;
};

// `times_ns` must not be empty.
Quartiles QuartilesOf(std::vector<int64_t> times_ns);

struct Row {
  std::string scene, engine;
  std::string baseline;  // the engine that it is compared with; its own name: none
  std::vector<int64_t> times_ns;
};

// How many times the median of its baseline for the same scene a row's median is; nothing without
// one.
std::optional<double> RatioOf(const Row& row, const std::vector<Row>& rows);

// As Markdown, milliseconds.
std::string TableOf(const std::vector<Row>& rows);
// As a JSON array of objects: scene, engine, baseline, times_ns, low_ns, median_ns, high_ns, ratio.
std::string JsonOf(const std::vector<Row>& rows);

// "a,b" → {"a", "b"}; empty parts are left out.
std::vector<std::string> SplitList(const std::string& list);

}  // namespace voxeld::bench
