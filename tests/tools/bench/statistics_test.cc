#include "tools/bench/voxel_bench/statistics.h"

#include <gmock/gmock.h>

namespace voxeld::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(Spread, IsOfTheSortedValuesAndKeepsTheirOrder) {
  const Spread odd = SpreadOf({5, 1, 9});
  EXPECT_EQ(odd.median, 5);
  EXPECT_EQ(odd.least, 1);
  EXPECT_EQ(odd.greatest, 9);
  EXPECT_THAT(odd.values, ElementsAre(5, 1, 9));
  EXPECT_EQ(SpreadOf({4, 1, 3, 2}).median, 2.5);
  EXPECT_EQ(SpreadOf({7}).median, 7);
  EXPECT_EQ(SpreadOf({-3, -1}).greatest, -1);
}

TEST(Spread, OfNothingIsNothing) {
  const Spread none = SpreadOf({});
  EXPECT_EQ(none.median, 0);
  EXPECT_THAT(none.values, IsEmpty());
}

TEST(Ratios, AreOfPairsNotOfMedians) {
  // Medians 2 and 4; the ratios of the pairs are 1/4, 2/2 and 3/6.
  const std::vector<double> values = {1, 2, 3}, baseline = {4, 2, 6};
  const Spread ratios = RatiosOf(values, baseline);
  EXPECT_THAT(ratios.values, ElementsAre(0.25, 1, 0.5));
  EXPECT_EQ(ratios.median, 0.5);
  EXPECT_EQ(ratios.least, 0.25);
  EXPECT_EQ(ratios.greatest, 1);
}

TEST(Ratios, GoAsFarAsBothAndLeaveOutZeros) {
  const std::vector<double> values = {1, 2, 3}, baseline = {0, 4};
  EXPECT_THAT(RatiosOf(values, baseline).values, ElementsAre(0.5));
  EXPECT_THAT(RatiosOf(values, {}).values, IsEmpty());
}

TEST(Quantile, IsOfTheNearestRank) {
  std::vector<double> hundred;
  for (int i = 100; i >= 1; --i) hundred.push_back(i);
  EXPECT_EQ(QuantileOf(hundred, 0.5), 50);
  EXPECT_EQ(QuantileOf(hundred, 0.99), 99);
  EXPECT_EQ(QuantileOf(hundred, 0.991), 100);
  EXPECT_EQ(QuantileOf(hundred, 1), 100);
  EXPECT_EQ(QuantileOf(hundred, 0), 1);
  EXPECT_EQ(QuantileOf({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(QuantileOf({}, 0.5), 0);
}

TEST(JainIndex, IsOneForEqualsAndAnNthForOneAlone) {
  EXPECT_DOUBLE_EQ(JainIndexOf(std::vector<double>{3, 3, 3, 3}), 1);
  EXPECT_DOUBLE_EQ(JainIndexOf(std::vector<double>{0, 8, 0, 0}), 0.25);
  EXPECT_DOUBLE_EQ(JainIndexOf(std::vector<double>{1, 3}), 16.0 / 20);
  EXPECT_EQ(JainIndexOf({}), 0);
  EXPECT_EQ(JainIndexOf(std::vector<double>{0, 0}), 0);
}

TEST(Mean, IsTheSumByTheNumber) {
  EXPECT_DOUBLE_EQ(MeanOf(std::vector<double>{1, 2, 6}), 3);
  EXPECT_EQ(MeanOf({}), 0);
}

}  // namespace
}  // namespace voxeld::bench
