// The part of CommitApplier that defines and deletes objects.
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "absl/strings/str_format.h"
#include "daemon/scene/commit_applier.h"
#include "daemon/scene/quoted.h"

namespace voxeld::daemon {
namespace {

const std::string* InstanceName(const ObjectPart& part) {
  const auto* instance = std::get_if<InstanceRef>(&part.content);
  return instance == nullptr ? nullptr : &instance->object;
}

}  // namespace

std::vector<UseKey> CommitApplier::InstancesOf(const std::string& name, size_t limit) const {
  std::vector<UseKey> uses;
  draft_.uses().ForEachFrom({author_.owner, name, false, "", ""}, [&](const UseKey& use, bool) {
    if (use.owner != author_.owner || use.object != name || use.by_object) return false;
    uses.push_back(use);
    return uses.size() < limit;
  });
  return uses;
}

std::vector<std::string> CommitApplier::ObjectsUsing(const std::string& name) const {
  std::vector<std::string> users;
  draft_.uses().ForEachFrom({author_.owner, name, true, "", ""}, [&](const UseKey& use, bool) {
    if (use.owner != author_.owner || use.object != name) return false;
    users.push_back(use.layer);
    return true;
  });
  return users;
}

std::set<std::string> CommitApplier::ObjectsAbove(const std::string& name) const {
  std::set<std::string> above;
  std::vector<std::string> open = {name};
  while (!open.empty()) {
    const std::string at = std::move(open.back());
    open.pop_back();
    for (std::string& user : ObjectsUsing(at)) {
      if (above.insert(user).second) open.push_back(std::move(user));
    }
  }
  return above;
}

std::vector<std::pair<std::string, Object>> CommitApplier::Derive(const std::string& name,
                                                                  const ObjectDataPtr& data) const {
  std::set<std::string> affected = ObjectsAbove(name);
  affected.insert(name);
  std::map<std::string, size_t> done;  // index into `derived`
  std::vector<std::pair<std::string, Object>> derived;

  // The recursion is bounded: existing objects respect the depth limit, and there are no cycles.
  const auto derive = [&](const auto& self, const std::string& at) -> void {
    if (done.contains(at)) return;
    Object object;
    const Object* there = draft_.FindObject(Key(at));
    object.data = at == name || there == nullptr ? data : there->data;
    for (const ObjectPart& part : object.data->parts) {
      const std::string* child_name = InstanceName(part);
      Bounds bounds;
      if (child_name == nullptr) {
        object.drawables =
            AddSaturating(object.drawables, draft_.DrawablesOf(author_.owner, part.content));
        object.derived =
            AddSaturating(object.derived, draft_.DerivedBytesOf(author_.owner, part.content));
        bounds = draft_.BoundsOf(author_.owner, part.content);
      } else {
        if (affected.contains(*child_name)) self(self, *child_name);
        const auto it = done.find(*child_name);
        const Object* child =
            it != done.end() ? &derived[it->second].second : draft_.FindObject(Key(*child_name));
        if (child == nullptr) continue;  // refused earlier
        object.drawables = AddSaturating(object.drawables, child->drawables);
        object.derived = AddSaturating(object.derived, child->derived);
        object.depth = std::max(object.depth, child->depth + 1);
        bounds = child->bounds;
      }
      object.bounds.Include(MapBounds(part.transform, bounds));
    }
    done.emplace(at, derived.size());
    derived.emplace_back(at, std::move(object));
  };
  for (const std::string& at : affected) derive(derive, at);
  return derived;
}

bool CommitApplier::RefusedDefinition(const Operation& operation, const DefineObject& define) {
  const std::set<std::string> above = ObjectsAbove(define.object);
  const std::vector<ObjectPart>& parts = define.data->parts;
  for (size_t i = 0; i < parts.size(); ++i) {
    const std::string* child = InstanceName(parts[i]);
    if (child == nullptr) continue;
    const std::string field =
        absl::StrFormat("define_object.definition.parts[%d].primitive.instance.object", i);
    if (*child == define.object || above.contains(*child)) {
      Refuse(operation, "", define.object, field, Reason::kCycle,
             absl::StrFormat("object %s would contain itself through %s", Quoted(define.object),
                             Quoted(*child)));
      return true;
    }
    if (draft_.FindObject(Key(*child)) == nullptr) {
      Refuse(operation, "", define.object, field, Reason::kNotFound,
             absl::StrFormat("object %s is not defined; define it first", Quoted(*child)));
      return true;
    }
  }
  return false;
}

bool CommitApplier::RefusedDerived(const Operation& operation, const DefineObject& define,
                                   const std::vector<std::pair<std::string, Object>>& derived) {
  const auto refuse = [&](Reason reason, std::string message) {
    Refuse(operation, "", define.object, "define_object.definition", reason, std::move(message));
    return true;
  };
  const OwnerTally& tally = draft_.tally(author_.owner);
  OwnerTally wanted = tally;
  for (const auto& [name, object] : derived) {
    if (object.depth > limits_.max_instance_depth) {
      return refuse(Reason::kCycle,
                    absl::StrFormat("object %s would be %d deep; "
                                    "max_instance_depth is %d",
                                    Quoted(name), object.depth, limits_.max_instance_depth));
    }
    if (!std::isfinite(LargestMagnitude(object.bounds))) {
      return refuse(Reason::kOutOfRange,
                    absl::StrFormat("object %s would have a coordinate that is not finite after "
                                    "its transforms; it must be",
                                    Quoted(name)));
    }
    const Object* before = draft_.FindObject(Key(name));
    if (before == nullptr) continue;
    for (const UseKey& use : InstancesOf(name)) {
      wanted.drawables -= std::max<uint64_t>(1, before->drawables);
      wanted.drawables = AddSaturating(wanted.drawables, std::max<uint64_t>(1, object.drawables));
      wanted.derived = AddSaturating(wanted.derived - before->derived, object.derived);
      if (wanted.drawables > limits_.max_entities_per_owner) {
        return refuse(Reason::kQuotaExceeded, *OverQuota(wanted));
      }
      const OwnedName layer = Key(use.layer);
      const gpu::Affine& transform = (*draft_.FindEntity(layer, use.id))->data.transform;
      if (auto wrong =
              OutOfRange(draft_.FindLayer(layer)->transform, MapBounds(transform, object.bounds))) {
        return refuse(Reason::kOutOfRange,
                      absl::StrFormat("instance %s in layer %s: %s", Quoted(use.id),
                                      Quoted(use.layer), *wrong));
      }
    }
  }
  const Object* old = draft_.FindObject(Key(define.object));
  wanted.bytes = tally.bytes - (old == nullptr ? 0 : old->bytes) +
                 Draft::ObjectBytes(define.object, *define.data);
  if (auto over = OverQuota(wanted)) {
    return refuse(Reason::kQuotaExceeded, *std::move(over));
  }
  return false;
}

void CommitApplier::Do(Operation& operation, DefineObject& define) {
  if (RefusedDefinition(operation, define)) return;
  std::vector<std::pair<std::string, Object>> derived = Derive(define.object, define.data);
  if (RefusedDerived(operation, define, derived)) return;
  for (auto& [name, object] : derived) draft_.PutObject(Key(name), std::move(object));
  // Checks existing instances. Each counts as at least one geometry.
  int left = kMostLookedAt;
  for (const auto& [name, object] : derived) {
    for (const UseKey& use : InstancesOf(name, static_cast<size_t>(std::max(left, 0)))) {
      if (left-- <= 0) break;
      TellIfCoarse(operation, use.layer, use.id, (*draft_.FindEntity(Key(use.layer), use.id))->data,
                   "define_object.definition", &left);
    }
    if (left <= 0) break;
  }
  ++applied_;
  objects_touched_ = true;
}

void CommitApplier::Do(Operation& operation, DeleteObject& del) {
  const auto refuse = [&](Reason reason, std::string message) {
    Refuse(operation, "", del.object, "delete_object.object", reason, std::move(message));
  };
  if (draft_.FindObject(Key(del.object)) == nullptr) {
    return refuse(Reason::kNotFound,
                  absl::StrFormat("object %s is not defined", Quoted(del.object)));
  }
  const std::vector<UseKey> instances = InstancesOf(del.object);
  const std::vector<std::string> users = ObjectsUsing(del.object);
  if (!del.cascade && !(instances.empty() && users.empty())) {
    return refuse(Reason::kInUse,
                  absl::StrFormat("object %s has %d instances and is part of %d objects; delete "
                                  "those first, or say cascade",
                                  Quoted(del.object), instances.size(), users.size()));
  }
  for (const UseKey& use : instances) {
    EditLayer(Key(use.layer));
    draft_.RemoveEntity(Key(use.layer), use.id);
    touched_.insert(use.layer);
  }
  for (const std::string& user : users) {
    auto without = std::make_shared<ObjectData>();
    for (const ObjectPart& part : draft_.FindObject(Key(user))->data->parts) {
      const std::string* child = InstanceName(part);
      if (child == nullptr || *child != del.object) without->parts.push_back(part);
    }
    for (auto& [name, object] : Derive(user, without))
      draft_.PutObject(Key(name), std::move(object));
  }
  draft_.RemoveObject(Key(del.object));
  ++applied_;
  objects_touched_ = true;
}

}  // namespace voxeld::daemon
