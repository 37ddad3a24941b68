// Tests that the client uploads assets, continues an interrupted upload, and draws with the
// uploaded content.
#include "voxeld/assets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "daemon/assets/asset_store.h"
#include "display/sync/clock.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "voxeld/client.h"

namespace voxeld::client {
namespace {

using ::testing::HasSubstr;

class WithAssets : public ::testing::Test {
 protected:
  absl::StatusOr<Asset> Upload(std::string_view bytes,
                               std::function<bool(uint64_t, uint64_t)> progress = nullptr) {
    return UploadAsset(bytes, {.address = daemon_.target(), .progress = std::move(progress)});
  }

  sync::SystemClock clock_;
  std::unique_ptr<daemon::assets::AssetStore> store_ =
      daemon::assets::AssetStore::Open("", {.max_asset_bytes = 8u << 20}, clock_, nullptr);
  daemon::services::Daemon daemon_{{.assets = store_.get()}};
};

std::string BytesOf(const std::vector<float>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(float)};
}

TEST_F(WithAssets, ShapesNameWhatWasBrought) {
  const auto positions = Upload(BytesOf({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  ASSERT_TRUE(positions.ok()) << positions.status();
  const auto samples = Upload(std::string("\x00\xff\x00\xff\x00\xff\x00\xff", 8));
  const auto heights = Upload(BytesOf({0, 0.5, 0.25, 1}));
  ASSERT_TRUE(samples.ok() && heights.ok());

  auto session = *Session::Open({.address = daemon_.target(), .strict = true});
  const Layer layer = session->GetLayer("l");
  ASSERT_TRUE(layer.Put("mesh", Mesh{.vertices = {.positions = *positions}}).ok());
  Grid grid{.size_a = 2, .size_b = 2, .size_c = 2};
  grid.samples = Array<uint8_t>(*samples);
  ASSERT_TRUE(layer.Put("volume", Volume{.grid = grid}).ok());
  ASSERT_TRUE(layer.Put("heights", HeightMap{.columns = 2, .rows = 2, .heights = *heights}).ok());
  const auto frame = session->Commit();
  ASSERT_TRUE(frame.ok());
  const auto receipt = session->WaitAccepted(*frame, std::chrono::seconds(60));
  EXPECT_TRUE(receipt.ok()) << receipt.status();
  EXPECT_EQ(daemon_.Entities().total(), 3u);

  const auto scale =
      layer.Put("no", Points{.vertices = {.positions = *positions}},
                {.color_scale = ColorScale{.colormap = "viridis", .scalars = *heights}});
  EXPECT_TRUE(absl::IsInvalidArgument(scale.status()));
}

TEST_F(WithAssets, WhatIsThereIsNotSentAgain) {
  const std::string bytes(700'000, 'v');
  std::vector<uint64_t> told;
  const auto first = Upload(bytes, [&](uint64_t stored, uint64_t size) {
    EXPECT_EQ(size, bytes.size());
    told.push_back(stored);
    return true;
  });
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->sha256, AssetOf(bytes).sha256);
  EXPECT_THAT(told, ::testing::ElementsAre(256u << 10, 512u << 10, 700'000));
  const auto second = Upload(bytes, [](uint64_t, uint64_t) {
    ADD_FAILURE() << "sent again";
    return true;
  });
  EXPECT_TRUE(second.ok());
  EXPECT_EQ(store_->figures().bytes_in, bytes.size());
}

TEST_F(WithAssets, WhatWasStoppedGoesOnWhereItStopped) {
  const std::string bytes(4u << 20, 'w');
  const std::vector digests = {AssetOf(bytes).sha256};
  const auto stopped = Upload(bytes, [&](uint64_t sent, uint64_t) {
    if (sent < (2u << 20)) return true;
    while (store_->List(digests).front().stored < (1u << 20)) continue;  // the upload is under way
    return false;
  });
  EXPECT_TRUE(absl::IsCancelled(stopped.status()));
  uint64_t first = 0;
  const auto rest = Upload(bytes, [&first](uint64_t stored, uint64_t) {
    if (first == 0) first = stored;
    return true;
  });
  ASSERT_TRUE(rest.ok()) << rest.status();
  EXPECT_GT(first, 1u << 20) << "the first piece is behind the stored bytes";
  EXPECT_EQ(store_->figures().bytes_in, bytes.size()) << "every byte was sent once";
  EXPECT_EQ(store_->figures().count, 1u);
}

TEST_F(WithAssets, WhatIsTooLargeIsSaid) {
  const auto large = Upload(std::string((8u << 20) + 1, 'x'));
  EXPECT_TRUE(absl::IsInvalidArgument(large.status()));
  EXPECT_THAT(std::string(large.status().message()), HasSubstr("which is max_asset_bytes"));
  EXPECT_TRUE(absl::IsInvalidArgument(Upload("").status()));
}

TEST_F(WithAssets, APartThatIsWrongIsBroughtAnew) {
  const std::string bytes(600'000, 'r');
  const auto wrong = store_->Begin(AssetOf(bytes).sha256, bytes.size(), 0);
  ASSERT_TRUE(wrong.ok());
  ASSERT_TRUE(store_->Append(*wrong, 0, std::string(1000, 'x')).ok());
  store_->Abandon(*wrong);
  const auto asset = Upload(bytes);
  ASSERT_TRUE(asset.ok()) << asset.status();
  EXPECT_EQ(store_->FindAsset(asset->sha256, 0, bytes.size())->bytes, bytes);
}

TEST(Assets, AServerThatIsAwayIsGivenUp) {
  const auto away = UploadAsset(
      "x", {.address = "unix:/nowhere/voxeld.sock", .patience = std::chrono::milliseconds(50)});
  EXPECT_TRUE(absl::IsDeadlineExceeded(away.status()) || absl::IsUnavailable(away.status()))
      << away.status();
}

TEST(Assets, WhoeverWaitsForAServerMayStop) {
  int told = 0;
  const auto stopped =
      UploadAsset("x", {.address = "unix:/nowhere/voxeld.sock",
                        .patience = std::chrono::hours(1),
                        .progress = [&told](uint64_t, uint64_t) { return ++told < 2; }});
  EXPECT_TRUE(absl::IsCancelled(stopped.status())) << stopped.status();
}

}  // namespace
}  // namespace voxeld::client
