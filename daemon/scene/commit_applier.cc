#include "daemon/scene/commit_applier.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "daemon/scene/quoted.h"

namespace voxeld::daemon {
namespace {

// Saturates, so that a very long lifetime never ends.
sync::TimeNs ExpiryTime(sync::TimeNs now, int64_t lifetime_ns) {
  if (lifetime_ns <= 0 || lifetime_ns >= sync::kNever - now) return sync::kNever;
  return now + lifetime_ns;
}

const std::string* LayerOf(const Operation& operation) {
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) return &upsert->layer;
  if (const auto* set = std::get_if<SetTransform>(&operation.op)) return &set->layer;
  if (const auto* del = std::get_if<Delete>(&operation.op)) {
    return del->what == Delete::What::kAllMine ? nullptr : &del->layer;
  }
  return nullptr;
}

// Returns: the name of the limit that applies to an owner.
const char* MostOf(uint64_t by_operator, uint64_t limit, const char* name) {
  return by_operator < limit ? "what an operator has set for it" : name;
}

}  // namespace

CommitApplier::CommitApplier(Draft& draft, const Limits& limits,
                             const std::vector<DisplayView>& views, const MemoryRoom& room,
                             const Author& author, sync::TimeNs now)
    : draft_(draft), limits_(limits), views_(views), room_(room), author_(author), now_(now) {}

void CommitApplier::Apply(Operation& operation) {
  if (Frame* frame = FrameOf(operation)) {
    frame->operations.push_back(&operation);
  } else {
    Dispatch(operation);
  }
}

void CommitApplier::Dispatch(Operation& operation) {
  std::visit([&](auto& op) { Do(operation, op); }, operation.op);
  // Free the rest of the operation now: freeing a large commit in one piece would delay other owners.
  operation.op = Commit();
}

void CommitApplier::Replay() {
  if (replayed_->next < replayed_->operations.size()) {
    return Dispatch(*replayed_->operations[replayed_->next++]);
  }
  ++applied_;  // counts the FrameBegin
  Applied(replayed_->layer);
  replayed_.reset();
}

void CommitApplier::End() {
  for (const auto& [layer, frame] : frames_) {
    refused_ += frame.operations.size() + 1;
    Issue issue;
    issue.sequence = frame.begin_sequence;
    issue.layer = layer;
    issue.field = "frame_begin.layer";
    issue.reason = Reason::kOutOfOrder;
    issue.message = absl::StrFormat(
        "the frame of layer %s was still open at the commit: its %d operations are discarded "
        "and "
        "the layer is as it was; send FrameEnd before Commit",
        Quoted(layer), frame.operations.size());
    refusals_.Add(std::move(issue), limits_.max_issues_per_commit);
  }
  frames_.clear();
}

bool CommitApplier::hidden() const {
  if (objects_touched_ || touched_.empty()) return false;
  bool any = false;
  for (const std::string& name : touched_) {
    const Layer* before = draft_.base().FindLayer(Key(name));
    const Layer* after = draft_.FindLayer(Key(name));
    if ((before != nullptr && before->shown()) || (after != nullptr && after->shown()))
      return false;
    any = any || before != nullptr || after != nullptr;
  }
  return any;
}

CommitApplier::Frame* CommitApplier::FrameOf(const Operation& operation) {
  const std::string* layer = LayerOf(operation);
  if (layer == nullptr) return nullptr;
  const auto it = frames_.find(*layer);
  return it == frames_.end() ? nullptr : &it->second;
}

void CommitApplier::Applied(const std::string& layer) {
  ++applied_;
  touched_.insert(layer);
}

void CommitApplier::Refuse(const Operation& operation, std::string layer, std::string id,
                           std::string field, Reason reason, std::string message) {
  ++refused_;
  refusals_.Add({operation.sequence, std::move(layer), std::move(id), std::move(field), reason,
                 std::move(message)},
                limits_.max_issues_per_commit);
}

