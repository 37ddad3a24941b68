// The voxel volume on the device: the scene's table of drawables, the indices of what may lie in which
// tile (pair_index.h), of thin lines (line_index.h), of points (point_index.h) and of small
// triangles (triangle_index.h), and the drawing of the regions that changed.
//
// Each index is a few batches: a change adds one, batches of like size are merged, and what has gone
// is dropped on the way; so an index of n costs O(log n) each, and what has gone never costs more
// than what is there.
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

// The tiles of a target, dark and clean.
struct DeviceTiles {
  TileGrid grid;
  RegionGrid regions;
  std::vector<uint8_t> owned_here;  // as the device has it
  Block owned, dirty, region_dirty, dirty_list, lit, counters;
  Block colors;  // unless pictures are packed as tiles are drawn
  VolumeView view() const;

  static absl::StatusOr<DeviceTiles> Make(Device& device, const TileGrid& grid,
                                          std::span<const uint8_t> owned, bool keep_colors);
};

// Of a geometry's positions, closed; and how far corners of one of its triangles are apart at most.
struct GeometryBounds {
  double lo[3], hi[3];
  double extent[3] = {};
};

// What a geometry's arrays lie in; and its bounds, if its items may be thin lines or small triangles, or if it
// is filled.
struct DeviceArrays {
  std::shared_ptr<Block> block;
  std::optional<GeometryBounds> bounds;
  // Of what is worked out on the host as well, implicit shapes and curves, where that can read them.
  std::optional<RetainedGeometry> on_host;
};

// A box of voxels, closed, of which nothing more is asked than about how large it is.
struct RoughBox {
  double lo[3], hi[3];

  static constexpr double kFar = 1e30;
  static RoughBox Nothing() { return {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}}; }
  static RoughBox Everything() { return {{-kFar, -kFar, -kFar}, {kFar, kFar, kFar}}; }
  void Add(const RoughBox& other);
  // Of a volume's regions, the share that it touches.
  double ShareOf(const RegionGrid& regions) const;
};

// Thread-bound. Its calls queue work in the device's stream. An error leaves the scene as it was,
// and what could not be drawn is drawn with the next Update.
class CudaVolume final : private SceneObserver {
 public:
  CudaVolume(Device& device, Uploader& uploader, const Tuning& tuning);

  // All or nothing. InvalidArgument for a malformed delta, ResourceExhausted if its arrays do not
  // fit the device.
  absl::Status Apply(std::span<const std::byte> delta, BulkSource* bulk);

  // Everything is to be drawn anew; with `all_dirty` also where nothing is.
  absl::Status SetView(DeviceTiles tiles, const Affine& view, bool all_dirty);

  // A frame: TakeIn takes in what has come and gone, and ListDirty finds what is dirty, by group.
  // Then, each group once, DrawGroup draws that: into the tiles, and marks the slices that look at it;
  // or, if there is `packed`, straight into pictures. If DrawsApart, groups may be drawn in streams of
  // their own, after what ListDirty has queued.
  absl::Status TakeIn();
  absl::Status ListDirty(const DrawGroups& groups);
  // About how many items lie where something is dirty; after TakeIn.
  double ItemsToDraw() const;
  bool DrawsApart() const {
    return CountDeferred([](uint32_t) { return true; }) == 0;
  }
  absl::Status DrawGroup(uint32_t group, const SliceIndexView& slices, const PackedView* packed,
                         cudaStream_t stream);
  // The frame's counters have been told, and begin anew.
  void CountersAreClear() { counted_ = false; }

  // The colours of voxels, after a frame; for who asks. `out` is on the device.
  absl::Status Read(const Box3& box, uint32_t* out);

  VolumeView view() const { return tiles_.view(); }
  uint32_t singular_drawables() const { return singular_; }
  // In the host's memory.
  uint64_t host_bytes() const;

