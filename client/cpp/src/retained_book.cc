#include "client/cpp/src/retained_book.h"

#include <algorithm>
#include <set>
#include <utility>

#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

// The object that an instance draws; empty for any other primitive.
std::string InstanceOf(const Rope& primitive) {
  // Instances are short: longer ones are not worth reading.
  constexpr size_t kMostBytes = 4096;
  if (primitive.size() > kMostBytes) return "";
  v1::Primitive read;
  if (!read.ParseFromString(primitive.Flat()) || !read.has_instance()) return "";
  return read.instance().object();
}

}  // namespace

RetainedBook::Layer& RetainedBook::LayerOf(const std::string& name) {
  const auto [it, is_new] = layers_.try_emplace(name);
  if (is_new) it->second.number = next_number_++;
  return it->second;
}

void RetainedBook::Put(const UpsertOperation& upsert, int64_t now_ns) {
  Entity& entity = LayerOf(upsert.layer).entities[upsert.id];
  entity.upsert = upsert;
  entity.number = next_number_++;
  entity.expires_ns = upsert.lifetime_ns > 0 ? now_ns + upsert.lifetime_ns : 0;
}

struct RetainedBook::Applier {
  RetainedBook& book;
  const std::set<std::pair<std::string, std::string>>& refused;  // (layer, id); ("", object)
  int64_t now_ns;

  void operator()(const UpsertOperation& upsert) const {
    if (!refused.contains({upsert.layer, upsert.id})) book.Put(upsert, now_ns);
  }
  void operator()(const DeleteOperation& removal) const {
    using What = DeleteOperation::What;
    if (removal.what == What::kAllMine) {
      for (auto& [name, layer] : book.layers_) layer.entities.clear();
      return;
    }
    const auto it = book.layers_.find(removal.layer);
    if (it == book.layers_.end()) return;
    std::erase_if(it->second.entities, [&](const auto& entity) {
      return removal.what == What::kLayer ||
             (removal.what == What::kId && entity.first == removal.text) ||
             (removal.what == What::kPrefix && entity.first.starts_with(removal.text));
    });
  }
  void operator()(const TransformOperation& move) const {
    const auto layer = book.layers_.find(move.layer);
    if (layer == book.layers_.end() || refused.contains({move.layer, move.id})) return;
    const auto entity = layer->second.entities.find(move.id);
    if (entity != layer->second.entities.end()) entity->second.upsert.transform = move.transform;
  }
  void operator()(const LayerOperation& operation) const {
    if (refused.contains({operation.layer, ""})) return;
    LayerLook& look = book.LayerOf(operation.layer).look;
    const auto take = [](const auto& from, auto* to) {
      if (from.has_value()) *to = from;
    };
    take(operation.look.visible, &look.visible);
    take(operation.look.opacity, &look.opacity);
    take(operation.look.order, &look.order);
    take(operation.look.blend, &look.blend);
    take(operation.look.transform, &look.transform);
    take(operation.look.clip, &look.clip);
    take(operation.look.region, &look.region);
  }
  void operator()(const DefineOperation& define) const {
    if (!refused.contains({"", define.object})) book.objects_[define.object] = define;
  }
  void operator()(const RemoveObjectOperation& removal) const {
    if (refused.contains({"", removal.object})) return;
    book.objects_.erase(removal.object);
    if (removal.cascade) book.RemoveInstancesOf(removal.object);
  }
  void operator()(const FrameOperation& frame) const {
    if (frame.layer.empty()) return;  // given up
    book.LayerOf(frame.layer).entities.clear();
    for (const UpsertOperation& upsert : frame.upserts) (*this)(upsert);
  }
};

void RetainedBook::RemoveInstancesOf(const std::string& object) {
  for (auto& [name, layer] : layers_) {
    std::erase_if(layer.entities, [&](const auto& entity) {
      return InstanceOf(entity.second.upsert.primitive) == object;
    });
  }
}

void RetainedBook::Apply(const std::vector<Operation>& operations, const std::vector<Issue>& issues,
                         int64_t now_ns) {
  std::set<std::pair<std::string, std::string>> refused;
  for (const Issue& issue : issues) refused.insert({issue.layer, issue.id});
  const Applier applier{*this, refused, now_ns};
  for (const Operation& operation : operations) std::visit(applier, operation);
}

void RetainedBook::AddObject(const std::string& name, std::map<std::string, bool>* added,
                             std::vector<Operation>* out) const {
  const auto it = objects_.find(name);
  if (it == objects_.end() || !added->emplace(name, true).second) return;
  for (const std::string& used : it->second.uses) AddObject(used, added, out);
  out->push_back(it->second);
}

std::vector<Operation> RetainedBook::Restore(int64_t now_ns) const {
  std::vector<Operation> out;
  std::map<std::string, bool> added;
  for (const auto& [name, definition] : objects_) AddObject(name, &added, &out);
  std::vector<std::pair<uint64_t, std::string>> order;
  for (const auto& [name, layer] : layers_) order.push_back({layer.number, name});
  std::sort(order.begin(), order.end());
  for (const auto& [number, name] : order) {
    const Layer& layer = layers_.at(name);
    // Also when it sets nothing: it makes the layer, in its turn.
    out.push_back(LayerOperation{name, layer.look});
    std::vector<const Entity*> entities;
    for (const auto& [id, entity] : layer.entities) {
      if (entity.expires_ns == 0 || entity.expires_ns > now_ns) entities.push_back(&entity);
    }
    std::sort(entities.begin(), entities.end(),
              [](const Entity* a, const Entity* b) { return a->number < b->number; });
    for (const Entity* entity : entities) {
      UpsertOperation upsert = entity->upsert;
      if (entity->expires_ns != 0) upsert.lifetime_ns = entity->expires_ns - now_ns;
      out.push_back(std::move(upsert));
    }
  }
  return out;
}

}  // namespace voxeld::client
