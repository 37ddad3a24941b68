#include "tools/bench/voxel_bench/svg_plot.h"

#include <gmock/gmock.h>

#include <regex>

namespace voxeld::bench {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

// Returns the points of each line drawn, in order.
std::vector<std::vector<std::pair<double, double>>> LinesIn(const std::string& svg) {
  std::vector<std::vector<std::pair<double, double>>> lines;
  const std::regex polyline("<polyline[^>]* points=\"([^\"]*)\""), point("([-0-9.]+),([-0-9.]+)");
  for (std::sregex_iterator at(svg.begin(), svg.end(), polyline), end; at != end; ++at) {
    const std::string points = (*at)[1];
    lines.emplace_back();
    for (std::sregex_iterator p(points.begin(), points.end(), point); p != end; ++p) {
      lines.back().emplace_back(std::stod((*p)[1]), std::stod((*p)[2]));
    }
  }
  return lines;
}

TEST(Svg, DrawsInProportion) {
  const std::string svg = SvgOf("title", "seconds", {{"y", {{"one", {{0, 0}, {5, 10}, {10, 5}}}}}});
  EXPECT_THAT(svg, StartsWith("<svg "));
  EXPECT_THAT(svg, EndsWith("</svg>\n"));
  const auto lines = LinesIn(svg);
  ASSERT_EQ(lines.size(), 1u);
  ASSERT_EQ(lines[0].size(), 3u);
  const auto [x0, y0] = lines[0][0];
  const auto [x1, y1] = lines[0][1];
  const auto [x2, y2] = lines[0][2];
  EXPECT_NEAR(x1 - x0, x2 - x1, 0.11);
  EXPECT_GT(x1, x0);
  EXPECT_GT(y0, y1);  // y grows downwards
  EXPECT_NEAR(y0 - y1, 2 * (y2 - y1), 0.21);
}

TEST(Svg, PanelsShareTheirTimeAndNotTheirHeight) {
  const std::string svg = SvgOf("t", "s",
                                {{"small", {{"a", {{0, 1}, {4, 1}}}}},
                                 {"great", {{"b", {{0, 1000}, {2, 1000}}}, {"c", {{4, 0}}}}}});
  const auto lines = LinesIn(svg);
  ASSERT_EQ(lines.size(), 3u);
  // In the second panel the later series is drawn first.
  EXPECT_NEAR(lines[0][1].first, lines[1][0].first, 0.11);
  EXPECT_GT(lines[2][0].second, lines[0][0].second);
}

TEST(Svg, EscapesText) {
  const std::string svg = SvgOf("<script>&\"", "x", {{"<y>", {{"<s>", {}}}}});
  EXPECT_THAT(svg, HasSubstr("&lt;script&gt;&amp;&quot;"));
  EXPECT_THAT(svg, Not(HasSubstr("<script>")));
  EXPECT_THAT(svg, HasSubstr("&lt;y&gt;"));
  EXPECT_THAT(svg, HasSubstr("&lt;s&gt;"));
}

TEST(Svg, OfNothingIsStillAPlot) {
  const std::string svg = SvgOf("t", "s", {{"y", {{"a", {}}}}});
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
}

TEST(RoundAbove, IsTheNextOfOneTwoFive) {
  EXPECT_DOUBLE_EQ(RoundAbove(3), 5);
  EXPECT_DOUBLE_EQ(RoundAbove(5), 5);
  EXPECT_DOUBLE_EQ(RoundAbove(5.1), 10);
  EXPECT_DOUBLE_EQ(RoundAbove(0.013), 0.02);
  EXPECT_DOUBLE_EQ(RoundAbove(1100), 2000);
  EXPECT_DOUBLE_EQ(RoundAbove(0), 1);
  EXPECT_DOUBLE_EQ(RoundAbove(-4), 1);
}

}  // namespace
}  // namespace voxeld::bench
