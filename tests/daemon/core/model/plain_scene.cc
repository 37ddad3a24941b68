#include "tests/daemon/core/model/plain_scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon::model {
namespace {

template <typename T>
void Append(std::string& text, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  text.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

// Both zeros are written alike.
void AppendMap(std::string& text, const gpu::Affine& map) {
  for (const double value : map.m) Append(text, value + 0.0);
}

void AppendText(std::string& text, const std::string& more) {
  Append(text, more.size());
  text += more;
}

gpu::Affine Product(const gpu::Affine& outer, const gpu::Affine& inner) {
  gpu::Affine product;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 4; ++col) {
      double sum = col == 3 ? outer.m[4 * row + 3] : 0;
      for (int i = 0; i < 3; ++i) sum += outer.m[4 * row + i] * inner.m[4 * i + col];
      product.m[4 * row + col] = sum;
    }
  }
  return product;
}

bool Singular(const gpu::Affine& map) {
  const double* m = map.m;
  const double determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                             m[1] * (m[4] * m[10] - m[6] * m[8]) +
                             m[2] * (m[4] * m[9] - m[5] * m[8]);
  return determinant == 0;
}

std::optional<Reason> WrongMap(const gpu::Affine& map) {
  for (const double value : map.m) {
    if (!std::isfinite(value)) return Reason::kInvalidValue;
  }
  if (Singular(map)) return Reason::kSingularTransform;
  return std::nullopt;
}

std::optional<Reason> WrongContent(const Content& content, const Limits& limits) {
  const auto* geometry = std::get_if<GeometryPtr>(&content);
  if (geometry == nullptr) return std::nullopt;
  if ((*geometry)->record.vertex_count > limits.max_vertices_per_entity) {
    return Reason::kQuotaExceeded;
  }
  return std::nullopt;
}

const std::string* Child(const Content& content) {
  const auto* instance = std::get_if<InstanceRef>(&content);
  return instance == nullptr ? nullptr : &instance->object;
}

}  // namespace

std::string LayerText(int32_t order, uint32_t opacity, gpu::BlendMode blend,
                      const gpu::Affine& transform, const gpu::ClipPlane* planes, uint32_t count,
                      const gpu::Region* region) {
  std::string text = "layer";
  Append(text, order);
  Append(text, opacity);
  Append(text, blend);
  AppendMap(text, transform);
  for (uint32_t i = 0; i < count; ++i) Append(text, planes[i]);
  if (region != nullptr) Append(text, *region);
  return text;
}

std::string DrawableText(uint32_t priority, bool erase, const gpu::Affine& transform,
                         const gpu::GeometryRecord& record, std::span<const float> positions) {
  std::string text = "drawable";
  Append(text, priority);
  Append(text, erase);
  AppendMap(text, transform);
  Append(text, record.kind);
  Append(text, record.color);
  Append(text, record.params);
  Append(text, record.fill);
  Append(text, positions.size());
  for (const float at : positions) Append(text, at);
  return text;
}

std::optional<Reason> PlainScene::WrongAlone(const Operation& operation, const Limits& limits) {
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    const std::optional<Reason> wrong = WrongMap(upsert->entity.transform);
    return wrong.has_value() ? wrong : WrongContent(upsert->entity.content, limits);
  }
  if (const auto* set = std::get_if<SetTransform>(&operation.op)) return WrongMap(set->transform);
  if (const auto* define = std::get_if<DefineObject>(&operation.op)) {
    if (define->data->parts.size() > limits.max_parts_per_object) return Reason::kQuotaExceeded;
    for (const ObjectPart& part : define->data->parts) {
      std::optional<Reason> wrong = WrongMap(part.transform);
      if (!wrong.has_value()) wrong = WrongContent(part.content, limits);
      if (wrong.has_value()) return wrong;
    }
    return std::nullopt;
  }
  const auto* state = std::get_if<LayerState>(&operation.op);
  if (state == nullptr) return std::nullopt;
  if (state->transform.has_value()) {
    if (const auto wrong = WrongMap(*state->transform)) return wrong;
  }
  if (state->clip != nullptr) {
    if (state->clip->planes_in_all() > limits.max_clip_planes) return Reason::kQuotaExceeded;
    if (state->clip->cylinders_count > limits.max_clip_cylinders) return Reason::kQuotaExceeded;
    for (uint32_t i = 0; i < state->clip->count; ++i) {
      const gpu::ClipPlane& p = state->clip->planes[i];
      if (p.a == 0 && p.b == 0 && p.c == 0) return Reason::kInvalidValue;
    }
  }
  if (state->region.has_value() && state->region->has_value()) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!((*state->region)->min[axis] < (*state->region)->max[axis])) {
        return Reason::kInvalidValue;
      }
    }
  }
  return std::nullopt;
}

