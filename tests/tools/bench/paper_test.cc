// Tests the reproduction of the paper's tables: batches, rows, text, figures; and a small run on
// the CPU.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tools/bench/log_plot.h"
#include "tools/bench/paper/figures.h"
#include "tools/bench/paper/paper_bench.h"
#include "tools/bench/paper/workload.h"

namespace voxeld::bench::paper {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

uint64_t CountOf(const Workload& workload) {
  uint64_t voxels = 0;
  for (const auto& segment : workload.segments) {
    double sum = 0;
    for (size_t a = 0; a < 3; ++a)
      sum += (segment.end[a] - segment.start[a]) * (segment.end[a] - segment.start[a]);
    voxels += static_cast<uint64_t>(std::sqrt(sum)) + 1;  // the paper's N, plus one
  }
  return voxels;
}

TEST(PaperWorkload, HasAsManyVoxelsAsItSays) {
  for (const uint64_t each : {20, 1000, 200'000}) {
    const Workload workload = OneLength("3", 1024, each, 7);
    EXPECT_THAT(workload.segments, SizeIs(1024));
    EXPECT_EQ(workload.voxels, 1024 * each);
    EXPECT_EQ(CountOf(workload), 1024 * each);
  }
  for (const uint64_t total : {1'000'000, 123'456'789}) {
    const Workload different = Different(total, 3), skewed = Skewed(total, 3);
    EXPECT_THAT(different.segments, SizeIs(1024));
    EXPECT_EQ(different.voxels, total);
    EXPECT_EQ(CountOf(different), total);
    EXPECT_THAT(skewed.segments, SizeIs(1024));
    EXPECT_EQ(skewed.voxels, total);
    EXPECT_EQ(CountOf(skewed), total);
  }
  const Workload packed = Packed(1'000'000, 3);
  EXPECT_GE(packed.voxels, 1'000'000u);
  EXPECT_LT(packed.voxels, 1'004'000u);
  for (const auto& segment : packed.segments) {
    for (const auto& p : {segment.start, segment.end}) {
      for (size_t a = 0; a < 3; ++a) {
        EXPECT_GE(p[a], 0);
        EXPECT_LT(p[a], a == 2 ? 1024 : 2048);
      }
    }
  }
}

TEST(PaperWorkload, IsTheSameForOneSeedAndAnotherForAnother) {
  EXPECT_EQ(Different(1'000'000, 5).segments[9].end, Different(1'000'000, 5).segments[9].end);
  EXPECT_NE(Different(1'000'000, 5).segments[9].end, Different(1'000'000, 6).segments[9].end);
}

TEST(PaperBench, MeasuresRowsWithTheirCeilingsAndThePapersRates) {
  int lines = 0;
  const auto report = MeasurePaper(
      {.engines = {"cpu", "auto"}, .tables = {"2", "4"}, .seconds = 0.001, .voxels = 200'000},
      [&](const std::string&) { ++lines; }, [] { return true; });
  ASSERT_TRUE(report.ok()) << report.status();
  const nlohmann::json& rows = (*report)["rows"];
  EXPECT_EQ(lines, static_cast<int>(rows.size()));
  EXPECT_EQ(rows.size() % 13, 0u) << "ten of Table 2, three of Table 4, in each column";
  for (const nlohmann::json& row : rows) {
    EXPECT_GT(double(row["mvoxel_per_s"]), 0);
    EXPECT_NEAR(double(row["mvoxel_per_s"]) * double(row["ms"]) * 1e3, double(row["voxels"]),
                double(row["voxels"]) * 1e-9);
    EXPECT_LE(double(row["ms_least"]), double(row["ms"]));
    EXPECT_EQ(row["ceiling_ratio"].is_null(), row["engine"] == "auto");
    EXPECT_TRUE(row["host_copy"]);
    EXPECT_EQ(row["paper_mvoxel_per_s"].is_null(), row["table"] != "2")
        << "not of this number of voxels";
  }
  // One segment of a million: its best takes 3.65 ms.
  for (const nlohmann::json& row : rows) {
    if (row["table"] == "2" && row["voxels"] == 1'000'000) {
      EXPECT_NEAR(double(row["paper_mvoxel_per_s"]), 273.65, 0.01);
    }
  }
  const std::string text = PaperText(*report);
  EXPECT_THAT(text, HasSubstr("GTX 1070 (2016)"));
  EXPECT_THAT(text, HasSubstr("CPU, 1 thread"));
  EXPECT_THAT(text, HasSubstr("of streaming stores of the same bytes"));
  EXPECT_THAT(FiguresOf(*report), SizeIs(2)) << "5 and 6; what was not measured is not drawn";
}

TEST(PaperBench, EndsWhenItIsInterrupted) {
  const auto report = MeasurePaper(
      {.engines = {"cpu"}, .tables = {"2"}}, [](const std::string&) {}, [] { return false; });
  EXPECT_EQ(report.status().code(), absl::StatusCode::kCancelled);
}

nlohmann::json Row(const std::string& table, uint64_t segments, uint64_t voxels, double ms) {
  return {{"table", table},   {"segments", segments},
          {"voxels", voxels}, {"engine", "cuda"},
          {"threads", 16},    {"host_copy", true},
          {"ms", ms},         {"mvoxel_per_s", static_cast<double>(voxels) / ms / 1e3}};
}

TEST(PaperFigures, HaveThePapersMachinesAndOurs) {
  nlohmann::json report = {{"rows",
                            {Row("2", 1, 1000, 0.1), Row("2", 1, 1'000'000, 0.4),
                             Row("3", 1024, 20'480, 0.2), Row("4", 1024, 1'000'000'000, 218)}}};
  const auto figures = FiguresOf(report);
  ASSERT_THAT(figures, SizeIs(5));
  EXPECT_EQ(figures[0].first, "paper-figure-5.svg");
  EXPECT_THAT(figures[0].second, HasSubstr("Core 2 Quad Q9550 (2008)"));
  EXPECT_THAT(figures[0].second, HasSubstr("ours, CUDA with the copy"));
  EXPECT_THAT(figures[1].second, Not(HasSubstr("Core 2 Quad"))) << "GPUs only";
  EXPECT_EQ(figures[4].first, "paper-figure-9.svg");
  EXPECT_THAT(figures[4].second, HasSubstr("4587"));
}

TEST(LogPlot, PutsDecadesAtEqualDistancesAndEscapesText) {
  const std::string svg =
      LogLogSvg("a < b", "x", "y", {{"one & all", true, {{10, 1}, {100, 10}, {1000, 100}}}});
  EXPECT_THAT(svg, HasSubstr("a &lt; b"));
  EXPECT_THAT(svg, HasSubstr("one &amp; all"));
  // Two decades over 560 and 410 pixels from the lower left.
  EXPECT_THAT(svg, HasSubstr("points=\"90.0,460.0 370.0,255.0 650.0,50.0 \""));
  // With explicit marks, an axis ends where they do.
  const std::string marked =
      LogLogSvg("t", "x", "y",
                {{.name = "g", .points = {{2, 1}, {4, 10}, {8, 100}}, .guide = true}}, {2, 4, 8});
  EXPECT_THAT(marked, HasSubstr("points=\"90.0,460.0 370.0,255.0 650.0,50.0 \""));
  EXPECT_THAT(marked, HasSubstr(">4</text>"));
  EXPECT_THAT(marked, HasSubstr("stroke-dasharray"));
  EXPECT_THAT(svg, Not(HasSubstr("stroke-dasharray")));
  EXPECT_THAT(LogLogSvg("t", "x", "y", {}), HasSubstr("</svg>"));
  EXPECT_THAT(LogBarsSvg("t", "l", {{"b", false, 5}}), HasSubstr("<rect"));
}

}  // namespace
}  // namespace voxeld::bench::paper
