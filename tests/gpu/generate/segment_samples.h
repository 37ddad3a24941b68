// Segments for testing a generator: random ones, and those that are likely to fail.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "gpu/generate/batch.h"

namespace voxeld::gpu::generate::testing {

using SegmentI = Segment<int32_t>;
using SegmentF = Segment<float>;
using SegmentD = Segment<double>;

// Axis-parallel, diagonal, of length 0 and 1, on halves, in both directions, with slopes whose
// voxels meet faces exactly, just below and just above integers, around `origin`.
inline std::vector<SegmentD> Adversarial(double origin, double length) {
  std::vector<SegmentD> out;
  constexpr double kUnit = 1.0 / 65536;
  const auto add = [&](double sx, double sy, double sz, double dx, double dy, double dz) {
    const SegmentD g = {{origin + sx, origin + sy, origin + sz},
                        {origin + sx + dx, origin + sy + dy, origin + sz + dz}};
    out.push_back(g);
    out.push_back({g.end, g.start});
  };
  for (const double at : {0.0, 0.5, kUnit, -kUnit, 1 - kUnit}) {
    for (const double l : {0.0, kUnit, 0.5, 1 - kUnit, 1.0, 1 + kUnit, 2.0, length}) {
      add(at, at, at, l, 0, 0);
      add(at, 0, at, 0, l, 0);
      add(0, at, at, 0, 0, l);
      add(at, at, at, l, l, l);
      add(at, at, 0, l, -l, 0);
      add(0, at, 0.5, l, l, -l);
      add(at, 0.5, at, l, l / 2, l / 4);
    }
  }
  const double third = static_cast<double>(static_cast<int64_t>(length / 3)) * 3;
  add(0, 0, 0, third, third / 3, -third / 3);
  add(0, 0, 0, length, 1, -1);
  add(kUnit, 0, 0, length, 1, kUnit);
  add(0, 1 - kUnit, 0.5, length, -1, kUnit);
  add(0, 0, 0, length, length - 1, 1);
  // Half a unit, and the value just below it.
  const double half = kUnit / 2;
  for (const double at : {half, std::nextafter(half, 0.0), -half, std::nextafter(-half, -1.0)}) {
    out.push_back({{at, at, at}, {length + at, at, -at}});
  }
  return out;
}

// Ends within ±`reach`; on whole voxels if `whole`.
inline std::vector<SegmentD> RandomSegments(uint64_t seed, size_t count, double reach, bool whole) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> within(-reach, reach);
  std::vector<SegmentD> out(count);
  for (SegmentD& g : out) {
    for (auto* p : {&g.start, &g.end}) {
      for (double& v : *p)
        v = whole ? static_cast<double>(static_cast<int64_t>(within(random))) : within(random);
    }
  }
  return out;
}

}  // namespace voxeld::gpu::generate::testing
