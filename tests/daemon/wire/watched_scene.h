// The knowledge of a client that watches the scene, from messages alone; and the same from a
// snapshot, as text, for comparison.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "daemon/scene/snapshot.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/primitive.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {

inline std::string InWords(const GeometryData& g) {
  const gpu::GeometryRecord& r = g.record;
  std::string text = absl::StrCat(
      static_cast<int>(r.kind), " #", absl::Hex(r.color), " ", static_cast<int>(r.color_mode), " ",
      static_cast<int>(r.sampling), " ", static_cast<int>(r.rule), " ", static_cast<int>(r.fill),
      " ", static_cast<int>(r.topology), " ", static_cast<int>(r.thickness_unit), " ", r.thickness,
      " ", r.vertex_count, " ", r.index_count, " ", static_cast<int>(r.drawn_by), " ",
      static_cast<int>(r.splat), " ", r.texture_width, " × ", r.texture_height, " (");
  for (const float param : r.params) absl::StrAppendFormat(&text, "%a ", param);
  for (int axis = 0; axis < 3; ++axis)
    absl::StrAppendFormat(&text, "%a-%a ", g.min[axis], g.max[axis]);
  // Bit for bit, since zero has two signs.
  const auto bytes = [&](const auto& array) {
    text += ") (";
    text.append(reinterpret_cast<const char*>(array.data()), array.size() * 4);
  };
  bytes(g.arrays.positions());
  bytes(g.arrays.indices());
  bytes(g.arrays.colors());
  return text + ")";
}

inline std::string InWords(const gpu::Affine& map) {
  return absl::StrJoin(
      map.m, ",", [](std::string* out, double value) { absl::StrAppendFormat(out, "%a", value); });
}

// Returns everything that decoding an entity's primitive gives.
inline std::string InWords(const Content& content) {
  if (const auto* instance = std::get_if<InstanceRef>(&content)) {
    return absl::StrCat("of ", instance->object, " #", absl::Hex(instance->tint));
  }
  if (const auto* geometry = std::get_if<GeometryPtr>(&content)) return InWords(**geometry);
  const GroupData& group = *std::get<GroupPtr>(content);
  std::string text = absl::StrCat(group.kind, " #", absl::Hex(group.color));
  for (const GroupData::Part& part : group.parts) {
    absl::StrAppend(&text, " [", InWords(*part.geometry), " at ", InWords(part.transform), "]");
  }
  return text;
}

inline std::string InWords(const v1::Affine& map) {
  gpu::Affine out;
  EXPECT_EQ(map.m_size(), 12);
  EXPECT_FALSE(ToAffine(FieldPath("map"), map, &out).has_value());
  return InWords(out);
}

inline std::string InWords(const v1::Primitive& primitive) {
  Content content;
  const MaybeFault fault = ToContent(FieldPath("primitive"), primitive, {Limits()}, &content);
  EXPECT_FALSE(fault.has_value()) << fault->field << " " << fault->message;
  return fault.has_value() ? "" : InWords(content);
}

// Maps keys to what is reported about them.
struct SceneInWords {
  std::map<std::pair<uint64_t, std::string>, std::string> layers, objects;
  std::map<std::tuple<uint64_t, std::string, std::string>, std::string> entities;
  bool operator==(const SceneInWords&) const = default;
};

