#include <cmath>
#include <optional>

#include "tests/display/geometry/swept_solid.h"

namespace voxeld::display {
namespace {

// The union of the lights' boxes.
class SweptLattice : public SweptSolid {
 public:
  SweptLattice(const Lattice& lattice, const VoxelGrid& grid) : lattice_(lattice), grid_(grid) {}

  Where Locate(const Vec3& point) const override {
    Where where = Where::kOutside;
    for (const std::optional<Vec3>& light : lattice_.points_mm) {
      if (!light.has_value()) continue;
      if (InBox(*light, point, -kMargin)) return Where::kInside;
      if (InBox(*light, point, kMargin)) where = Where::kNearBoundary;
    }
    return where;
  }

  std::vector<PixelId> Passing(const Vec3& point) const override {
    std::vector<PixelId> pixels;
    for (size_t n = 0; n < lattice_.points_mm.size(); ++n) {
      const std::optional<Vec3>& light = lattice_.points_mm[n];
      if (!light.has_value() || !InBox(*light, point, -kMargin)) continue;
      const auto pixel = static_cast<int32_t>(n);
      pixels.push_back({pixel / lattice_.width_px, pixel % lattice_.width_px, 0});
    }
    return pixels;
  }

  Vec3 Centre(const PixelId& pixel) const override {
    const double none = std::nan("");
    return Light(pixel.slice, pixel.u).value_or(Vec3{none, none, none});
  }

  bool MayShowOuter(int32_t slice, int32_t u, const FootprintEntry& entry, int) const override {
    const std::optional<Vec3>& light = Light(slice, u);
    if (!light.has_value()) return false;
    const Vec3 voxel = VoxelCentre(grid_, entry.x, entry.y, entry.z);
    const double half = 0.5 + kMargin;
    return InBox(*light, voxel, kMargin) ||
           (std::abs(light->x - voxel.x) <= half * grid_.pitch_mm.x &&
            std::abs(light->y - voxel.y) <= half * grid_.pitch_mm.y &&
            std::abs(light->z - voxel.z) <= half * grid_.pitch_mm.z);
  }

  bool MayShowInner(int32_t, int32_t, const FootprintEntry& entry) const override {
    return entry == FootprintEntry{};
  }

 private:
  const std::optional<Vec3>& Light(int32_t slice, int32_t u) const {
    return lattice_.points_mm[static_cast<size_t>(slice * lattice_.width_px + u)];
  }

  // `slack` is in voxels.
  bool InBox(const Vec3& light, const Vec3& point, double slack) const {
    const auto within = [&](double distance, double size, double pitch) {
      return std::abs(distance) < size / 2 + slack * pitch;
    };
    return within(point.x - light.x, lattice_.cell_mm.x, grid_.pitch_mm.x) &&
           within(point.y - light.y, lattice_.cell_mm.y, grid_.pitch_mm.y) &&
           within(point.z - light.z, lattice_.cell_mm.z, grid_.pitch_mm.z);
  }

  const Lattice lattice_;
  const VoxelGrid grid_;
};

}  // namespace

std::unique_ptr<SweptSolid> MakeSweptLattice(const Lattice& lattice, const VoxelGrid& grid) {
  return std::make_unique<SweptLattice>(lattice, grid);
}

}  // namespace voxeld::display
