// Tracks what an engine holds of the scene, and computes the delta that brings it to any other
// snapshot.
//
//   EngineScene scene;                          // an engine that holds nothing
//   size_t size = scene.Plan(snapshot);         // the differences; 0: none
//   DeltaWriter writer(block.bytes());
//   scene.Write(writer);                        // writer.size() == size
//   block.Refer(writer.TakeReferred());         // data in bulk memory is not copied
//
// An instance becomes one drawable for each primitive that it draws; all share the primitive's
// geometry. Maps of nested parts are composed from the outside in: ((entity ∘ part) ∘ part of the
// part) …
//
// Some entities may be drawn by the CPU of an engine that has a GPU, or left out: `choose` decides
// when they are drawn.
//
// Single-threaded. Plan assumes that the delta will be applied; call Forget if it was not.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "daemon/scene/snapshot.h"
#include "gpu/delta.h"

namespace voxeld::daemon {

enum class DrawnWhere : uint8_t { kEngine, kCpu, kNowhere };

class EngineScene {
 public:
  // Called for each entity that is drawn or redrawn.
  using Choose = std::function<DrawnWhere(const OwnedName& layer, const std::string& id,
                                          const Entity& entity)>;

  // `breathe` (may be empty) is called regularly during long work, so that its owner can do urgent
  // work. It must not call back. If `choose` is empty, the engine draws everything.
  explicit EngineScene(std::function<void()> breathe = nullptr, Choose choose = nullptr);

  // Replaces `breathe`. Requires: no call is running.
  void SetBreathe(std::function<void()> breathe) { breathe_ = std::move(breathe); }

  // Of what is held (since the last Plan); null: nothing.
  const SnapshotPtr& held() const { return held_; }

  // Computes the delta from the held snapshot to `next`, and treats `next` as held from now on.
  // Returns: the delta's size in bytes; 0 if an engine would see no difference. The cost depends on
  // the differences only.
  size_t Plan(SnapshotPtr next);
  // Writes the delta of the last Plan. Call once.
  void Write(gpu::DeltaWriter& writer);

  // Declares that the engine is new or its content is unknown. The next delta begins with a reset.
  void Forget();

  // Counts of the held content, for tests and statistics.
  size_t geometries() const { return geometries_.size(); }
  // Returns: the size in bytes of the indexes of the held content.
  uint64_t memory_bytes() const;

 private:
  // The engine stores a geometry twice if it is drawn by both the GPU and the CPU.
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
  // Puts unchanged layers whose mask was added, removed or recreated.
  void PlanMasks(const Snapshot& before);
  void PlanInstances(const Snapshot& before, const Snapshot& next);
  void Draw(const OwnedName& key, const Layer& layer, const std::string& id, const Entity& entity);
  void Undraw(const Entity& entity);
  void Flatten(uint64_t owner, const Content& content, const gpu::Affine& map, uint32_t tint);
  uint64_t Use(const HeldGeometry& geometry);
  void Release(const HeldGeometry& geometry);
  // Shrinks indexes that have become much larger than their contents.
  void GiveBackSlots();
  void Breathe();

  std::function<void()> breathe_;
  const Choose choose_;
  uint32_t since_breath_ = 0;

  SnapshotPtr held_;
  bool reset_ = true;  // the next delta begins with a reset
  uint64_t next_id_ = 1;
  absl::flat_hash_map<GeometryKey, GeometryUse> geometries_;
  std::unordered_map<uint64_t, std::vector<Part>> drawn_;  // by entity number
  uint64_t parts_bytes_ = 0;                               // size of the vectors in it

  // The plan.
  SnapshotPtr next_;
  std::vector<Flat> flat_;
  // Unchanged entities to redraw because the objects that they draw have changed. By entity number.
  std::map<uint64_t, EntityPlace> redraw_;
  absl::flat_hash_set<OwnedName> renumbered_;  // layers that were added, removed or recreated
  std::vector<HeldGeometry> put_geometries_;
  std::vector<HeldGeometry> unused_;  // were unused at some point; may be in use again
  std::vector<uint64_t> drop_geometries_, drop_drawables_, drop_layers_;
  std::vector<gpu::LayerRecord> put_layers_;
  std::deque<gpu::DrawableRecord> put_drawables_;  // a deque, like DeltaPlan::steps
  bool put_reset_ = false;
};

}  // namespace voxeld::daemon
