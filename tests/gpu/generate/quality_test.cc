// Measures the generator's voxels: neighbours, duplicates, gaps, distance, the reverse direction;
// beside the paper's own definition, by its seven-neighbour search. `--gtest_filter=Quality.*`
// prints the numbers of docs/results/fidelity.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <set>

#include "gpu/generate/generator.h"
#include "tests/gpu/generate/segment_samples.h"

namespace voxeld::gpu::generate {
namespace quality_test {

using testing::Adversarial;
using testing::SegmentD;
using Cell = std::array<int32_t, 3>;
using Cells = std::vector<Cell>;

std::vector<Cells> VoxelsOf(const std::vector<SegmentD>& segments, Sampling sampling) {
  const Format format = {sampling, Output::kI32x3};
  const auto generator = MakeCpuGenerator(1);
  const auto plan = generator->Prepare(segments, format);
  EXPECT_TRUE(plan.ok()) << plan.status();
  std::vector<std::byte> out(plan->voxels() * 12);
  EXPECT_TRUE(generator->Generate(segments, *plan, format, out).ok());
  std::vector<Cells> all;
  for (size_t i = 0; i < segments.size(); ++i) {
    Cells cells(plan->offsets[i + 1] - plan->offsets[i]);
    std::memcpy(cells.data(), out.data() + plan->offsets[i] * 12, cells.size() * 12);
    all.push_back(std::move(cells));
  }
  return all;
}

int32_t Apart(const Cell& a, const Cell& b) {
  int32_t most = 0;
  for (size_t i = 0; i < 3; ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

// Returns the distance of the cell's centre from the segment, in plain double arithmetic.
double Distance(const Cell& cell, const SegmentD& g) {
  double dd = 0, pd = 0;
  std::array<double, 3> d = {}, p = {};
  for (size_t a = 0; a < 3; ++a) {
    d[a] = g.end[a] - g.start[a];
    p[a] = cell[a] + 0.5 - g.start[a];
    dd += d[a] * d[a];
    pd += p[a] * d[a];
  }
  const double t = dd > 0 ? std::clamp(pd / dd, 0.0, 1.0) : 0;
  double sum = 0;
  for (size_t a = 0; a < 3; ++a) sum += (p[a] - t * d[a]) * (p[a] - t * d[a]);
  return std::sqrt(sum);
}

// The paper's reference: of the seven neighbours in the direction of travel, always the one whose
// centre is nearest to the line, from S's voxel to E's.
Cells SevenNeighbours(const SegmentD& g) {
  Cell at, last;
  std::array<int32_t, 3> way;
  for (size_t a = 0; a < 3; ++a) {
    at[a] = static_cast<int32_t>(std::floor(g.start[a]));
    last[a] = static_cast<int32_t>(std::floor(g.end[a]));
    way[a] = last[a] > at[a] ? 1 : -1;
  }
  Cells cells = {at};
  while (at != last) {
    Cell best = at;
    double least = 1e300;
    for (int move = 1; move < 8; ++move) {
      Cell next = at;
      bool beyond = false;
      for (size_t a = 0; a < 3; ++a) {
        if ((move >> a & 1) == 0) continue;
        beyond |= next[a] == last[a];
        next[a] += way[a];
      }
      if (beyond) continue;
      const double distance = Distance(next, g);
      if (distance < least) least = distance, best = next;
    }
    at = best;
    cells.push_back(at);
  }
  return cells;
}

struct Figures {
  uint64_t segments = 0, voxels = 0, inner = 0, not_two = 0, duplicates = 0, gaps = 0,
           lines_with_gaps = 0;
  uint64_t distinct = 0, backwards_differs = 0, in_paper = 0, paper = 0;
  double sum = 0, most = 0;
};

Figures Measure(const std::vector<SegmentD>& segments, Sampling sampling, bool beside_paper) {
  Figures f;
  const std::vector<Cells> all = VoxelsOf(segments, sampling);
  std::vector<SegmentD> turned = segments;
  for (SegmentD& g : turned) std::swap(g.start, g.end);
  const std::vector<Cells> back = VoxelsOf(turned, sampling);
  for (size_t s = 0; s < segments.size(); ++s) {
    const Cells& cells = all[s];
    const std::set<Cell> set(cells.begin(), cells.end());
    ++f.segments;
    f.voxels += cells.size();
    f.distinct += set.size();
    f.backwards_differs += set != std::set<Cell>(back[s].begin(), back[s].end());
    bool gap = false;
    for (size_t k = 0; k + 1 < cells.size(); ++k) {
      const int32_t apart = Apart(cells[k], cells[k + 1]);
      f.duplicates += apart == 0;
      f.gaps += apart > 1;
      gap |= apart > 1;
    }
    f.lines_with_gaps += gap;
    // Neighbours among the set's cells, which are near each other in the list.
    const Cells unique = [&] {
      Cells u;
      for (const Cell& c : cells) {
        if (u.empty() || u.back() != c) u.push_back(c);
      }
      return u;
    }();
    for (size_t k = 1; k + 1 < unique.size(); ++k) {
      int neighbours = 0;
      for (size_t j = k > 6 ? k - 6 : 0; j < std::min(unique.size(), k + 7); ++j) {
        neighbours += j != k && Apart(unique[j], unique[k]) == 1;
      }
      ++f.inner;
      f.not_two += neighbours != 2;
    }
    for (const Cell& c : set) {
      const double distance = Distance(c, segments[s]);
      f.sum += distance;
      f.most = std::max(f.most, distance);
    }
    if (beside_paper) {
      const Cells paper = SevenNeighbours(segments[s]);
      f.paper += paper.size();
      for (const Cell& c : paper) f.in_paper += set.contains(c);
    }
  }
  return f;
}

void Print(const char* what, const char* sampling, const Figures& f) {
  std::printf(
      "%-22s %-10s segments %llu, voxels %llu, consecutive duplicates %.2f %%, gaps in %.2f %% of "
      "segments, "
      "inner voxels without just two neighbours %.2f %%, distance mean %.3f, max %.3f, of the "
      "seven-neighbour "
      "search's voxels %.2f %%\n",
      what, sampling, static_cast<unsigned long long>(f.segments),
      static_cast<unsigned long long>(f.voxels),
      100.0 * static_cast<double>(f.duplicates) / static_cast<double>(f.voxels),
      100.0 * static_cast<double>(f.lines_with_gaps) / static_cast<double>(f.segments),
      100.0 * static_cast<double>(f.not_two) / static_cast<double>(std::max<uint64_t>(1, f.inner)),
      f.sum / static_cast<double>(f.distinct), f.most,
      f.paper > 0 ? 100.0 * static_cast<double>(f.in_paper) / static_cast<double>(f.paper) : 0.0);
}

// Returns segments in 512×512×256.
std::vector<SegmentD> InVolume(uint64_t seed, size_t count, bool whole) {
  std::mt19937_64 random(seed);
  std::vector<SegmentD> out(count);
  for (SegmentD& g : out) {
    for (auto* p : {&g.start, &g.end}) {
      for (size_t a = 0; a < 3; ++a) {
        const double v =
            std::uniform_real_distribution<double>(0, a == 2 ? 255.99 : 511.99)(random);
        // Rounded as in the batch, so that distances are to the segment that is generated.
        (*p)[a] = whole ? std::floor(v) : std::floor(v * 65536) / 65536;
      }
    }
  }
  return out;
}

// The centres of voxels are half a voxel away from integer end points: integers mean a segment
// between centres when distances are measured.
std::vector<SegmentD> ToCentres(std::vector<SegmentD> segments) {
  for (SegmentD& g : segments) {
    for (auto* p : {&g.start, &g.end}) {
      for (double& v : *p) v += 0.5;
    }
  }
  return segments;
}

// Half a voxel's diagonal, and half a unit of each end point's rounding.
constexpr double kFarthest = 0.8660255 + 0.5 / 65536 * 1.7320509;

void ExpectThin(const Figures& f) {
  EXPECT_EQ(f.duplicates, 0u);
  EXPECT_EQ(f.gaps, 0u);
  EXPECT_EQ(f.not_two, 0u) << "two and only two neighbours";
  EXPECT_EQ(f.distinct, f.voxels);
  EXPECT_EQ(f.backwards_differs, 0u);
  EXPECT_LE(f.most, kFarthest);
}

TEST(Quality, RandomSegmentsBetweenRealEndPoints) {
  const auto segments = InVolume(1, 4000, false);
  const Figures thin = Measure(segments, Sampling::kThin, true);
  Print("real end points", "THIN", thin);
  ExpectThin(thin);
  const Figures euclidean = Measure(segments, Sampling::kEuclidean, true);
  Print("real end points", "EUCLIDEAN", euclidean);
  EXPECT_EQ(euclidean.backwards_differs, 0u);
  EXPECT_LE(euclidean.most, kFarthest);
  // The paper's N violates its own definition, by this much and no more.
  EXPECT_GT(euclidean.duplicates, euclidean.voxels / 50);
  EXPECT_LT(euclidean.duplicates, euclidean.voxels / 10);
  EXPECT_LT(euclidean.lines_with_gaps, euclidean.segments / 50);
  const Figures cover = Measure(segments, Sampling::kCover, false);
  Print("real end points", "COVER", cover);
  EXPECT_EQ(cover.duplicates, 0u);
  EXPECT_EQ(cover.gaps, 0u);
  EXPECT_EQ(cover.backwards_differs, 0u);
}

TEST(Quality, RandomSegmentsBetweenCentresOfVoxels) {
  const auto segments = ToCentres(InVolume(2, 4000, true));
  const Figures thin = Measure(segments, Sampling::kThin, true);
  Print("centres of voxels", "THIN", thin);
  ExpectThin(thin);
  EXPECT_LE(thin.most, std::sqrt(0.5) + 1e-9) << "the nearest cell of each layer";
  const Figures euclidean = Measure(segments, Sampling::kEuclidean, true);
  Print("centres of voxels", "EUCLIDEAN", euclidean);
  EXPECT_EQ(euclidean.gaps, 0u);
  EXPECT_EQ(euclidean.backwards_differs, 0u);
  EXPECT_GT(euclidean.duplicates, euclidean.voxels / 50);
  // The paper's definition, each centre at the least distance: THIN satisfies it.
  EXPECT_GT(thin.in_paper * 100, thin.paper * 80);
}

TEST(Quality, AdversarialSegments) {
  for (const double origin : {0.0, -7.5, 1000.25}) {
    const auto segments = Adversarial(origin, 60);
    const Figures thin = Measure(segments, Sampling::kThin, false);
    Print("adversarial", "THIN", thin);
    ExpectThin(thin);
    for (const Sampling sampling : {Sampling::kEuclidean, Sampling::kCover}) {
      const Figures f = Measure(segments, sampling, false);
      Print("adversarial", sampling == Sampling::kCover ? "COVER" : "EUCLIDEAN", f);
      EXPECT_EQ(f.backwards_differs, 0u);
    }
  }
}

// 6-connected, and includes every cell whose inside the segment passes through.
TEST(Quality, CoverMovesOverOneFaceAtATime) {
  for (const Cells& cells : VoxelsOf(InVolume(3, 500, false), Sampling::kCover)) {
    for (size_t k = 0; k + 1 < cells.size(); ++k) {
      int32_t sum = 0;
      for (size_t a = 0; a < 3; ++a) sum += std::abs(cells[k][a] - cells[k + 1][a]);
      ASSERT_EQ(sum, 1);
    }
  }
}

}  // namespace quality_test
}  // namespace voxeld::gpu::generate
