#include "tools/recording/putting_up.h"

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::recording {
namespace {

constexpr size_t kMostNameBytes = 240;  // leaves space for a number within max_id_bytes

// Truncates the text to at most `bytes` bytes, between code points.
std::string UpTo(std::string text, size_t bytes) {
  if (text.size() <= bytes) return text;
  while (bytes > 0 && (text[bytes] & 0xc0) == 0x80) --bytes;
  text.resize(bytes);
  return text;
}

}  // namespace

std::string PuttingUp::NameOf(const LayerName& layer) {
  const auto found = mirror_.layers().find(layer);
  const uint64_t number = found == mirror_.layers().end() ? 0 : found->second.number();
  std::string& name = names_[{layer.owner, layer.layer, number}];
  if (!name.empty()) return name;
  const std::string plain = UpTo(prefix_ + layer.layer, kMostNameBytes);
  name = plain;
  for (int n = 2; !taken_.insert(name).second; ++n) name = absl::StrCat(plain, " (", n, ")");
  return name;
}

std::string PuttingUp::ObjectOf(uint64_t owner, const std::string& name) {
  return absl::StrCat(owner, "/", name);
}

void PuttingUp::Rename(uint64_t owner, v1::Primitive* primitive) {
  if (!primitive->has_instance()) return;
  primitive->mutable_instance()->set_object(ObjectOf(owner, primitive->instance().object()));
}

void PuttingUp::PutLayers(std::vector<v1::LayerInfo> layers, std::vector<v1::StreamRequest>* out) {
  std::sort(layers.begin(), layers.end(),
            [](const auto& a, const auto& b) { return a.number() < b.number(); });
  for (const v1::LayerInfo& info : layers) {
    v1::LayerState* state = out->emplace_back().mutable_layer_state();
    state->set_layer(NameOf({info.owner(), info.layer()}));
    state->set_visible(info.visible());
    state->set_opacity(info.opacity());
    state->set_order(info.order());
    state->set_blend(info.blend());
    *state->mutable_transform() = info.transform();
    *state->mutable_clip() = info.clip();      // without parts: none
    *state->mutable_region() = info.region();  // without corners: none
  }
}

void PuttingUp::PutObjects(const std::map<ObjectName, v1::Object>& objects,
                           std::vector<v1::StreamRequest>* out) const {
  std::set<ObjectName> begun;
  // Objects that others refer to come first.
  const auto put = [&](const auto& self, const ObjectName& key) -> void {
    const auto found = objects.find(key);
    if (found == objects.end() || !begun.insert(key).second) return;
    for (const v1::Object::Part& part : found->second.parts()) {
      if (part.primitive().has_instance()) {
        self(self, {key.first, part.primitive().instance().object()});
      }
    }
    v1::DefineObject* define = out->emplace_back().mutable_define_object();
    define->set_object(ObjectOf(key.first, key.second));
    *define->mutable_definition() = found->second;
    for (v1::Object::Part& part : *define->mutable_definition()->mutable_parts()) {
      Rename(key.first, part.mutable_primitive());
    }
  };
  for (const auto& [key, object] : objects) put(put, key);
}

void PuttingUp::PutEntity(const v1::WatchedEntity& entity, std::vector<v1::StreamRequest>* out) {
  const v1::EntityInfo& info = entity.info();
  v1::Upsert* upsert = out->emplace_back().mutable_upsert();
  upsert->set_layer(NameOf({info.key().owner(), info.key().layer()}));
  upsert->set_id(info.key().id());
  v1::Entity* to = upsert->mutable_entity();
  *to->mutable_primitive() = entity.primitive();
  Rename(info.key().owner(), to->mutable_primitive());
  *to->mutable_transform() = info.transform();
  to->set_priority(info.priority());
  to->set_erase(info.erase());
  to->set_label(info.label());
}

void PuttingUp::PutMasks(std::vector<v1::StreamRequest>* out) {
  std::erase_if(masks_, [&](const auto& mask) { return !mirror_.layers().contains(mask.first); });
  for (const auto& [layer, info] : mirror_.layers()) {
    const std::string mask =
        info.mask_layer().empty() ? "" : NameOf({layer.owner, info.mask_layer()});
    std::string& was = masks_[layer];
    if (was == mask) continue;
    was = mask;
    v1::LayerState* state = out->emplace_back().mutable_layer_state();
    state->set_layer(NameOf(layer));
    state->set_mask_layer(mask);
  }
}

std::vector<PuttingUp::ObjectName> PuttingUp::InOrderOfLeaving(
    const v1::WatchSceneResponse& changes) const {
  std::set<ObjectName> left;
  for (const v1::ObjectKey& key : changes.removed_objects()) {
    left.insert({key.owner(), key.object()});
  }
  std::vector<ObjectName> order;
  const auto go = [&](const auto& self, const ObjectName& name) -> void {
    if (left.erase(name) == 0) return;
    const auto found = mirror_.objects().find(name);
    if (found != mirror_.objects().end()) {
      for (const v1::Object::Part& part : found->second.parts()) {
        if (!part.primitive().has_instance()) continue;
        self(self, {name.first, part.primitive().instance().object()});
      }
    }
    order.push_back(name);
  };
  while (!left.empty()) go(go, ObjectName(*left.begin()));
  std::reverse(order.begin(), order.end());  // parts were found first
  return order;
}

std::vector<v1::StreamRequest> PuttingUp::Step(const v1::WatchSceneResponse& changes) {
  std::vector<v1::StreamRequest> out;
  const auto empty = [&](const LayerName& layer) {
    v1::Delete* remove = out.emplace_back().mutable_delete_();
    remove->set_layer(NameOf(layer));
    remove->set_all_of_layer(true);
    emptied_.push_back(remove->layer());
    masks_.erase(layer);
  };
  for (const v1::LayerKey& key : changes.removed_layers()) empty({key.owner(), key.layer()});
  // A layer that was removed and created again has another number.
  for (const v1::LayerInfo& info : changes.layers()) {
    const auto was = mirror_.layers().find({info.owner(), info.layer()});
    const bool removed = std::any_of(
        changes.removed_layers().begin(), changes.removed_layers().end(), [&](const auto& key) {
          return key.owner() == info.owner() && key.layer() == info.layer();
        });
    if (was != mirror_.layers().end() && was->second.number() != info.number() && !removed) {
      empty(was->first);
    }
  }
  for (const v1::EntityKey& key : changes.removed_entities()) {
    v1::Delete* remove = out.emplace_back().mutable_delete_();
    remove->set_layer(NameOf({key.owner(), key.layer()}));
    remove->set_id(key.id());
  }
  const std::vector<ObjectName> leaving = InOrderOfLeaving(changes);
  mirror_.Apply(changes);
  std::map<ObjectName, v1::Object> objects;
  for (const v1::WatchedObject& object : changes.objects()) {
    objects[{object.key().owner(), object.key().object()}] = object.definition();
  }
  PutObjects(objects, &out);
  PutLayers({changes.layers().begin(), changes.layers().end()}, &out);
  PutMasks(&out);
  for (const v1::WatchedEntity& entity : changes.entities()) PutEntity(entity, &out);
  // Everything else that referred to them has been removed, or refers to others now.
  for (const auto& [owner, object] : leaving) {
    out.emplace_back().mutable_delete_object()->set_object(ObjectOf(owner, object));
  }
  return out;
}

std::vector<v1::StreamRequest> PuttingUp::Whole() {
  std::vector<v1::StreamRequest> out;
  masks_.clear();
  PutObjects(mirror_.objects(), &out);
  std::vector<v1::LayerInfo> layers;
  for (const auto& [name, info] : mirror_.layers()) layers.push_back(info);
  PutLayers(std::move(layers), &out);
  PutMasks(&out);
  for (const auto& [name, entity] : mirror_.entities()) PutEntity(entity, &out);
  return out;
}

std::vector<std::string> PuttingUp::TakeEmptied() {
  for (const std::string& name : emptied_) {
    taken_.erase(name);
    std::erase_if(names_, [&](const auto& one) { return one.second == name; });
  }
  return std::exchange(emptied_, {});
}

}  // namespace voxeld::recording
