// Tests pictures that are packed while the volume is drawn: a whole engine is compared, pixel by
// pixel, with the definitions of tone, dither and packing for the voxels that it reports; and when
// each picture changed.
#include "gpu/slice/plane_packer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <random>

#include "gpu/cpu/cpu_engine.h"
#include "gpu/delta.h"
#include "gpu/engine.h"
#include "gpu/slice/pack.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {
namespace {

constexpr int32_t kWidth = 37, kHeight = 45, kSlices = 20;  // the last tile is incomplete in each

Target StackTarget(int32_t sub_frames, display::Dither dither) {
  display::PlanarStack stack;
  stack.width_px = kWidth;
  stack.height_px = kHeight;
  for (int32_t s = 0; s < kSlices; ++s) stack.positions_mm.push_back(s);
  Target target;
  target.geometry = {stack, {}};
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {.slices = kSlices,
                   .width = kWidth,
                   .height = kHeight,
                   .sub_frames = sub_frames,
                   .format = display::PixelFormat::kBitPlanes};
  std::mt19937 random(3);
  for (display::Tone::Curve& curve : target.tone.lut) {
    for (size_t c = 1; c < 256; ++c) curve[c] = static_cast<uint16_t>(random() % 65536);
    curve[255] = 65535;
  }
  target.tone.dither = dither;
  return target;
}

class StackEngine {
 public:
  explicit StackEngine(const Target& target)
      : engine_(CreateCpuEngine({.threads = 2, .inline_execution = true}, "a test")),
        bytes_(target.layout.bytes()),
        changed_in_(target.layout.pictures()) {
    SetTarget(target);
    Apply([](DeltaWriter& w) { w.PutLayer({.id = 1}); });
  }

  void SetTarget(const Target& target) {
    target_ = target;
    engine_->SetTarget(target, [](const absl::Status& status) { ASSERT_TRUE(status.ok()); });
  }

  void Apply(const std::function<void(DeltaWriter&)>& write) {
    StagingBlock block = *engine_->AcquireStaging(1 << 17);
    DeltaWriter writer(block.bytes());
    write(writer);
    ASSERT_FALSE(writer.overrun());
    engine_->Apply(std::move(block), writer.size(),
                   [](const absl::Status& status) { ASSERT_TRUE(status.ok()) << status; });
  }

  // Inserts lines as drawable `id`.
  void PutLines(uint64_t id, uint32_t seed, int lines) {
    std::mt19937 random(seed);
    std::vector<float> positions;
    std::vector<uint32_t> colors;
    for (int i = 0; i < lines * 2; ++i) {
      for (const int32_t size : {kWidth, kHeight, kSlices}) {
        positions.push_back(static_cast<float>(random() % static_cast<uint32_t>(size * 16)) / 16);
      }
      colors.push_back(static_cast<uint32_t>(random()) & 0xFFFFFF);
    }
    Apply([&](DeltaWriter& w) {
      GeometryRecord g;
      g.id = ++geometries_;
      g.kind = PrimitiveKind::kSegments;
      g.color_mode = ColorMode::kPerVertex;
      g.vertex_count = static_cast<uint32_t>(lines) * 2;
      w.PutGeometry(g, positions, {}, colors);
      w.PutDrawable({.id = id, .geometry = geometries_, .layer = 1});
    });
  }

  // Inserts a box as drawable `id`, from the corner of the volume on.
  void PutBox(uint64_t id, uint32_t rgb, std::array<float, 3> size) {
    Apply([&](DeltaWriter& w) {
      GeometryRecord g;
      g.id = ++geometries_;
      g.kind = PrimitiveKind::kBox;
      g.fill = Fill::kSolid;
      g.color = rgb;
      for (size_t a = 0; a < 3; ++a) {
        g.params[a] = size[a] / 2;
        g.params[3 + a] = size[a];
      }
      w.PutGeometry(g, {}, {}, {});
      w.PutDrawable({.id = id, .geometry = geometries_, .layer = 1});
    });
  }

  std::vector<uint32_t> ReadVoxels() {
    const display::VoxelGrid& grid = target_.geometry.grid;
    std::vector<uint32_t> voxels(static_cast<size_t>(grid.nx * grid.ny * grid.nz));
    engine_->ReadVoxels({0, 0, 0, grid.nx, grid.ny, grid.nz}, voxels,
                        [](const absl::Status& status) { ASSERT_TRUE(status.ok()); });
    return voxels;
  }

  // Returns the pictures of a stack whose pixels are voxels.
  std::vector<std::byte> Expected(const std::vector<uint32_t>& voxels) const {
    const display::FrameLayout& layout = target_.layout;
    std::vector<std::byte> out(layout.bytes());
    const auto subs = static_cast<uint32_t>(layout.sub_frames);
    for (size_t picture = 0; picture < layout.pictures(); ++picture) {
      uint8_t* const to =
          reinterpret_cast<uint8_t*>(out.data()) + picture * layout.bytes_per_slice();
      for (uint32_t v = 0; v < kHeight; ++v) {
        for (uint32_t u = 0; u < kWidth; ++u) {
          const uint32_t rgb = voxels[(picture / subs * kHeight + v) * kWidth + u];
          const uint32_t t =
              Threshold(target_.tone.dither, u, v, static_cast<uint32_t>(picture % subs), subs);
          const auto level = [&](int shift) {
            return Quantize(target_.tone.lut[2 - shift / 8][rgb >> shift & 0xFF], 2, t);
          };
          PackPixel({layout.format, 1, kWidth, kHeight}, u, v, {level(16), level(8), level(0)}, to);
        }
      }
    }
    return out;
  }

