#include "daemon/scene/engine_delta.h"

#include <algorithm>
#include <utility>

#include "gpu/derived_bytes.h"
#include "gpu/word.h"

namespace voxeld::daemon {
namespace {

constexpr uint32_t kNoTint = 0x00FFFFFF;
constexpr uint64_t kNoLayer = 0;  // no layer has this number
constexpr uint32_t kRecordsPerBreath = 256;
constexpr size_t kBytesPerBreath = size_t{1} << 20;
constexpr size_t kKeptSlots = 4096;  // for an index with few entries left

const Snapshot& EmptyScene() {
  static const Snapshot empty;
  return empty;
}

// `mask` is the layer that masks it; null if it does not exist.
gpu::LayerRecord RecordOf(const Layer& layer, const Layer* mask) {
  gpu::LayerRecord record;
  record.id = layer.number;
  record.order = layer.order;
  record.visible = layer.shown() ? 1 : 0;
  record.opacity = layer.opacity;
  record.blend = layer.blend;
  record.transform = layer.transform;
  PutClip(layer.clip, record);  // always succeeds: an invalid clip was refused earlier
  record.has_region = layer.region.has_value() ? 1 : 0;
  record.region = layer.region.value_or(gpu::Region());
  record.has_mask = layer.mask.empty() ? 0 : 1;
  record.mask = mask == nullptr ? kNoLayer : mask->number;
  return record;
}

bool LooksSame(const Layer& a, const Layer& b) {
  return a.order == b.order && a.shown() == b.shown() && a.opacity == b.opacity &&
         a.blend == b.blend && a.transform == b.transform && a.clip == b.clip &&
         a.region == b.region && a.mask == b.mask;
}

// Returns: whether an engine sees no difference. Label, sequence and expiry may differ.
bool LooksSame(const Entity& a, const Entity& b) {
  return a.number == b.number && a.data.priority == b.data.priority &&
         a.data.erase == b.data.erase && a.data.transform == b.data.transform &&
         a.data.content == b.data.content;
}

// Releases the memory, which clear() and an assignment of {} would keep.
template <typename Container>
void Free(Container& container) {
  Container().swap(container);
}

template <typename T>
uint64_t BytesOf(const std::vector<T>& values) {
  return gpu::HeapBytes(values.capacity() * sizeof(T));
}

}  // namespace

EngineScene::EngineScene(std::function<void()> breathe, Choose choose)
    : breathe_(std::move(breathe)), choose_(std::move(choose)) {}

void EngineScene::Breathe() {
  if (++since_breath_ < kRecordsPerBreath) return;
  since_breath_ = 0;
  if (breathe_) breathe_();
}

void EngineScene::Forget() {
  held_ = nullptr;
  reset_ = true;
  geometries_.clear();
  drawn_.clear();
  parts_bytes_ = 0;
}

size_t EngineScene::Plan(SnapshotPtr next) {
  next_ = std::move(next);
  put_geometries_.clear();
  unused_.clear();
  drop_geometries_.clear();
  drop_drawables_.clear();
  drop_layers_.clear();
  put_layers_.clear();
  put_drawables_.clear();
  put_reset_ = std::exchange(reset_, false);

  const Snapshot& before = held_ == nullptr ? EmptyScene() : *held_;
  PlanInstances(before, *next_);
  PersistentMap<OwnedName, LayerPtr>::Diff(
      before.layers, next_->layers,
      [&](const OwnedName& key, const LayerPtr* was, const LayerPtr* is) {
        const Layer* old_layer = was == nullptr ? nullptr : was->get();
        const Layer* new_layer = is == nullptr ? nullptr : is->get();
        if (old_layer == nullptr || new_layer == nullptr ||
            old_layer->number != new_layer->number) {
          renumbered_.insert(key);
        }
        if (old_layer != nullptr && new_layer != nullptr &&
            old_layer->number != new_layer->number) {
          PlanLayer(key, old_layer, nullptr);  // removed and recreated with the same name
          old_layer = nullptr;
        }
        PlanLayer(key, old_layer, new_layer);
      });
  PlanMasks(before);
  for (const auto& [number, place] : redraw_) {
    Draw(place.layer, *next_->FindLayer(place.layer), place.id,
         *next_->FindEntity(place.layer, place.id));
  }
  redraw_.clear();

  size_t size = put_reset_ ? gpu::DeltaWriter::kSizeOfReset : 0;
  for (const HeldGeometry& geometry : unused_) {
    const auto it = geometries_.find(geometry.key());
    if (it == geometries_.end() || it->second.uses > 0) continue;
    // A geometry that this delta would both put and drop is omitted.
    if (!it->second.fresh) drop_geometries_.push_back(it->second.id);
    geometries_.erase(it);
  }
  std::erase_if(put_geometries_, [&](const HeldGeometry& geometry) {
    return !geometries_.contains(geometry.key());
  });
  for (const HeldGeometry& geometry : put_geometries_) {
    geometries_.find(geometry.key())->second.fresh = false;
    size += geometry.geometry->arrays.block() ? gpu::DeltaWriter::kSizeOfBulkGeometry
                                              : gpu::DeltaWriter::SizeOf(geometry.geometry->record);
  }
  size += put_layers_.size() * gpu::DeltaWriter::SizeOf(gpu::LayerRecord());
  size += put_drawables_.size() * gpu::DeltaWriter::SizeOf(gpu::DrawableRecord());
  size += gpu::DeltaWriter::kSizeOfId *
          (drop_geometries_.size() + drop_drawables_.size() + drop_layers_.size());
  GiveBackSlots();
  held_ = next_;
  return size;
}

void EngineScene::GiveBackSlots() {
  if (drawn_.bucket_count() > kKeptSlots && drawn_.size() < drawn_.bucket_count() / 8) {
    drawn_.rehash(0);
  }
  if (geometries_.capacity() > kKeptSlots && geometries_.size() < geometries_.capacity() / 8) {
    geometries_.rehash(0);
  }
}

void EngineScene::Write(gpu::DeltaWriter& writer) {
  if (put_reset_) writer.Reset();
  size_t since = 0;
  for (const HeldGeometry& held : put_geometries_) {
    const GeometryData& geometry = *held.geometry;
    gpu::GeometryRecord record = geometry.record;
    record.id = geometries_.find(held.key())->second.id;
    record.drawn_by = held.by_cpu ? gpu::DrawnBy::kCpu : gpu::DrawnBy::kEngine;
    const gpu::GeometryArrays& arrays = geometry.arrays;
    Breathe();
    if (arrays.block()) {
      writer.PutGeometry(record, arrays.block());
      continue;
    }
    writer.PutGeometry(record, arrays.positions(), arrays.indices(), arrays.colors());
    since += geometry.bytes();
    if (since >= kBytesPerBreath) {
      since = 0;
      if (breathe_) breathe_();
    }
  }
  for (const gpu::LayerRecord& layer : put_layers_) writer.PutLayer(layer);
  for (const gpu::DrawableRecord& drawable : put_drawables_) {
    writer.PutDrawable(drawable);
    Breathe();
  }
  for (const uint64_t id : drop_drawables_) writer.Drop(gpu::Op::kDropDrawable, id);
  for (const uint64_t id : drop_geometries_) writer.Drop(gpu::Op::kDropGeometry, id);
  for (const uint64_t id : drop_layers_) writer.Drop(gpu::Op::kDropLayer, id);
  // A plan may be large and the next one small.
  Free(put_geometries_);
  Free(unused_);
  Free(flat_);
  Free(put_layers_);
  Free(put_drawables_);
  Free(drop_drawables_);
  Free(drop_geometries_);
  Free(drop_layers_);
}

uint64_t EngineScene::memory_bytes() const {
  using Drawn = decltype(drawn_)::value_type;
  using Geometry = decltype(geometries_)::value_type;
  constexpr uint64_t kNode = gpu::HeapBytes(sizeof(Drawn) + sizeof(void*));
  return drawn_.size() * kNode + gpu::HeapBytes(drawn_.bucket_count() * sizeof(void*)) +
         gpu::HeapBytes(geometries_.capacity() * (sizeof(Geometry) + 1)) + parts_bytes_;
}

void EngineScene::PlanInstances(const Snapshot& before, const Snapshot& next) {
  redraw_.clear();
  PersistentMap<OwnedName, ObjectPtr>::Diff(
      before.objects, next.objects,
      [&](const OwnedName& key, const ObjectPtr*, const ObjectPtr* is) {
        if (is == nullptr) return;
        next.uses.ForEachFrom({key.owner, key.name, false, "", ""}, [&](const UseKey& use, bool) {
          if (use.owner != key.owner || use.object != key.name || use.by_object) return false;
          EntityPlace place{{use.owner, use.layer}, use.id};
          // A scene joined from parts (WithPartsOf) may lack the entity; then the diff of its layer covers it.
          const EntityPtr entity = next.FindEntity(place.layer, place.id);
          if (entity != nullptr) redraw_.emplace(entity->number, std::move(place));
          return true;
        });
      });
}

void EngineScene::PutLayer(const OwnedName& key, const Layer& layer) {
  const Layer* const mask = next_->FindLayer({key.owner, layer.mask});
  put_layers_.push_back(RecordOf(layer, mask));
}

void EngineScene::PlanMasks(const Snapshot& before) {
  if (renumbered_.empty()) return;
  next_->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (layer->mask.empty() || renumbered_.contains(key)) return;
    if (!renumbered_.contains({key.owner, layer->mask})) return;
    if (LooksSame(*before.FindLayer(key), *layer)) PutLayer(key, *layer);
  });
  renumbered_.clear();
}

