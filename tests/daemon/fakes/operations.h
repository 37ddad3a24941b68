// Helpers for writing operations in tests.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/scene/operation.h"

namespace voxeld::daemon::testing {

// Points at (x, 0, 0), (x+1, 0, 0), … in one colour.
inline GeometryPtr Dots(float x, uint32_t color = 0xFFFFFF, uint32_t count = 1) {
  auto data = std::make_shared<GeometryData>();
  data->record.kind = gpu::PrimitiveKind::kPoints;
  data->record.color = color;
  data->record.vertex_count = count;
  std::vector<float> positions(size_t{3} * count);
  for (uint32_t i = 0; i < count; ++i) positions[3 * i] = x + static_cast<float>(i);
  data->arrays = gpu::GeometryArrays::Of(data->record, positions);
  data->min[0] = x;
  data->max[0] = x + count - 1;
  return data;
}

inline gpu::Affine Shift(double x, double y = 0, double z = 0) {
  gpu::Affine map;
  map.m[3] = x;
  map.m[7] = y;
  map.m[11] = z;
  return map;
}

inline gpu::Affine Scale(double x, double y, double z) {
  gpu::Affine map;
  map.m[0] = x;
  map.m[5] = y;
  map.m[10] = z;
  return map;
}

inline EntityData Entity1(Content content, gpu::Affine transform = {}) {
  EntityData data;
  data.content = std::move(content);
  data.transform = transform;
  return data;
}

inline Operation Put(std::string layer, std::string id, EntityData data) {
  return {0, Upsert{std::move(layer), std::move(id), std::move(data)}};
}
inline Operation Put(std::string layer, std::string id, float x = 0) {
  return Put(std::move(layer), std::move(id), Entity1(Dots(x)));
}
inline Operation PutInstance(std::string layer, std::string id, std::string object,
                             gpu::Affine transform = {}) {
  return Put(std::move(layer), std::move(id), Entity1(InstanceRef{std::move(object)}, transform));
}
inline Operation Move(std::string layer, std::string id, gpu::Affine transform) {
  return {0, SetTransform{std::move(layer), std::move(id), transform}};
}
inline Operation DeleteId(std::string layer, std::string id, uint64_t guard = 0) {
  return {0, Delete{Delete::What::kId, std::move(layer), std::move(id), guard}};
}
inline Operation DeletePrefix(std::string layer, std::string prefix, uint64_t guard = 0) {
  return {0, Delete{Delete::What::kPrefix, std::move(layer), std::move(prefix), guard}};
}
inline Operation DeleteAllOf(std::string layer, uint64_t guard = 0) {
  return {0, Delete{Delete::What::kAllOfLayer, std::move(layer), "", guard}};
}
inline Operation DeleteAllMine() { return {0, Delete{Delete::What::kAllMine, "", "", 0}}; }
inline Operation SetLayer(std::string layer, std::optional<bool> visible,
                          std::optional<gpu::Affine> transform = {}) {
  LayerState state;
  state.layer = std::move(layer);
  state.visible = visible;
  state.transform = transform;
  return {0, std::move(state)};
}
inline Operation SetClip(std::string layer, const std::vector<gpu::ClipPlane>& planes) {
  LayerState state;
  state.layer = std::move(layer);
  auto clip = std::make_shared<Clip>();
  clip->count = static_cast<uint32_t>(planes.size());
  std::copy(planes.begin(), planes.end(), clip->planes);
  state.clip = std::move(clip);
  return {0, std::move(state)};
}
inline Operation SetRegion(std::string layer, std::optional<gpu::Region> region) {
  LayerState state;
  state.layer = std::move(layer);
  state.region = region;
  return {0, std::move(state)};
}
inline Operation SetMask(std::string layer, std::string mask) {
  LayerState state;
  state.layer = std::move(layer);
  state.mask = std::move(mask);
  return {0, std::move(state)};
}
inline Operation Begin(std::string layer) { return {0, FrameBegin{std::move(layer)}}; }
inline Operation End(std::string layer) { return {0, FrameEnd{std::move(layer)}}; }
inline Operation Define(std::string object, std::vector<ObjectPart> parts) {
  auto data = std::make_shared<ObjectData>();
  data->parts = std::move(parts);
  return {0, DefineObject{std::move(object), std::move(data)}};
}
inline Operation Undefine(std::string object, bool cascade = false) {
  return {0, DeleteObject{std::move(object), cascade}};
}
inline Operation EndCommit(uint64_t frame_id = 0) {
  Commit commit;
  commit.frame_id = frame_id;
  return {0, commit};
}

// Numbers the operations as a stream does: 1, 2, 3, … after `last`.
template <typename... Ops>
std::vector<Operation> Sequence(uint64_t last, Ops... ops) {
  std::vector<Operation> all;
  (all.push_back(std::move(ops)), ...);
  for (Operation& op : all) op.sequence = ++last;
  return all;
}

}  // namespace voxeld::daemon::testing
