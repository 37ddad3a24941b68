#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/tools/ros/markers_of.h"
#include "tools/ros/marker_array.h"

namespace voxeld::ros1 {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Marker Cube(const char* ns, int id, int action = Marker::ADD) {
  Marker marker = Of(Marker::CUBE);
  marker.ns = ns;
  marker.id = id;
  marker.action = action;
  return marker;
}

std::vector<std::string> Entities(const PendingMarkers::Taken& taken) {
  std::vector<std::string> ids;
  for (const foxglove::SceneEntity& entity : taken.update.entities()) ids.push_back(entity.id());
  return ids;
}

// "*": all are deleted.
std::vector<std::string> Deletions(const PendingMarkers::Taken& taken) {
  std::vector<std::string> ids;
  for (const foxglove::SceneEntityDeletion& deletion : taken.update.deletions()) {
    ids.push_back(deletion.type() == foxglove::SceneEntityDeletion::ALL ? "*" : deletion.id());
  }
  return ids;
}

TEST(PendingMarkers, NamespaceAndIdNameAMarker) {
  PendingMarkers pending;
  EXPECT_TRUE(pending.empty());
  pending.Add(Cube("a", 1));
  pending.Add(Cube("a", 2));
  pending.Add(Cube("b", 1));
  pending.Add(Cube("", -1));
  Marker again = Cube("a", 1);
  again.scale.x = 9;
  pending.Add(again);
  EXPECT_FALSE(pending.empty());
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(Entities(taken), ElementsAre("/-1", "a/1", "a/2", "b/1"));
  EXPECT_EQ(taken.update.entities(1).cubes_size(), 1);
  EXPECT_EQ(taken.update.entities(1).cubes(0).size().x(), 9);
  EXPECT_THAT(Deletions(taken), IsEmpty());
  EXPECT_TRUE(pending.empty());
  EXPECT_THAT(Entities(pending.Take()), IsEmpty());
}

TEST(PendingMarkers, TheLastThingSaidOfAMarkerHolds) {
  PendingMarkers pending;
  pending.Add(Cube("a", 1));
  pending.Add(Cube("a", 1, Marker::DELETE));
  pending.Add(Cube("a", 2, Marker::DELETE));
  pending.Add(Cube("a", 2));
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(Entities(taken), ElementsAre("a/2"));
  EXPECT_THAT(Deletions(taken), ElementsAre("a/1"));
}

TEST(PendingMarkers, AllAreDeletedThatWereBefore) {
  PendingMarkers pending;
  pending.Add(Cube("a", 1));
  pending.Add(Cube("a", 2, Marker::DELETE));
  pending.Add(Cube("", 0, Marker::DELETEALL));
  EXPECT_FALSE(pending.empty());
  pending.Add(Cube("a", 3));
  pending.Add(Cube("a", 4, Marker::DELETE));
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(Entities(taken), ElementsAre("a/3"));
  EXPECT_THAT(Deletions(taken), ElementsAre("*"));
  EXPECT_THAT(Deletions(pending.Take()), IsEmpty());
}

TEST(PendingMarkers, WhatCannotBeReadIsCountedAndTakesAwayWhatItWas) {
  PendingMarkers pending;
  pending.Add(Cube("a", 1));
  Marker bad = Cube("a", 1);
  bad.scale.x = std::numeric_limits<double>::quiet_NaN();
  pending.Add(bad);
  pending.Add(Cube("a", 2));
  pending.Add(Cube("a", 2, 1));
  Marker unreadable = Cube("\xff", 3);
  pending.Add(unreadable);
  pending.AddMalformed("a message was cut");
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(Entities(taken), ElementsAre("a/2"));
  EXPECT_THAT(Deletions(taken), ElementsAre("a/1"));
  EXPECT_EQ(taken.malformed, 4u);
  EXPECT_EQ(taken.malformed_last, "a message was cut");
  EXPECT_EQ(pending.Take().malformed, 0u);
}

TEST(PendingMarkers, ColoursThatAreNotOneEachAreTold) {
  PendingMarkers pending;
  Marker marker = Of(Marker::LINE_STRIP);
  for (int i = 0; i < 3; ++i) AddPoint(&marker, i, 0, 0);
  AddColor(&marker, 0, 1, 0);
  pending.Add(marker);
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(taken.left_out, ElementsAre("colors that are not one for each point"));
  EXPECT_THAT(taken.update.entities(0).lines(0).colors(), IsEmpty());
  EXPECT_EQ(taken.malformed, 0u);
}

TEST(PendingMarkers, HasItsLimits) {
  PendingMarkers pending;
  Marker many = Of(Marker::SPHERE_LIST);
  for (int i = 0; i < 60'000; ++i) AddPoint(&many, i, 0, 0);
  pending.Add(many);
  pending.Add(many);  // replaces itself
  EXPECT_THAT(pending.Take().left_out, IsEmpty());
  pending.Add(many);
  many.id = 8;
  pending.Add(many);
  const PendingMarkers::Taken taken = pending.Take();
  EXPECT_THAT(Entities(taken), ElementsAre("n/7"));
  EXPECT_THAT(taken.left_out, ElementsAre("markers beyond what one update may have"));
}

}  // namespace
}  // namespace voxeld::ros1
