// A display's correction as maps: the nominal place of what its shape says, the true one of its
// light.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "display/api/geometry.h"
#include "display/geometry/homography.h"

namespace voxeld::display {

// Immutable, so thread-safe. IEEE operations in one order: the same places on every machine.
class Corrector {
 public:
  // Valid (CheckCorrection), or none: then every place is where it is.
  explicit Corrector(const std::optional<Correction>& correction);

  Vec3 ToTrue(const Vec3& nominal) const;
  // The inverse, within 2⁻³⁰ mm, by iteration: the displacement is a contraction.
  Vec3 ToNominal(const Vec3& place) const;

  // Of a slice's picture, mm from its middle.
  PicturePlace PictureToTrue(int32_t slice, PicturePlace place) const;
  PicturePlace PictureToNominal(int32_t slice, PicturePlace place) const;
  bool moves_pictures() const { return !homographies_.empty(); }

 private:
  Vec3 DisplacementAt(const Vec3& nominal) const;
  static const Homography& Of(const std::vector<Homography>& all, int32_t slice) {
    return all[all.size() == 1 ? 0 : static_cast<size_t>(slice)];
  }

  bool moves_space_ = false;
  std::array<double, 12> affine_, inverse_;
  std::optional<DisplacementGrid> displacement_;
  std::vector<Homography> homographies_, inverse_homographies_;
};

// Half the sides of a shape's pictures, mm; none: it has no projected pictures.
std::optional<PicturePlace> HalfPicture(const Geometry& geometry);

// InvalidArgument with the first field of a geometry's correction that is wrong. Its shape is valid.
absl::Status CheckCorrection(const Geometry& geometry);

}  // namespace voxeld::display
