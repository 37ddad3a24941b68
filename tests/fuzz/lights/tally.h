// The invariants of an intake, whatever arrived.
#pragma once

#include "tests/fuzz/expect.h"
#include "tools/lights/intake.h"

namespace voxeld::fuzz {

inline void CheckTally(const lights::Intake& intake) {
  const lights::IntakeTally& t = intake.tally();
  EXPECT_THAT_HOLDS(t.messages == t.set + t.shows + t.ended + t.other + t.outside + t.outranked +
                                      t.stale + t.malformed,
                    "the messages do not add up");
  EXPECT_THAT_HOLDS(t.pictures == t.taken + t.superseded + (intake.waiting() ? 1 : 0),
                    "the pictures do not add up");
  EXPECT_THAT_HOLDS(intake.malformed().ok() == (t.malformed == 0));
  ExpectSays(intake.malformed());
}

// Takes the waiting picture, if one is waiting.
inline void TakePicture(lights::Intake& intake, size_t lights) {
  const bool waiting = intake.waiting();
  const auto picture = intake.Take();
  EXPECT_THAT_HOLDS(picture.has_value() == waiting);
  if (picture.has_value()) EXPECT_THAT_HOLDS(picture->size() == 3 * lights);
  EXPECT_THAT_HOLDS(!intake.waiting() && !intake.Take().has_value(), "a picture is taken twice");
}

}  // namespace voxeld::fuzz
