#include "tests/gpu/slice/measured_light.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/slice/light_plan.h"
#include "tests/display/geometry/swept_flat.h"
#include "tests/display/geometry/swept_solid.h"

namespace voxeld::gpu {
namespace {

using display::Geometry;
using display::Helix;
using display::Lattice;
using display::PlanarStack;
using display::Rotor;
using display::Vec3;

constexpr int32_t kPeriod = 64;  // of dither along u and v
constexpr int32_t kCube = 4;

struct Window {
  int32_t begin = 0, end = 0;
  bool has(int64_t i) const { return i >= begin && i < end; }
};

// Returns the middle part, at most `most` of `count`.
Window MiddleOf(int32_t count, int32_t most) {
  const int32_t wide = std::min(count, most), begin = (count - wide) / 2 / kCube * kCube;
  return {begin, begin + wide};
}

// The pixels that are examined, and the voxels that light only these.
struct Part {
  Window u, v;
  Window x, y, z;
};

Part PartOf(const Geometry& geometry) {
  const display::VoxelGrid& grid = geometry.grid;
  Part part{{}, {}, {0, grid.nx}, {0, grid.ny}, {0, grid.nz}};
  const auto [width, height] = std::visit(
      [](const auto& shape) { return std::pair(shape.width_px, shape.height_px); }, geometry.shape);
  part.u = {0, width};
  part.v = {0, height};
  const auto same_grid = [](const Window& pixels, int32_t voxels, int32_t count) {
    return voxels == count ? pixels : Window{0, voxels};
  };
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    part.u = MiddleOf(width, kPeriod);
    part.v = MiddleOf(height, kPeriod);
    part.x = same_grid(part.u, grid.nx, width);
    Window& v = stack->normal == PlanarStack::Normal::kZ ? part.y : part.z;
    v = same_grid(part.v, v.end, height);
  } else if (std::holds_alternative<Rotor>(geometry.shape)) {
    part.v = MiddleOf(height, kPeriod);
    part.z = same_grid(part.v, grid.nz, height);
  }
  return part;
}

// Calls `put` with the places of a pixel's light, evenly spaced in time, and with those at its
// corners.
using Put = std::function<void(const Vec3&)>;

class Places {
 public:
  explicit Places(const Geometry& geometry) : geometry_(geometry), fine_(geometry) {
    if (auto* rotor = std::get_if<Rotor>(&fine_.shape)) {
      steps_ = StepsOf(rotor->width_px, rotor->slices_per_turn);
      columns_ = rotor->width_px > 200 ? 1 : 3;
      rotor->slices_per_turn *= steps_;
      rotor->width_px *= columns_;
      for (Rotor::Panel& panel : rotor->panels) panel.pitch_u_mm /= columns_;
    } else if (auto* helix = std::get_if<Helix>(&fine_.shape)) {
      steps_ = 3;
      helix->slices_per_turn *= steps_;
    }
  }

  void Of(int32_t slice, int32_t u, int32_t v, const Put& put) const {
    std::visit([&](const auto& shape) { Along(shape, slice, u, v, put); }, geometry_.shape);
  }

 private:
  // Odd, so that the way's end at the rim is divided into pieces shorter than two thirds of a
  // pixel.
  static int32_t StepsOf(int32_t width, int32_t slices) {
    return static_cast<int32_t>(std::ceil(3.1416 * width / slices / 0.66)) / 2 * 2 + 1;
  }
  Vec3 Fine(int32_t slice, int32_t u, int32_t v) const {
    return display::PixelPosition(fine_, slice, u, v);
  }

  // From half-way to one neighbour of its stroke to half-way to the other.
  void Along(const PlanarStack& stack, int32_t slice, int32_t u, int32_t v, const Put& put) const {
    const Vec3 middle = display::PixelPosition(geometry_, slice, u, v);
    const auto count = static_cast<int32_t>(stack.positions_mm.size()) / stack.strokes;
    const int32_t stroke = slice / count, i = slice % count;
    const auto at = [&](int32_t n) {
      return stack.positions_mm[static_cast<size_t>(stroke * count + n)];
    };
    double to[2] = {stack.thickness_mm / 2, -stack.thickness_mm / 2};
    if (count > 1) {
      if (i > 0) to[0] = (at(i - 1) - at(i)) / 2;
      if (i + 1 < count) to[1] = (at(i + 1) - at(i)) / 2;
      if (i == 0) to[0] = -to[1];
      if (i + 1 == count) to[1] = -to[0];
    }
    constexpr int kFine = 24;
    for (int step = 0; step < kFine; ++step) {
      const double shift = to[0] + (to[1] - to[0]) * (step + 0.5) / kFine;
      Vec3 place = middle;
      (stack.normal == PlanarStack::Normal::kZ ? place.z : place.y) += shift;
      put(place);
    }
  }

