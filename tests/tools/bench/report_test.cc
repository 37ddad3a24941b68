#include "tools/bench/voxel_bench/report.h"

#include <gmock/gmock.h>

namespace voxeld::bench {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

TEST(Report, SaysWhatWhereAndHow) {
  const nlohmann::json report = ReportOf("ingest", {{"rounds", 5}});
  EXPECT_EQ(report["benchmark"], "ingest");
  EXPECT_EQ(report["options"]["rounds"], 5);
  EXPECT_TRUE(report["figures"].is_array());
  EXPECT_TRUE(report["figures"].empty());
  EXPECT_THAT(std::string(report["time"]), MatchesRegex("....-..-..T..:..:..Z"));
  EXPECT_GE(int(report["machine"]["cores"]), 1);
  EXPECT_FALSE(std::string(report["machine"]["cpu"]).empty());
  EXPECT_FALSE(std::string(report["build"]["type"]).empty());
  // A tree without git has no commit.
  const nlohmann::json& commit = report["build"]["commit"];
  EXPECT_TRUE(commit.is_null() || !std::string(commit).empty());
}

TEST(Report, FiguresHaveTheirSpread) {
  nlohmann::json report = ReportOf("x", {});
  AddFigure(report, "a.ratio", "of the bare sink", SpreadOf({0.5, 0.25, 1}));
  AddFigure(report, "b", "kB", 7);
  ASSERT_EQ(report["figures"].size(), 2u);
  const nlohmann::json& figure = report["figures"][0];
  EXPECT_EQ(figure["name"], "a.ratio");
  EXPECT_EQ(figure["unit"], "of the bare sink");
  EXPECT_EQ(figure["median"], 0.5);
  EXPECT_EQ(figure["min"], 0.25);
  EXPECT_EQ(figure["max"], 1);
  EXPECT_EQ(figure["values"], (std::vector<double>{0.5, 0.25, 1}));
  EXPECT_EQ(report["figures"][1]["median"], 7);

  const std::string text = TextOf(report);
  EXPECT_THAT(text, HasSubstr("of the bare sink  (0.25 to 1, 3)\n"));
  EXPECT_THAT(text, HasSubstr("7 kB\n"));
  EXPECT_THAT(text, Not(HasSubstr("(7")));
}

TEST(Report, ReadsTheProcessorsName) {
  EXPECT_EQ(CpuModelIn("processor\t: 0\nmodel name\t: AMD EPYC 7\nmodel name\t: other\n"),
            "AMD EPYC 7");
  EXPECT_EQ(CpuModelIn("model\t\t: 3\nmodel name  : A: B \n"), "A: B");
  EXPECT_EQ(CpuModelIn(""), "unknown");
}

}  // namespace
}  // namespace voxeld::bench
