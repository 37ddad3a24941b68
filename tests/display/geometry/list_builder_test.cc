#include "display/geometry/list_builder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace voxeld::display {
namespace {

using testing::ElementsAre;

TEST(ListBuilderTest, SortsByDepthThenRowThenColumn) {
  ListBuilder builder(3);
  builder.Add(2, {5, 1, 0});
  builder.Add(0, {9, 9, 9});
  builder.Add(2, {4, 2, 0});
  builder.Add(2, {6, 0, 1});
  builder.Add(2, {4, 1, 0});
  const FootprintLists lists = builder.Build();
  EXPECT_THAT(lists.begin, ElementsAre(0, 1, 1, 5));
  EXPECT_THAT(lists.entries,
              ElementsAre(FootprintEntry{9, 9, 9}, FootprintEntry{4, 1, 0}, FootprintEntry{5, 1, 0},
                          FootprintEntry{4, 2, 0}, FootprintEntry{6, 0, 1}));
}

TEST(ListBuilderTest, KeepsTheGreatestWeightOfAVoxel) {
  ListBuilder builder(2);
  builder.Add(0, {1, 2, 3, 40});
  builder.Add(0, {1, 2, 3, 200});
  builder.Add(0, {1, 2, 3, 128});
  builder.Add(1, {1, 2, 3, 7});
  const FootprintLists lists = builder.Build();
  EXPECT_THAT(lists.begin, ElementsAre(0, 1, 2));
  EXPECT_THAT(lists.entries, ElementsAre(FootprintEntry{1, 2, 3, 200}, FootprintEntry{1, 2, 3, 7}));
}

TEST(ListBuilderTest, NothingAddedIsEmptyLists) {
  const FootprintLists lists = ListBuilder(2).Build();
  EXPECT_THAT(lists.begin, ElementsAre(0, 0, 0));
  EXPECT_TRUE(lists.entries.empty());
}

}  // namespace
}  // namespace voxeld::display
