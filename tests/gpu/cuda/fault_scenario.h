// A short life of an engine in which every kind of its work occurs, and the result of each step.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "gpu/engine.h"
#include "tests/conformance/engine_driver.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu {

struct FaultStep {
  enum class Kind { kTarget, kApply, kFrame, kVoxels };
  Kind kind = Kind::kFrame;
  std::string name;
  Target target;                   // the one in force
  conformance::DeltaBuffer delta;  // for kApply
  conformance::SceneModel scene;   // after the step
};

// Returns every kind of work: targets, including one with the same layout; lines that the CPU
// draws; a crowd that moves; deltas that add, replace, drop, hide, and outgrow tables; more
// removals than an index keeps; frames in between; reading voxels. Ends with a frame.
std::vector<FaultStep> FaultScenario();

// Returns a random scenario: a scene of every kind of drawable under one target and then another,
// which changes from frame to frame. The same for the same seed. Ends with a frame.
std::vector<FaultStep> RandomFaultScenario(uint64_t seed);
// Nine seeds with many lit voxels and displays of every kind.
inline constexpr uint64_t kFaultSeeds[] = {5, 13, 16, 18, 26, 28, 36, 42, 56};

// The observable state of an engine after a step.
struct Seen {
  std::vector<std::byte> pictures;
  std::vector<uint64_t> changed_in;
  std::vector<uint32_t> voxels;
  uint64_t lit_voxels = 0;
  uint32_t singular_drawables = 0;
};

class FaultPlayer {
 public:
  explicit FaultPlayer(const conformance::EngineCase& engine);

  absl::Status Do(const FaultStep& step);
  const Seen& seen() const { return seen_; }
  Engine& engine() { return driver_.engine(); }

 private:
  conformance::EngineDriver driver_;
  Seen seen_;
};

}  // namespace voxeld::gpu