std::optional<std::string> CommitApplier::OutOfRange(const gpu::Affine& layer_transform,
                                                     const Bounds& in_layer) const {
  const double in_scene = LargestMagnitude(MapBounds(layer_transform, in_layer));
  if (!std::isfinite(in_scene)) {
    return "a coordinate is not finite after the transforms; it must be";
  }
  for (const DisplayView& view : views_) {
    const double largest =
        LargestMagnitude(MapBounds(gpu::Compose(view.scene_to_voxel, layer_transform), in_layer));
    if (!(std::abs(largest) <= limits_.max_coordinate_voxels)) {
      return absl::StrFormat("a coordinate is %g voxels on display \"%s\"; it must be within ±%.0f",
                             largest, view.display, limits_.max_coordinate_voxels);
    }
  }
  return std::nullopt;
}

bool CommitApplier::RefusedNewLayer(const Operation& operation, const std::string& layer,
                                    const std::string& field) {
  if (draft_.FindLayer(Key(layer)) != nullptr) return false;
  const auto refuse = [&](std::string message) {
    Refuse(operation, layer, "", field, Reason::kQuotaExceeded, std::move(message));
    return true;
  };
  const OwnerTally& tally = draft_.tally(author_.owner);
  if (tally.layers >= limits_.max_layers_per_owner) {
    return refuse(absl::StrFormat("layer %s would be one more than max_layers_per_owner, %d",
                                  Quoted(layer), limits_.max_layers_per_owner));
  }
  if (draft_.total().layers + room_.promised.layers >= limits_.max_layers) {
    return refuse(
        absl::StrFormat("layer %s would be one more than max_layers, %d, which all "
                        "owners share; orphaned layers can be cleared",
                        Quoted(layer), limits_.max_layers));
  }
  OwnerTally wanted = tally;
  wanted.bytes += Draft::LayerBytes(Key(layer));
  if (auto over = OverQuota(wanted)) {
    return refuse(*std::move(over));
  }
  return false;
}

std::optional<std::string> CommitApplier::OverQuota(const OwnerTally& wanted) const {
  const auto [drawables, layers, bytes, derived] = wanted;
  const OwnerTally& tally = draft_.tally(author_.owner);
  const OwnerTally& promised = room_.promised;
  if (drawables > tally.drawables) {
    if (drawables > limits_.max_entities_per_owner || drawables > author_.max_entities) {
      return absl::StrFormat(
          "its owner would have %d entities (an instance counts as what it draws); %s is %d",
          drawables,
          MostOf(author_.max_entities, limits_.max_entities_per_owner, "max_entities_per_owner"),
          std::min(author_.max_entities, limits_.max_entities_per_owner));
    }
    const uint64_t all =
        draft_.total().drawables - tally.drawables + drawables + promised.drawables;
    if (all > limits_.max_entities) {
      return absl::StrFormat(
          "the scene would have %d entities (an instance counts as what it draws); max_entities, "
          "which all owners share, is %d; orphaned layers can be cleared",
          all, limits_.max_entities);
    }
  }
  if (bytes > tally.bytes) {
    if (bytes > limits_.max_bytes_per_owner || bytes > author_.max_bytes) {
      return absl::StrFormat(
          "its owner would hold %d bytes; %s is %d", bytes,
          MostOf(author_.max_bytes, limits_.max_bytes_per_owner, "max_bytes_per_owner"),
          std::min(author_.max_bytes, limits_.max_bytes_per_owner));
    }
    const uint64_t all = draft_.total().bytes - tally.bytes + bytes + promised.bytes;
    if (all > limits_.max_scene_bytes) {
      return absl::StrFormat(
          "the scene would hold %d bytes; max_scene_bytes, which all owners share, is %d; orphaned "
          "layers can be cleared",
          all, limits_.max_scene_bytes);
    }
  }
  return OverMemory(wanted);
}

