#include "display/geometry/flat_footprints.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <variant>
#include <vector>

#include "display/geometry/corrector.h"
#include "display/geometry/helix.h"
#include "display/geometry/limits.h"
#include "display/geometry/list_builder.h"
#include "display/geometry/pixel_edges.h"
#include "display/geometry/planar_stack.h"
#include "display/geometry/rotor_passes.h"
#include "display/geometry/slabs.h"

namespace voxeld::display {
namespace {

// Each class has ForEachAt(place, each), which calls each(slice, u, v, weight) for the pixels that
// pass a nominal place.

class StackPasses {
 public:
  StackPasses(const PlanarStack& stack, const VoxelGrid& grid, const Corrector& corrector,
              Sampling sampling)
      : corrector_(corrector),
        sampling_(sampling),
        flat_(stack.normal == PlanarStack::Normal::kZ),
        across_{grid.nx, grid.pitch_mm.x, grid.origin_mm.x},
        up_(flat_ ? GridAxis{grid.ny, grid.pitch_mm.y, grid.origin_mm.y}
                  : GridAxis{grid.nz, grid.pitch_mm.z, grid.origin_mm.z}),
        along_(flat_ ? GridAxis{grid.nz, grid.pitch_mm.z, grid.origin_mm.z}
                     : GridAxis{grid.ny, grid.pitch_mm.y, grid.origin_mm.y}),
        row_u_(StackRowU(stack), across_.pitch_mm, across_.origin_mm),
        row_v_(StackRowV(stack), up_.pitch_mm, up_.origin_mm) {
    for (int32_t stroke = 0; stroke < stack.strokes; ++stroke) {
      strokes_.push_back({Slabs(stack, stroke, along_), SlicesOfStroke(stack, stroke)});
    }
  }

  template <typename Each>
  void ForEachAt(const Vec3& place, Each&& each) const {
    const std::optional<Fixed> depth = At(flat_ ? place.z : place.y, along_);
    for (const Stroke& stroke : strokes_) {
      if (!depth) return;
      stroke.slabs.ForEachAt(*depth, sampling_, [&](size_t rank, uint16_t weight) {
        const int32_t slice = stroke.slices[rank];
        const PicturePlace p =
            corrector_.PictureToNominal(slice, {place.x, flat_ ? place.y : place.z});
        const auto u = row_u_.PixelAt(At(p.u, across_)), v = row_v_.PixelAt(At(p.v, up_));
        if (u && v) each(slice, *u, *v, weight);
      });
    }
  }

 private:
  struct Stroke {
    Slabs slabs;
    std::vector<int32_t> slices;
  };
  static std::optional<Fixed> At(double mm, const GridAxis& axis) {
    return ToFixedNear(mm - axis.origin_mm, axis.pitch_mm);
  }

  const Corrector& corrector_;
  const Sampling sampling_;
  const bool flat_;
  const GridAxis across_, up_, along_;
  const PixelEdges row_u_, row_v_;
  std::vector<Stroke> strokes_;
};

class RotorPasses {
 public:
  RotorPasses(const Rotor& rotor, const VoxelGrid& grid, const Corrector&, Sampling sampling)
      : rotor_(rotor),
        sampling_(sampling),
        unit_mm_(std::min(grid.pitch_mm.x, grid.pitch_mm.y)),
        pitch_z_mm_(grid.pitch_mm.z),
        origin_z_mm_(grid.origin_mm.z) {
    for (const Rotor::Panel& panel : rotor.panels) {
      panels_.push_back({PixelEdges(PanelRowU(rotor, panel), unit_mm_),
                         PixelEdges(PanelRowV(rotor, panel), pitch_z_mm_, origin_z_mm_),
                         LeanOf(panel)});
    }
  }

  template <typename Each>
  void ForEachAt(const Vec3& place, Each&& each) const {
    // A correction may move places far beyond all panels.
    const double most = kMaxRotorReach * unit_mm_;
    if (!(std::abs(place.x) <= most && std::abs(place.y) <= most)) return;
    const Fixed x = ToFixed(place.x, unit_mm_), y = ToFixed(place.y, unit_mm_);
    for (size_t p = 0; p < panels_.size(); ++p) {
      const auto& [row_u, row_v, lean] = panels_[p];
      const double w = place.z / lean.cos;  // along the panel's v axis
      const auto v = row_v.PixelAt(ToFixedNear(w - origin_z_mm_, pitch_z_mm_));
      if (!v) continue;
      const Fixed e = ToFixed(rotor_.panels[p].eccentricity_mm + w * lean.sin, unit_mm_);
      ForEachPass(rotor_, rotor_.panels[p], row_u, x, y, e, sampling_,
                  [&](uint32_t step, int32_t u, uint16_t weight) {
                    each(static_cast<int32_t>(step * panels_.size() + p), u, *v, weight);
                  });
    }
  }

