#include "gpu/samples_bricks.h"

#include <algorithm>

#include "gpu/primitives/samples.h"

namespace voxeld::gpu {
namespace {

constexpr int32_t kBrick = static_cast<int32_t>(SampleHead::kBrick);

// The range of the samples of a brick and of those next to it.
struct Range {
  float least = 0, greatest = 0;
  bool any = false;    // there are numbers
  bool edge = false;   // at the grid's edge, or beside samples that are NaN
  bool alpha = false;  // for colours: some alpha is not 0

  void Add(float number) {
    if (implicit::IsNan(number)) {
      edge = true;
      return;
    }
    least = any ? std::min(least, number) : number;
    greatest = any ? std::max(greatest, number) : number;
    any = true;
  }
};

Range RangeOf(const SampleView& view, const int32_t at[3]) {
  Range range;
  int32_t lo[3], hi[3];
  for (int a = 0; a < 3; ++a) {
    const int32_t n = static_cast<int32_t>(view.head().size[a]);
    lo[a] = std::max(0, at[a] - 1);
    hi[a] = std::min(n, at[a] + kBrick + 1);
    range.edge = range.edge || at[a] == 0 || at[a] + kBrick >= n;
  }
  const bool colors = view.head().format == SampleFormat::kRgba8;
  for (int32_t z = lo[2]; z < hi[2]; ++z) {
    for (int32_t y = lo[1]; y < hi[1]; ++y) {
      const uint64_t row = view.IndexOf(0, y, z);
      for (int32_t x = lo[0]; x < hi[0]; ++x) {
        const uint64_t i = row + static_cast<uint64_t>(x);
        if (colors) {
          range.alpha = range.alpha || view.Word(i) >> 24 != 0;
        } else {
          range.Add(view.Number(i));
        }
      }
    }
  }
  // Allows for the rounding of means of samples.
  constexpr float kRounding = 1e-6f;
  range.least -= implicit::Abs(range.least) * kRounding;
  range.greatest += implicit::Abs(range.greatest) * kRounding;
  return range;
}

bool MayBeCovered(const SampleView& view, const Range& range, const GeometryRecord& record) {
  const SampleHead& head = view.head();
  if (head.format == SampleFormat::kRgba8) return range.alpha;
  if (!range.any) return false;
  if (head.by_level == 0) {
    const uint32_t first = Samples::EntryOf(head, range.least),
                   last = Samples::EntryOf(head, range.greatest);
    return std::any_of(view.table() + first, view.table() + last + 1,
                       [](uint32_t entry) { return (entry & SampleHead::kDrawn) != 0; });
  }
  const bool inside = range.greatest >= head.level;
  if (record.fill == Fill::kSolid) return inside;
  // A thick shell can reach anywhere numbers change.
  if (record.thickness > 0) return range.least < range.greatest || inside;
  return inside && (range.least < head.level || range.edge);
}

}  // namespace

uint32_t BrickWords(const uint32_t size[3]) {
  uint64_t bricks = 1;
  for (int a = 0; a < 3; ++a) bricks *= (size[a] + SampleHead::kBrick - 1) / SampleHead::kBrick;
  return static_cast<uint32_t>((bricks + 31) / 32);
}

uint64_t SampleWords(const uint32_t size[3], uint32_t format) {
  const uint64_t samples = uint64_t{size[0]} * size[1] * size[2];
  return kSampleHeadWords + uint64_t{SampleHead::kTableEntries} + BrickWords(size) +
         SampleHead::WordsOf(static_cast<SampleFormat>(format), samples);
}

void FillBricks(const GeometryRecord& record, std::span<uint32_t> words) {
  const SampleView view{words.data()};
  const SampleHead head = view.head();
  uint32_t* const out = words.data() + (view.bricks() - view.words);
  std::fill_n(out, head.bricks, 0);
  uint64_t brick = 0;
  const auto size = [&](int a) { return static_cast<int32_t>(head.size[a]); };
  for (int32_t z = 0; z < size(2); z += kBrick) {
    for (int32_t y = 0; y < size(1); y += kBrick) {
      for (int32_t x = 0; x < size(0); x += kBrick, ++brick) {
        const int32_t at[3] = {x, y, z};
        if (MayBeCovered(view, RangeOf(view, at), record)) out[brick / 32] |= 1u << (brick % 32);
      }
    }
  }
}

}  // namespace voxeld::gpu
