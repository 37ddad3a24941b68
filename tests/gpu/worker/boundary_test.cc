// Tests the data that crosses the boundary between processes: segments and targets.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "gpu/bulk/segment.h"
#include "gpu/worker/target_codec.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu {
namespace {

TEST(Segment, IsTheSameMemoryAtBothEnds) {
  const auto made = Segment::Create(100'000);
  ASSERT_TRUE(made.ok()) << made.status();
  (*made)->bytes()[99'999] = std::byte{7};
  const auto adopted = Segment::Adopt(dup((*made)->fd()), 100'000);
  ASSERT_TRUE(adopted.ok()) << adopted.status();
  EXPECT_EQ((*adopted)->bytes()[99'999], std::byte{7});
  (*adopted)->bytes()[0] = std::byte{9};
  EXPECT_EQ((*made)->bytes()[0], std::byte{9});
  EXPECT_NE(ftruncate((*made)->fd(), 1), 0);  // sealed
}

TEST(Segment, OfAnotherSizeOrWithoutSealsIsRefused) {
  const auto made = Segment::Create(4096);
  ASSERT_TRUE(made.ok());
  EXPECT_EQ(Segment::Adopt(dup((*made)->fd()), 8192).status().code(),
            absl::StatusCode::kInvalidArgument);
  const int open = memfd_create("open", MFD_CLOEXEC);
  ASSERT_EQ(ftruncate(open, 4096), 0);
  EXPECT_EQ(Segment::Adopt(open, 4096).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(TargetCodec, BringsEveryTargetThrough) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const Target target = conformance::SceneGenerator(seed).RandomTarget();
    const auto bytes = EncodeTarget(target);
    const auto decoded = DecodeTarget(bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->geometry, target.geometry);
    EXPECT_EQ(decoded->layout, target.layout);
    EXPECT_EQ(decoded->tone, target.tone);
    EXPECT_EQ(decoded->view, target.view);
    for (size_t cut = 0; cut < bytes.size(); cut += 1 + bytes.size() / 50) {
      EXPECT_FALSE(DecodeTarget(std::span(bytes).first(cut)).ok()) << cut;
    }
  }
}

Target LatticeTarget() {
  Target target;
  target.geometry.shape = display::Lattice{.width_px = 2,
                                           .points_mm = {display::Vec3{1, 2, 3}, std::nullopt,
                                                         std::nullopt, display::Vec3{-4, 5.5, 1e6}},
                                           .cell_mm = {0.5, 0.25, 2}};
  return target;
}

TEST(TargetCodec, BringsALatticeThrough) {
  const Target target = LatticeTarget();
  const auto bytes = EncodeTarget(target);
  const auto decoded = DecodeTarget(bytes);
  ASSERT_TRUE(decoded.ok()) << decoded.status();
  EXPECT_EQ(decoded->geometry, target.geometry);
  for (size_t cut = 0; cut < bytes.size(); ++cut) {
    EXPECT_FALSE(DecodeTarget(std::span(bytes).first(cut)).ok()) << cut;
  }
}

TEST(TargetCodec, RefusesALatticeOfMoreLightsThanBytes) {
  // The number of lights follows the kind of shape and the picture's two sides.
  constexpr size_t kCount = sizeof(uint64_t) + 2 * sizeof(int32_t);
  const auto good = EncodeTarget(LatticeTarget());
  uint64_t count = 0;
  std::memcpy(&count, good.data() + kCount, sizeof(count));
  ASSERT_EQ(count, 4u);
  for (const uint64_t hostile : {uint64_t{3}, uint64_t{5}, uint64_t{good.size()}, uint64_t{1} << 28,
                                 uint64_t{1} << 63, ~uint64_t{0}}) {
    auto bytes = good;
    std::memcpy(bytes.data() + kCount, &hostile, sizeof(hostile));
    EXPECT_FALSE(DecodeTarget(bytes).ok()) << hostile;
  }
  auto bytes = good;
  bytes[kCount + sizeof(count)] = std::byte{2};  // neither a light nor the lack of one
  EXPECT_FALSE(DecodeTarget(bytes).ok());
  bytes = good;
  bytes[0] = std::byte{3};  // the kind of shape
  EXPECT_FALSE(DecodeTarget(bytes).ok());
}

// Returns targets with every kind of shape, with a table of displacements and one homography for
// each panel.
std::vector<Target> TargetsOfAllShapes() {
  std::vector<Target> targets(4);
  display::PlanarStack stack{.width_px = 3, .height_px = 5, .mirror_v = true};
  stack.positions_mm = {1, 2.5};
  targets[0].geometry.shape = stack;
  targets[1].geometry.shape =
      display::Rotor{.slices_per_turn = 7, .panels = {{.tilt_deg = 3}, {}}, .clockwise = true};
  targets[2] = LatticeTarget();
  targets[3].geometry.shape = display::Helix{.slices_per_turn = 9, .left_handed = true};
  display::Correction correction;
  correction.homographies.resize(2);
  correction.displacement.emplace();
  correction.displacement->at_mm = {{1, 2, 3}, {4, 5, 6}};
  targets[1].geometry.correction = correction;
  return targets;
}

TEST(TargetCodec, EveryCutAndEveryByteMoreIsRefused) {
  for (const Target& target : TargetsOfAllShapes()) {
    auto bytes = EncodeTarget(target);
    const auto decoded = DecodeTarget(bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.status();
    EXPECT_EQ(decoded->geometry, target.geometry);
    for (size_t cut = 0; cut < bytes.size(); ++cut) {
      EXPECT_FALSE(DecodeTarget(std::span(bytes).first(cut)).ok()) << cut;
    }
    bytes.push_back(std::byte{0});
    EXPECT_FALSE(DecodeTarget(bytes).ok());
  }
}

// For any value of a byte: what is accepted is encoded again to the same bytes, and booleans are 1
// and 0.
TEST(TargetCodec, WhatIsTakenHasNoOtherMeaning) {
  for (const Target& target : TargetsOfAllShapes()) {
    const auto good = EncodeTarget(target);
    for (size_t at = 0; at < good.size(); ++at) {
      for (const unsigned value : {2u, 0xFFu}) {
        auto bytes = good;
        bytes[at] = static_cast<std::byte>(value);
        const auto decoded = DecodeTarget(bytes);
        if (decoded.ok()) {
          EXPECT_EQ(EncodeTarget(*decoded), bytes) << at;
        }
      }
    }
  }
  // The last byte of a stack's own fields is mirror_v; the grid follows.
  auto bytes = EncodeTarget(TargetsOfAllShapes()[0]);
  constexpr size_t kMirrorV = 8 + 1 + 2 * 4 + 2 * 8 + 8 + 2 * 8 + 4 + 8 + 1;
  ASSERT_EQ(bytes[kMirrorV], std::byte{1});
  for (const unsigned wrong : {2u, 3u, 0xFFu}) {
    bytes[kMirrorV] = static_cast<std::byte>(wrong);
    EXPECT_FALSE(DecodeTarget(bytes).ok()) << wrong;
  }
  bytes[kMirrorV] = std::byte{0};
  EXPECT_TRUE(DecodeTarget(bytes).ok());
  for (const unsigned wrong : {4u, 5u, 0xFFu}) {
    bytes[0] = static_cast<std::byte>(wrong);
    EXPECT_EQ(DecodeTarget(bytes).status().message(), "a target of an unknown shape");
  }
}

}  // namespace
}  // namespace voxeld::gpu
