// The voxel volume on the device: the scene's table of drawables; the indices of the items that may
// lie in each tile (pair_index.h), of thin lines (line_index.h), of points (point_index.h) and of
// small triangles (triangle_index.h); and the drawing of the regions that changed.
//
// Each index consists of a few batches: a change adds one, batches of similar size are merged, and
// removed items are dropped in the process. So an index of n items costs O(log n) for each, and
// removed items never cost more than the live ones.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/affine.h"
#include "gpu/assemble/scene.h"
#include "gpu/cpu/executor.h"
#include "gpu/cuda/compiled_formulas.h"
#include "gpu/cuda/covered_types.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/line_index.h"
#include "gpu/cuda/list_budget.h"
#include "gpu/cuda/pair_index.h"
#include "gpu/cuda/point_index.h"
#include "gpu/cuda/triangle_index.h"
#include "gpu/cuda/tuning.h"
#include "gpu/cuda/types.h"
#include "gpu/cuda/uploader.h"

namespace voxeld::gpu::cuda {

// The tiles of a target, initially dark and clean.
struct DeviceTiles {
  TileGrid grid;
  RegionGrid regions;
  std::vector<uint8_t> owned_here;  // a copy of the device's data
  Block owned, dirty, region_dirty, dirty_list, lit, counters;
  Block colors;  // empty if slice images are packed as tiles are drawn
  VolumeView view() const;

  static absl::StatusOr<DeviceTiles> Make(Device& device, const TileGrid& grid,
                                          std::span<const uint8_t> owned, bool keep_colors);
};

// The bounds of a geometry's positions, closed, and the greatest distance between corners of one of
// its triangles.
struct GeometryBounds {
  double lo[3], hi[3];
  double extent[3] = {};
};

// The memory of a geometry's arrays; and its bounds, if its items may be thin lines or small
// triangles, or if it is filled.
struct DeviceArrays {
  std::shared_ptr<Block> block;
  std::optional<GeometryBounds> bounds;
  // For geometries that the host processes as well (implicit shapes and curves): a copy that the
  // host can read.
  std::optional<RetainedGeometry> on_host;
};

// A box of voxels, closed, which is only used to estimate sizes.
struct RoughBox {
  double lo[3], hi[3];

  static constexpr double kFar = 1e30;
  static RoughBox Nothing() { return {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}}; }
  static RoughBox Everything() { return {{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}}; }
  void Add(const RoughBox& other);
  // Returns the share of a volume's regions that the box touches.
  double ShareOf(const RegionGrid& regions) const;
};

// Thread-bound. Calls queue work in the device's stream. An error leaves the scene as it was, and
// what could not be drawn is drawn with the next Update.
class CudaVolume final : private SceneObserver {
 public:
  CudaVolume(Device& device, Uploader& uploader, const Tuning& tuning);

  // Applies all of a delta or nothing. Errors: InvalidArgument for a malformed delta,
  // ResourceExhausted if its arrays do not fit in the device's memory.
  absl::Status Apply(std::span<const std::byte> delta, BulkSource* bulk);

  // Everything is to be drawn again; with `all_dirty`, also empty regions.
  absl::Status SetView(DeviceTiles tiles, const Affine& view, bool all_dirty);

  // A frame has these steps: TakeIn applies added and removed drawables, and ListDirty finds the
  // dirty regions, by group. Then DrawGroup draws each group once: into the tiles, and marks the
  // slices that look at it; or, with `packed`, directly into slice images. If DrawsApart, groups
  // may be drawn in streams of their own, after the work that ListDirty has queued.
  absl::Status TakeIn();
  absl::Status ListDirty(const DrawGroups& groups);
  // Returns approximately how many items lie in dirty regions; call after TakeIn.
  double ItemsToDraw() const;
  bool DrawsApart() const {
    return CountDeferred([](uint32_t) { return true; }) == 0;
  }
  absl::Status DrawGroup(uint32_t group, const SliceIndexView& slices, const PackedView* packed,
                         cudaStream_t stream);
  // Called when the frame's counters have been reported and start again at 0.
  void CountersAreClear() { counted_ = false; }

  // Reads the colours of voxels, after a frame. `out` is on the device.
  absl::Status Read(const Box3& box, uint32_t* out);

  VolumeView view() const { return tiles_.view(); }
  uint32_t singular_drawables() const { return singular_; }
  // Returns the bytes in the host's memory.
  uint64_t host_bytes() const;

 private:
  // The index by which a drawable's items are drawn.
  enum class IndexedBy : uint8_t { kPairs, kLines, kPoints, kTriangles };
  // The host's data about a slot of the table.
  struct Slot {
    uint32_t items = 0;
    bool singular = false;
    IndexedBy indexed_by = IndexedBy::kPairs;
    RoughBox box = RoughBox::Everything();
    uint32_t regions_each = 0;        // that a triangle touches at most
    Block tiles, begin, voxels;       // of a drawable that the CPU has drawn
    Block hoisted, reach, covered;    // of an implicit shape (ImplicitPlace; CoveredView)
    Block vertices, indices, colors;  // of a curve that was cut
    Block inside;                     // of a filled mesh
  };

