// Tests frames that a worker passes: what is copied, and that damage is detected.
#include "gpu/worker/frame_slot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace voxeld::gpu {
namespace {

struct Frame {
  explicit Frame(const display::FrameLayout& layout)
      : slot{layout.pictures(), layout.bytes()}, memory(slot.size()) {}
  FrameBuffer buffer() { return slot.In(memory); }
  FrameSlot slot;
  std::vector<std::byte> memory;
};

void Fill(FrameBuffer buffer, uint64_t newest, uint32_t seed) {
  std::mt19937 random(seed);
  for (std::byte& byte : buffer.bytes) byte = static_cast<std::byte>(random());
  for (uint64_t& number : buffer.changed_in) number = 1 + random() % newest;
}

class FrameSlotOf : public ::testing::TestWithParam<display::FrameLayout> {};

// Small pictures of odd sizes, and pictures so large that they are copied past the caches, by
// several threads.
INSTANTIATE_TEST_SUITE_P(
    Layouts, FrameSlotOf,
    ::testing::Values(display::FrameLayout{.slices = 30, .width = 7, .height = 5, .sub_frames = 3},
                      display::FrameLayout{
                          .slices = 60, .width = 521, .height = 211, .sub_frames = 2}),
    [](const auto& info) { return info.param.bytes() < 100'000 ? "Small" : "Large"; });

TEST_P(FrameSlotOf, CopiesWhatIsNewerOfItsSlicesAndNothingElse) {
  const display::FrameLayout& layout = GetParam();
  const PictureRange range = PictureRange::Of(layout, {.begin = 4, .end = layout.slices - 3});
  const size_t subs = static_cast<size_t>(layout.sub_frames);
  EXPECT_EQ(range.begin, 4 * subs);
  EXPECT_EQ(range.end, layout.pictures() - 3 * subs);
  const auto executor = MakeFrameExecutor(layout.bytes());
  constexpr uint64_t kNewest = 9, kToHolds = 6;
  Frame from(layout), to(layout);
  Fill(from.buffer(), kNewest, 1);
  Fill(to.buffer(), 1, 2);
  const std::vector<std::byte> before = to.memory;
  const uint32_t crc = CopyFrame(layout, from.buffer(), 3, range, to.buffer(), kToHolds, *executor);
  EXPECT_EQ(crc, FrameCrc(layout, from.buffer(), range, 3, *executor));
  Frame old(layout);
  old.memory = before;
  const size_t size = layout.bytes_per_slice();
  size_t copied = 0;
  for (size_t p = 0; p < layout.pictures(); ++p) {
    const bool mine = p >= range.begin && p < range.end;
    const bool newer = mine && from.buffer().changed_in[p] > kToHolds;
    EXPECT_EQ(to.buffer().changed_in[p], (mine ? from : old).buffer().changed_in[p]);
    const auto want = (newer ? from : old).buffer().bytes.subspan(p * size, size);
    ASSERT_TRUE(std::ranges::equal(to.buffer().bytes.subspan(p * size, size), want)) << p;
    copied += newer;
  }
  EXPECT_GT(copied, 10u);
}

TEST_P(FrameSlotOf, DamageShowsWhereThePicturesAreNew) {
  const display::FrameLayout& layout = GetParam();
  const PictureRange range = PictureRange::Of(layout, {.begin = 1, .end = layout.slices - 1});
  const auto executor = MakeFrameExecutor(layout.bytes());
  constexpr uint64_t kHolds = 5;
  Frame frame(layout);
  Fill(frame.buffer(), 9, 3);
  const FrameBuffer buffer = frame.buffer();
  const uint32_t crc = FrameCrc(layout, buffer, range, kHolds, *executor);
  std::mt19937 random(4);
  int seen = 0;
  for (int i = 0; i < 60; ++i) {
    const size_t at = random() % buffer.bytes.size();
    const size_t picture = at / layout.bytes_per_slice();
    const bool looked_at =
        picture >= range.begin && picture < range.end && buffer.changed_in[picture] > kHolds;
    buffer.bytes[at] ^= std::byte{0x10};
    EXPECT_EQ(FrameCrc(layout, buffer, range, kHolds, *executor) != crc, looked_at);
    buffer.bytes[at] ^= std::byte{0x10};
    seen += looked_at;
  }
  EXPECT_GT(seen, 10);
  ++buffer.changed_in[range.begin];
  EXPECT_NE(FrameCrc(layout, buffer, range, kHolds, *executor), crc);
}

}  // namespace
}  // namespace voxeld::gpu
