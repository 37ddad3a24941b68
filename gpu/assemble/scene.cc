#include "gpu/assemble/scene.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "gpu/assemble/delta_plan.h"
#include "gpu/derived_bytes.h"

namespace voxeld::gpu {

namespace {

constexpr size_t kKeptSlots = 4096;  // a hash map keeps at most so many when few entries are left

}  // namespace

RetainedGeometry KeepOnHost(const GeometryView& view) {
  const size_t positions = view.positions.size_bytes(), indices = view.indices.size_bytes(),
               colors = view.colors.size_bytes();
  RetainedGeometry kept{view, view.bulk};
  if (view.bulk != nullptr || positions + indices + colors == 0) return kept;
  std::shared_ptr<std::byte[]> memory =
      std::make_shared_for_overwrite<std::byte[]>(positions + indices + colors);
  std::byte* at = memory.get();
  const auto copy = [&at](auto& array) {
    using Value = typename std::remove_reference_t<decltype(array)>::element_type;
    std::memcpy(at, array.data(), array.size_bytes());
    array = {reinterpret_cast<Value*>(at), array.size()};
    at += array.size_bytes();
  };
  copy(kept.view.positions);
  if (indices > 0) copy(kept.view.indices);
  if (colors > 0) copy(kept.view.colors);
  kept.memory = std::move(memory);
  kept.copied_bytes = HeapBytes(positions + indices + colors);
  return kept;
}

bool LooksSame(const LayerRecord& a, const LayerRecord& b) {
  return a.visible == b.visible && a.opacity == b.opacity && a.order == b.order &&
         a.blend == b.blend && a.has_mask == b.has_mask && (a.has_mask == 0 || a.mask == b.mask) &&
         SameClip(a, b);
}

void Scene::MapClips(const Affine& view, bool anew) {
  for (const auto& [id, layer] : layers_) {
    if (anew || !layer->clip.has_value()) layer->clip = MapClip(layer->record, view);
  }
}

int64_t Scene::GeometryUses(uint64_t id) const {
  const auto it = geometries_.find(id);
  return it == geometries_.end() ? -1 : static_cast<int64_t>(it->second.users.size());
}

int64_t Scene::LayerUses(uint64_t id) const {
  const auto it = layers_.find(id);
  return it == layers_.end() ? -1 : static_cast<int64_t>(it->second->drawables.size());
}

const Drawable* Scene::FindDrawable(uint64_t id) const {
  const auto it = drawables_.find(id);
  return it == drawables_.end() ? nullptr : it->second.get();
}

uint64_t Scene::memory_bytes() const {
  // Each slot of a hash map has a control byte. A set of pointers has about three slots for two pointers.
  constexpr uint64_t kLink = (sizeof(Drawable*) + 1) * 3 / 2;
  constexpr uint64_t kDrawable = HeapBytes(sizeof(Drawable)) + 2 * kLink;
  static_assert(kDrawable + 3 * HeapBytes(1) + 64 <= kMostDrawableBytes);
  // Each geometry has a block for its set of users.
  return HashBytes(drawables_) + HashBytes(geometries_) + HashBytes(layers_) +
         drawables_.size() * kDrawable +
         geometries_.size() * (HeapBytes(sizeof(RetainedGeometry) + 16) + HeapBytes(1)) +
         layers_.size() * HeapBytes(sizeof(Layer)) + copied_bytes_;
}

void Scene::PutGeometry(const GeometryView& view, SceneObserver& observer) {
  GeometryEntry& entry = geometries_[view.record.id];
  if (entry.geometry != nullptr) copied_bytes_ -= entry.geometry->copied_bytes;
  entry.geometry = std::make_shared<const RetainedGeometry>(observer.Retain(view));
  copied_bytes_ += entry.geometry->copied_bytes;
  // Only after a drop in the same delta can it have users already.
  for (Drawable* drawable : entry.users) {
    observer.OnLeave(*drawable);
    drawable->geometry = entry.geometry;
    observer.OnEnter(*drawable);
  }
}

std::unique_ptr<Drawable> Scene::TakeDrawable(uint64_t id, SceneObserver& observer) {
  auto node = drawables_.extract(id);
  std::unique_ptr<Drawable> drawable = std::move(node.mapped());
  observer.OnLeave(*drawable);
  drawable->layer->drawables.erase(drawable.get());
  geometries_[drawable->record.geometry].users.erase(drawable.get());
  drawable->layer = nullptr;
  drawable->geometry = nullptr;
  return drawable;
}

void Scene::PutDrawable(const DrawableRecord& record, SceneObserver& observer) {
  std::unique_ptr<Drawable>& slot = drawables_[record.id];
  if (slot == nullptr) {
    slot = std::make_unique<Drawable>();
  } else {
    observer.OnLeave(*slot);
    slot->layer->drawables.erase(slot.get());
    geometries_[slot->record.geometry].users.erase(slot.get());
  }
  slot->record = record;
  slot->geometry = geometries_[record.geometry].geometry;
  slot->layer = layers_[record.layer].get();
  geometries_[record.geometry].users.insert(slot.get());
  slot->layer->drawables.insert(slot.get());
  observer.OnEnter(*slot);
}

void Scene::PutLayer(const LayerRecord& record, SceneObserver& observer) {
  std::unique_ptr<Layer>& slot = layers_[record.id];
  if (slot == nullptr) {
    slot = std::make_unique<Layer>();
    slot->record = record;
    return;
  }
  observer.OnLayerLook(*slot, record);
  const bool moved = !(slot->record.transform == record.transform) && !observer.OnLayerMove(*slot);
  if (moved) {
    for (Drawable* drawable : slot->drawables) observer.OnLeave(*drawable);
  }
  slot->record = record;
  slot->clip.reset();
  if (moved) {
    for (Drawable* drawable : slot->drawables) observer.OnEnter(*drawable);
  }
}

void Scene::GiveBackSlots() {
  const auto shrink = [](auto& map) {
    if (map.capacity() > kKeptSlots && map.size() < map.capacity() / 8) map.rehash(0);
  };
  shrink(drawables_);
  shrink(geometries_);
  for (auto& [id, layer] : layers_) shrink(layer->drawables);
}

void Scene::RankLayers() {
  std::vector<Layer*> layers;
  for (const auto& [id, layer] : layers_) layers.push_back(layer.get());
  std::sort(layers.begin(), layers.end(), [](const Layer* a, const Layer* b) {
    return std::pair(a->record.order, a->record.id) < std::pair(b->record.order, b->record.id);
  });
  for (size_t i = 0; i < layers.size(); ++i) layers[i]->rank = static_cast<int>(i);
}

void Scene::LinkMasks() {
  for (const auto& [id, layer] : layers_) {
    const auto it = layer->record.has_mask != 0 ? layers_.find(layer->record.mask) : layers_.end();
    layer->mask = it == layers_.end() ? nullptr : it->second.get();
    layer->drawn = layer->seen();
  }
  for (const auto& [id, layer] : layers_) {
    if (layer->mask != nullptr && layer->seen()) layers_[layer->mask->record.id]->drawn = true;
  }
}

absl::Status Scene::Apply(std::span<const std::byte> delta, BulkSource* bulk,
                          SceneObserver& observer, std::vector<std::unique_ptr<Drawable>>& gone) {
  absl::StatusOr<DeltaPlan> plan = PlanDelta(delta, *this, bulk);
  if (!plan.ok()) return plan.status();
  if (absl::Status status = observer.OnPlan(*plan); !status.ok()) return status;
  // A record may name a geometry or layer that comes later in the delta.
  for (const DeltaStep& step : plan->steps) {
    if (std::holds_alternative<ResetStep>(step)) {
      for (auto& [id, drawable] : drawables_) {
        observer.OnLeave(*drawable);
        drawable->layer = nullptr;
        drawable->geometry = nullptr;
        gone.push_back(std::move(drawable));
      }
      drawables_.clear();
      layers_.clear();
      geometries_.clear();
      copied_bytes_ = 0;
    } else if (const auto* geometry = std::get_if<GeometryView>(&step)) {
      PutGeometry(*geometry, observer);
    } else if (const auto* layer = std::get_if<LayerStep>(&step)) {
      PutLayer(**layer, observer);
    }
  }
  for (const DeltaStep& step : plan->steps) {
    if (const auto* drawable = std::get_if<DrawableRecord>(&step)) {
      PutDrawable(*drawable, observer);
    } else if (const auto* drop = std::get_if<DropStep>(&step);
               drop != nullptr && drop->op == Op::kDropDrawable) {
      gone.push_back(TakeDrawable(drop->id, observer));
    }
  }
  for (uint64_t id : plan->geometries_to_erase) {
    const auto node = geometries_.extract(id);
    copied_bytes_ -= node.mapped().geometry->copied_bytes;
  }
  for (uint64_t id : plan->layers_to_erase) layers_.erase(id);
  GiveBackSlots();
  RankLayers();
  LinkMasks();
  return absl::OkStatus();
}

}  // namespace voxeld::gpu