inline SceneInWords InWords(const Snapshot& scene, const v1::WatchSceneRequest& request) {
  SceneInWords words;
  scene.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (request.owner() != 0 && key.owner != request.owner()) return;
    if (!request.layer().empty() && key.name != request.layer()) return;
    words.layers[{key.owner, key.name}] =
        absl::StrCat(layer->number, " ", layer->visible, " ", layer->opacity, " ", layer->order,
                     " ", static_cast<int>(layer->blend) + 1, " ", InWords(layer->transform), " ",
                     layer->writer->ended, " ", layer->writer->client_name);
    layer->entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      const EntityData& data = entity->data;
      const auto* geometry = std::get_if<GeometryPtr>(&data.content);
      static constexpr const char* kKinds[] = {"",    "points", "segments", "mesh",
                                               "box", "sphere", "cylinder"};
      const char* kind = "instance";
      if (geometry != nullptr) {
        kind = (*geometry)->kind != nullptr ? (*geometry)->kind
                                            : kKinds[static_cast<int>((*geometry)->record.kind)];
      } else if (const auto* group = std::get_if<GroupPtr>(&data.content)) {
        kind = (*group)->kind;
      }
      words.entities[{key.owner, key.name, id}] = absl::StrCat(
          kind, " ", geometry == nullptr ? 0 : (*geometry)->record.vertex_count, " ", entity->bytes,
          " ", data.priority, " ", data.erase, " ", entity->sequence, " ",
          entity->expires_ns == sync::kNever ? 0 : entity->expires_ns, " ", data.label, " ",
          InWords(data.transform), request.contents() ? InWords(data.content) : "");
    });
  });
  scene.objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    if (!request.contents() || (request.owner() != 0 && key.owner != request.owner())) return;
    std::string& text = words.objects[{key.owner, key.name}];
    for (const ObjectPart& part : object->data->parts) {
      text += InWords(part.transform) + InWords(part.content) + ";";
    }
  });
  return words;
}

// The contents of messages, which arrive in the order that the contract gives: removals first, then
// layers and objects, then entities.
class WatchedScene {
 public:
  void Apply(const v1::WatchSceneResponse& message) {
    for (const v1::LayerKey& key : message.removed_layers()) {
      EXPECT_EQ(words_.layers.erase({key.owner(), key.layer()}), 1u) << key.layer();
      std::erase_if(words_.entities, [&](const auto& entity) {
        return std::get<0>(entity.first) == key.owner() && std::get<1>(entity.first) == key.layer();
      });
    }
    for (const v1::EntityKey& key : message.removed_entities()) {
      EXPECT_EQ(words_.entities.erase({key.owner(), key.layer(), key.id()}), 1u) << key.id();
    }
    for (const v1::ObjectKey& key : message.removed_objects()) {
      EXPECT_EQ(words_.objects.erase({key.owner(), key.object()}), 1u) << key.object();
    }
    for (const v1::LayerInfo& layer : message.layers()) {
      EXPECT_EQ(layer.entities(), 0u);
      EXPECT_EQ(layer.bytes(), 0u);
      words_.layers[{layer.owner(), layer.layer()}] =
          absl::StrCat(layer.number(), " ", layer.visible(), " ", layer.opacity(), " ",
                       layer.order(), " ", static_cast<int>(layer.blend()), " ",
                       InWords(layer.transform()), " ", layer.orphaned(), " ", layer.client_name());
    }
    for (const v1::WatchedObject& object : message.objects()) {
      std::string& text = words_.objects[{object.key().owner(), object.key().object()}];
      text.clear();
      for (const v1::Object::Part& part : object.definition().parts()) {
        text += InWords(part.transform()) + InWords(part.primitive()) + ";";
      }
    }
    for (const v1::WatchedEntity& entity : message.entities()) {
      const v1::EntityInfo& info = entity.info();
      EXPECT_TRUE(words_.layers.contains({info.key().owner(), info.key().layer()}));
      words_.entities[{info.key().owner(), info.key().layer(), info.key().id()}] = absl::StrCat(
          info.kind(), " ", info.vertices(), " ", info.bytes(), " ", info.priority(), " ",
          info.erase(), " ", info.sequence(), " ", info.expires_ns(), " ", info.label(), " ",
          InWords(info.transform()), entity.has_primitive() ? InWords(entity.primitive()) : "");
    }
    if (message.in_sync() != 0) {
      EXPECT_GT(message.in_sync(), in_sync_);
      in_sync_ = message.in_sync();
    }
  }

  const SceneInWords& words() const { return words_; }
  uint64_t in_sync() const { return in_sync_; }  // the last number reported; 0: none yet

 private:
  SceneInWords words_;
  uint64_t in_sync_ = 0;
};

}  // namespace voxeld::daemon::wire
