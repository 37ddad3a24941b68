// Implements gpu/primitives/samples.h's definition voxel by voxel, without bricks.
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "tests/conformance/oracle_shapes.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();

// The words by their indices: 0 to 2 sizes, 3 format, 4 filter, 5 by level, 6 low, 7 scale, 8
// level, 9 words of bricks; from 12 on the table.
struct Words {
  const std::vector<uint32_t>& all;

  int64_t size(int a) const { return all[static_cast<size_t>(a)]; }
  uint32_t format() const { return all[3]; }
  bool nearest() const { return all[4] == 1; }
  float real(size_t i) const {
    float value;
    std::memcpy(&value, &all[i], sizeof(value));
    return value;
  }
  uint32_t entry(size_t i) const { return all[12 + i]; }
  // Returns the four channels, or the number four times.
  std::array<float, 4> At(int64_t x, int64_t y, int64_t z) const {
    const size_t i = static_cast<size_t>((z * size(1) + y) * size(0) + x),
                 begin = 12 + 256 + all[9];
    const auto* bytes = reinterpret_cast<const unsigned char*>(&all[begin]);
    if (format() == 3) {
      const uint32_t word = all[begin + i];
      std::array<float, 4> color;
      for (size_t c = 0; c < 4; ++c) color[c] = static_cast<float>(word >> (8 * c) & 255);
      return color;
    }
    float number = 0;
    if (format() == 0) number = static_cast<float>(bytes[i]);
    if (format() == 1) number = static_cast<float>(bytes[2 * i] + 256 * bytes[2 * i + 1]);
    if (format() == 2) number = real(begin + i);
    return {number, number, number, number};
  }
};

// The neighbourhood of a place: the eight samples around it, corner by corner, and its position
// between them.
struct Around {
  std::array<float, 4> corner[8];
  float t[3];

  std::array<float, 4> Mean(const float (&at)[3]) const {
    std::array<float, 4> mean;
    for (size_t c = 0; c < 4; ++c) {
      float v[8];
      for (size_t i = 0; i < 8; ++i) v[i] = corner[i][c];
      // Interpolates along one axis after another.
      for (size_t i = 0; i < 4; ++i) v[i] = v[2 * i] + (v[2 * i + 1] - v[2 * i]) * at[0];
      for (size_t i = 0; i < 2; ++i) v[i] = v[2 * i] + (v[2 * i + 1] - v[2 * i]) * at[1];
      mean[c] = v[0] + (v[1] - v[0]) * at[2];
    }
    return mean;
  }
};

std::optional<Around> Look(const Words& words, const OracleFrame& frame, int64_t x, int64_t y,
                           int64_t z) {
  float q[3];
  frame.Coordinates(x, y, z, q);
  int64_t first[3], second[3];
  Around around;
  for (int a = 0; a < 3; ++a) {
    const int64_t n = words.size(a);
    if (!(q[a] >= 0 && q[a] < static_cast<float>(n))) return std::nullopt;
    if (words.nearest()) {
      first[a] = second[a] = std::min<int64_t>(static_cast<int64_t>(std::floor(q[a])), n - 1);
      around.t[a] = 0;
    } else {
      const float place = q[a] - 0.5f;
      const auto below = static_cast<int64_t>(std::floor(place));
      first[a] = std::max<int64_t>(below, 0);
      second[a] = std::min(below + 1, n - 1);
      around.t[a] = place - static_cast<float>(below);
    }
  }
  for (int i = 0; i < 8; ++i) {
    around.corner[i] = words.At(i & 1 ? second[0] : first[0], i & 2 ? second[1] : first[1],
                                i & 4 ? second[2] : first[2]);
  }
  return around;
}

std::array<float, 4> ValueOf(const Words& words, const Around& around) {
  return words.nearest() ? around.corner[0] : around.Mean(around.t);
}

float DepthAt(const Words& words, const OracleFrame& frame, int64_t x, int64_t y, int64_t z) {
  const std::optional<Around> around = Look(words, frame, x, y, z);
  if (!around) return kNothing;
  const float depth = words.real(8) - ValueOf(words, *around)[0];
  return std::isnan(depth) ? kNothing : depth;
}