  absl::Status OnPlan(const DeltaPlan& plan) override;
  RetainedGeometry Retain(const GeometryView& view) override;
  void OnLeave(Drawable& drawable) override;
  void OnEnter(Drawable& drawable) override;
  bool OnLayerMove(Layer& layer) override;
  void OnLayerLook(Layer& layer, const LayerRecord& next) override;

  absl::Status PutLayers();
  absl::Status FindGeometryBounds(const DeltaPlan& plan);
  template <typename T>
  std::span<const T> OnDevice(const GeometryView& view, std::span<const T> array) const;
  // Returns the index for its items, if they turn out to be thin, or small.
  static IndexedBy IndexFor(const GeometryRecord& record);
  // Chooses the index of a drawable that is added.
  void ChooseIndex(const Drawable& drawable, const TableEntry& entry, const Cut* cut,
                   Slot& slot) const;
  static void ChooseIndexOf(IndexedBy by, const RoughBox& box, const double extent[3], Slot& slot);
  static void ChooseIndexOfCut(IndexedBy by, const Cut& cut, Slot& slot);
  static constexpr IndexedBy kByRegion[] = {IndexedBy::kLines, IndexedBy::kPoints,
                                            IndexedBy::kTriangles};
  RegionIndex& IndexOf(IndexedBy by) {
    if (by == IndexedBy::kLines) return lines_;
    if (by == IndexedBy::kPoints) return points_;
    return triangles_;
  }
  // Discards all slots, in tables and indexes. All drawables become pending.
  void EnterAllAgain();
  absl::Status KillPairs();
  absl::Status MarkLeft();
  absl::Status MarkPairs(std::span<const uint32_t> slots);
  absl::Status Enter();
  // `entries`: null, or the entries of these drawables that the table does not have yet; the
  // drawables are then added together.
  absl::Status EnterRegions(IndexedBy by, std::span<const Drawable* const> drawables,
                            std::span<const uint32_t> slots, const FewEntries* entries);
  // Returns whether they are lines, or points, of one layer, and so few that an index puts them
  // into the table itself.
  bool AreFew(std::span<const uint32_t> slots, std::span<const TableEntry> entries) const;
  // Drawables of one layer, at most as many as may be added at once.
  struct Arriving {
    std::vector<uint32_t> slots;
    std::vector<uint64_t> first = {0};
    bool drawn = false, mixed = false;
    uint32_t regions_each = 0;
  };
  absl::Status EnterGroup(RegionIndex& index, uint32_t layer, const Arriving& arriving,
                          const FewEntries* entries);
  absl::Status EnterPairs(std::span<const PairedDrawable> drawables);

  // All drawables of a layer, if they are many boxes, spheres and cylinders: when the layer moves,
  // the device places them again, and the host does no work for each of them
  // (cuda_volume_crowds.cc).
  struct Crowd {
    std::vector<const Drawable*> drawables;
    std::vector<uint32_t> slots;      // of each, with one item: all have an inverse
    uint32_t layer = 0;               // the slot of the layer
    bool moved = false;               // and not yet placed again
    bool marks = false;               // their old places are to be drawn again
    Block there, firsts, transforms;  // on the device, when needed