  void Along(const Rotor& rotor, int32_t slice, int32_t u, int32_t v, const Put& put) const {
    const auto panels = static_cast<int32_t>(rotor.panels.size());
    const int32_t turn = rotor.slices_per_turn * steps_;
    for (int32_t i = 0; i < steps_; ++i) {
      const int32_t at = (slice / panels * steps_ + i - steps_ / 2 + turn) % turn;
      for (int32_t j = 0; j < columns_; ++j) {
        put(Fine(at * panels + slice % panels, u * columns_ + j, v));
      }
    }
  }

  void Along(const Helix& helix, int32_t slice, int32_t u, int32_t v, const Put& put) const {
    const int32_t turn = helix.slices_per_turn * steps_;
    for (int32_t i = 0; i < steps_; ++i) {
      put(Fine((slice * steps_ + i - steps_ / 2 + turn) % turn, u, v));
    }
  }

  void Along(const Lattice&, int32_t slice, int32_t u, int32_t v, const Put& put) const {
    put(display::PixelPosition(geometry_, slice, u, v));
  }

  const Geometry& geometry_;
  Geometry fine_;
  int32_t steps_ = 1, columns_ = 1;  // pieces of a pixel's way, and of its width
};

// Where a place is in the solid that all pixels sweep.
class Reach {
 public:
  explicit Reach(const Geometry& geometry) {
    const auto* rotor = std::get_if<Rotor>(&geometry.shape);
    const bool tilted =
        rotor != nullptr && std::any_of(rotor->panels.begin(), rotor->panels.end(),
                                        [](const Rotor::Panel& p) { return p.tilt_deg != 0; });
    if (geometry.correction || tilted || std::holds_alternative<Helix>(geometry.shape)) {
      flat_ = std::make_unique<display::SweptFlat>(geometry);
    } else {
      solid_ = display::MakeSweptSolid(geometry);
    }
  }
  bool Inside(const Vec3& place) const {
    const auto where = flat_ ? flat_->Locate(place) : solid_->Locate(place);
    return where == display::SweptSolid::Where::kInside && !(flat_ && flat_->Doubtful(place));
  }

 private:
  std::unique_ptr<display::SweptSolid> solid_;
  std::unique_ptr<display::SweptFlat> flat_;
};

bool Turns(const Geometry& geometry) {
  return std::holds_alternative<Rotor>(geometry.shape) ||
         std::holds_alternative<Helix>(geometry.shape);
}

// The light of a white pixel over all sub-frames, relative to full light (the mean of the
// channels); 0 outside every voxel.
class White {
 public:
  explicit White(const DisplayUnderTest& display)
      : layout_(display.layout),
        table_(display::BuildFootprints(display.geometry, display.tone.sampling)),
        plan_(LightPlan::Of(table_, display.geometry.grid, display.layout, display.tone)),
        finish_(plan_.finish(display.layout, display.tone)),
        most_(LevelsOf(finish_.format, finish_.bits)) {}

  const display::FootprintTable& table() const { return table_; }

  double At(int32_t slice, int32_t u, int32_t v) const {
    const uint32_t column =
        static_cast<uint32_t>(table_.flat_row == 0 ? u : v * table_.flat_row + u);
    const size_t row = static_cast<size_t>(slice) * static_cast<size_t>(table_.width) + column;
    if (table_.outer.list(row).empty()) return 0;
    if (table_.flat_row == 0 && table_.Inner(slice, v).empty()) return 0;
    const Light light = finish_.LightAt(0xFFFFFF, row);
    double sum = 0;
    for (uint32_t sub = 0; sub < finish_.sub_frames; ++sub) {
      const Levels q = finish_.LevelsAt(light, static_cast<uint32_t>(slice),
                                        static_cast<uint32_t>(u), static_cast<uint32_t>(v), sub);
      sum += Share(q.r, most_.r) + Share(q.g, most_.g) + Share(q.b, most_.b);
    }
    return sum / 3 / finish_.sub_frames;
  }

 private:
  double Share(uint32_t level, uint32_t levels) const {
    if (finish_.format == display::PixelFormat::kPlanes24) {
      return static_cast<double>(__builtin_popcount(level)) / display::kProjectorParts;
    }
    return static_cast<double>(level) / (levels - 1);
  }

  display::FrameLayout layout_;
  display::FootprintTable table_;
  LightPlan plan_;
  Finish finish_;
  Levels most_;
};

}  // namespace