void EngineScene::PlanLayer(const OwnedName& key, const Layer* before, const Layer* now) {
  if (now == nullptr) {
    before->entities.ForEach([&](const std::string&, const EntityPtr& entity) { Undraw(*entity); });
    drop_layers_.push_back(before->number);
    return;
  }
  if (before == nullptr || !LooksSame(*before, *now)) PutLayer(key, *now);
  EntityMap::Diff(before == nullptr ? EntityMap() : before->entities, now->entities,
                  [&](const std::string& id, const EntityPtr* was, const EntityPtr* is) {
                    if (is == nullptr) {
                      if (was != nullptr) Undraw(**was);  // at least one of the two exists
                      return;
                    }
                    if (was != nullptr && (*was)->number != (*is)->number) Undraw(**was);
                    if (was != nullptr && LooksSame(**was, **is)) return;
                    redraw_.erase((*is)->number);
                    Draw(key, *now, id, **is);
                  });
}

void EngineScene::Draw(const OwnedName& key, const Layer& layer, const std::string& id,
                       const Entity& entity) {
  const DrawnWhere where = choose_ ? choose_(key, id, entity) : DrawnWhere::kEngine;
  flat_.clear();
  if (where != DrawnWhere::kNowhere) {
    Flatten(key.owner, entity.data.content, entity.data.transform, kNoTint);
  }
  std::vector<Part>& parts = drawn_[entity.number];
  // Release the old geometries only after the new ones are in use, so that unchanged ones are not
  // sent again.
  const std::vector<Part> old = std::move(parts);
  parts.clear();
  parts.reserve(flat_.size());
  parts_bytes_ += BytesOf(parts) - BytesOf(old);
  for (size_t i = 0; i < flat_.size(); ++i) {
    gpu::DrawableRecord record;
    record.id = i < old.size() ? old[i].drawable : next_id_++;
    HeldGeometry geometry{std::move(flat_[i].geometry), where == DrawnWhere::kCpu};
    record.geometry = Use(geometry);
    record.layer = layer.number;
    record.priority = entity.data.priority;
    record.erase = entity.data.erase ? 1 : 0;
    record.transform = flat_[i].transform;
    record.tint = flat_[i].tint;
    put_drawables_.push_back(record);
    parts.push_back({record.id, std::move(geometry)});
    Breathe();
  }
  if (flat_.capacity() > kKeptSlots) Free(flat_);
  for (size_t i = 0; i < old.size(); ++i) {
    if (i >= parts.size()) drop_drawables_.push_back(old[i].drawable);
    Release(old[i].geometry);
  }
}