// ------------------------------------------------------------------------------------- counting

uint64_t PlainScene::ContentBytes(const Content& content) {
  if (const auto* geometry = std::get_if<GeometryPtr>(&content)) {
    return sizeof(GeometryData) + 12 * uint64_t{(*geometry)->record.vertex_count};
  }
  return sizeof(InstanceRef) + std::get<InstanceRef>(content).object.size();
}

uint64_t PlainScene::ObjectBytes(const std::string& name, const std::vector<ObjectPart>& parts) {
  uint64_t bytes = sizeof(Object) + name.size();
  for (const ObjectPart& part : parts) bytes += sizeof(ObjectPart) + ContentBytes(part.content);
  return bytes;
}

uint64_t PlainScene::EntityBytes(const std::string& layer, const std::string& id,
                                 const EntityData& data) {
  return sizeof(Entity) + layer.size() + id.size() + data.label.size() + ContentBytes(data.content);
}

uint64_t PlainScene::LayerBytes(const PlainLayer& layer, const std::string& name) const {
  uint64_t bytes = 0;
  for (const auto& [id, entity] : layer.entities) bytes += EntityBytes(name, id, entity.data);
  return bytes;
}

uint64_t PlainScene::Drawables(const PlainOwner& owner, const Content& content) const {
  const std::string* object = Child(content);
  if (object == nullptr) return 1;
  // Inside an object, an empty one draws nothing; an instance in a layer counts as at least one
  // drawable.
  const auto inside = [&](const auto& self, const std::string& name) -> uint64_t {
    uint64_t sum = 0;
    for (const ObjectPart& part : owner.objects.at(name)) {
      sum += Child(part.content) == nullptr ? 1 : self(self, *Child(part.content));
    }
    return sum;
  };
  return std::max<uint64_t>(1, inside(inside, *object));
}

uint32_t PlainScene::Depth(const PlainOwner& owner, const std::string& object) const {
  uint32_t depth = 1;
  for (const ObjectPart& part : owner.objects.at(object)) {
    if (const std::string* child = Child(part.content)) {
      depth = std::max(depth, 1 + Depth(owner, *child));
    }
  }
  return depth;
}

PlainCount PlainScene::Count(const PlainOwner& owner) const {
  PlainCount count;
  for (const auto& [name, layer] : owner.layers) {
    ++count.layers;
    count.bytes += sizeof(Layer) + name.size() + LayerBytes(layer, name);
    for (const auto& [id, entity] : layer.entities) {
      ++count.entities;
      count.drawables += Drawables(owner, entity.data.content);
    }
  }
  for (const auto& [name, parts] : owner.objects) {
    ++count.objects;
    count.bytes += ObjectBytes(name, parts);
  }
  return count;
}

PlainCount PlainScene::CountAll() const {
  PlainCount all;
  for (const auto& [number, owner] : owners) {
    const PlainCount one = Count(owner);
    all.entities += one.entities;
    all.layers += one.layers;
    all.objects += one.objects;
    all.bytes += one.bytes;
    all.drawables += one.drawables;
  }
  return all;
}

bool PlainScene::Reaches(const PlainOwner& owner, const Content& content, const gpu::Affine& outer,
                         double limit) const {
  if (const std::string* object = Child(content)) {
    const std::vector<ObjectPart>& parts = owner.objects.at(*object);
    return std::any_of(parts.begin(), parts.end(), [&](const ObjectPart& part) {
      return Reaches(owner, part.content, Product(outer, part.transform), limit);
    });
  }
  const GeometryData& geometry = *std::get<GeometryPtr>(content);
  const auto reaches = [&](double x, double y, double z) {
    for (int row = 0; row < 3; ++row) {
      const double* m = outer.m + size_t{4} * row;
      if (std::abs(m[0] * x + m[1] * y + m[2] * z + m[3]) > limit) return true;
    }
    return false;
  };
  if (gpu::IsSolid(geometry.record.kind)) {
    const double* const low = geometry.min;
    const double* const high = geometry.max;
    bool far = false;
    for (int corner = 0; corner < 8; ++corner) {
      far = far || reaches(corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1],
                           corner & 4 ? high[2] : low[2]);
    }
    return far;
  }
  const std::span<const float> at = geometry.arrays.positions();
  for (size_t i = 0; i + 2 < at.size(); i += 3) {
    if (reaches(at[i], at[i + 1], at[i + 2])) return true;
  }
  return false;
}

bool PlainScene::TooFar(const PlainOwner& owner, const Content& content,
                        const gpu::Affine& in_layer, const gpu::Affine& layer) const {
  // Views multiply by 4; what tests draw is either well inside or far outside.
  return displays_ &&
         Reaches(owner, content, Product(layer, in_layer), limits_.max_coordinate_voxels / 4);
}

