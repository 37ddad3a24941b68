#include "tools/voxelctl/scene/paint.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/pictures/picture.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMostTexels = uint64_t{64} << 20;

// Returns: the texel index of a coordinate; the picture repeats.
uint32_t Texel(float at, uint32_t size) {
  const double within = at - std::floor(double{at});
  return std::min(static_cast<uint32_t>(within * size), size - 1);
}

}  // namespace

absl::StatusOr<Part> PaintVertices(const Part& part, const std::string& picture) {
  const absl::StatusOr<pictures::PictureFile> file = pictures::PictureFile::Open(picture);
  if (!file.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("a picture of it ", file.status().message()));
  }
  if (const auto [width, height] = file->size(); uint64_t{width} * height > kMostTexels) {
    return absl::InvalidArgumentError(absl::StrCat("a picture of it has ", width, " by ", height,
                                                   " texels; at most ", kMostTexels, " are read"));
  }
  const absl::StatusOr<std::vector<uint32_t>> texels = file->Read();
  if (!texels.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("a picture of it ", texels.status().message()));
  }
  Part painted = part;
  painted.picture = kNoPicture;
  painted.texture_coordinates.clear();
  const auto [width, height] = file->size();
  for (size_t v = 0; v < painted.colors.size(); ++v) {
    const auto& [right, down] = part.texture_coordinates[v];
    const uint32_t texel = (*texels)[size_t{Texel(down, height)} * width + Texel(right, width)];
    const auto product = [](uint32_t a, uint32_t b) {
      return static_cast<uint8_t>((a * b + 127) / 255);
    };
    Rgb& color = painted.colors[v];
    color = {product(color.r, texel >> 16 & 0xFF), product(color.g, texel >> 8 & 0xFF),
             product(color.b, texel & 0xFF)};
  }
  return painted;
}

}  // namespace voxeld::voxelctl