void EngineScene::Undraw(const Entity& entity) {
  const auto it = drawn_.find(entity.number);
  if (it == drawn_.end()) return;
  for (const Part& part : it->second) {
    drop_drawables_.push_back(part.drawable);
    Release(part.geometry);
  }
  parts_bytes_ -= BytesOf(it->second);
  drawn_.erase(it);
  Breathe();
}

void EngineScene::Flatten(uint64_t owner, const Content& content, const gpu::Affine& map,
                          uint32_t tint) {
  if (const auto* geometry = std::get_if<GeometryPtr>(&content)) {
    flat_.push_back({*geometry, map, tint});
    return;
  }
  if (const auto* group = std::get_if<GroupPtr>(&content)) {
    for (const GroupData::Part& part : (*group)->parts) {
      flat_.push_back({part.geometry, gpu::Compose(map, part.transform), tint});
    }
    return;
  }
  const auto& instance = std::get<InstanceRef>(content);
  const Object* object = next_->FindObject({owner, instance.object});
  const uint32_t both = gpu::Tinted(instance.tint, tint);
  for (const ObjectPart& part : object->data->parts) {
    Flatten(owner, part.content, gpu::Compose(map, part.transform), both);
  }
}

uint64_t EngineScene::Use(const HeldGeometry& geometry) {
  const auto [it, fresh] = geometries_.try_emplace(geometry.key());
  if (fresh) {
    it->second.id = next_id_++;
    it->second.fresh = true;
    put_geometries_.push_back(geometry);
  }
  ++it->second.uses;
  return it->second.id;
}

void EngineScene::Release(const HeldGeometry& geometry) {
  if (--geometries_.find(geometry.key())->second.uses == 0) unused_.push_back(geometry);
}

}  // namespace voxeld::daemon
