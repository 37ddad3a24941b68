// A display's correction as maps between the nominal places of its shape and the true places of its
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

// Immutable, so thread-safe. Uses IEEE operations in a fixed order: the same places on every
// machine.
class Corrector {
 public:
  // `correction` must be valid (CheckCorrection), or empty: then every place maps to itself.
  explicit Corrector(const std::optional<Correction>& correction);

  Vec3 ToTrue(const Vec3& nominal) const;
  // Inverts ToTrue, within 2⁻³⁰ mm, by iteration: the displacement is a contraction.
  Vec3 ToNominal(const Vec3& place) const;

  // Map places in a slice image, mm from its middle.
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

// Returns half the sides of a shape's slice images, mm; nothing if it has no projected images.
std::optional<PicturePlace> HalfPicture(const Geometry& geometry);

// Errors: InvalidArgument with the first wrong field of a geometry's correction. Requires a valid
// shape.
absl::Status CheckCorrection(const Geometry& geometry);

}  // namespace voxeld::display