 private:
  // By which index a drawable's items are drawn.
  enum class IndexedBy : uint8_t { kPairs, kLines, kPoints, kTriangles };
  // What the host knows of a slot of the table.
  struct Slot {
    uint32_t items = 0;
    bool singular = false;
    IndexedBy indexed_by = IndexedBy::kPairs;
    RoughBox box = RoughBox::Everything();
    uint32_t regions_each = 0;        // that a triangle touches at most
    Block tiles, begin, voxels;       // of what the CPU has drawn
    Block hoisted, reach, covered;    // of an implicit shape (ImplicitPlace; CoveredView)
    Block vertices, indices, colors;  // of a curve that was cut
    Block inside;                     // of a mesh that is filled
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
  // The index that its items are drawn by, if they turn out to be thin, or small.
  static IndexedBy IndexFor(const GeometryRecord& record);
  // Decides it for a drawable that comes.
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
  // Forgets all places, in tables and indexes. All drawables are pending.
  void EnterAllAgain();
  absl::Status KillPairs();
  absl::Status MarkLeft();
  absl::Status MarkPairs(std::span<const uint32_t> slots);
  absl::Status Enter();
  // `entries`: null, or what the table does not have of these drawables, which then come together.
  absl::Status EnterRegions(IndexedBy by, std::span<const Drawable* const> drawables,
                            std::span<const uint32_t> slots, const FewEntries* entries);
  // Whether they are lines, or points, of one layer, and so few that an index of them puts them
  // into the table.
  bool AreFew(std::span<const uint32_t> slots, std::span<const TableEntry> entries) const;
  // Of one layer, no more than may come at once.
  struct Arriving {
    std::vector<uint32_t> slots;
    std::vector<uint64_t> first = {0};
    bool drawn = false, mixed = false;
    uint32_t regions_each = 0;
  };
  absl::Status EnterGroup(RegionIndex& index, uint32_t layer, const Arriving& arriving,
                          const FewEntries* entries);
  absl::Status EnterPairs(std::span<const PairedDrawable> drawables);

  // All that a layer has, if it is many boxes, spheres and cylinders: where the layer moves, the device
  // places them anew, and the host has nothing to do for each (cuda_volume_crowds.cc).
  struct Crowd {
    std::vector<const Drawable*> drawables;
    std::vector<uint32_t> slots;      // of each, with one item: none is without an inverse
    uint32_t layer = 0;               // its slot
    bool moved = false;               // and not yet placed anew
    bool marks = false;               // where they were is to be drawn anew
    Block there, firsts, transforms;  // on the device, once they are needed

    uint32_t count() const { return static_cast<uint32_t>(slots.size()); }
  };
  using Crowds = absl::flat_hash_map<const Layer*, Crowd>;
  // Of drawables that come: those that are crowds get their pairs, and are no more among `pairs`.
  absl::Status EnterCrowds(std::span<const Drawable* const> drawables,
                           std::span<const uint32_t> slots, Crowds& formed,
                           std::vector<PairedDrawable>& pairs);
  // Places those anew whose layers have moved. What cannot stay together leaves, and comes anew.
  absl::Status MoveCrowds();
  // False: it cannot stay together.
  absl::StatusOr<bool> MoveCrowd(const Layer& layer, Crowd& crowd);
  // What is needed of it there and is not; its transforms only if it has moved.
  absl::Status BringCrowd(Crowd& crowd);
  // A layer's drawables are on their own again: one comes, or goes.
  void Disperse(const Layer* layer);
  void DisperseAll();
  // Puts off all that the index of pairs has.
  void DeferPairs();
  // What is drawn by a group's number, at the same time as other groups.
  absl::StatusOr<DrawView> ViewForDrawing(uint32_t group);
  // The regions that `view` lists.
  absl::Status DrawListed(DrawView& view, DrawTo to, cudaStream_t stream);
  // The items, of layers for which seen(slot) is true, that have no lists.
  using Seen = std::function<bool(uint32_t)>;
  uint64_t CountDeferred(const Seen& seen) const;
  absl::Status DrawInPasses(const DrawView& view, DrawTo to, const Seen& seen);
  // Gives them lists of what `pass` draws. False if not all have: there was no room. Then only if
  // `some` they can be drawn all the same.
  absl::StatusOr<bool> SortPass(const RegionGrid& pass, const Seen& seen, bool some);
  void EndPass();
  absl::Status Draw(DrawView& view, DrawTo to, cudaStream_t stream);
  absl::Status GrowTable();
  absl::Status PutDrawables(std::span<const uint32_t> slots, std::span<const TableEntry> entries);
  // What the host works out of a drawable that comes, until it has gone over.
  struct WorkedOut {
    std::vector<uint32_t> hoisted;  // of an implicit shape
    std::unique_ptr<Cut> cut;       // of what is curved
  };
  // An implicit shape that was placed: which voxels it covers is yet to be found.
  struct PlacedImplicit {
    CoveredView view;
    cudaKernel_t formula = nullptr;  // by which; null: by interpreting its program
  };
  static const GeometryView& OnHost(const Drawable& drawable);
  TableEntry EntryOf(const Drawable& drawable, WorkedOut& worked_out) const;
  // Queues its way over, and finds room for what the device works out. It is to live until then.
  absl::Status Place(const Drawable& drawable, const WorkedOut& worked_out, TableEntry& entry,
                     uint32_t slot);
  absl::Status PlaceImplicit(const Drawable& drawable, std::span<const uint32_t> hoisted,
                             TableEntry& entry, uint32_t slot);
  absl::Status PlaceFilled(TableEntry& entry, Slot& slot);
  // Where a geometry is, or the whole volume.
  Box3 BoundsOf(const Drawable& drawable, const Affine& map) const;
  absl::Status PlaceCut(const Cut& cut, TableEntry& entry, Slot& slot);
  // Which voxels implicit shapes cover, of those that were placed and are in the table
  // (cuda_volume_implicit.cc).
  absl::Status FindImplicit();
  template <typename F>
  absl::Status ForViews(std::vector<CoveredView> all, F&& f);
  absl::StatusOr<std::optional<Block>> RoomToKeep(uint64_t bytes);
  // Has the CPU draw it; the result goes over, and into `slot`.
  absl::Status DrawInto(TableEntry& entry, const Drawable& drawable, Slot& slot);
  uint32_t TakeSlot();

