#include "daemon/core/scene_info.h"

#include <variant>

namespace voxeld::daemon {
namespace {

const char* KindName(gpu::PrimitiveKind kind) {
  switch (kind) {
    case gpu::PrimitiveKind::kPoints:
      return "points";
    case gpu::PrimitiveKind::kSegments:
      return "segments";
    case gpu::PrimitiveKind::kTriangles:
    case gpu::PrimitiveKind::kFilled:
      return "mesh";
    case gpu::PrimitiveKind::kBox:
      return "box";
    case gpu::PrimitiveKind::kSphere:
      return "sphere";
    case gpu::PrimitiveKind::kCylinder:
      return "cylinder";
    case gpu::PrimitiveKind::kImplicit:
      return "implicit";
    case gpu::PrimitiveKind::kCurves:
      return "curve";
    case gpu::PrimitiveKind::kPatches:
      return "bezier_surface";
    case gpu::PrimitiveKind::kSamples:
      return "volume";
  }
  return "?";
}

}  // namespace

EntityInfo InfoOf(const OwnedName& layer, const std::string& id, const Entity& entity) {
  EntityInfo info;
  info.key = {layer.owner, layer.name, id};
  if (const auto* geometry = std::get_if<GeometryPtr>(&entity.data.content)) {
    const char* const kind = (*geometry)->kind;
    info.kind = kind != nullptr ? kind : KindName((*geometry)->record.kind);
    info.vertices = (*geometry)->record.vertex_count;
    info.color = (*geometry)->record.color;
  } else if (const auto* group = std::get_if<GroupPtr>(&entity.data.content)) {
    info.kind = (*group)->kind;
    info.color = (*group)->color;
  } else {
    info.kind = "instance";
  }
  info.bytes = entity.bytes;
  info.priority = entity.data.priority;
  info.erase = entity.data.erase;
  info.transform = entity.data.transform;
  info.sequence = entity.sequence;
  info.expires_ns = entity.expires_ns == sync::kNever ? 0 : entity.expires_ns;
  info.label = entity.data.label;
  return info;
}

LayerInfo InfoOf(const OwnedName& key, const Layer& layer) {
  LayerInfo info;
  info.owner = key.owner;
  info.layer = key.name;
  info.number = layer.number;
  info.visible = layer.visible;
  info.opacity = layer.opacity;
  info.order = layer.order;
  info.blend = layer.blend;
  info.transform = layer.transform;
  info.clip = layer.clip;
  info.region = layer.region;
  info.mask = layer.mask;
  info.entities = layer.entities.size();
  info.bytes = layer.bytes;
  info.orphaned = layer.writer->ended;
  info.client_name = layer.writer->client_name;
  return info;
}

}  // namespace voxeld::daemon