// Returns whether `object` contains `child`, directly or through others.
bool PlainScene::Uses(const PlainOwner& owner, const std::string& object,
                      const std::string& child) {
  const auto it = owner.objects.find(object);
  if (it == owner.objects.end()) return false;
  return std::any_of(it->second.begin(), it->second.end(), [&](const ObjectPart& part) {
    const std::string* name = Child(part.content);
    return name != nullptr && (*name == child || Uses(owner, *name, child));
  });
}

// ------------------------------------------------------------------------- effects without a
// commit

void PlainScene::Expire(sync::TimeNs now) {
  for (auto& [number, owner] : owners) {
    for (auto& [name, layer] : owner.layers) {
      std::erase_if(layer.entities, [now](const auto& entry) {
        return entry.second.expires_ns != 0 && entry.second.expires_ns <= now;
      });
    }
  }
}

void PlainScene::RemoveLayersOf(uint64_t session) {
  for (auto& [number, owner] : owners) {
    std::erase_if(owner.layers,
                  [session](const auto& entry) { return entry.second.writer == session; });
  }
}

void PlainScene::HandOver(uint64_t session, const std::string& client_name, bool orphaned) {
  for (auto& [number, owner] : owners) {
    for (auto& [name, layer] : owner.layers) {
      if (layer.writer != session) continue;
      layer.client_name = client_name;
      layer.orphaned = orphaned;
    }
  }
}

bool PlainScene::HasLayers(uint64_t session) const {
  for (const auto& [number, owner] : owners) {
    for (const auto& [name, layer] : owner.layers) {
      if (layer.writer == session) return true;
    }
  }
  return false;
}

std::string PlainScene::Fingerprint() const {
  std::string text;
  for (const auto& [number, owner] : owners) {
    if (owner.layers.empty() && owner.objects.empty()) continue;
    Append(text, number);
    for (const auto& [name, layer] : owner.layers) {
      AppendText(text, name);
      Append(text, owner.hidden);
      Append(text, layer.created);
      Append(text, layer.visible);
      Append(text, layer.writer);
      Append(text, layer.orphaned);
      AppendText(text, layer.client_name);
      text += LayerText(layer.order, layer.opacity, layer.blend, layer.transform, layer.clip.planes,
                        layer.clip.count, layer.region.has_value() ? &*layer.region : nullptr);
      for (const auto& [id, entity] : layer.entities) {
        AppendText(text, id);
        Append(text, entity.sequence);
        Append(text, entity.expires_ns);
        AppendMap(text, entity.data.transform);
      }
    }
    for (const auto& [name, parts] : owner.objects) {
      AppendText(text, name);
      Append(text, parts.size());
    }
  }
  return text;
}

void PlainScene::DrawContent(const PlainOwner& owner, const PlainEntity& entity,
                             const Content& content, const gpu::Affine& map,
                             std::vector<std::string>& out) {
  if (const std::string* object = Child(content)) {
    for (const ObjectPart& part : owner.objects.at(*object)) {
      DrawContent(owner, entity, part.content, Product(map, part.transform), out);
    }
    return;
  }
  const GeometryData& geometry = *std::get<GeometryPtr>(content);
  out.push_back(DrawableText(entity.data.priority, entity.data.erase, map, geometry.record,
                             geometry.arrays.positions()));
}

void PlainScene::Picture::Add(bool shows, const std::string& layer,
                              std::vector<std::string> drawables) {
  std::sort(drawables.begin(), drawables.end());
  std::string text = layer;
  for (const std::string& drawable : drawables) text += drawable;
  if (shows && !drawables.empty()) seen += text;
  (shows ? shown : hidden) += text;
}

PlainScene::Picture PlainScene::Draw() const {
  std::map<uint64_t, std::pair<const PlainOwner*, const PlainLayer*>> by_creation;
  for (const auto& [number, owner] : owners) {
    for (const auto& [name, layer] : owner.layers) by_creation[layer.created] = {&owner, &layer};
  }
  Picture picture;
  std::vector<std::string> drawn;
  for (const auto& [created, which] : by_creation) {
    const auto& [owner, layer] = which;
    drawn.clear();
    for (const auto& [id, entity] : layer->entities) {
      DrawContent(*owner, entity, entity.data.content, entity.data.transform, drawn);
    }
    picture.Add(
        layer->visible && !owner->hidden,
        LayerText(layer->order, layer->opacity, layer->blend, layer->transform, layer->clip.planes,
                  layer->clip.count, layer->region.has_value() ? &*layer->region : nullptr),
        drawn);
  }
  return picture;
}

}  // namespace voxeld::daemon::model