  // Draws a frame and checks all of it. Returns how many pictures changed.
  int ExpectFrame() {
    const std::vector<std::byte> before = bytes_;
    const std::vector<uint64_t> changed_before = changed_in_;
    ++frame_;
    engine_->SubmitFrame({frame_, frame_ - 1}, {bytes_, changed_in_},
                         [](const absl::StatusOr<FrameResult>& result) {
                           ASSERT_TRUE(result.ok()) << result.status();
                           EXPECT_TRUE(result->packed_as_drawn);
                         });
    EXPECT_EQ(bytes_, Expected(ReadVoxels())) << "frame " << frame_;
    const size_t size = target_.layout.bytes_per_slice();
    int changed = 0;
    for (size_t picture = 0; picture < changed_in_.size(); ++picture) {
      const auto at = [&](const auto& bytes) {
        return bytes.begin() + static_cast<ptrdiff_t>(picture * size);
      };
      const bool differs =
          !std::equal(at(bytes_), at(bytes_) + static_cast<ptrdiff_t>(size), at(before));
      EXPECT_EQ(changed_in_[picture], frame_ == 1 || differs ? frame_ : changed_before[picture])
          << "frame " << frame_ << ", picture " << picture;
      changed += changed_in_[picture] == frame_;
    }
    return changed;
  }

 private:
  Target target_;
  const std::unique_ptr<Engine> engine_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_in_;
  uint64_t frame_ = 0, geometries_ = 0;
};

TEST(PlanePacker, ShowsTheVolumeAndTellsWhatChanged) {
  for (const auto& [sub_frames, dither] :
       {std::pair(1, display::Dither::kOrdered), std::pair(3, display::Dither::kOrdered),
        std::pair(1, display::Dither::kNone)}) {
    StackEngine engine(StackTarget(sub_frames, dither));
    engine.ExpectFrame();  // nothing is drawn
    engine.PutLines(1, 1, 3);
    EXPECT_GT(engine.ExpectFrame(), 0);
    engine.PutLines(2, 2, 300);
    EXPECT_EQ(engine.ExpectFrame(), kSlices * sub_frames);
    EXPECT_EQ(engine.ExpectFrame(), 0);
    engine.PutLines(2, 3, 200);
    engine.ExpectFrame();
    engine.PutLines(3, 3, 200);  // over the existing ones
    EXPECT_EQ(engine.ExpectFrame(), 0);
    engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 2); });
    EXPECT_EQ(engine.ExpectFrame(), 0) << "the same lines are still there";
    engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 3); });
    EXPECT_GT(engine.ExpectFrame(), 0);
    engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 1); });
    EXPECT_GT(engine.ExpectFrame(), 0) << "dark again";
  }
}

TEST(PlanePacker, TilesOfOneColourBecomeOthersAndBack) {
  for (const int sub_frames : {1, 3}) {
    StackEngine engine(StackTarget(sub_frames, display::Dither::kOrdered));
    const int all = kSlices * sub_frames;
    engine.PutBox(1, 0xC04080, {kWidth, kHeight, kSlices});
    EXPECT_EQ(engine.ExpectFrame(), all);
    engine.PutBox(1, 0xC04080, {kWidth, kHeight, kSlices});
    EXPECT_EQ(engine.ExpectFrame(), 0) << "the same once more";
    engine.PutBox(1, 0x30A060, {kWidth, kHeight, kSlices});
    EXPECT_EQ(engine.ExpectFrame(), all) << "another colour";
    engine.PutLines(2, 5, 2);
    EXPECT_GT(engine.ExpectFrame(), 0) << "no longer of one";
    engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 2); });
    EXPECT_GT(engine.ExpectFrame(), 0);
    engine.PutBox(1, 0x30A060, {16, 20, 7});
    EXPECT_EQ(engine.ExpectFrame(), all) << "a part";
    engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 1); });
    EXPECT_EQ(engine.ExpectFrame(), 7 * sub_frames) << "dark again";
  }
}

TEST(PlanePacker, WhatIsReadBetweenFramesIsNoChange) {
  StackEngine engine(StackTarget(1, display::Dither::kOrdered));
  engine.PutLines(1, 1, 40);
  engine.ReadVoxels();
  EXPECT_EQ(engine.ExpectFrame(), kSlices);
  engine.PutLines(1, 2, 40);
  engine.ReadVoxels();
  EXPECT_GT(engine.ExpectFrame(), 0);
  engine.PutLines(1, 3, 40);
  engine.ReadVoxels();
  engine.PutLines(1, 2, 40);
  EXPECT_EQ(engine.ExpectFrame(), 0) << "there and back";
  engine.PutLines(1, 3, 40);
  engine.ReadVoxels();
  engine.PutLines(1, 2, 40);
  engine.ReadVoxels();
  EXPECT_EQ(engine.ExpectFrame(), 0) << "there and back, both read";
}

TEST(PlanePacker, ANewPlanKeepsThePicturesThatComeOutAlike) {
  Target target = StackTarget(1, display::Dither::kOrdered);
  StackEngine engine(target);
  engine.PutLines(1, 1, 40);
  engine.ExpectFrame();
  engine.SetTarget(target);
  EXPECT_EQ(engine.ExpectFrame(), 0);
  target.tone.dither = display::Dither::kNone;
  engine.SetTarget(target);
  EXPECT_GT(engine.ExpectFrame(), 0);
  engine.Apply([](DeltaWriter& w) { w.Drop(Op::kDropDrawable, 1); });
  engine.SetTarget(target);  // nothing is drawn with this plan
  EXPECT_GT(engine.ExpectFrame(), 0) << "dark again";
}

}  // namespace
}  // namespace voxeld::gpu