std::optional<std::string> CommitApplier::OverMemory(const OwnerTally& wanted) const {
  const OwnerTally& tally = draft_.tally(author_.owner);
  if (wanted.bytes <= tally.bytes && wanted.derived <= tally.derived) return std::nullopt;
  // Returns: the growth of all owners since the last commit; negative if this commit has removed more than it added.
  const auto growth = [&](uint64_t OwnerTally::*of) {
    return static_cast<double>(draft_.total().*of) - static_cast<double>(draft_.base().total.*of) +
           static_cast<double>(wanted.*of) - static_cast<double>(tally.*of);
  };
  const auto all_growth = [&](uint64_t OwnerTally::*of) {
    return growth(of) + static_cast<double>(room_.promised.*of);
  };
  const double bytes = all_growth(&OwnerTally::bytes) +
                       all_growth(&OwnerTally::derived) * static_cast<double>(room_.engines);
  if (bytes <= static_cast<double>(room_.bytes)) return std::nullopt;
  return absl::StrFormat(
      "%.0f bytes more would be held for the scene and what %d %s derive from it, and "
      "max_memory_bytes leaves %d; make it smaller, or try again when others have taken something "
      "away",
      bytes, room_.engines, room_.engines == 1 ? "engine would" : "engines would", room_.bytes);
}

void CommitApplier::Do(Operation& operation, Upsert& upsert) {
  const OwnedName key = Key(upsert.layer);
  const auto refuse = [&](std::string field, Reason reason, std::string message) {
    Refuse(operation, upsert.layer, upsert.id, std::move(field), reason, std::move(message));
  };
  if (const auto* instance = std::get_if<InstanceRef>(&upsert.entity.content)) {
    if (draft_.FindObject(Key(instance->object)) == nullptr) {
      return refuse(
          "upsert.entity.primitive.instance.object", Reason::kNotFound,
          absl::StrFormat("object %s is not defined; define it first", Quoted(instance->object)));
    }
  }
  if (RefusedNewLayer(operation, upsert.layer, "upsert.layer")) return;
  const Layer* layer = draft_.FindLayer(key);
  const Bounds bounds =
      MapBounds(upsert.entity.transform, draft_.BoundsOf(author_.owner, upsert.entity.content));
  if (auto wrong = OutOfRange(layer == nullptr ? gpu::Affine() : layer->transform, bounds)) {
    return refuse("upsert.entity", Reason::kOutOfRange, *std::move(wrong));
  }

  const EntityPtr* old = layer == nullptr ? nullptr : layer->entities.Find(upsert.id);
  const OwnerTally& tally = draft_.tally(author_.owner);
  OwnerTally wanted = tally;
  if (old != nullptr) {
    const Content& before = (*old)->data.content;
    wanted.drawables -= draft_.DrawablesOf(author_.owner, before);
    wanted.derived -= draft_.DerivedBytesOf(author_.owner, before);
    wanted.bytes -= (*old)->bytes;
  }
  const Content& content = upsert.entity.content;
  wanted.drawables = AddSaturating(wanted.drawables, draft_.DrawablesOf(author_.owner, content));
  wanted.derived = AddSaturating(wanted.derived, draft_.DerivedBytesOf(author_.owner, content));
  wanted.bytes += (layer == nullptr ? Draft::LayerBytes(key) : 0) +
                  Draft::EntityBytes(key, upsert.id, upsert.entity);
  if (auto over = OverQuota(wanted)) {
    return refuse("upsert", Reason::kQuotaExceeded, *std::move(over));
  }

  Entity entity;
  entity.sequence = operation.sequence;
  entity.expires_ns = ExpiryTime(now_, upsert.entity.lifetime_ns);
  if (replayed_.has_value()) {
    const EntityPtr* replaced = replayed_->replaced.Find(upsert.id);
    if (replaced != nullptr) entity.number = (*replaced)->number;
  }
  entity.data = std::move(upsert.entity);
  EditLayer(key);
  TellIfCoarse(operation, upsert.layer, upsert.id, entity.data, "upsert.entity");
  draft_.PutEntity(key, upsert.id, std::move(entity));
  Applied(upsert.layer);
}

