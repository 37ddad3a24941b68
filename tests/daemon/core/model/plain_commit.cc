// Applies one commit to the plain scene: operation by operation, on a copy of its owner's part.
#include <algorithm>

#include "daemon/scene/snapshot.h"
#include "tests/daemon/core/model/plain_scene.h"

namespace voxeld::daemon::model {

class PlainScene::Commit {
 public:
  Commit(PlainScene& scene, const PlainAuthor& author, sync::TimeNs now)
      : scene_(scene),
        author_(author),
        now_(now),
        before_(scene.owners.at(author.owner)),
        owner_(scene.owners.at(author.owner)) {}

  void Take(const Operation& operation) {
    if (const std::string* layer = RecordedIn(operation);
        layer != nullptr && open_.contains(*layer)) {
      open_.at(*layer).inside.push_back(&operation);
      return;
    }
    std::visit([&](const auto& op) { Do(operation.sequence, op); }, operation.op);
  }

  PlainVerdict End() {
    for (const auto& [layer, frame] : open_) {
      verdict_.refused_operations += frame.inside.size() + 1;
      verdict_.refusals.push_back({frame.sequence, Reason::kOutOfOrder});
    }
    verdict_.hidden = OnlyHidden();
    return verdict_;
  }
  // Reverts the commit.
  void Forget() { owner_ = before_; }

 private:
  struct OpenFrame {
    uint64_t sequence = 0;
    std::vector<const Operation*> inside;
  };

  static const std::string* RecordedIn(const Operation& operation) {
    if (const auto* op = std::get_if<Upsert>(&operation.op)) return &op->layer;
    if (const auto* op = std::get_if<SetTransform>(&operation.op)) return &op->layer;
    const auto* op = std::get_if<Delete>(&operation.op);
    return op == nullptr || op->what == Delete::What::kAllMine ? nullptr : &op->layer;
  }

  bool OnlyHidden() const {
    if (objects_ || touched_.empty()) return false;
    bool any = false;
    for (const std::string& name : touched_) {
      for (const PlainOwner* owner : std::initializer_list<const PlainOwner*>{&before_, &owner_}) {
        const auto layer = owner->layers.find(name);
        if (layer == owner->layers.end()) continue;
        any = true;
        if (layer->second.visible && !owner->hidden) return false;
      }
    }
    return any;
  }

  void Refuse(uint64_t sequence, Reason reason, Reason or_else = Reason::kUnspecified) {
    ++verdict_.refused_operations;
    verdict_.refusals.push_back({sequence, reason, or_else});
  }
  void Applied(const std::string& layer) {
    ++verdict_.applied_operations;
    touched_.insert(layer);
  }
  PlainLayer& Write(const std::string& name) {
    const auto [it, made] = owner_.layers.try_emplace(name);
    if (made) it->second.created = ++scene_.layers_made_;
    it->second.writer = author_.session;
    it->second.orphaned = false;
    it->second.client_name = author_.client_name;
    return it->second;
  }

  // Quotas limit additions, not what already exists.
  bool OverQuota(const PlainCount& was, const PlainCount& all_was, uint64_t drawables,
                 uint64_t bytes) const {
    const Limits& limits = scene_.limits_;
    if (drawables > was.drawables) {
      if (drawables > std::min(limits.max_entities_per_owner, owner_.max_entities)) return true;
      if (all_was.drawables - was.drawables + drawables > limits.max_entities) return true;
    }
    if (bytes > was.bytes) {
      if (bytes > std::min(limits.max_bytes_per_owner, owner_.max_bytes)) return true;
      if (all_was.bytes - was.bytes + bytes > limits.max_scene_bytes) return true;
    }
    return false;
  }
  bool NoNewLayer(const std::string& name) const {
    if (owner_.layers.contains(name)) return false;
    const PlainCount mine = scene_.Count(owner_), all = scene_.CountAll();
    return mine.layers >= scene_.limits_.max_layers_per_owner ||
           all.layers >= scene_.limits_.max_layers ||
           OverQuota(mine, all, mine.drawables, mine.bytes + sizeof(Layer) + name.size());
  }

