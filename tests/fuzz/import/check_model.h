// The promises of every reader of files.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "tests/fuzz/expect.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::fuzz {

// An input selects one of `count` readers by its first byte; the rest is the file.
inline voxelctl::SourceFile FileOf(const uint8_t* data, size_t size, const char* const* extensions,
                                   size_t count, size_t* which) {
  *which = size == 0 ? 0 : data[0] % count;
  voxelctl::SourceFile file;
  file.extension = extensions[*which];
  file.path = "file." + file.extension;
  if (size > 1) file.bytes.assign(reinterpret_cast<const char*>(data) + 1, size - 1);
  return file;
}

inline void CheckModel(const absl::StatusOr<voxelctl::Model>& model) {
  if (!model.ok()) {
    ExpectSays(model.status());
    EXPECT_THAT_HOLDS(model.status().message().substr(0, 4) == "file", model.status().ToString());
    return;
  }
  EXPECT_THAT_HOLDS(model->up != voxelctl::Up::kAuto && !model->format.empty());
  ExpectSays(model->note.empty() ? absl::OkStatus() : absl::InvalidArgumentError(model->note));
  for (const voxelctl::Part& part : model->parts) {
    const size_t count = part.positions.size();
    EXPECT_THAT_HOLDS(part.normals.empty() || part.normals.size() == count);
    EXPECT_THAT_HOLDS(part.colors.empty() || part.colors.size() == count);
    EXPECT_THAT_HOLDS(std::isfinite(part.thickness) && part.thickness >= 0);
    for (const voxelctl::Point3& p : part.positions) {
      EXPECT_THAT_HOLDS(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
    for (const voxelctl::Point3& n : part.normals) {
      const double length = n.x * n.x + n.y * n.y + n.z * n.z;
      EXPECT_THAT_HOLDS(length == 0 || std::abs(length - 1) < 1e-3, length);
    }
    for (const uint32_t index : part.indices) EXPECT_THAT_HOLDS(index < count);
  }
  for (const voxelctl::SampledVolume& volume : model->volumes) {
    EXPECT_THAT_HOLDS(uint64_t{volume.size[0]} * volume.size[1] * volume.size[2] ==
                      volume.samples.size());
    for (const voxelctl::Point3& p : volume.corners) {
      EXPECT_THAT_HOLDS(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    }
    for (const float sample : volume.samples) EXPECT_THAT_HOLDS(!std::isinf(sample));
  }
}

}  // namespace voxeld::fuzz
