// Records a scene and replays it: random change sets, through the daemon's own store.
#include "tools/recording/scene_recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "absl/strings/str_cat.h"
#include "daemon/wire/decode.h"
#include "daemon/wire/encode.h"
#include "daemon/wire/watch_messages.h"
#include "scene_update.pb.h"
#include "tests/daemon/scene/random_scene.h"
#include "tests/daemon/wire/random_primitive.h"
#include "tests/daemon/wire/watched_scene.h"
#include "tools/recording/foxglove_scene.h"
#include "tools/recording/putting_up.h"

namespace voxeld::recording {
namespace {

using daemon::Content;
using daemon::Entity;
using daemon::EntityPtr;
using daemon::Layer;
using daemon::LayerPtr;
using daemon::Operation;
using daemon::OwnedName;
using daemon::Snapshot;
using daemon::testing::StoreFixture;

// Returns what is visible of a scene, as text: layers in the order in which they blend, without the
// names of their owners and their own.
std::string Shown(const Snapshot& scene) {
  std::vector<std::tuple<int32_t, uint64_t, std::string>> layers;
  const auto contents = [&](const Layer& layer) {
    std::string words;
    layer.entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      const auto* instance = std::get_if<daemon::InstanceRef>(&entity->data.content);
      absl::StrAppend(&words, "\n  ", id, " ", entity->data.priority, " ", entity->data.erase, " ",
                      entity->data.label, " ", daemon::wire::InWords(entity->data.transform), " ",
                      instance != nullptr ? absl::StrCat("instance ", instance->tint)
                                          : daemon::wire::InWords(entity->data.content));
    });
    return words;
  };
  scene.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (layer->entities.empty()) return;  // nothing is visible
    v1::LayerInfo info;
    daemon::LayerInfo plain;
    plain.visible = layer->visible;
    plain.opacity = layer->opacity;
    plain.blend = layer->blend;
    plain.transform = layer->transform;
    plain.clip = layer->clip;
    plain.region = layer->region;
    daemon::wire::Encode(plain, &info);
    const Layer* mask = layer->mask.empty() ? nullptr : scene.FindLayer({key.owner, layer->mask});
    layers.emplace_back(
        layer->order, layer->number,
        absl::StrCat(info.ShortDebugString(), layer->mask.empty() ? "" : " masked by ",
                     mask == nullptr ? "" : contents(*mask), contents(*layer)));
  });
  std::sort(layers.begin(), layers.end());
  std::string text;
  for (const auto& [order, number, words] : layers) absl::StrAppend(&text, order, " ", words, "\n");
  // The definitions, whatever their names.
  std::vector<std::string> objects;
  scene.objects.ForEach([&](const OwnedName&, const daemon::ObjectPtr& object) {
    std::string words = "object";
    for (const daemon::ObjectPart& part : object->data->parts) {
      const auto* instance = std::get_if<daemon::InstanceRef>(&part.content);
      absl::StrAppend(&words, " ", daemon::wire::InWords(part.transform),
                      instance != nullptr ? absl::StrCat("instance ", instance->tint)
                                          : daemon::wire::InWords(part.content));
    }
    objects.push_back(std::move(words));
  });
  std::sort(objects.begin(), objects.end());
  for (const std::string& object : objects) absl::StrAppend(&text, object, "\n");
  return text;
}

// The scene of the replaying client.
class Replayed {
 public:
  void Apply(const std::vector<v1::StreamRequest>& requests) {
    std::vector<Operation> operations;
    for (const v1::StreamRequest& request : requests) {
      daemon::wire::Decoded decoded =
          daemon::wire::DecodeStreamRequest(request, daemon::Limits(), sequence_);
      ASSERT_TRUE(decoded.status.ok()) << decoded.status;
      ASSERT_TRUE(decoded.refused.issues.empty()) << decoded.refused.issues[0].message;
      sequence_ = decoded.sequence;
      for (Operation& operation : decoded.operations) operations.push_back(std::move(operation));
    }
    const daemon::CommitResult result = scene.CommitAll(scene.me, std::move(operations));
    for (const daemon::Issue& issue : result.issues) {
      EXPECT_TRUE(issue.applied) << issue.layer << "/" << issue.id << ": " << issue.message;
    }
  }
  void Remove(const std::vector<std::string>& layers) {
    scene.store.RemoveLayers(
        [&](const OwnedName& key, const Layer&) {
          return std::find(layers.begin(), layers.end(), key.name) != layers.end();
        },
        false);
  }

