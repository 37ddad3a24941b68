// The outcomes of a stream's commits, counted from its receipts.
#pragma once

#include <cstdint>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

struct Tally {
  uint64_t sent = 0;  // commits
  uint64_t accepted = 0, refused = 0, refused_operations = 0, issues = 0, dropped_frames = 0;
  uint64_t owed = 0;  // outcomes that are owed: one per display for each accepted commit
  uint64_t presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0;

  void Told(const v1::Receipt& receipt);

  uint64_t answered() const { return accepted + refused; }
  uint64_t outcomes() const { return presented + unchanged + superseded + lost + not_shown; }
  uint64_t pending() const { return owed - outcomes(); }
  // Returns whether every commit has its answer and every accepted commit its outcomes.
  bool Settled() const { return answered() == sent && outcomes() == owed; }
  // Returns whether there are no more answers than commits, no more outcomes than are owed, and no
  // refusals.
  bool Sound() const {
    return answered() <= sent && outcomes() <= owed && refused == 0 && refused_operations == 0 &&
           issues == 0;
  }

  Tally& operator+=(const Tally& other);
};

}  // namespace voxeld::bench
