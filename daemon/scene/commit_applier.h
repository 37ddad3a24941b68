// Applies one commit's operations to a draft: the rules of the scene,
// and every refusal that depends on it.
//
// A refused operation leaves its entity, layer or object as it was and gives one Issue. What is
// upserted between FrameBegin and FrameEnd takes effect at FrameEnd, in place of all that the layer
// held; a frame still open when the commit ends is discarded whole, with one Issue (OUT_OF_ORDER)
// of its FrameBegin, and every operation in it counts as refused.
//
// A commit can be applied piece by piece, so that a large one does not hold up others: between two calls the draft may
// be rebased, and `room` and `author` may change. Single-threaded.
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

// Whose commit it is.
struct Author {
  uint64_t owner = 0;
  WriterPtr writer;
  bool suppressed = false;  // hidden by an operator
  bool may_erase = true;    // OpenOptions::may_erase
  // The owner's quotas, if an operator set any.
  uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;
};

// The memory that a scene may grow into.
struct MemoryRoom {
  uint64_t bytes = UINT64_MAX;  // that the scene, and what engines derive from it, may grow by
  uint64_t engines = 0;         // each of which derives all of it
  // The growth by unfinished commits of other owners. It counts as part of the scene.
  OwnerTally promised;
};

// A display's map from the scene to its voxels, for range checks.
struct DisplayView {
  std::string display;
  gpu::Affine scene_to_voxel;
};

class CommitApplier {
 public:
  // All are borrowed.
  CommitApplier(Draft& draft, const Limits& limits, const std::vector<DisplayView>& views,
                const MemoryRoom& room, const Author& author, sync::TimeNs now);

  // Operations must have passed CheckAlone and be no Commit. They live until End, and their content is taken. After a
  // FrameEnd, `replaying` answers true until Replay has been called for each operation of the frame; no other may be
  // applied meanwhile.
  void Apply(Operation& operation);
  bool replaying() const { return replayed_.has_value(); }
  // Returns: the operation that the next Replay applies; null: it ends the frame.
  const Operation* next_replayed() const {
    const bool is_last = replayed_->next == replayed_->operations.size();
    return is_last ? nullptr : replayed_->operations[replayed_->next];
  }
  void Replay();
  void End();
  // The layers that have been changed, by name.
  const std::set<std::string>& touched() const { return touched_; }

  const Refusals& refusals() const { return refusals_; }
  uint64_t applied() const { return applied_; }
  uint64_t refused() const { return refused_; }

  // True if every applied operation acted on layers that were hidden (or not there) before the
  // commit and are hidden after it. Operations on objects act on no layer, so with them, or with
  // none at all, false.
  bool hidden() const;

 private:
  struct Frame {
    uint64_t begin_sequence = 0;
    std::vector<Operation*> operations;
  };
  // A frame that has ended and takes effect.
  struct Replayed {
    std::string layer;
    std::vector<Operation*> operations;
    size_t next = 0;
    EntityMap replaced;  // what the layer held before
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
  // The layer whose open frame takes this operation; null: none does.
  Frame* FrameOf(const Operation& operation);
  void Applied(const std::string& layer);
  void Refuse(const Operation& operation, std::string layer, std::string id, std::string field,
              Reason reason, std::string message);
  // What is wrong with `in_layer` on some display; nothing if it is in range on all.
  std::optional<std::string> OutOfRange(const gpu::Affine& layer_transform,
                                        const Bounds& in_layer) const;

  // ---- curves that may be drawn coarser than their error on some display (coarse_curves.cc)
  // So many geometries are looked at for an operation, so that a layer may be moved at every frame.
  static constexpr int kMostLookedAt = 4096;
  // What is wrong with the first such geometry of `content`, which is drawn by `map`; counts `left`, of the geometries
  // that may be looked at, down.
  std::optional<Issue> CoarseOf(const Content& content, const gpu::Affine& map, int* left) const;
  // Tells of one entity, or of those that a layer holds: what is met with the first kMostLookedAt.
  void TellIfCoarse(const Operation& operation, const std::string& layer, const std::string& id,
                    const EntityData& entity, const char* field, int* left = nullptr);
  void TellOfCoarseIn(const Operation& operation, const std::string& name, const Layer& layer,
                      const char* field);

  // Returns: why the author may not come to `wanted` (layers aside); nothing if quotas and memory allow it.
  std::optional<std::string> OverQuota(const OwnerTally& wanted) const;
  std::optional<std::string> OverMemory(const OwnerTally& wanted) const;
  bool RefusedNewLayer(const Operation& operation, const std::string& layer,
                       const std::string& field);

  // ---- objects (object_rules.cc)
  // Objects that refer to `name`, directly or through others.
  std::set<std::string> ObjectsAbove(const std::string& name) const;
  // `name` with `data`, and every object above it, with what is derived worked out anew;
  // parts before wholes.
  std::vector<std::pair<std::string, Object>> Derive(const std::string& name,
                                                     const ObjectDataPtr& data) const;
  // Entities that are instances of `name`; at most `limit`.
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

// What can be said of an operation without the scene:
// singular transforms, counts against the limits.
std::optional<Issue> CheckAlone(const Operation& operation, const Limits& limits);

}  // namespace voxeld::daemon
