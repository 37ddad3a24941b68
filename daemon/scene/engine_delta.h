// What an engine holds of the scene, and the delta that brings it to another snapshot, whichever.
//
//   EngineScene scene;                          // an engine that holds nothing
//   size_t size = scene.Plan(snapshot);         // what differs; 0: nothing
//   DeltaWriter writer(block.bytes());
//   scene.Write(writer);                        // writer.size() == size
//   block.Refer(writer.TakeReferred());         // what lies in bulk memory is not copied
//
// An instance becomes one drawable for each primitive that it draws;
// all share the primitive's geometry. Maps of nested parts are composed from the outside in:
// ((entity ∘ part) ∘ part of the part) …
//
// Some entities may be drawn by the CPU of an engine that has a GPU, or left out: `choose` says so
// when they are drawn.
//
// Single-threaded. Plan takes it that the delta will be applied; if it was not, call Forget.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "daemon/scene/snapshot.h"
#include "gpu/delta.h"

namespace voxeld::daemon {

enum class DrawnWhere : uint8_t { kEngine, kCpu, kNowhere };

class EngineScene {
 public:
  // Asked for each entity that is drawn or drawn anew.
  using Choose = std::function<DrawnWhere(const OwnedName& layer, const std::string& id,
                                          const Entity& entity)>;

  // `breathe` (may be empty) is called now and then during long work, so that its owner can do what
  // will not wait. It must not call back. `choose` empty: everything by the engine.
  explicit EngineScene(std::function<void()> breathe = nullptr, Choose choose = nullptr);

  // Of what is held (since the last Plan); null: nothing.
  const SnapshotPtr& held() const { return held_; }

  // Works out the delta from what is held to `next`, and takes that to be held from now on. Answers
  // its size in bytes; 0 if nothing that an engine sees differs. The cost is of what differs.
  size_t Plan(SnapshotPtr next);
  // Writes the delta planned last, once.
  void Write(gpu::DeltaWriter& writer);

  // The engine is new, or nobody knows what it holds: the next delta begins with a reset.
  void Forget();

  // What is held, for tests and figures.
  size_t geometries() const { return geometries_.size(); }
  // Bytes of the indexes of what is held.
  uint64_t memory_bytes() const;

 private:
  // A geometry that is drawn in both ways is two to the engine.
  struct GeometryKey {
    const GeometryData* geometry = nullptr;
    bool by_cpu = false;
    bool operator==(const GeometryKey&) const = default;
    template <typename H>
    friend H AbslHashValue(H h, const GeometryKey& k) {
      return H::combine(std::move(h), k.geometry, k.by_cpu);
    }
  };
  struct HeldGeometry {
    GeometryPtr geometry;
    bool by_cpu = false;
    GeometryKey key() const { return {geometry.get(), by_cpu}; }
  };
  struct Part {
    uint64_t drawable = 0;
    HeldGeometry geometry;
  };
  struct GeometryUse {
    uint64_t id = 0;
    uint64_t uses = 0;
    bool fresh = false;  // put by the delta that is being planned
  };
  struct Flat {
    GeometryPtr geometry;
    gpu::Affine transform;
    uint32_t tint;
  };

  void PlanLayer(const OwnedName& key, const Layer* before, const Layer* now);
  void PutLayer(const OwnedName& key, const Layer& layer);
  // Of layers that have not changed themselves, puts those whose mask has come, gone, or been made anew.
  void PlanMasks(const Snapshot& before);
  void PlanInstances(const Snapshot& before, const Snapshot& next);
  void Draw(const OwnedName& key, const Layer& layer, const std::string& id, const Entity& entity);
  void Undraw(const Entity& entity);
  void Flatten(uint64_t owner, const Content& content, const gpu::Affine& map, uint32_t tint);
  uint64_t Use(const HeldGeometry& geometry);
  void Release(const HeldGeometry& geometry);
  // Shrinks indexes that have grown much larger than their contents.
  void GiveBackSlots();
  void Breathe();

  const std::function<void()> breathe_;
  const Choose choose_;
  uint32_t since_breath_ = 0;

  SnapshotPtr held_;
  bool reset_ = true;  // the next delta begins with one
  uint64_t next_id_ = 1;
  absl::flat_hash_map<GeometryKey, GeometryUse> geometries_;
  std::unordered_map<uint64_t, std::vector<Part>> drawn_;  // by number of entity
  uint64_t parts_bytes_ = 0;                               // of the vectors in it

  // The plan.
  SnapshotPtr next_;
  std::vector<Flat> flat_;
  // Entities to draw anew though they have not changed: objects that they draw have. By number.
  std::map<uint64_t, EntityPlace> redraw_;
  absl::flat_hash_set<OwnedName> renumbered_;  // layers that came, went, or were made anew
  std::vector<HeldGeometry> put_geometries_;
  std::vector<HeldGeometry> unused_;  // dropped to no use at some time; may be in use again
  std::vector<uint64_t> drop_geometries_, drop_drawables_, drop_layers_;
  std::vector<gpu::LayerRecord> put_layers_;
  std::deque<gpu::DrawableRecord> put_drawables_;  // as DeltaPlan::steps
  bool put_reset_ = false;
};

}  // namespace voxeld::daemon