void CommitApplier::Do(Operation& operation, Delete& del) {
  const auto guarded = [&](const Entity& entity) {
    return del.guard_sequence != 0 && entity.sequence > del.guard_sequence;
  };
  // Removes the matching entities of the layer. Whole layers without a guard are cleared in one
  // step.
  const auto remove_from = [&](const OwnedName& key, const std::string& prefix) {
    if (prefix.empty() && del.guard_sequence == 0) return draft_.ClearLayer(key);
    std::vector<std::string> ids;
    draft_.FindLayer(key)->entities.ForEachFrom(
        prefix, [&](const std::string& id, const EntityPtr& entity) {
          if (id.compare(0, prefix.size(), prefix) != 0) return false;
          if (!guarded(*entity)) ids.push_back(id);
          return true;
        });
    for (const std::string& id : ids) draft_.RemoveEntity(key, id);
  };

  if (del.what == Delete::What::kAllMine) {
    std::vector<OwnedName> mine;
    draft_.ForEachLayer([&](const OwnedName& key, const Layer& layer) {
      if (layer.writer->session == author_.writer->session) mine.push_back(key);
    });
    ++applied_;
    for (const OwnedName& key : mine) {
      touched_.insert(key.name);
      remove_from(key, "");
      if (draft_.FindLayer(key)->entities.empty()) draft_.RemoveLayer(key);
    }
    return;
  }

  const OwnedName key = Key(del.layer);
  if (draft_.FindLayer(key) == nullptr) {
    ++applied_;
    return;
  }
  if (del.what == Delete::What::kId) {
    const EntityPtr* entity = draft_.FindEntity(key, del.id_or_prefix);
    if (entity != nullptr && guarded(**entity)) {
      return Refuse(
          operation, del.layer, del.id_or_prefix, "delete.guard_sequence", Reason::kStaleSequence,
          absl::StrFormat("entity %s was upserted by sequence %d, after %d; it stays",
                          Quoted(del.id_or_prefix), (*entity)->sequence, del.guard_sequence));
    }
    if (entity != nullptr) draft_.RemoveEntity(key, del.id_or_prefix);
  } else {
    remove_from(key, del.what == Delete::What::kPrefix ? del.id_or_prefix : "");
  }
  EditLayer(key);
  Applied(del.layer);
}

void CommitApplier::Do(Operation& operation, SetTransform& set) {
  const OwnedName key = Key(set.layer);
  const EntityPtr* found = draft_.FindEntity(key, set.id);
  if (found == nullptr) {
    return Refuse(operation, set.layer, set.id, "set_transform.id", Reason::kNotFound,
                  absl::StrFormat("layer %s has no entity %s; upsert it first", Quoted(set.layer),
                                  Quoted(set.id)));
  }
  const Bounds bounds =
      MapBounds(set.transform, draft_.BoundsOf(author_.owner, (*found)->data.content));
  if (auto wrong = OutOfRange(draft_.FindLayer(key)->transform, bounds)) {
    return Refuse(operation, set.layer, set.id, "set_transform.transform", Reason::kOutOfRange,
                  *std::move(wrong));
  }
  Entity entity = **found;
  entity.data.transform = set.transform;
  EditLayer(key);
  TellIfCoarse(operation, set.layer, set.id, entity.data, "set_transform.transform");
  draft_.PutEntity(key, set.id, std::move(entity));
  Applied(set.layer);
}