  void Do(uint64_t sequence, const Upsert& op) {
    const auto* instance = std::get_if<InstanceRef>(&op.entity.content);
    if (instance != nullptr && !owner_.objects.contains(instance->object)) {
      return Refuse(sequence, Reason::kNotFound);
    }
    if (NoNewLayer(op.layer)) return Refuse(sequence, Reason::kQuotaExceeded);
    const auto layer = owner_.layers.find(op.layer);
    const bool is_new = layer == owner_.layers.end();
    if (scene_.TooFar(owner_, op.entity.content, op.entity.transform,
                      is_new ? gpu::Affine() : layer->second.transform)) {
      return Refuse(sequence, Reason::kOutOfRange);
    }
    const PlainCount mine = scene_.Count(owner_);
    uint64_t drawables = mine.drawables + scene_.Drawables(owner_, op.entity.content);
    uint64_t bytes = mine.bytes + EntityBytes(op.layer, op.id, op.entity);
    if (is_new) bytes += sizeof(Layer) + op.layer.size();
    if (!is_new && layer->second.entities.contains(op.id)) {
      const EntityData& old = layer->second.entities.at(op.id).data;
      drawables -= scene_.Drawables(owner_, old.content);
      bytes -= EntityBytes(op.layer, op.id, old);
    }
    if (OverQuota(mine, scene_.CountAll(), drawables, bytes)) {
      return Refuse(sequence, Reason::kQuotaExceeded);
    }
    const int64_t lifetime = op.entity.lifetime_ns;
    Write(op.layer).entities[op.id] = {op.entity, sequence, lifetime > 0 ? now_ + lifetime : 0};
    Applied(op.layer);
  }

  static void Remove(PlainLayer& layer, const std::string& prefix, uint64_t guard) {
    std::erase_if(layer.entities, [&](const auto& entry) {
      return entry.first.substr(0, prefix.size()) == prefix &&
             (guard == 0 || entry.second.sequence <= guard);
    });
  }

  void Do(uint64_t sequence, const Delete& op) {
    if (op.what == Delete::What::kAllMine) {
      ++verdict_.applied_operations;
      for (auto it = owner_.layers.begin(); it != owner_.layers.end();) {
        auto& [name, layer] = *it;
        if (layer.writer != author_.session) {
          ++it;
          continue;
        }
        touched_.insert(name);
        Remove(layer, "", op.guard_sequence);
        it = layer.entities.empty() ? owner_.layers.erase(it) : std::next(it);
      }
      return;
    }
    const auto layer = owner_.layers.find(op.layer);
    if (layer == owner_.layers.end()) {
      ++verdict_.applied_operations;  // it is not an error if nothing matches
      return;
    }
    auto& entities = layer->second.entities;
    if (op.what == Delete::What::kId) {
      const auto it = entities.find(op.id_or_prefix);
      if (it != entities.end()) {
        if (op.guard_sequence != 0 && it->second.sequence > op.guard_sequence) {
          return Refuse(sequence, Reason::kStaleSequence);
        }
        entities.erase(it);
      }
    } else {
      Remove(layer->second, op.what == Delete::What::kPrefix ? op.id_or_prefix : "",
             op.guard_sequence);
    }
    Write(op.layer);
    Applied(op.layer);
  }

  void Do(uint64_t sequence, const SetTransform& op) {
    const auto layer = owner_.layers.find(op.layer);
    if (layer == owner_.layers.end() || !layer->second.entities.contains(op.id)) {
      return Refuse(sequence, Reason::kNotFound);
    }
    PlainEntity& entity = layer->second.entities.at(op.id);
    if (scene_.TooFar(owner_, entity.data.content, op.transform, layer->second.transform)) {
      return Refuse(sequence, Reason::kOutOfRange);
    }
    entity.data.transform = op.transform;
    Write(op.layer);
    Applied(op.layer);
  }

  void Do(uint64_t sequence, const LayerState& op) {
    if (NoNewLayer(op.layer)) return Refuse(sequence, Reason::kQuotaExceeded);
    const auto found = owner_.layers.find(op.layer);
    if (op.transform.has_value() && found != owner_.layers.end()) {
      for (const auto& [id, entity] : found->second.entities) {
        if (!scene_.TooFar(owner_, entity.data.content, entity.data.transform, *op.transform)) {
          continue;
        }
        return Refuse(sequence, Reason::kOutOfRange);
      }
    }
    PlainLayer& layer = Write(op.layer);
    if (op.visible.has_value()) layer.visible = *op.visible;
    if (op.opacity.has_value()) layer.opacity = *op.opacity;
    if (op.order.has_value()) layer.order = *op.order;
    if (op.blend.has_value()) layer.blend = *op.blend;
    if (op.transform.has_value()) layer.transform = *op.transform;
    if (op.clip != nullptr) layer.clip = *op.clip;
    if (op.region.has_value()) layer.region = *op.region;
    Applied(op.layer);
  }

  void Do(uint64_t sequence, const FrameBegin& op) {
    if (!open_.try_emplace(op.layer, OpenFrame{sequence, {}}).second) {
      Refuse(sequence, Reason::kOutOfOrder);
    }
  }