  StoreFixture scene;

 private:
  uint64_t sequence_ = 0;
};

class SceneRecording : public ::testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(path_); }
  const std::string path_ = absl::StrCat(::testing::TempDir(), "/voxeld-scene-", getpid(), ".mcap");
};

TEST_F(SceneRecording, RandomScenesComeUpAgainTheSameAfterEveryChange) {
  for (uint32_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    std::filesystem::remove(path_);
    std::mt19937 random(seed);
    daemon::wire::RandomPrimitives primitives(random);
    const auto content = [&] {
      Content out;
      EXPECT_FALSE(daemon::wire::ToContent(daemon::wire::FieldPath("primitive"),
                                           primitives.Next(20, false), {daemon::Limits()}, &out)
                       .has_value());
      return out;
    };
    StoreFixture f;
    v1::WatchSceneRequest request;
    request.set_contents(true);
    daemon::wire::WatchMessages watch(request, 2000);
    auto recorder = SceneRecorder::Create(path_, "test");
    ASSERT_TRUE(recorder.ok()) << recorder.status();
    std::map<uint64_t, std::string> shown;
    for (int step = 0; step < 25; ++step) {
      std::vector<Operation> operations = daemon::testing::RandomOperations(random, 12);
      for (Operation& operation : operations) {
        operation.sequence = ++f.last_sequence;
        if (auto* upsert = std::get_if<daemon::Upsert>(&operation.op)) {
          if (std::holds_alternative<daemon::GeometryPtr>(upsert->entity.content)) {
            upsert->entity.content = content();
          }
        } else if (auto* define = std::get_if<daemon::DefineObject>(&operation.op)) {
          auto data = std::make_shared<daemon::ObjectData>(*define->data);
          for (daemon::ObjectPart& part : data->parts) {
            if (std::holds_alternative<daemon::GeometryPtr>(part.content)) part.content = content();
          }
          define->data = std::move(data);
        } else if (auto* state = std::get_if<daemon::LayerState>(&operation.op)) {
          state->order = static_cast<int32_t>(random() % 3) - 1;
        }
      }
      f.CommitAll(daemon::testing::MakeAuthor(1 + random() % 2, 11), std::move(operations));
      if (random() % 6 == 0) {
        f.store.RemoveLayers([&](const OwnedName& key, const Layer&) { return key.name == "l2"; },
                             random() % 2 == 0);
      }
      f.now += 5;
      f.store.Expire(f.now);
      if (random() % 3 == 0 || watch.told() == f.store.snapshot()->number) continue;
      watch.Begin(f.store.snapshot());
      while (!watch.in_sync()) {
        v1::WatchSceneResponse message;
        ASSERT_TRUE(watch.Next(&message).ok());
        ASSERT_TRUE((*recorder)->Add(message, 1000 + static_cast<uint64_t>(step)).ok());
      }
      shown[f.store.snapshot()->number] = Shown(*f.store.snapshot());
    }
    ASSERT_TRUE((*recorder)->Close().ok());

    // From the beginning, and from somewhere in the middle.
    for (const size_t skip : {size_t{0}, shown.size() / 2}) {
      auto reader = McapReader::Open(path_);
      ASSERT_TRUE(reader.ok());
      Replayed replayed;
      PuttingUp up;
      size_t sets = 0;
      const absl::Status read = ReadScene(**reader, [&](ChangeSet set) {
        ++sets;
        if (sets <= skip) {
          up.Skip(set.changes);
          if (sets < skip) return true;
          replayed.Apply(up.Whole());
        } else {
          replayed.Apply(up.Step(set.changes));
        }
        replayed.Remove(up.TakeEmptied());
        EXPECT_EQ(Shown(*replayed.scene.store.snapshot()), shown.at(set.snapshot)) << set.snapshot;
        return !HasFailure();
      });
      ASSERT_TRUE(read.ok()) << read;
      EXPECT_EQ(sets, shown.size());
    }
    if (HasFailure()) return;
  }
}