void CommitApplier::Do(Operation& operation, LayerState& state) {
  if (RefusedNewLayer(operation, state.layer, "layer_state.layer")) return;
  const OwnedName key = Key(state.layer);
  const Layer* found = draft_.FindLayer(key);
  if (state.transform.has_value() && found != nullptr) {
    auto wrong = OutOfRange(*state.transform, found->bounds);
    if (wrong.has_value()) {
      // The bounds may be wider than the remaining entities, so compute exact ones before refusing.
      Bounds exact;
      found->entities.ForEach([&](const std::string&, const EntityPtr& entity) {
        exact.Include(MapBounds(entity->data.transform,
                                draft_.BoundsOf(author_.owner, entity->data.content)));
      });
      draft_.EditLayer(key, found->writer).bounds = exact;
      wrong = OutOfRange(*state.transform, exact);
    }
    if (wrong.has_value()) {
      return Refuse(operation, state.layer, "", "layer_state.transform", Reason::kOutOfRange,
                    *std::move(wrong));
    }
  }
  if (state.blend == gpu::BlendMode::kErase && !author_.may_erase) {
    return Refuse(operation, state.layer, "", "layer_state.blend", Reason::kPermissionDenied,
                  "blend is ERASE, which acts on others' layers and takes the scope control; give "
                  "OVER or ADD, or erase within the layer by Entity.erase");
  }
  Layer& layer = EditLayer(key);
  layer.visible = state.visible.value_or(layer.visible);
  layer.opacity = state.opacity.value_or(layer.opacity);
  layer.order = state.order.value_or(layer.order);
  layer.blend = state.blend.value_or(layer.blend);
  layer.transform = state.transform.value_or(layer.transform);
  if (state.transform.has_value()) {
    TellOfCoarseIn(operation, state.layer, layer, "layer_state.transform");
  }
  if (state.clip != nullptr) layer.clip = *state.clip;
  layer.region = state.region.value_or(layer.region);
  layer.mask = state.mask.value_or(layer.mask);
  Applied(state.layer);
}

void CommitApplier::Do(Operation& operation, FrameBegin& begin) {
  const auto [it, fresh] = frames_.try_emplace(begin.layer);
  if (!fresh) {
    return Refuse(operation, begin.layer, "", "frame_begin.layer", Reason::kOutOfOrder,
                  absl::StrFormat("the frame that sequence %d began in layer %s is still open; "
                                  "frames do not nest, end it first",
                                  it->second.begin_sequence, Quoted(begin.layer)));
  }
  it->second.begin_sequence = operation.sequence;
}

void CommitApplier::Do(Operation& operation, FrameEnd& end) {
  const auto it = frames_.find(end.layer);
  if (it == frames_.end()) {
    return Refuse(
        operation, end.layer, "", "frame_end.layer", Reason::kOutOfOrder,
        absl::StrFormat("no frame is open in layer %s; begin one first", Quoted(end.layer)));
  }
  Frame frame = std::move(it->second);
  frames_.erase(it);
  if (RefusedNewLayer(operation, end.layer, "frame_end.layer")) {
    refused_ += frame.operations.size() + 1;
    return;
  }
  const OwnedName key = Key(end.layer);
  touched_.insert(end.layer);
  replayed_ = Replayed{end.layer, std::move(frame.operations), 0, EditLayer(key).entities};
  draft_.ClearLayer(key);
}

// The core handles commits; operations never contain one.
void CommitApplier::Do(Operation&, Commit&) {}

