#include "client/cpp/src/retained_book.h"

#include <algorithm>
#include <functional>
#include <tuple>
#include <utility>

#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

// Returns the object that an instance draws; empty for any other primitive.
std::string InstanceOf(const Rope& primitive) {
  // Instances are short: longer primitives are not parsed.
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
  if (entity.expires_ns == 0) return;
  if (expiries_.size() >= most_expiries_) {
    std::erase_if(expiries_, [this](const Expiry& expiry) { return !IsThere(expiry); });
    std::make_heap(expiries_.begin(), expiries_.end(), std::greater<>());
    most_expiries_ = std::max<size_t>(64, 2 * expiries_.size());
  }
  expiries_.push_back({entity.expires_ns, entity.number, upsert.layer, upsert.id});
  std::push_heap(expiries_.begin(), expiries_.end(), std::greater<>());
}

bool RetainedBook::IsThere(const Expiry& expiry) const {
  const auto layer = layers_.find(expiry.layer);
  if (layer == layers_.end()) return false;
  const auto entity = layer->second.entities.find(expiry.id);
  return entity != layer->second.entities.end() && entity->second.number == expiry.number;
}

void RetainedBook::Expire(int64_t now_ns) {
  while (!expiries_.empty() && expiries_.front().expires_ns <= now_ns) {
    std::pop_heap(expiries_.begin(), expiries_.end(), std::greater<>());
    if (IsThere(expiries_.back()))
      layers_.at(expiries_.back().layer).entities.erase(expiries_.back().id);
    expiries_.pop_back();
  }
}

size_t RetainedBook::entities() const {
  size_t count = 0;
  for (const auto& [name, layer] : layers_) count += layer.entities.size();
  return count;
}

struct RetainedBook::Applier {
  RetainedBook& book;
  const Refusals& refusals;
  int64_t now_ns;
  size_t request = 0, operation = 0;  // the next ones to check

  // Returns whether the next operation, on entity `id` in `layer`, was refused.
  bool Refused(const std::string& layer, const std::string& id) {
    while (request < refusals.requests.size() &&
           operation >= refusals.requests[request].operations) {
      ++request;
      operation = 0;
    }
    if (request == refusals.requests.size()) return false;
    ++operation;
    const auto& [sequence, operations] = refusals.requests[request];
    if (operations > 1) return refusals.refused.contains({sequence, layer, id});
    const auto first = refusals.refused.lower_bound({sequence, "", ""});
    return first != refusals.refused.end() && std::get<0>(*first) == sequence;
  }

  void operator()(const UpsertOperation& upsert) {
    if (!Refused(upsert.layer, upsert.id)) book.Put(upsert, now_ns);
  }
  void operator()(const DeleteOperation& removal) {
    using What = DeleteOperation::What;
    if (Refused(removal.layer, removal.text)) return;
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
  void operator()(const TransformOperation& move) {
    const auto layer = book.layers_.find(move.layer);
    if (Refused(move.layer, move.id) || layer == book.layers_.end()) return;
    const auto entity = layer->second.entities.find(move.id);
    if (entity != layer->second.entities.end()) entity->second.upsert.transform = move.transform;
  }
  void operator()(const LayerOperation& operation) {
    if (Refused(operation.layer, "")) return;
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
    take(operation.look.mask, &look.mask);
  }
  void operator()(const DefineOperation& define) {
    if (!Refused("", define.object)) book.objects_[define.object] = define;
  }
  void operator()(const RemoveObjectOperation& removal) {
    if (Refused("", removal.object)) return;
    book.objects_.erase(removal.object);
    if (removal.cascade) book.RemoveInstancesOf(removal.object);
  }
  void operator()(const FrameOperation& frame) {
    if (frame.layer.empty()) return;  // dropped
    const bool begins = !Refused(frame.layer, "");
    std::vector<const UpsertOperation*> taken;
    for (const UpsertOperation& upsert : frame.upserts) {
      if (!Refused(upsert.layer, upsert.id)) taken.push_back(&upsert);
    }
    const bool ends = !Refused(frame.layer, "");
    if (!begins || !ends) return;
    book.LayerOf(frame.layer).entities.clear();
    for (const UpsertOperation* upsert : taken) book.Put(*upsert, now_ns);
  }
};

void RetainedBook::RemoveInstancesOf(const std::string& object) {
  for (auto& [name, layer] : layers_) {
    std::erase_if(layer.entities, [&](const auto& entity) {
      return InstanceOf(entity.second.upsert.primitive) == object;
    });
  }
}

void RetainedBook::ApplyNow(const std::vector<Operation>& operations, const Refusals& refusals,
                            int64_t now_ns) {
  Expire(now_ns);
  Applier applier{*this, refusals, now_ns};
  for (const Operation& operation : operations) std::visit(applier, operation);
}

void RetainedBook::Apply(const std::vector<Operation>& operations, const Refusals& refusals,
                         int64_t now_ns) {
  if (waiting_.empty()) return ApplyNow(operations, refusals, now_ns);
  waiting_.push_back({0, false, operations, refusals, now_ns});
}

void RetainedBook::Doubt(uint64_t frame, const std::vector<Operation>& operations, int64_t now_ns) {
  waiting_.push_back({frame, true, operations, {}, now_ns});
}

void RetainedBook::WasApplied(uint64_t frame) {
  for (Waiting& waiting : waiting_) {
    if (waiting.frame == frame) waiting.doubtful = false;
  }
  ApplyUpToDoubt();
}

void RetainedBook::EndDoubts() {
  std::erase_if(waiting_, [](const Waiting& waiting) { return waiting.doubtful; });
  ApplyUpToDoubt();
}

void RetainedBook::ApplyUpToDoubt() {
  for (; !waiting_.empty() && !waiting_.front().doubtful; waiting_.pop_front()) {
    const Waiting& first = waiting_.front();
    ApplyNow(first.operations, first.refusals, first.now_ns);
  }
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
  order.reserve(layers_.size());
  for (const auto& [name, layer] : layers_) order.push_back({layer.number, name});
  std::sort(order.begin(), order.end());
  for (const auto& [number, name] : order) {
    const Layer& layer = layers_.at(name);
    // Emitted even if it sets nothing: it creates the layer in the right order.
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