TEST(Layers, GoByTheirNamesAndByANumberWhereSeveralHaveOne) {
  const auto layer = [](uint64_t owner, const std::string& name, uint64_t number) {
    v1::LayerInfo info;
    info.set_owner(owner);
    info.set_layer(name);
    info.set_number(number);
    return info;
  };
  PuttingUp up("night: ");
  const auto names = [&](const v1::WatchSceneResponse& changes) {
    std::vector<std::string> out;
    for (const v1::StreamRequest& request : up.Step(changes)) {
      if (request.has_layer_state()) out.push_back("+" + request.layer_state().layer());
      if (request.has_delete_()) out.push_back("-" + request.delete_().layer());
    }
    return out;
  };
  v1::WatchSceneResponse changes;
  *changes.add_layers() = layer(58, "voxelctl", 127);
  *changes.add_layers() = layer(59, "voxelctl", 128);
  *changes.add_layers() = layer(59, std::string(254, 'a') + "é", 129);
  EXPECT_THAT(names(changes), ::testing::ElementsAre("+night: voxelctl", "+night: voxelctl (2)",
                                                     "+night: " + std::string(233, 'a')));
  // If it is made again, it is another layer, although the first still exists.
  changes.Clear();
  *changes.add_layers() = layer(58, "voxelctl", 130);
  EXPECT_THAT(names(changes), ::testing::ElementsAre("-night: voxelctl", "+night: voxelctl (3)"));
  EXPECT_THAT(up.TakeEmptied(), ::testing::ElementsAre("night: voxelctl"));
  changes.Clear();
  *changes.add_layers() = layer(60, "voxelctl", 131);
  EXPECT_THAT(names(changes), ::testing::ElementsAre("+night: voxelctl")) << "it is free again";
}

TEST(Objects, ThatLeaveTogetherLeaveBeforeTheirParts) {
  v1::WatchSceneResponse defined, removed;
  for (const char* name : {"a", "b", "c"}) {
    v1::WatchedObject* object = defined.add_objects();
    object->mutable_key()->set_owner(7);
    object->mutable_key()->set_object(name);
    *removed.add_removed_objects() = object->key();
  }
  // b contains a, and c contains b.
  const auto part = [&](int of) {
    return defined.mutable_objects(of)->mutable_definition()->add_parts()->mutable_primitive();
  };
  part(0)->mutable_sphere();
  part(1)->mutable_instance()->set_object("a");
  part(2)->mutable_instance()->set_object("b");
  PuttingUp up;
  const auto names = [](const std::vector<v1::StreamRequest>& requests) {
    std::vector<std::string> out;
    for (const v1::StreamRequest& request : requests) {
      out.push_back(request.has_define_object() ? "+" + request.define_object().object()
                                                : "-" + request.delete_object().object());
    }
    return out;
  };
  EXPECT_THAT(names(up.Step(defined)), ::testing::ElementsAre("+7/a", "+7/b", "+7/c"));
  EXPECT_THAT(names(up.Step(removed)), ::testing::ElementsAre("-7/c", "-7/b", "-7/a"));
}

TEST_F(SceneRecording, AFileWithoutASceneSaysSo) {
  auto writer = McapWriter::Create(path_, "somebody");
  ASSERT_TRUE((*writer)->Close().ok());
  auto reader = McapReader::Open(path_);
  EXPECT_TRUE(absl::IsInvalidArgument(ReadScene(**reader, [](ChangeSet) { return true; })));
}

