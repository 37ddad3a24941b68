// The packed pictures of the slices that an engine owns: which are out of date, and since which
// frame each has its bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"
#include "gpu/assemble/volume.h"
#include "gpu/cpu/executor.h"
#include "gpu/engine.h"
#include "gpu/slice/level_columns.h"
#include "gpu/slice/levels.h"
#include "gpu/slice/light_plan.h"
#include "gpu/slice/plane_packer.h"
#include "gpu/slice/sampler.h"

namespace voxeld::gpu {

// What a target comes to.
struct SlicePlan {
  display::FrameLayout layout;
  display::Tone tone;
  int32_t begin = 0, end = 0;  // the slices owned
  std::shared_ptr<const LightPlan> light;
  Sampler sampler;
  display::TileToSlices tile_to_slices;
};

// Thread-bound; the work inside is spread over `executor`.
class Pictures {
 public:
  explicit Pictures(Executor& executor) : executor_(executor) {}

  // Everything is to be sliced anew, from a volume that is drawn anew. With the layout as before,
  // pictures that come out the same keep the frame of their last change.
  void SetPlan(SlicePlan plan);

  struct Result {
    bool changed = false;
    uint32_t pictures_drawn = 0;
  };
  // Who is to be told of tiles that are drawn, in frames; null: nobody. It is another after SetPlan.
  TileObserver* observer() { return packer_ ? &*packer_ : nullptr; }
  // Slices again what looks at `changes`, as pictures of `frame`. `unobserved`: tiles of theirs of which the observer was not told.
  Result Update(const TileStore& tiles, const Volume::Changes& changes,
                std::span<const uint32_t> unobserved, uint64_t frame);

  uint64_t memory_bytes() const {
    return bytes_.size() + before_.size() + (columns_ ? columns_->memory_bytes() : 0) +
           (packer_ ? packer_->memory_bytes() : 0);
  }

  // Writes the pictures that changed after frame `buffer_holds`, and when each did.
  void CopyTo(FrameBuffer buffer, uint64_t buffer_holds) const;

 private:
  struct Scratch {
    SlicePixels pixels;
    std::vector<uint8_t> picture;
    LevelColumns::Scratch columns;
    std::vector<int32_t> lit;  // slices
  };

  uint8_t* picture(size_t index) { return bytes_.data() + index * plan_->layout.bytes_per_slice(); }
  void MarkSlices(const TileStore& tiles, const Volume::Changes& changes);
  bool Keep(size_t index, std::span<const uint8_t> drawn, uint64_t frame);
  bool DrawSlices(const TileStore& tiles, std::span<const int32_t> slices, uint64_t frame,
                  Scratch& scratch);
  bool TakePacked(const TileStore& tiles, std::span<const uint32_t> unobserved, uint64_t frame);
  template <display::PixelFormat kFormat>
  void PackAs(const SlicePixels& pixels, uint32_t sub, uint8_t* picture) const;
  template <display::PixelFormat kFormat>
  void FinishAs(const SlicePixels& pixels, int32_t slice, uint32_t sub, uint8_t* picture) const;
  void Pack(const SlicePixels& pixels, int32_t slice, uint32_t sub, uint8_t* picture) const;

  Executor& executor_;
  std::optional<SlicePlan> plan_;
  LevelTables levels_;                   // of the plan's format and tone; where it is plain
  std::optional<LevelColumns> columns_;  // where it applies
  std::optional<PlanePacker> packer_;    // where it applies: then it alone writes pictures
  std::vector<uint8_t> bytes_;           // the owned slices' pictures, from the first on
  std::vector<uint8_t> before_;       // under the plan before, until the packer has packed all anew
  std::vector<uint64_t> changed_in_;  // 0: not drawn yet
  std::vector<uint32_t> lit_tiles_;   // of each owned slice
  std::vector<uint8_t> dirty_;        // of each owned slice
  std::vector<uint8_t> blank_;        // all its pictures are zeros
  std::vector<Scratch> scratch_;
};

}  // namespace voxeld::gpu
