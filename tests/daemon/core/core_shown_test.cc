// Tests what a display shows, together with the scene from which it was drawn.
#include <gtest/gtest.h>

#include "daemon/pipeline/frame_pipeline.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::DeleteId;
using testing::Put;
using testing::Shift;
using testing::Simulation;

struct Watched : Simulation {
  Watched() {
    Start();
    client = Open();
    Send(client, 1, Put("a", "first", 1));
    Show();
  }

  void Watch() {
    core->WatchVolumes("main", [this](const absl::StatusOr<display::DecodedVolume>& volume) {
      told = volume.ok() ? volume->volume : 0;
    });
    core->Step();
    while (Show()) {
    }
  }

  absl::StatusOr<ShownScene> Shown() {
    absl::StatusOr<ShownScene> shown = absl::UnknownError("no answer");
    core->GetShownScene("main", [&](absl::StatusOr<ShownScene> s) { shown = std::move(s); });
    core->Step();
    return shown;
  }

  // Returns the entities of layer a from which the shown volume was drawn.
  std::string Names() {
    const absl::StatusOr<ShownScene> shown = Shown();
    if (!shown.ok()) return std::string(shown.status().message());
    EXPECT_EQ(shown->volume.volume, told);
    std::string names;
    const Layer* const layer = shown->from.scene->FindLayer({client.info.owner, "a"});
    if (layer == nullptr) return "no layer";
    layer->entities.ForEach([&](const std::string& id, const EntityPtr&) { names += id + " "; });
    return names;
  }

  Client client;
  uint64_t told = 0;
};

TEST(CoreShown, NobodyWatches) {
  Watched sim;
  EXPECT_TRUE(absl::IsFailedPrecondition(sim.Shown().status()));
}

TEST(CoreShown, TheSceneThatTheVolumeWasDrawnFrom) {
  Watched sim;
  sim.Watch();
  EXPECT_EQ(sim.Names(), "first ");
  // The next volume is drawn and on its way, but the previous one is still shown.
  sim.Send(sim.client, 2, Put("a", "second", 2));
  EXPECT_EQ(sim.Names(), "first ");
  sim.Send(sim.client, 3, DeleteId("a", "first"));
  EXPECT_EQ(sim.Names(), "first ");
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(sim.Names(), "first second ");
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(sim.Names(), "second ");
}

TEST(CoreShown, WithTheViewThatItWasDrawnThrough) {
  Watched sim;
  sim.Watch();
  const gpu::Affine before = sim.Shown()->from.scene_to_voxel;
  sim.Send(sim.client, 2, Put("a", "second", 2));
  DisplayUpdate update;
  update.view = ViewOptions{ViewOptions::Mode::kVoxels, {}, {}};
  ASSERT_TRUE(sim.Update(update).ok());
  EXPECT_EQ(sim.Shown()->from.scene_to_voxel, before) << "it is not shown yet";
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(sim.Shown()->from.scene_to_voxel, gpu::Affine());
}

TEST(CoreShown, APictureThatStaysWasDrawnFromTheNewestSceneThatLooksSo) {
  Watched sim;
  sim.Watch();
  const uint64_t volume = sim.told;
  EXPECT_EQ(sim.Names(), "first ");
  // The scene is drawn again with other entities that look the same: the same dot under two names,
  // then under one.
  sim.Send(sim.client, 2, Put("a", "again", 1));
  while (sim.Show()) {
  }
  sim.Send(sim.client, 3, DeleteId("a", "first"));
  while (sim.Show()) {
  }
  EXPECT_EQ(sim.Names(), "again ");
  EXPECT_GE(sim.told, volume);
}

TEST(CoreShown, WhoDoesNotAskHasNothingKept) {
  Watched sim;
  sim.Watch();
  EXPECT_EQ(sim.Names(), "first ");
  sim.Advance(FramePipeline::kScenesLinger);
  sim.Send(sim.client, 2, Put("a", "second", 2));
  EXPECT_EQ(sim.Names(), "what the volume was drawn from is not known any more");
  // From now on it is.
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(sim.Names(), "first second ");
}

TEST(CoreShown, AnUnknownDisplay) {
  Watched sim;
  absl::Status status;
  sim.core->GetShownScene("none",
                          [&](const absl::StatusOr<ShownScene>& s) { status = s.status(); });
  sim.core->Step();
  EXPECT_TRUE(absl::IsNotFound(status));
}

}  // namespace
}  // namespace voxeld::daemon
