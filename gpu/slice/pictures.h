// The packed slice images of the slices that an engine owns: which are out of date, and since which
// frame each has had its bytes.
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

// The data derived from a target.
struct SlicePlan {
  display::FrameLayout layout;
  display::Tone tone;
  int32_t begin = 0, end = 0;  // the owned slices
  std::shared_ptr<const LightPlan> light;
  Sampler sampler;
  display::TileToSlices tile_to_slices;
};

// Thread-bound; the work inside is spread over `executor`.
class Pictures {
 public:
  explicit Pictures(Executor& executor) : executor_(executor) {}

  // Slices everything again, from a volume that is drawn again. If the layout is the same as
  // before, slice images with unchanged bytes keep the frame of their last change.
  void SetPlan(SlicePlan plan);

  struct Result {
    bool changed = false;
    uint32_t pictures_drawn = 0;
  };
  // Returns the observer of tiles that are drawn during frames; null if there are none to notify.
  // It changes with SetPlan.
  TileObserver* observer() { return packer_ ? &*packer_ : nullptr; }
  // Slices again the slices that look at `changes`, as slice images of `frame`. `unobserved`: those
  // of the changed tiles that the observer was not notified of.
  Result Update(const TileStore& tiles, const Volume::Changes& changes,
                std::span<const uint32_t> unobserved, uint64_t frame);

  uint64_t memory_bytes() const {
    return bytes_.size() + before_.size() + (columns_ ? columns_->memory_bytes() : 0) +
           (packer_ ? packer_->memory_bytes() : 0);
  }

  // Copies the slice images that changed after frame `buffer_holds`, and the frame of each one's
  // last change.
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
  LevelTables levels_;                   // of the plan's format and tone, if it is plain
  std::optional<LevelColumns> columns_;  // if the method applies
  std::optional<PlanePacker> packer_;    // if it applies: then only the packer writes images
  std::vector<uint8_t> bytes_;           // the owned slices' images, from the first on
  std::vector<uint8_t> before_;       // under the previous plan, until the packer packed everything
  std::vector<uint64_t> changed_in_;  // 0: not drawn yet
  std::vector<uint32_t> lit_tiles_;   // for each owned slice
  std::vector<uint8_t> dirty_;        // for each owned slice
  std::vector<uint8_t> blank_;        // all slice images of the slice are zeros
  std::vector<Scratch> scratch_;
};

}  // namespace voxeld::gpu