bool IsAtLevel(const ModelGeometry& g, const Words& words, const OracleFrame& frame, float half,
               int64_t x, int64_t y, int64_t z) {
  const float depth = DepthAt(words, frame, x, y, z);
  if (g.record.fill == Fill::kSolid) return depth <= 0;
  if (half > 0 && !words.nearest() && depth != kNothing) {
    const Around around = *Look(words, frame, x, y, z);
    float slope[3], square = 0;
    for (int a = 0; a < 3; ++a) {
      float low[3] = {around.t[0], around.t[1], around.t[2]}, high[3] = {low[0], low[1], low[2]};
      low[a] = 0;
      high[a] = 1;
      slope[a] = around.Mean(high)[0] - around.Mean(low)[0];
    }
    for (int c = 0; c < 3; ++c) {
      float d = slope[0] * frame.inverse[0][c] + slope[1] * frame.inverse[1][c];
      d = d + slope[2] * frame.inverse[2][c];
      square = square + d * d;
    }
    if (std::fabs(depth) <= half * std::sqrt(square)) return true;
  }
  for (int n = 0; n < 27; ++n) {
    const int dx = n % 3 - 1, dy = n / 3 % 3 - 1, dz = n / 9 - 1;
    const int faces = std::abs(dx) + std::abs(dy) + std::abs(dz);
    if (faces == 0 || (faces > 1 && g.record.rule == SurfaceRule::kThin)) continue;
    const float other = DepthAt(words, frame, x + dx, y + dy, z + dz);
    if ((other <= 0) != (depth <= 0) && std::fabs(other) >= std::fabs(depth)) return true;
  }
  return false;
}

}  // namespace

void PlotSamples(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                 const Plot& plot) {
  OracleFrame frame;
  if (!SetOracleFrame(map, false, frame)) return;
  const Words words{g.indices};
  const float half = static_cast<float>(OracleRadius(g.record, map)) / 256;
  for (int64_t z = 0; z < grid.nz; ++z) {
    for (int64_t y = 0; y < grid.ny; ++y) {
      for (int64_t x = 0; x < grid.nx; ++x) {
        if (g.indices[5] == 1) {
          if (IsAtLevel(g, words, frame, half, x, y, z)) plot(x, y, z, g.record.color);
          continue;
        }
        if (g.indices[5] == 2) {
          if (!IsAtLevel(g, words, frame, half, x, y, z)) continue;
          float q[3];
          frame.Coordinates(x, y, z, q);
          float place = q[0] * g.record.params[0] + q[1] * g.record.params[1];
          place = place + q[2] * g.record.params[2];
          place = std::floor(place + g.record.params[3]);
          const float entry = place >= 0 ? std::min(place, 255.0f) : 0.0f;
          plot(x, y, z, words.entry(static_cast<size_t>(entry)) & 0xFFFFFF);
          continue;
        }
        const std::optional<Around> around = Look(words, frame, x, y, z);
        if (!around) continue;
        const std::array<float, 4> value = ValueOf(words, *around);
        if (words.format() == 3) {
          uint32_t rgb = 0;
          const auto alpha = static_cast<uint32_t>(std::floor(value[3] + 0.5f));
          for (size_t c = 3; c-- > 0;) {
            const auto channel = static_cast<uint32_t>(std::floor(value[c] + 0.5f));
            rgb = rgb << 8 | (channel * alpha + 127) / 255;
          }
          if (alpha > 0) plot(x, y, z, rgb);
          continue;
        }
        if (std::isnan(value[0])) continue;
        const float place = (value[0] - words.real(6)) * words.real(7);
        const uint32_t entry =
            words.entry(place > 0 ? static_cast<size_t>(std::min(place, 255.0f)) : 0);
        if ((entry >> 24 & 1) != 0) plot(x, y, z, entry & 0xFFFFFF);
      }
    }
  }
}

}  // namespace voxeld::gpu::conformance
