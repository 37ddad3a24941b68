// The tables by which a target's pixels become light (finish.h), made on the host for every engine.
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
  std::vector<uint16_t> noise;    // of kBlueNoise, else none
  std::vector<uint16_t> factors;  // of each outer row of the footprints; none: all are full

  static LightPlan Of(const display::FootprintTable& table, const display::VoxelGrid& grid,
                      const display::FrameLayout& layout, const display::Tone& tone);
  // The same, where all rows are full.
  static LightPlan WithoutFactors(const display::Tone& tone);

  // Ordered dither or none, and all that a pixel's place decides is its threshold: what is worked out once for many places
  // (levels.h) holds.
  bool plain(const display::FrameLayout& layout) const {
    return noise.empty() && factors.empty() && layout.format != display::PixelFormat::kPlanes24;
  }

  // Refers to this.
  Finish finish(const display::FrameLayout& layout, const display::Tone& tone) const;
};

// Makes a target's plan, and keeps the factors, which can take a while, for the next target: one with another view, or
// dimmed, has the same. Thread-bound.
class LightPlanner {
 public:
  // `table`: the footprints of `geometry`, as the tone samples them.
  std::shared_ptr<const LightPlan> Of(const display::FootprintTable& table,
                                      const display::Geometry& geometry,
                                      const display::FrameLayout& layout,
                                      const display::Tone& tone);

 private:
  // What the factors were made of.
  struct Even {
    display::Geometry geometry;
    display::Sampling sampling;
    uint16_t least;
    std::vector<uint16_t> factors;
  };
  std::optional<Even> even_;
};

// The factor of light with which full white lights every pixel, whatever its threshold, in a sub-frame at least; 1 to 65535. White is
// the tone's at full brightness: how far it is dimmed plays no part.
uint16_t LeastFactor(const display::FrameLayout& layout, const display::Tone& tone);

}  // namespace voxeld::gpu
