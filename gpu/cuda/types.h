// The data in device memory, used by host and device. Plain data.
#pragma once

#include <cstdint>

#include "display/geometry/footprint_entry.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"
#include "gpu/slice/finish.h"

namespace voxeld::gpu::cuda {

// Replaces a primitive's kind if the CPU has drawn it: each of its items is the part that it covers
// of a tile.
inline constexpr PrimitiveKind kDrawnByCpu = PrimitiveKind{0};

// CpuVoxels in device memory.
struct CpuVoxelsView {
  const uint32_t* tiles = nullptr;
  const uint64_t* begin = nullptr;
  const uint64_t* voxels = nullptr;
};

// A drawable in the table, by slot. `source.record` points to `record`, its arrays point into
// device memory; vertices are mapped and snapped when needed.
struct TableEntry {
  Source source;
  GeometryRecord record;
  CpuVoxelsView drawn;  // for kDrawnByCpu, which has no source
  uint32_t priority = 0;
  uint32_t erase = 0;
  uint32_t layer = 0;  // the slot of the layer
  uint32_t alive = 0;
};

// A layer, by slot.
struct LayerLook {
  int32_t rank = -1;   // in the order of combination; −1: the slot is free
  uint32_t seen = 0;   // not 0: visible, and its mask, if it has one, exists
  uint32_t drawn = 0;  // not 0: seen, or the mask of a seen layer
  int32_t mask = -1;   // the slot of its mask; −1: none
  uint32_t opacity = 255;
  BlendMode blend = BlendMode::kOver;
  // Its half-spaces and cylinders (gpu/clip.h) in the arrays of all layers; at most kMaxHalfSpaces,
  // kMaxClipCylinders.
  uint32_t first_half_space = 0, half_spaces = 0;
  uint32_t first_cylinder = 0, cylinders = 0;
  bool operator==(const LayerLook&) const = default;
};

// The items of some drawables in one row: those of slot(i) are the items from first(i) on, up to
// first(i + 1). A few are stored in the struct itself, which is a kernel's argument, so that
// nothing has to be uploaded.
inline constexpr uint32_t kFewRows = 4;
struct ItemList {
  const uint32_t* slots = nullptr;   // null: use `few`
  const uint64_t* firsts = nullptr;  // count + 1
  uint32_t count = 0;
  uint32_t few_slots[kFewRows] = {};
  uint64_t few_firsts[kFewRows + 1] = {};

  VOXELD_HD uint32_t slot(uint32_t i) const { return slots != nullptr ? slots[i] : few_slots[i]; }
  VOXELD_HD uint64_t first(uint32_t i) const {
    return slots != nullptr ? firsts[i] : few_firsts[i];
  }
};

// Entries of the table, by slot, as a kernel's argument.
struct FewEntries {
  uint32_t slots[kFewRows];
  TableEntry entries[kFewRows];
};
static_assert(sizeof(FewEntries) <= 3500, "arguments have 4 KB");

// A pair says that an item may lie in a tile. Key: the tile and, in the lower kLayerBits, the
// layer's slot. Value: the drawable's slot and, in the lower half, the item.
inline constexpr uint32_t kLayerBits = 16;
inline constexpr uint32_t kMaxLayers = 1u << kLayerBits;
VOXELD_HD constexpr uint64_t PairKey(uint32_t tile, uint32_t layer) {
  return static_cast<uint64_t>(tile) << kLayerBits | layer;
}
VOXELD_HD constexpr uint64_t PairValue(uint32_t slot, uint32_t item) {
  return static_cast<uint64_t>(slot) << 32 | item;
}

// Pairs, ascending by key; those of a tile are the row [row_begin[tile], row_begin[tile + 1]).
struct BatchView {
  const uint64_t* keys = nullptr;
  const uint64_t* values = nullptr;
  const uint32_t* row_begin = nullptr;
};

inline constexpr uint32_t kMaxBatches = 32;  // a lane handles one
struct BatchList {
  BatchView batches[kMaxBatches];
  uint32_t count = 0;
};

// Dirty regions are listed, drawn and packed in groups of planes of regions along z, so that slice
// images of one group are copied while the next is drawn.
inline constexpr uint32_t kMostDrawGroups = 8;
struct DrawGroups {
  uint32_t count = 1;
  int32_t end[kMostDrawGroups] = {0x7FFFFFFF};  // planes, half-open
};

// The counters of kernels. All before lit_voxels are 0 when a frame begins: the kernel that
// finishes the last slices resets them.
struct Counters {
  uint32_t tiles_drawn = 0;
  uint32_t slices_drawn = 0;
  uint32_t pictures_changed = 0;
  uint32_t ended = 0;                    // blocks of threads that have finished their slices
  uint32_t dirty[kMostDrawGroups] = {};  // regions in the list of each group
  uint32_t taken[kMostDrawGroups] = {};  // places in it that drawing blocks have taken
  uint64_t lit_voxels = 0;
};

// The volume: interleaved colours, kTileVoxels per tile.
struct VolumeView {
  TileGrid grid;
  const uint8_t* owned = nullptr;  // a TileOwner for each tile
  uint8_t* dirty = nullptr;
  // By region (line_types.h), because regions are drawn whole.
  uint8_t* region_dirty = nullptr;
  uint32_t* dirty_list = nullptr;  // each group's after all that earlier groups may have
  uint32_t* lit = nullptr;         // voxels of each tile
  uint32_t* colors = nullptr;      // null: slice images are packed as tiles are drawn
  Counters* counters = nullptr;
};

// Which slices look at which tiles (display::TileToSlices), and the state of each owned slice.
struct SliceIndexView {
  uint32_t stride[3] = {};  // of the outer plane of tiles
  uint32_t inner_axis = 2;  // 0 to 2
  uint32_t inner_sets = 1;
  uint32_t inner_tiles = 0;  // along the inner axis
  const uint32_t* begin = nullptr;
  const int32_t* slices = nullptr;
  const uint8_t* inner_seen = nullptr;
  int32_t first = 0, last = 0;    // the owned slices, half-open
  uint32_t* dirty = nullptr;      // by slice − first
  uint32_t* lit_tiles = nullptr;  // by slice − first
};

struct ListsView {
  const uint32_t* begin = nullptr;
  const display::FootprintEntry* entries = nullptr;
};

// All data for slicing.
struct SliceView {
  ListsView outer, inner;
  uint32_t width = 0, height = 0, inner_sets = 1, inner_axis = 2;
  uint32_t columns = 0;   // outer lists per slice
  uint32_t flat_row = 0;  // as in FootprintTable
  uint32_t line = 0;      // voxels along the inner axis that inner lists reach
  display::Sampling sampling = display::Sampling::kMax;
  Finish finish;
  uint32_t sub_frames = 1;
  uint32_t bytes_per_picture = 0;
  uint8_t* bytes = nullptr;  // slice images of the owned slices
  uint64_t* changed_in = nullptr;
  uint64_t* told = nullptr;     // the same, in the host's memory
  uint32_t* differs = nullptr;  // for each slice image: its bytes have changed
  uint32_t* blank = nullptr;    // for each owned slice: all its slice images are zeros
};

}  // namespace voxeld::gpu::cuda
