// Applies the operations of one commit to a draft. Implements the rules of the scene and every
// refusal that depends on it.
//
// A refused operation leaves its entity, layer or object unchanged and adds one Issue. Upserts
// between FrameBegin and FrameEnd take effect at FrameEnd and replace everything that the layer
// held. A draw batch that is still open at the end of the commit is discarded as a whole, with one
// Issue (OUT_OF_ORDER) for its FrameBegin, and all its operations count as refused.
//
// A commit can be applied in pieces, so that a large one does not delay others: between two calls
// the draft may be rebased, and `room` and `author` may change. Single-threaded.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/scene/draft.h"
#include "daemon/scene/operation.h"

namespace voxeld::daemon {

// The owner of the commit.
struct Author {
  uint64_t owner = 0;
  WriterPtr writer;
  bool suppressed = false;  // hidden by an operator
  bool may_erase = true;    // OpenOptions::may_erase
  // The owner's quotas, if an operator has set any.
  uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;
};

// The memory into which a scene may grow.
struct MemoryRoom {
  uint64_t bytes = UINT64_MAX;  // allowed growth of the scene and of what engines derive
  uint64_t engines = 0;         // number of engines, each of which derives all of it
  // Growth by unfinished commits of other owners. It counts as part of the scene.
  OwnerTally promised;
};

// A display's map from the scene to its voxels, for range checks.
struct DisplayView {
  std::string display;
  gpu::Affine scene_to_voxel;
};

class CommitApplier {
 public:
  // All arguments are borrowed.
  CommitApplier(Draft& draft, const Limits& limits, const std::vector<DisplayView>& views,
                const MemoryRoom& room, const Author& author, sync::TimeNs now);

  // Applies an operation. Requires: it has passed CheckAlone, is not a Commit, and lives until End;
  // its content is moved out. After a FrameEnd, `replaying` returns true until Replay has been
  // called for each operation of the draw batch. No other operation may be applied meanwhile.
  void Apply(Operation& operation);
  bool replaying() const { return replayed_.has_value(); }
  // Returns: the operation that the next Replay applies; null: the next Replay ends the draw batch.
  const Operation* next_replayed() const {
    const bool is_last = replayed_->next == replayed_->operations.size();
    return is_last ? nullptr : replayed_->operations[replayed_->next];
  }
  void Replay();
  void End();
  // Returns: the names of the layers that have been changed.
  const std::set<std::string>& touched() const { return touched_; }

  const Refusals& refusals() const { return refusals_; }
  uint64_t applied() const { return applied_; }
  uint64_t refused() const { return refused_; }

  // Returns: whether every applied operation changed layers that were hidden (or missing) before
  // the commit and are hidden after it. False if no layer was changed, or if objects were.
  bool hidden() const;

 private:
  struct Frame {
    uint64_t begin_sequence = 0;
    std::vector<Operation*> operations;
  };
  // A draw batch that has ended and is being applied.
  struct Replayed {
    std::string layer;
    std::vector<Operation*> operations;
    size_t next = 0;
    EntityMap replaced;  // the layer's previous entities
  };
  using ObjectDataPtr = std::shared_ptr<const ObjectData>;

  void Dispatch(Operation& operation);
  void Do(Operation& operation, Upsert& upsert);
  void Do(Operation& operation, Delete& del);
  void Do(Operation& operation, SetTransform& set);
  void Do(Operation& operation, LayerState& state);
  void Do(Operation& operation, FrameBegin& begin);
  void Do(Operation& operation, FrameEnd& end);
  void Do(Operation& operation, DefineObject& define);
  void Do(Operation& operation, DeleteObject& del);
  void Do(Operation& operation, Commit& commit);

  OwnedName Key(const std::string& name) const { return {author_.owner, name}; }
  Layer& EditLayer(const OwnedName& key) {
    Layer& layer = draft_.EditLayer(key, author_.writer);
    layer.suppressed = author_.suppressed;
    return layer;
  }
  // Returns: the open draw batch that takes this operation; null: none.
  Frame* FrameOf(const Operation& operation);
  void Applied(const std::string& layer);
  void Refuse(const Operation& operation, std::string layer, std::string id, std::string field,
              Reason reason, std::string message);
  // Returns: how `in_layer` is out of range on some display; nothing if it is in range on all.
  std::optional<std::string> OutOfRange(const gpu::Affine& layer_transform,
                                        const Bounds& in_layer) const;

  // ---- curves that may be drawn more coarsely than their error bound (coarse_curves.cc)
  // Limits the geometries checked per operation, so that a layer can be moved at every frame.
  static constexpr int kMostLookedAt = 4096;
  // Returns: an issue for the first such geometry of `content`, drawn with `map`. Decrements
  // `left`, the number of geometries that may still be checked.
  std::optional<Issue> CoarseOf(const Content& content, const gpu::Affine& map, int* left) const;
  // Reports this for one entity, or for the entities of a layer, within the first kMostLookedAt
  // geometries.
  void TellIfCoarse(const Operation& operation, const std::string& layer, const std::string& id,
                    const EntityData& entity, const char* field, int* left = nullptr);
  void TellOfCoarseIn(const Operation& operation, const std::string& name, const Layer& layer,
                      const char* field);

  // Returns: why the author may not reach `wanted` (layers aside); nothing if quotas and memory
  // allow it.
  std::optional<std::string> OverQuota(const OwnerTally& wanted) const;
  std::optional<std::string> OverMemory(const OwnerTally& wanted) const;
  bool RefusedNewLayer(const Operation& operation, const std::string& layer,
                       const std::string& field);

  // ---- objects (object_rules.cc)
  // Returns: the objects that refer to `name`, directly or through others.
  std::set<std::string> ObjectsAbove(const std::string& name) const;
  // Returns: `name` with `data` and every object above it, with derived values recomputed; parts
  // before wholes.
  std::vector<std::pair<std::string, Object>> Derive(const std::string& name,
                                                     const ObjectDataPtr& data) const;
  // Returns: the entities that are instances of `name`; at most `limit`.
  std::vector<UseKey> InstancesOf(const std::string& name, size_t limit = SIZE_MAX) const;
  std::vector<std::string> ObjectsUsing(const std::string& name) const;
  bool RefusedDefinition(const Operation& operation, const DefineObject& define);
  bool RefusedDerived(const Operation& operation, const DefineObject& define,
                      const std::vector<std::pair<std::string, Object>>& derived);

  Draft& draft_;
  const Limits& limits_;
  const std::vector<DisplayView>& views_;
  const MemoryRoom& room_;
  const Author& author_;
  const sync::TimeNs now_;

  std::map<std::string, Frame> frames_;
  std::optional<Replayed> replayed_;
  std::set<std::string> touched_;
  bool objects_touched_ = false;
  Refusals refusals_;
  uint64_t applied_ = 0, refused_ = 0;
};

// Checks what can be checked without the scene: singular transforms, and counts against the limits.
std::optional<Issue> CheckAlone(const Operation& operation, const Limits& limits);

}  // namespace voxeld::daemon
