// The tables that convert a target's pixels to light (finish.h), computed on the host for every
// engine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/slice/finish.h"

namespace voxeld::gpu {

struct LightPlan {
  std::vector<uint16_t> curves;   // 256 each of red, green and blue
  std::vector<uint16_t> noise;    // of kBlueNoise, otherwise empty
  std::vector<uint16_t> factors;  // for each outer row of the footprints; empty: all are full

  static LightPlan Of(const display::FootprintTable& table, const display::VoxelGrid& grid,
                      const display::FrameLayout& layout, const display::Tone& tone);
  // The same, if all rows are full.
  static LightPlan WithoutFactors(const display::Tone& tone);

  // Returns whether dither is ordered or off and a pixel's place decides only its threshold, so
  // that values computed once for many places (levels.h) are valid.
  bool plain(const display::FrameLayout& layout) const {
    return noise.empty() && factors.empty() && layout.format != display::PixelFormat::kPlanes24;
  }

  // The result refers to this plan.
  Finish finish(const display::FrameLayout& layout, const display::Tone& tone) const;
};

// Computes a target's plan, and keeps the factors, whose computation can take a while, for the next
// target: a target with another view, or with other brightness, has the same factors. Thread-bound.
class LightPlanner {
 public:
  // `table`: the footprints of `geometry`, for the tone's sampling.
  std::shared_ptr<const LightPlan> Of(const display::FootprintTable& table,
                                      const display::Geometry& geometry,
                                      const display::FrameLayout& layout,
                                      const display::Tone& tone);

 private:
  // The inputs from which the factors were computed.
  struct Even {
    display::Geometry geometry;
    display::Sampling sampling;
    uint16_t least;
    std::vector<uint16_t> factors;
  };
  std::optional<Even> even_;
};

// Returns the least factor of light with which full white lights every pixel, whatever its
// threshold, in at least one sub-frame; 1 to 65535. White is the tone's at full brightness: dimming
// has no influence.
uint16_t LeastFactor(const display::FrameLayout& layout, const display::Tone& tone);

}  // namespace voxeld::gpu