  void Do(uint64_t sequence, const FrameEnd& op) {
    const auto it = open_.find(op.layer);
    if (it == open_.end()) return Refuse(sequence, Reason::kOutOfOrder);
    const OpenFrame frame = it->second;
    open_.erase(it);
    if (NoNewLayer(op.layer)) {
      Refuse(sequence, Reason::kQuotaExceeded);
      verdict_.refused_operations += frame.inside.size() + 1;
      return;
    }
    Write(op.layer).entities.clear();
    for (const Operation* inside : frame.inside) {
      std::visit([&](const auto& inner) { Do(inside->sequence, inner); }, inside->op);
    }
    ++verdict_.applied_operations;  // its FrameBegin
    Applied(op.layer);
  }

  void Do(uint64_t sequence, const DefineObject& op) {
    for (const ObjectPart& part : op.data->parts) {
      const auto* child = std::get_if<InstanceRef>(&part.content);
      if (child == nullptr) continue;
      if (child->object == op.object || Uses(owner_, child->object, op.object)) {
        return Refuse(sequence, Reason::kCycle);
      }
      if (!owner_.objects.contains(child->object)) return Refuse(sequence, Reason::kNotFound);
    }
    const PlainCount mine = scene_.Count(owner_), all = scene_.CountAll();
    const std::map<std::string, std::vector<ObjectPart>> objects = owner_.objects;
    owner_.objects[op.object] = op.data->parts;
    bool deep = false, far = false;
    for (const auto& [name, parts] : owner_.objects) {
      deep = deep || scene_.Depth(owner_, name) > scene_.limits_.max_instance_depth;
    }
    for (const auto& [name, layer] : owner_.layers) {
      for (const auto& [id, entity] : layer.entities) {
        far = far ||
              scene_.TooFar(owner_, entity.data.content, entity.data.transform, layer.transform);
      }
    }
    const PlainCount then = scene_.Count(owner_);
    const bool over = OverQuota(mine, all, then.drawables, then.bytes);
    if (deep || far || over) {
      owner_.objects = objects;
      return Refuse(sequence,
                    deep  ? Reason::kCycle
                    : far ? Reason::kOutOfRange
                          : Reason::kQuotaExceeded,
                    far && over && !deep ? Reason::kQuotaExceeded : Reason::kUnspecified);
    }
    ++verdict_.applied_operations;
    objects_ = true;
  }

  void Do(uint64_t sequence, const DeleteObject& op) {
    if (!owner_.objects.contains(op.object)) return Refuse(sequence, Reason::kNotFound);
    const auto is_it = [&](const Content& content) {
      const auto* instance = std::get_if<InstanceRef>(&content);
      return instance != nullptr && instance->object == op.object;
    };
    const auto part_is_it = [&](const ObjectPart& part) { return is_it(part.content); };
    bool used = false;
    for (const auto& [name, parts] : owner_.objects) {
      used = used || std::any_of(parts.begin(), parts.end(), part_is_it);
    }
    std::set<std::string> in;
    for (const auto& [name, layer] : owner_.layers) {
      for (const auto& [id, entity] : layer.entities) {
        if (is_it(entity.data.content)) in.insert(name);
      }
    }
    if (!op.cascade && (used || !in.empty())) return Refuse(sequence, Reason::kInUse);
    for (const std::string& name : in) {
      std::erase_if(Write(name).entities,
                    [&](const auto& entry) { return is_it(entry.second.data.content); });
      touched_.insert(name);
    }
    for (auto& [name, parts] : owner_.objects) std::erase_if(parts, part_is_it);
    owner_.objects.erase(op.object);
    ++verdict_.applied_operations;
    objects_ = true;
  }

  void Do(uint64_t, const daemon::Commit&) {}

  PlainScene& scene_;
  const PlainAuthor& author_;
  const sync::TimeNs now_;
  const PlainOwner before_;
  PlainOwner& owner_;
  std::map<std::string, OpenFrame> open_;
  std::set<std::string> touched_;
  bool objects_ = false;
  PlainVerdict verdict_;
};

PlainVerdict PlainScene::Apply(const PlainAuthor& author, const std::vector<Operation>& operations,
                               sync::TimeNs now, uint64_t refused_before) {
  Commit commit(*this, author, now);
  for (const Operation& operation : operations) commit.Take(operation);
  PlainVerdict verdict = commit.End();
  verdict.refused_operations += refused_before;
  verdict.applied = !author.strict || verdict.refused_operations == 0;
  if (!verdict.applied) commit.Forget();
  return verdict;
}

}  // namespace voxeld::daemon::model