 private:
  struct Panel {
    PixelEdges row_u, row_v;
    Lean lean;
  };
  const Rotor& rotor_;
  const Sampling sampling_;
  const double unit_mm_, pitch_z_mm_, origin_z_mm_;
  std::vector<Panel> panels_;
};

class HelixPasses {
 public:
  HelixPasses(const Helix& helix, const VoxelGrid& grid, const Corrector& corrector,
              Sampling sampling)
      : helix_(helix),
        corrector_(corrector),
        sampling_(sampling),
        unit_mm_(std::min(grid.pitch_mm.x, grid.pitch_mm.y)),
        row_u_(HelixRowU(helix), grid.pitch_mm.x, grid.origin_mm.x),
        row_v_(HelixRowV(helix), grid.pitch_mm.y, grid.origin_mm.y),
        pitch_x_mm_(grid.pitch_mm.x),
        pitch_y_mm_(grid.pitch_mm.y),
        origin_x_mm_(grid.origin_mm.x),
        origin_y_mm_(grid.origin_mm.y) {}

  template <typename Each>
  void ForEachAt(const Vec3& place, Each&& each) const {
    const double square = place.x * place.x + place.y * place.y;
    const double share = place.z / helix_.height_mm + 0.5;
    if (!(square >= helix_.hub_mm * helix_.hub_mm && square < helix_.radius_mm * helix_.radius_mm &&
          share >= 0 && share < 1)) {
      return;
    }
    const auto steps = static_cast<uint32_t>(helix_.slices_per_turn);
    const auto at = [&](uint32_t step, uint16_t weight) {
      const auto slice = static_cast<int32_t>(step);
      const PicturePlace p = corrector_.PictureToNominal(slice, {place.x, place.y});
      const auto u = row_u_.PixelAt(ToFixedNear(p.u - origin_x_mm_, pitch_x_mm_));
      const auto v = row_v_.PixelAt(ToFixedNear(p.v - origin_y_mm_, pitch_y_mm_));
      if (u && v) each(slice, *u, *v, weight);
    };
    const std::optional<Fixed> near_x = ToFixedNear(place.x, unit_mm_),
                               near_y = ToFixedNear(place.y, unit_mm_);
    if (!near_x || !near_y) return;
    const Fixed x = *near_x, y = *near_y;
    if (x == 0 && y == 0) {  // the axis is always at a blade's edge
      for (uint32_t step = 0; step < steps; ++step) at(step, kFullWeight);
      return;
    }
    const Turn risen = TurnFromFraction(share * helix_.span_turns);
    const auto blades = static_cast<uint32_t>(helix_.blades);
    for (uint32_t blade = 0; blade < blades; ++blade) {
      const Turn begin = TurnOf(x, y) + (helix_.left_handed ? risen : Turn{0} - risen) -
                         TurnFromRatio(blade, blades);
      Turn since_start = begin - TurnFromFraction(helix_.phase_turns);
      if (helix_.clockwise) since_start = Turn{0} - since_start;
      ForEachStepAt(since_start, steps, sampling_, at);
    }
  }

 private:
  const Helix& helix_;
  const Corrector& corrector_;
  const Sampling sampling_;
  const double unit_mm_;
  const PixelEdges row_u_, row_v_;
  const double pitch_x_mm_, pitch_y_mm_, origin_x_mm_, origin_y_mm_;
};

FootprintEntry EntryAt(int32_t i, int32_t j, int32_t k, uint16_t weight) {
  return {static_cast<uint16_t>(i), static_cast<uint16_t>(j), static_cast<uint16_t>(k), weight};
}

// Returns the cell at a position; −1 outside the axis, also for NaN.
int32_t CellAt(double mm, double pitch_mm, int32_t cells) {
  const double at = mm / pitch_mm;
  if (!(at > -1 && at < cells + 1)) return -1;
  const Fixed cell = ToFixed(mm, pitch_mm) >> kFixedBits;
  return cell < cells ? static_cast<int32_t>(cell) : -1;
}

class FlatScatter {
 public:
  FlatScatter(const Geometry& geometry, int32_t width, int32_t height, Sampling sampling)
      : geometry_(geometry),
        grid_(geometry.grid),
        corrector_(geometry.correction),
        sampling_(sampling),
        width_(width),
        height_(height),
        row_(FlatRow(width)),
        slices_(SliceCount(geometry)),
        lists_(static_cast<size_t>(slices_) * static_cast<size_t>(row_) *
               static_cast<size_t>(height)) {}