MeasuredLight MeasureLight(const DisplayUnderTest& display) {
  const display::VoxelGrid& grid = display.geometry.grid;
  const Part part = PartOf(display.geometry);
  const White white(display);
  const Places places(display.geometry);
  const int64_t across[3] = {(grid.nx + kCube - 1) / kCube, (grid.ny + kCube - 1) / kCube,
                             (grid.nz + kCube - 1) / kCube};
  std::vector<double> light(static_cast<size_t>(across[0] * across[1] * across[2]));
  std::vector<Vec3> at;
  for (int32_t slice = 0; slice < display.layout.slices; ++slice) {
    for (int32_t v = part.v.begin; v < part.v.end; ++v) {
      for (int32_t u = part.u.begin; u < part.u.end; ++u) {
        const double shown = white.At(slice, u, v);
        if (shown == 0) continue;
        at.clear();
        places.Of(slice, u, v, [&](const Vec3& place) { at.push_back(place); });
        for (const Vec3& place : at) {
          const auto i = static_cast<int64_t>(
              std::floor((place.x - grid.origin_mm.x) / grid.pitch_mm.x / kCube));
          const auto j = static_cast<int64_t>(
              std::floor((place.y - grid.origin_mm.y) / grid.pitch_mm.y / kCube));
          const auto k = static_cast<int64_t>(
              std::floor((place.z - grid.origin_mm.z) / grid.pitch_mm.z / kCube));
          if (i < 0 || j < 0 || k < 0 || i >= across[0] || j >= across[1] || k >= across[2])
            continue;
          light[static_cast<size_t>((k * across[1] + j) * across[0] + i)] +=
              shown / static_cast<double>(at.size());
        }
      }
    }
  }

  const Reach reach(display.geometry);
  const auto looked_at = [&](int64_t i, int64_t j, int64_t k) {
    const int64_t first[3] = {i * kCube, j * kCube, k * kCube};
    const Window windows[3] = {part.x, part.y, part.z};
    for (size_t a = 0; a < 3; ++a) {
      if (!windows[a].has(first[a]) || !windows[a].has(first[a] + kCube - 1)) return false;
    }
    for (int32_t n = 0; n < kCube * kCube * kCube; ++n) {
      const Vec3 centre = display::VoxelCentre(grid, static_cast<int32_t>(first[0]) + n % kCube,
                                               static_cast<int32_t>(first[1]) + n / kCube % kCube,
                                               static_cast<int32_t>(first[2]) + n / kCube / kCube);
      if (!reach.Inside(centre)) return false;
      const double r = std::hypot(centre.x / grid.pitch_mm.x, centre.y / grid.pitch_mm.y);
      if (Turns(display.geometry) && r < 2) return false;
    }
    return true;
  };
  MeasuredLight out;
  double squares = 0;
  for (int64_t k = 0; k < across[2]; ++k) {
    for (int64_t j = 0; j < across[1]; ++j) {
      for (int64_t i = 0; i < across[0]; ++i) {
        if (!looked_at(i, j, k)) continue;
        const double value = light[static_cast<size_t>((k * across[1] + j) * across[0] + i)];
        out.least = out.cubes == 0 ? value : std::min(out.least, value);
        out.most = std::max(out.most, value);
        out.mean += value;
        squares += value * value;
        ++out.cubes;
      }
    }
  }
  if (out.cubes == 0) return out;
  const double count = static_cast<double>(out.cubes);
  out.mean /= count;
  out.variation = std::sqrt(std::max(0.0, squares / count - out.mean * out.mean)) / out.mean;
  return out;
}

DarkVoxels CountDarkVoxels(const DisplayUnderTest& display) {
  const display::VoxelGrid& grid = display.geometry.grid;
  const Part part = PartOf(display.geometry);
  const White white(display);
  const display::FootprintTable& table = white.table();
  std::vector<uint8_t> lit(static_cast<size_t>(grid.nx) * static_cast<size_t>(grid.ny) *
                           static_cast<size_t>(grid.nz));
  const auto light = [&](int32_t x, int32_t y, int32_t z) {
    lit[(static_cast<size_t>(z) * static_cast<size_t>(grid.ny) + static_cast<size_t>(y)) *
            static_cast<size_t>(grid.nx) +
        static_cast<size_t>(x)] = 1;
  };
  for (int32_t slice = 0; slice < display.layout.slices; ++slice) {
    for (int32_t v = part.v.begin; v < part.v.end; ++v) {
      for (int32_t u = part.u.begin; u < part.u.end; ++u) {
        if (white.At(slice, u, v) == 0) continue;
        const bool flat = table.flat_row != 0;
        for (const auto& o : table.Outer(slice, flat ? v * table.flat_row + u : u)) {
          for (const auto& i : table.Inner(slice, flat ? 0 : v)) {
            const bool full = o.weight == display::kFullWeight && i.weight == display::kFullWeight;
            if (full) light(o.x + i.x, o.y + i.y, o.z + i.z);
          }
        }
      }
    }
  }
  const Reach reach(display.geometry);
  DarkVoxels out;
  size_t voxel = 0;
  for (int32_t k = 0; k < grid.nz; ++k) {
    for (int32_t j = 0; j < grid.ny; ++j) {
      for (int32_t i = 0; i < grid.nx; ++i, ++voxel) {
        if (!part.x.has(i) || !part.y.has(j) || !part.z.has(k)) continue;
        if (lit[voxel] == 0 && !reach.Inside(display::VoxelCentre(grid, i, j, k))) continue;
        ++out.reachable;
        out.dark += lit[voxel] == 0;
      }
    }
  }
  return out;
}

}  // namespace voxeld::gpu