std::optional<Issue> CheckAlone(const Operation& operation, const Limits& limits) {
  std::optional<Issue> issue;
  const auto refuse = [&](const std::string& layer, const std::string& id, std::string field,
                          Reason reason, std::string message) {
    if (issue.has_value()) return;
    issue = Issue{operation.sequence, layer, id, std::move(field), reason, std::move(message)};
  };
  const auto check_map = [&](const gpu::Affine& map, const std::string& layer,
                             const std::string& id, const std::string& field) {
    if (!IsFinite(map)) {
      refuse(layer, id, field, Reason::kInvalidValue,
             "the transform has a value that is not finite");
    } else if (IsSingular(map)) {
      refuse(layer, id, field, Reason::kSingularTransform,
             absl::StrCat("the transform cannot be inverted: ", DescribeLinear(map),
                          "; its linear part must have full rank"));
    }
  };
  const auto check_content = [&](const Content& content, const std::string& layer,
                                 const std::string& id, const std::string& field) {
    const auto* geometry = std::get_if<GeometryPtr>(&content);
    if (geometry == nullptr) return;
    const gpu::GeometryRecord& record = (*geometry)->record;
    if (record.vertex_count > limits.max_vertices_per_entity) {
      refuse(layer, id, field, Reason::kQuotaExceeded,
             absl::StrFormat("%d vertices; max_vertices_per_entity is %d", record.vertex_count,
                             limits.max_vertices_per_entity));
    } else if (record.index_count > limits.max_indices_per_entity) {
      refuse(layer, id, field, Reason::kQuotaExceeded,
             absl::StrFormat("%d indices; max_indices_per_entity is %d", record.index_count,
                             limits.max_indices_per_entity));
    }
  };
  const auto check_clip = [&](const Clip& clip, const std::string& layer) {
    if (clip.planes_in_all() > limits.max_clip_planes) {
      return refuse(layer, "", "layer_state.clip.planes", Reason::kQuotaExceeded,
                    absl::StrFormat("%d planes; max_clip_planes is %d", clip.planes_in_all(),
                                    limits.max_clip_planes));
    }
    if (clip.cylinders_count > limits.max_clip_cylinders) {
      return refuse(layer, "", "layer_state.clip.cylinders", Reason::kQuotaExceeded,
                    absl::StrFormat("%d cylinders; max_clip_cylinders is %d", clip.cylinders_count,
                                    limits.max_clip_cylinders));
    }
    for (uint32_t i = 0; i < clip.count; ++i) {
      const gpu::ClipPlane& p = clip.planes[i];
      const bool finite =
          std::isfinite(p.a) && std::isfinite(p.b) && std::isfinite(p.c) && std::isfinite(p.d);
      if (finite && (p.a != 0 || p.b != 0 || p.c != 0)) continue;
      return refuse(
          layer, "", absl::StrFormat("layer_state.clip.planes[%d]", i), Reason::kInvalidValue,
          absl::StrFormat("the plane is (%g, %g, %g, %g); it must be finite, its normal not 0", p.a,
                          p.b, p.c, p.d));
    }
    gpu::LayerRecord record;
    if (clip.boxes_count + clip.cylinders_count > 0 && !PutClip(clip, record)) {
      refuse(layer, "", "layer_state.clip", Reason::kInvalidValue,
             "a box or a cylinder of it has no inside, or does not stay finite");
    }
  };
  const auto check_region = [&](const gpu::Region& region, const std::string& layer) {
    for (int axis = 0; axis < 3; ++axis) {
      const double min = region.min[axis], max = region.max[axis];
      if (min < max && std::isfinite(min) && std::isfinite(max)) continue;
      refuse(layer, "", "layer_state.region", Reason::kInvalidValue,
             absl::StrFormat("the region goes from %g to %g along %c; both must be finite, the "
                             "first less than the second",
                             min, max, "xyz"[axis]));
    }
  };

  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    check_map(upsert->entity.transform, upsert->layer, upsert->id, "upsert.entity.transform");
    check_content(upsert->entity.content, upsert->layer, upsert->id, "upsert.entity.primitive");
  } else if (const auto* set = std::get_if<SetTransform>(&operation.op)) {
    check_map(set->transform, set->layer, set->id, "set_transform.transform");
  } else if (const auto* state = std::get_if<LayerState>(&operation.op)) {
    if (state->transform.has_value()) {
      check_map(*state->transform, state->layer, "", "layer_state.transform");
    }
    if (state->clip != nullptr) check_clip(*state->clip, state->layer);
    if (state->region.has_value() && state->region->has_value()) {
      check_region(**state->region, state->layer);
    }
  } else if (const auto* define = std::get_if<DefineObject>(&operation.op)) {
    const std::vector<ObjectPart>& parts = define->data->parts;
    if (parts.size() > limits.max_parts_per_object) {
      refuse("", define->object, "define_object.definition.parts", Reason::kQuotaExceeded,
             absl::StrFormat("%d parts; max_parts_per_object is %d", parts.size(),
                             limits.max_parts_per_object));
      return issue;
    }
    for (size_t i = 0; i < parts.size() && !issue.has_value(); ++i) {
      const std::string field = absl::StrFormat("define_object.definition.parts[%d]", i);
      check_map(parts[i].transform, "", define->object, field + ".transform");
      check_content(parts[i].content, "", define->object, field + ".primitive");
    }
  }
  return issue;
}

}  // namespace voxeld::daemon