  template <typename Passes, typename Shape>
  void AddPasses(const Shape& shape) {
    const Passes passes(shape, grid_, corrector_, sampling_);
    for (int32_t k = 0; k < grid_.nz; ++k) {
      for (int32_t j = 0; j < grid_.ny; ++j) {
        for (int32_t i = 0; i < grid_.nx; ++i) {
          const Vec3 centre = {(i + 0.5) * grid_.pitch_mm.x + grid_.origin_mm.x,
                               (j + 0.5) * grid_.pitch_mm.y + grid_.origin_mm.y,
                               (k + 0.5) * grid_.pitch_mm.z + grid_.origin_mm.z};
          passes.ForEachAt(corrector_.ToNominal(centre),
                           [&](int32_t slice, int32_t u, int32_t v, uint16_t weight) {
                             lists_.Add(ListOf(slice, u, v), EntryAt(i, j, k, weight));
                           });
        }
      }
    }
  }

  // Adds, for each pixel, the voxel that contains its centre.
  void AddCentres() {
    const uint16_t weight = sampling_ == Sampling::kWeighted ? kOwnWeight : kFullWeight;
    for (int32_t slice = 0; slice < slices_; ++slice) {
      for (int32_t v = 0; v < height_; ++v) {
        for (int32_t u = 0; u < width_; ++u) {
          const Vec3 p = PixelPosition(geometry_, corrector_, slice, u, v);
          const int32_t i = CellAt(p.x - grid_.origin_mm.x, grid_.pitch_mm.x, grid_.nx),
                        j = CellAt(p.y - grid_.origin_mm.y, grid_.pitch_mm.y, grid_.ny),
                        k = CellAt(p.z - grid_.origin_mm.z, grid_.pitch_mm.z, grid_.nz);
          if (std::min({i, j, k}) < 0) continue;
          lists_.Add(ListOf(slice, u, v), EntryAt(i, j, k, weight));
        }
      }
    }
  }

  FootprintTable Build() {
    FootprintTable table;
    table.slices = slices_;
    table.width = row_ * height_;
    table.height = 1;
    table.flat_row = row_;
    table.inner_axis = Axis::kZ;
    table.outer = lists_.Build();
    table.inner = {{0, 1}, {EntryAt(0, 0, 0, kFullWeight)}};
    return table;
  }

 private:
  size_t ListOf(int32_t slice, int32_t u, int32_t v) const {
    return (static_cast<size_t>(slice) * static_cast<size_t>(height_) + static_cast<size_t>(v)) *
               static_cast<size_t>(row_) +
           static_cast<size_t>(u);
  }

  const Geometry& geometry_;
  const VoxelGrid& grid_;
  const Corrector corrector_;
  const Sampling sampling_;
  const int32_t width_, height_, row_, slices_;
  ListBuilder lists_;
};

}  // namespace

bool IsFlat(const Geometry& geometry) {
  if (std::holds_alternative<Lattice>(geometry.shape)) return false;
  if (geometry.correction.has_value() || std::holds_alternative<Helix>(geometry.shape)) return true;
  const auto* const rotor = std::get_if<Rotor>(&geometry.shape);
  return rotor != nullptr && IsTilted(*rotor);
}

FootprintTable BuildFlatFootprints(const Geometry& geometry, Sampling sampling) {
  const auto [width, height] = std::visit(
      [](const auto& shape) { return std::pair(shape.width_px, shape.height_px); }, geometry.shape);
  FlatScatter scatter(geometry, width, height, sampling);
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    scatter.AddPasses<StackPasses>(*stack);
  } else if (const auto* rotor = std::get_if<Rotor>(&geometry.shape)) {
    scatter.AddPasses<RotorPasses>(*rotor);
  } else {
    scatter.AddPasses<HelixPasses>(std::get<Helix>(geometry.shape));
  }
  scatter.AddCentres();
  return scatter.Build();
}

}  // namespace voxeld::display
