// What an engine holds of a scene: geometries, drawables and layers by id,
// and how a delta changes them.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "absl/status/status.h"
#include "gpu/assemble/bins.h"
#include "gpu/clip.h"
#include "gpu/curves/cut.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// Immutable.
struct RetainedGeometry {
  GeometryView view;
  std::shared_ptr<const void> memory;  // what its arrays lie in; none if there are none
  uint64_t copied_bytes = 0;           // of `memory`, if it is host memory of this geometry alone
};

// Bulk memory as it is, else a copy of its arrays: the delta is gone after it was applied.
RetainedGeometry KeepOnHost(const GeometryView& view);

struct Layer;

struct Drawable {
  DrawableRecord record;
  std::shared_ptr<const RetainedGeometry> geometry;
  Layer* layer = nullptr;

  // Derived, in voxel space; empty while `pending`.
  std::vector<Int3> vertices;
  std::vector<uint32_t> hoisted;  // of an implicit shape
  std::unique_ptr<Cut> cut;       // of what is curved
  std::vector<uint32_t> inside;   // of a mesh that is filled, if there is room for it
  Source source;
  Bins bins;
  uint64_t derived_bytes = 0;
  uint64_t index_bytes = 0;  // of the budget (passes.h), for as long as bins and `inside` have it
  uint64_t list_bytes = 0;   // likewise, of the lists of its tiles and of `cut`
  bool pending = false;      // awaits preparation
  bool leaving = false;      // its entries are being taken out of the tiles
  // There was no room to list its tiles, so bins and `cut` are empty. It may be in any tile of `tile_box`.
  bool unlisted = false;
  Box3 tile_box;
};

struct Layer {
  LayerRecord record;
  std::optional<VoxelClip> clip;  // derived, in voxel space; none: to be mapped anew
  absl::flat_hash_set<Drawable*> drawables;
  int rank = 0;                 // in the order of combination
  const Layer* mask = nullptr;  // if it has one that is there
  bool drawn = false;           // it is seen, or the mask of one that is; as of the last delta

  // It is visible, and has no mask or one that is there.
  bool seen() const { return record.visible != 0 && (record.has_mask == 0 || mask != nullptr); }
};

// Whether what is drawn in a layer of this record comes out as in one of the other, if nothing moves.
bool LooksSame(const LayerRecord& a, const LayerRecord& b);

struct DeltaPlan;

// Told of changes while a delta is applied, before they are made.
struct SceneObserver {
  virtual ~SceneObserver() = default;
  // The delta is in order. An error here refuses it whole.
  virtual absl::Status OnPlan(const DeltaPlan&) { return absl::OkStatus(); }
  // What is kept of a new geometry: bulk memory as it is, else a copy of its arrays, unless an engine
  // has them elsewhere. The delta is gone after Apply.
  virtual RetainedGeometry Retain(const GeometryView& view) { return KeepOnHost(view); }
  // It goes, or what it is drawn from changes.
  virtual void OnLeave(Drawable& drawable) = 0;
  // It is new, or has changed (after OnLeave); `layer` and `geometry` are set.
  virtual void OnEnter(Drawable& drawable) = 0;
  // It is about to move, after OnLayerLook. True: its drawables do so together, and neither leave nor enter.
  virtual bool OnLayerMove(Layer&) { return false; }
  // Its drawables stay as they are, but combine otherwise (LooksSame is false, or it moves).
  virtual void OnLayerLook(Layer& layer, const LayerRecord& next) = 0;
};

class Scene {
 public:
  // Applies a delta, all of it or, if it is malformed, nothing (InvalidArgument). Drawables that
  // left and do not come back are moved to `gone`.
  // `bulk` finds what the delta refers to.
  absl::Status Apply(std::span<const std::byte> delta, BulkSource* bulk, SceneObserver& observer,
                     std::vector<std::unique_ptr<Drawable>>& gone);

  const absl::flat_hash_map<uint64_t, std::unique_ptr<Drawable>>& drawables() const {
    return drawables_;
  }
  const absl::flat_hash_map<uint64_t, std::unique_ptr<Layer>>& layers() const { return layers_; }
  // Sees to it that every layer has its `clip`. `anew`: the view has changed.
  void MapClips(const Affine& view, bool anew);
  // How many drawables use it; −1 if there is no such id.
  int64_t GeometryUses(uint64_t id) const;
  int64_t LayerUses(uint64_t id) const;
  const Drawable* FindDrawable(uint64_t id) const;
  // Returns: bytes of records, indexes and copies of arrays, without derived data.
  uint64_t memory_bytes() const;

 private:
  struct GeometryEntry {
    std::shared_ptr<const RetainedGeometry> geometry;
    absl::flat_hash_set<Drawable*> users;
  };

  void PutGeometry(const GeometryView& view, SceneObserver& observer);
  void PutDrawable(const DrawableRecord& record, SceneObserver& observer);
  void PutLayer(const LayerRecord& record, SceneObserver& observer);
  std::unique_ptr<Drawable> TakeDrawable(uint64_t id, SceneObserver& observer);
  // Shrinks maps that have grown much larger than their contents.
  void GiveBackSlots();
  void RankLayers();
  void LinkMasks();

  absl::flat_hash_map<uint64_t, GeometryEntry> geometries_;
  absl::flat_hash_map<uint64_t, std::unique_ptr<Layer>> layers_;
  absl::flat_hash_map<uint64_t, std::unique_ptr<Drawable>> drawables_;
  uint64_t copied_bytes_ = 0;  // of all geometries' arrays
};

}  // namespace voxeld::gpu
