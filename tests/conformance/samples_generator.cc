#include "tests/conformance/samples_generator.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"

namespace voxeld::gpu::conformance {

void AddSamples(SceneGenerator& random, ModelGeometry& g) {
  SampleHead head = {};
  for (uint32_t& size : head.size) {
    size = static_cast<uint32_t>(random.Chance(0.2) ? 1 : random.Int(2, 28));
  }
  head.format = static_cast<SampleFormat>(random.Int(0, 3));
  head.filter = random.Chance(0.3) ? SampleFilter::kNearest : SampleFilter::kLinear;
  head.by_level = head.format != SampleFormat::kRgba8 && random.Chance(0.5) ? 1 : 0;
  if (head.by_level == 1 && random.Chance(0.5)) {
    head.by_level = 2;
    for (int i = 0; i < 4; ++i)
      g.record.params[i] = static_cast<float>(i < 3 ? random.Real(-12, 12) : random.Real(-50, 300));
  }
  const double most = head.format == SampleFormat::kU16   ? 60000
                      : head.format == SampleFormat::kF32 ? 7.5
                                                          : 250;
  head.low = static_cast<float>(random.Real(0, most / 2));
  head.scale = static_cast<float>(random.Real(20, 400) / most);
  // Now and then the value of a sample, or one that many samples share.
  head.level = static_cast<float>(random.Chance(0.3)   ? std::floor(most / 2)
                                  : random.Chance(0.3) ? most
                                                       : random.Real(0, most));
  head.bricks = BrickWords(head.size);
  g.indices.resize(SampleWords(head.size, static_cast<uint32_t>(head.format)));
  std::memcpy(g.indices.data(), &head, sizeof(head));
  const bool holes = random.Chance(0.6);
  for (uint32_t i = 0; i < SampleHead::kTableEntries; ++i) {
    const bool drawn = !holes || i % 64 > 40;
    g.indices[kSampleHeadWords + i] = drawn ? random.RandomColor() | SampleHead::kDrawn : 0;
  }
  auto* const bytes = reinterpret_cast<unsigned char*>(
      &g.indices[kSampleHeadWords + SampleHead::kTableEntries + head.bricks]);
  // A few soft lumps, so that much of it is uniform, and some noise.
  double centre[3], period = random.Real(2, 15);
  for (double& c : centre) c = random.Real(-5, 25);
  const bool noise = random.Chance(0.3), gaps = random.Chance(0.3);
  size_t i = 0;
  for (uint32_t z = 0; z < head.size[2]; ++z) {
    for (uint32_t y = 0; y < head.size[1]; ++y) {
      for (uint32_t x = 0; x < head.size[0]; ++x, ++i) {
        const double distance = std::hypot(x - centre[0], std::hypot(y - centre[1], z - centre[2]));
        double value = std::clamp(1.3 * std::cos(distance / period), 0.0, 1.0) * most;
        if (noise && random.Chance(0.3)) value = random.Real(0, most);
        if (head.format == SampleFormat::kU8) bytes[i] = static_cast<unsigned char>(value);
        if (head.format == SampleFormat::kU16) {
          const auto number = static_cast<uint16_t>(value);
          std::memcpy(bytes + 2 * i, &number, 2);
        }
        if (head.format == SampleFormat::kF32) {
          float number = static_cast<float>(value);
          if (gaps && random.Chance(0.05)) number = std::numeric_limits<float>::quiet_NaN();
          std::memcpy(bytes + 4 * i, &number, 4);
        }
        if (head.format == SampleFormat::kRgba8) {
          const uint32_t color = random.RandomColor() | static_cast<uint32_t>(value) << 24;
          std::memcpy(bytes + 4 * i, &color, 4);
        }
      }
    }
  }
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
  FillBricks(g.record, g.indices);
}

}  // namespace voxeld::gpu::conformance