    uint32_t count() const { return static_cast<uint32_t>(slots.size()); }
  };
  using Crowds = absl::flat_hash_map<const Layer*, Crowd>;
  // Handles added drawables: those that form crowds get their pairs, and are removed from `pairs`.
  absl::Status EnterCrowds(std::span<const Drawable* const> drawables,
                           std::span<const uint32_t> slots, Crowds& formed,
                           std::vector<PairedDrawable>& pairs);
  // Places the crowds whose layers have moved. Drawables that cannot stay together are removed and
  // added again.
  absl::Status MoveCrowds();
  // Returns false if the crowd cannot stay together.
  absl::StatusOr<bool> MoveCrowd(const Layer& layer, Crowd& crowd);
  // Uploads the missing data of a crowd to the device; its transforms only if it has moved.
  absl::Status BringCrowd(Crowd& crowd);
  // Makes a layer's drawables independent again, because one is added or removed.
  void Disperse(const Layer* layer);
  void DisperseAll();
  // Defers everything in the index of pairs.
  void DeferPairs();
  // Returns the view for drawing a group, by its number, at the same time as other groups.
  absl::StatusOr<DrawView> ViewForDrawing(uint32_t group);
  // Draws the regions that `view` lists.
  absl::Status DrawListed(DrawView& view, DrawTo to, cudaStream_t stream);
  // Handles the items without lists, of layers for which seen(slot) is true.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  absl::Status DrawInPasses(const DrawView& view, DrawTo to, const Seen& seen);
  // Gives them lists for the regions that `pass` draws. Returns false if some have no lists for
  // lack of memory: then they can be drawn anyway only if `some` is true.
  absl::StatusOr<bool> SortPass(const RegionGrid& pass, const Seen& seen, bool some);
  void EndPass();
  absl::Status Draw(DrawView& view, DrawTo to, cudaStream_t stream);
  absl::Status GrowTable();
  absl::Status PutDrawables(std::span<const uint32_t> slots, std::span<const TableEntry> entries);
  // The data that the host computes for an added drawable, until it has been uploaded.
  struct WorkedOut {
    std::vector<uint32_t> hoisted;  // of an implicit shape
    std::unique_ptr<Cut> cut;       // of a curve or patch
  };
  // An implicit shape that was placed, and whose covered voxels have not been found yet.
  struct PlacedImplicit {
    CoveredView view;
    cudaKernel_t formula = nullptr;  // the kernel that finds them; null: its program is interpreted
  };
  static const GeometryView& OnHost(const Drawable& drawable);
  TableEntry EntryOf(const Drawable& drawable, WorkedOut& worked_out) const;
  // Queues its upload, and allocates memory for the data that the device computes. `worked_out`
  // must live until the upload is done.
  absl::Status Place(const Drawable& drawable, const WorkedOut& worked_out, TableEntry& entry,
                     uint32_t slot);
  absl::Status PlaceImplicit(const Drawable& drawable, std::span<const uint32_t> hoisted,
                             TableEntry& entry, uint32_t slot);
  absl::Status PlaceFilled(TableEntry& entry, Slot& slot);
  // Returns the bounds of a geometry, or the whole volume.
  Box3 BoundsOf(const Drawable& drawable, const Affine& map) const;
  absl::Status PlaceCut(const Cut& cut, TableEntry& entry, Slot& slot);
  // Finds which voxels implicit shapes cover, of those that were placed and are in the table
  // (cuda_volume_implicit.cc).
  absl::Status FindImplicit();
  template <typename F>
  absl::Status ForViews(std::vector<CoveredView> all, F&& f);
  absl::StatusOr<std::optional<Block>> RoomToKeep(uint64_t bytes);
  // Has the CPU draw it, and uploads the result into `slot`.
  absl::Status DrawInto(TableEntry& entry, const Drawable& drawable, Slot& slot);
  uint32_t TakeSlot();

  Device& device_;
  Uploader& uploader_;
  Scene scene_;
  DeviceTiles tiles_;
  Affine view_;
  bool listed_ = false;  // tiles were marked clean but not drawn: any may be dirty
  bool counted_ = true;  // the counters have started
  RoughBox dirty_ = RoughBox::Nothing();
  DrawGroups groups_;  // of the current frame
  ListBudget list_budget_;
  PairIndex index_;  // of all items that the others do not have
  LineIndex lines_;
  PointIndex points_;
  bool lines_suit_ = false, points_suit_ = false;  // the volume is not too large for them
  TriangleIndex triangles_;
  CompiledFormulas formulas_;
  // For blocks of regions: the size of the last pass that failed, with that many items without
  // lists, halved. The next pass gets as many planes along z.
  int32_t pass_planes_ = INT32_MAX;
  uint64_t pass_items_ = 0;

  Block table_;
  std::vector<Slot> slots_;
  std::vector<uint32_t> free_slots_;
  std::vector<uint32_t> dead_slots_;  // not free until the index has dropped them
  uint64_t live_items_ = 0, dead_items_ = 0;
  absl::flat_hash_map<const Drawable*, uint32_t> slot_of_;
  absl::flat_hash_set<const Drawable*> pending_;
  std::vector<PlacedImplicit> placed_;  // of the drawables that are being added
  Crowds crowds_;
  const uint32_t least_crowd_;

  Block looks_, half_spaces_, cylinders_;
  Block below_[kMostDrawGroups];                    // DrawView::below of each group
  std::vector<LayerLook> looks_now_, looks_there_;  // by slot; the device's contents
  std::vector<VoxelHalfSpace> half_spaces_now_, half_spaces_there_;
  std::vector<VoxelCylinder> cylinders_now_, cylinders_there_;
  absl::flat_hash_map<uint64_t, uint32_t> layer_slots_;
  std::vector<uint32_t> free_layer_slots_;

  std::vector<uint32_t> marks_;  // slots whose tiles are to be drawn again
  std::vector<uint32_t> left_;   // slots of removed drawables
  // Memory of removed geometries, until their tiles are marked.
  std::vector<std::shared_ptr<const RetainedGeometry>> kept_;

  // The arrays of the current delta, all at `arrays_`: those in the delta, from `arrays_begin_` on,
  // are at its beginning; those in bulk memory are at the offsets in `bulk_`, by the host address
  // of their positions.
  const std::byte* arrays_begin_ = nullptr;
  std::shared_ptr<Block> arrays_;
  absl::flat_hash_map<const float*, size_t> bulk_;
  // Bounds of the delta's geometries, by the host address of their positions.
  absl::flat_hash_map<const float*, GeometryBounds> bounds_;
  uint32_t singular_ = 0;
  std::unique_ptr<Executor> executor_;  // for drawing on the CPU; created on demand
};

}  // namespace voxeld::gpu::cuda
