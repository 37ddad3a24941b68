// Tests what a viewer gets of a display's volumes: the newest, and the parts of it that differ.
#include "daemon/core/volume_feed.h"

#include <gtest/gtest.h>

#include "daemon/pipeline/frame_pipeline.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Put;
using testing::Simulation;

// A simulation with something in the scene.
struct Lit : Simulation {
  Lit() {
    Start();
    client = Open();
    Send(client, 1, Put("a", "x", 1));
  }
  Client client;
};

struct Viewer {
  Viewer(Simulation& sim, const std::string& display = "main")
      : sim(sim), feed(VolumeFeed::Open(*sim.core, sim.clock, display, [this] { ++readies; })) {
    sim.core->Step();
  }
  // Shows everything that the display has to show.
  void Show() {
    sim.core->Step();
    while (sim.Show()) {
    }
  }

  Simulation& sim;
  int readies = 0;
  std::shared_ptr<VolumeFeed> feed;
};

TEST(VolumeFeed, BeginsWithAllAndGoesOnWithWhatDiffers) {
  Lit sim;
  Viewer viewer(sim);
  viewer.Show();
  EXPECT_EQ(viewer.readies, 1);
  auto change = viewer.feed->Take();
  ASSERT_TRUE(change.ok() && change->has_value());
  EXPECT_TRUE((*change)->whole);
  EXPECT_EQ((*change)->slices.size(), static_cast<size_t>((*change)->volume.layout.slices));
  change = viewer.feed->Take();
  ASSERT_TRUE(change.ok());
  EXPECT_FALSE(change->has_value());

  sim.Send(sim.client, 2, Put("a", "y", 2));
  viewer.Show();
  EXPECT_EQ(viewer.readies, 2);
  change = viewer.feed->Take();
  ASSERT_TRUE(change.ok() && change->has_value());
  EXPECT_FALSE((*change)->whole);
  EXPECT_EQ((*change)->slices, std::vector<int32_t>{0});
}

TEST(VolumeFeed, WhoDoesNotTakeIsPassedOverThenSleepsAndBeginsAnew) {
  Lit sim;
  Viewer viewer(sim);
  viewer.Show();
  sim.Send(sim.client, 2, Put("a", "x", 2));
  viewer.Show();
  EXPECT_EQ(viewer.readies, 1) << "notified once, though two arrived";
  EXPECT_FALSE(viewer.feed->asleep());
  sim.clock.Advance(VolumeFeed::kPatience);
  sim.Send(sim.client, 3, Put("a", "x", 3));
  viewer.Show();
  EXPECT_TRUE(viewer.feed->asleep());
  sim.core->Step();
  EXPECT_EQ(sim.GetStats().volume_watches_asleep, 1u);
  sim.Advance(FramePipeline::kWatchLinger);
  EXPECT_FALSE(sim.display().tapped()) << "nothing is decoded for a sleeping viewer";

  auto change = viewer.feed->Take();  // awake
  ASSERT_TRUE(change.ok());
  EXPECT_FALSE(change->has_value());
  EXPECT_FALSE(viewer.feed->asleep());
  viewer.Show();
  change = viewer.feed->Take();
  ASSERT_TRUE(change.ok() && change->has_value());
  EXPECT_TRUE((*change)->whole);
}

TEST(VolumeFeed, TwoWatchOneDisplayAndTheLastToGoEndsIt) {
  Lit sim;
  Viewer first(sim);
  first.Show();
  auto second = std::make_unique<Viewer>(sim);
  second->Show();
  EXPECT_EQ(second->readies, 1) << "the newest, at once";
  second.reset();
  sim.core->Step();
  EXPECT_TRUE(sim.display().tapped());
  first.feed.reset();
  sim.core->Step();
  sim.Advance(FramePipeline::kWatchLinger - 1);
  EXPECT_TRUE(sim.display().tapped()) << "a viewer that comes and goes costs the display nothing";
  const int sent = sim.display().sent;
  Viewer third(sim);
  EXPECT_EQ(third.readies, 1) << "the newest, and nothing is sent again for it";
  EXPECT_EQ(sim.display().sent, sent);
  third.feed.reset();
  sim.core->Step();
  sim.Advance(FramePipeline::kWatchLinger);
  EXPECT_FALSE(sim.display().tapped());
}

TEST(VolumeFeed, ANameThatIsNotThereIsTheEnd) {
  Simulation sim;
  sim.Start();
  Viewer viewer(sim, "none");
  EXPECT_EQ(viewer.readies, 1);
  EXPECT_TRUE(absl::IsNotFound(viewer.feed->Take().status()));
}

}  // namespace
}  // namespace voxeld::daemon