  Device& device_;
  Uploader& uploader_;
  Scene scene_;
  DeviceTiles tiles_;
  Affine view_;
  bool listed_ = false;  // tiles were taken for clean and not drawn: any may be dirty
  bool counted_ = true;  // the counters have begun
  RoughBox dirty_ = RoughBox::Nothing();
  DrawGroups groups_;  // of the frame under way
  ListBudget list_budget_;
  PairIndex index_;  // of all that the others do not have
  LineIndex lines_;
  PointIndex points_;
  bool lines_suit_ = false, points_suit_ = false;  // the volume is not too large for them
  TriangleIndex triangles_;
  CompiledFormulas formulas_;
  // Of blocks of regions: a pass that failed last, with so many items without lists, halved. As many
  // planes along z go in the next.
  int32_t pass_planes_ = INT32_MAX;
  uint64_t pass_items_ = 0;

  Block table_;
  std::vector<Slot> slots_;
  std::vector<uint32_t> free_slots_;
  std::vector<uint32_t> dead_slots_;  // not free before the index has forgotten them
  uint64_t live_items_ = 0, dead_items_ = 0;
  absl::flat_hash_map<const Drawable*, uint32_t> slot_of_;
  absl::flat_hash_set<const Drawable*> pending_;
  std::vector<PlacedImplicit> placed_;  // of those that are entering
  Crowds crowds_;
  const uint32_t least_crowd_;

  Block looks_, half_spaces_, cylinders_;
  Block below_[kMostDrawGroups];                    // DrawView::below of each group
  std::vector<LayerLook> looks_now_, looks_there_;  // by slot; what the device has
  std::vector<VoxelHalfSpace> half_spaces_now_, half_spaces_there_;
  std::vector<VoxelCylinder> cylinders_now_, cylinders_there_;
  absl::flat_hash_map<uint64_t, uint32_t> layer_slots_;
  std::vector<uint32_t> free_layer_slots_;

  std::vector<uint32_t> marks_;  // slots whose tiles are to be drawn anew
  std::vector<uint32_t> left_;   // slots that have left
  // Memory of geometries that have left, until their tiles are marked.
  std::vector<std::shared_ptr<const RetainedGeometry>> kept_;

  // The arrays of the delta under way, all at `arrays_`: those that lie in the delta, from
  // `arrays_begin_` on, at its beginning; those in bulk memory, by where their positions lie on the
  // host, where `bulk_` says.
  const std::byte* arrays_begin_ = nullptr;
  std::shared_ptr<Block> arrays_;
  absl::flat_hash_map<const float*, size_t> bulk_;
  // Of its geometries' positions, by where these lie on the host.
  absl::flat_hash_map<const float*, GeometryBounds> bounds_;
  uint32_t singular_ = 0;
  std::unique_ptr<Executor> executor_;  // for what the CPU draws; made when it is asked for
};

}  // namespace voxeld::gpu::cuda