TEST_F(SceneRecording, WhatWaitedIsOnTheDiskInTime) {
  auto recorder = SceneRecorder::Create(path_, "test");
  v1::WatchSceneResponse message;
  message.set_in_sync(1);
  ASSERT_TRUE((*recorder)->Add(message, 1'000'000'000).ok());
  const auto size = std::filesystem::file_size(path_);
  ASSERT_TRUE((*recorder)->Tick(1'000'000'000 + SceneRecorder::kFlushNs - 1).ok());
  EXPECT_EQ(std::filesystem::file_size(path_), size);
  ASSERT_TRUE((*recorder)->Tick(1'000'000'000 + SceneRecorder::kFlushNs).ok());
  EXPECT_GT(std::filesystem::file_size(path_), size);
  auto reader = McapReader::Open(path_);
  size_t sets = 0;
  EXPECT_TRUE(ReadScene(**reader, [&](ChangeSet) { return ++sets > 0; }).ok());
  EXPECT_EQ(sets, 1u);
}

// --------------------------------------------------------------------------------------- for other viewers

v1::WatchSceneResponse OneEntity(const v1::Primitive& primitive) {
  v1::WatchSceneResponse message;
  v1::LayerInfo* layer = message.add_layers();
  layer->set_owner(1);
  layer->set_layer("l");
  layer->set_visible(true);
  for (const double m : {1., 0., 0., 10., 0., 1., 0., 0., 0., 0., 1., 0.}) {
    layer->mutable_transform()->add_m(m);
  }
  v1::WatchedEntity* entity = message.add_entities();
  entity->mutable_info()->mutable_key()->set_owner(1);
  entity->mutable_info()->mutable_key()->set_layer("l");
  entity->mutable_info()->mutable_key()->set_id("e");
  *entity->mutable_primitive() = primitive;
  return message;
}

TEST(ViewersScene, ABoxIsWhereItIsUnderTheMapOfItsLayer) {
  v1::Primitive box;
  box.mutable_color()->set_rgb(0xFF8000);
  box.mutable_box()->mutable_center()->set_y(1);
  for (auto set : {&v1::Vec3::set_x, &v1::Vec3::set_y, &v1::Vec3::set_z}) {
    (box.mutable_box()->mutable_size()->*set)(2);
  }
  SceneMirror mirror;
  mirror.Apply(OneEntity(box));
  foxglove::SceneUpdate update;
  MakeSceneUpdate(mirror, 5'000'000'007, &update);
  ASSERT_EQ(update.entities_size(), 1);
  EXPECT_EQ(update.entities(0).id(), "1/l/e");
  EXPECT_EQ(update.entities(0).timestamp().seconds(), 5);
  EXPECT_EQ(update.entities(0).timestamp().nanos(), 7);
  ASSERT_EQ(update.entities(0).triangles_size(), 1);
  const foxglove::TriangleListPrimitive& drawn = update.entities(0).triangles(0);
  EXPECT_DOUBLE_EQ(drawn.color().g(), 128 / 255.0);
  double least[3] = {99, 99, 99}, most[3] = {-99, -99, -99};
  for (const foxglove::Point3& p : drawn.points()) {
    const double at[3] = {p.x(), p.y(), p.z()};
    for (int i = 0; i < 3; ++i) {
      least[i] = std::min(least[i], at[i]);
      most[i] = std::max(most[i], at[i]);
    }
  }
  EXPECT_THAT(least, ::testing::ElementsAre(9, 0, -1));
  EXPECT_THAT(most, ::testing::ElementsAre(11, 2, 1));
}

TEST(ViewersScene, WhatIsHiddenOrGoneIsDeleted) {
  v1::Primitive sphere;
  sphere.mutable_sphere()->set_radius(1);
  SceneMirror mirror;
  mirror.Apply(OneEntity(sphere));
  foxglove::SceneUpdate update;
  MakeSceneUpdate(mirror, 1, &update);
  v1::WatchSceneResponse hide;
  *hide.add_layers() = OneEntity(sphere).layers(0);
  hide.mutable_layers(0)->set_visible(false);
  mirror.Apply(hide);
  MakeSceneUpdate(mirror, 2, &update);
  EXPECT_EQ(update.entities_size(), 0);
  ASSERT_EQ(update.deletions_size(), 1);
  EXPECT_EQ(update.deletions(0).id(), "1/l/e");
  hide.mutable_layers(0)->set_visible(true);
  mirror.Apply(hide);
  MakeSceneUpdate(mirror, 3, &update);
  EXPECT_EQ(update.entities_size(), 1);
  v1::WatchSceneResponse gone;
  gone.add_removed_layers()->set_owner(1);
  gone.mutable_removed_layers(0)->set_layer("l");
  mirror.Apply(gone);
  MakeSceneUpdate(mirror, 4, &update);
  EXPECT_EQ(update.deletions_size(), 1);
  EXPECT_TRUE(mirror.entities().empty());
}

}  // namespace
}  // namespace voxeld::recording
