#include "display/geometry/rotor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "display/geometry/fixed_point.h"
#include "display/geometry/list_builder.h"
#include "display/geometry/rotor_passes.h"

namespace voxeld::display {
namespace {

constexpr int kDirectionBits = 30;

// Returns the centres of `cells` cells along x or y, from the axis, in units of 2⁻¹⁶ `unit_mm`.
std::vector<Fixed> Centres(int32_t cells, double pitch_mm, double origin_mm, double unit_mm) {
  std::vector<Fixed> centres;
  centres.reserve(static_cast<size_t>(cells));
  for (int32_t i = 0; i < cells; ++i) {
    centres.push_back(ToFixed((i + 0.5) * pitch_mm + origin_mm, unit_mm));
  }
  return centres;
}

// Fills the outer lists: columns of voxels by (slice, u).
class ColumnScatter {
 public:
  ColumnScatter(const Rotor& rotor, const VoxelGrid& grid, Sampling sampling)
      : rotor_(rotor),
        grid_(grid),
        sampling_(sampling),
        unit_mm_(std::min(grid.pitch_mm.x, grid.pitch_mm.y)),
        x_(Centres(grid.nx, grid.pitch_mm.x, grid.origin_mm.x, unit_mm_)),
        y_(Centres(grid.ny, grid.pitch_mm.y, grid.origin_mm.y, unit_mm_)),
        lists_(static_cast<size_t>(rotor.slices_per_turn) * rotor.panels.size() *
               static_cast<size_t>(rotor.width_px)) {}

  FootprintLists Build() {
    for (panel_ = 0; panel_ < rotor_.panels.size(); ++panel_) {
      AddCentres();
      AddPasses();
    }
    return lists_.Build();
  }

 private:
  const Rotor::Panel& panel() const { return rotor_.panels[panel_]; }

  void Add(uint32_t step, int32_t u, int32_t i, int32_t j, uint16_t weight) {
    const size_t slice = static_cast<size_t>(step) * rotor_.panels.size() + panel_;
    const size_t list = slice * static_cast<size_t>(rotor_.width_px) + static_cast<size_t>(u);
    lists_.Add(list, {static_cast<uint16_t>(i), static_cast<uint16_t>(j), 0, weight});
  }

  // Adds the column that contains a pixel's centre at the middle of its step.
  void AddCentres() {
    const PixelRow row = PanelRowU(rotor_, panel());
    const double pitch_x = grid_.pitch_mm.x, pitch_y = grid_.pitch_mm.y;
    const Fixed eccentricity_x = ToFixed(panel().eccentricity_mm, pitch_x);
    const Fixed eccentricity_y = ToFixed(panel().eccentricity_mm, pitch_y);
    const Fixed origin_x = ToFixed(grid_.origin_mm.x, pitch_x) << kDirectionBits;
    const Fixed origin_y = ToFixed(grid_.origin_mm.y, pitch_y) << kDirectionBits;
    std::vector<Fixed> along_x, along_y;
    for (int32_t u = 0; u < row.count; ++u) {
      along_x.push_back(ToFixed(row.CentreMm(u), pitch_x));
      along_y.push_back(ToFixed(row.CentreMm(u), pitch_y));
    }
    const uint16_t weight = sampling_ == Sampling::kWeighted ? kOwnWeight : kFullWeight;
    for (int32_t step = 0; step < rotor_.slices_per_turn; ++step) {
      const Direction d = DirectionOf(PanelTurn(rotor_, panel(), step));
      for (int32_t u = 0; u < row.count; ++u) {
        const Fixed x = along_x[static_cast<size_t>(u)] * d.cos - eccentricity_x * d.sin;
        const Fixed y = along_y[static_cast<size_t>(u)] * d.sin + eccentricity_y * d.cos;
        const Fixed i = (x - origin_x) >> (kFixedBits + kDirectionBits);
        const Fixed j = (y - origin_y) >> (kFixedBits + kDirectionBits);
        if (i < 0 || i >= grid_.nx || j < 0 || j >= grid_.ny) continue;
        Add(static_cast<uint32_t>(step), u, static_cast<int32_t>(i), static_cast<int32_t>(j),
            weight);
      }
    }
  }

  // The panel's plane passes a column at distance ρ from the axis where the column's place along u,
  // a, is ±√(ρ² − e²).
  void AddPasses() {
    const PixelEdges row(PanelRowU(rotor_, panel()), unit_mm_);
    const Fixed e = ToFixed(panel().eccentricity_mm, unit_mm_);
    for (int32_t j = 0; j < grid_.ny; ++j) {
      for (int32_t i = 0; i < grid_.nx; ++i) {
        ForEachPass(rotor_, panel(), row, x_[static_cast<size_t>(i)], y_[static_cast<size_t>(j)], e,
                    sampling_,
                    [&](uint32_t step, int32_t u, uint16_t weight) { Add(step, u, i, j, weight); });
      }
    }
  }

  const Rotor& rotor_;
  const VoxelGrid& grid_;
  const Sampling sampling_;
  const double unit_mm_;  // the unit of x_, y_ and everything compared with them
  const std::vector<Fixed> x_, y_;
  size_t panel_ = 0;
  ListBuilder lists_;
};

}  // namespace

PixelRow PanelRowU(const Rotor& rotor, const Rotor::Panel& panel) {
  return {rotor.width_px, panel.pitch_u_mm, panel.shift_u_mm, panel.mirror_u};
}

PixelRow PanelRowV(const Rotor& rotor, const Rotor::Panel& panel) {
  return {rotor.height_px, panel.pitch_v_mm, panel.shift_v_mm, panel.mirror_v};
}

Turn PanelTurn(const Rotor& rotor, const Rotor::Panel& panel, int32_t step) {
  const Turn turned =
      TurnFromRatio(static_cast<uint32_t>(step), static_cast<uint32_t>(rotor.slices_per_turn));
  const Turn phase = TurnFromFraction(panel.phase_turns);
  return rotor.clockwise ? phase - turned : phase + turned;
}

Lean LeanOf(const Rotor::Panel& panel) {
  const double turns = panel.tilt_deg / 360.0;
  const Direction d = DirectionOf(TurnFromFraction(turns < 0 ? turns + 1 : turns));
  constexpr double kUnit = 1.0 / (1 << kDirectionBits);
  return {d.cos * kUnit, d.sin * kUnit};
}

bool IsTilted(const Rotor& rotor) {
  return std::any_of(rotor.panels.begin(), rotor.panels.end(),
                     [](const Rotor::Panel& panel) { return panel.tilt_deg != 0; });
}

double RadiusMm(const Rotor& rotor) {
  double square = 0;
  for (const Rotor::Panel& panel : rotor.panels) {
    const PixelRow u = PanelRowU(rotor, panel), v = PanelRowV(rotor, panel);
    const double near = u.PositionMm(0), far = u.PositionMm(2 * u.count);
    const double along = std::max(near * near, far * far), lean = LeanOf(panel).sin;
    for (const double w : {v.PositionMm(0), v.PositionMm(2 * v.count)}) {
      const double e = panel.eccentricity_mm + w * lean;
      square = std::max(square, along + e * e);
    }
  }
  return std::sqrt(square);
}

FootprintTable BuildRotorFootprints(const Rotor& rotor, const VoxelGrid& grid, Sampling sampling) {
  FootprintTable table;
  table.slices =
      static_cast<int32_t>(static_cast<size_t>(rotor.slices_per_turn) * rotor.panels.size());
  table.width = rotor.width_px;
  table.height = rotor.height_px;
  table.inner_axis = Axis::kZ;

  const PixelRow first = PanelRowV(rotor, rotor.panels[0]);
  const bool alike = std::all_of(rotor.panels.begin(), rotor.panels.end(),
                                 [&](const auto& p) { return PanelRowV(rotor, p) == first; });
  table.inner_sets = alike ? 1 : static_cast<int32_t>(rotor.panels.size());
  table.inner.begin.push_back(0);
  for (int32_t set = 0; set < table.inner_sets; ++set) {
    const PixelRow row = PanelRowV(rotor, rotor.panels[static_cast<size_t>(set)]);
    for (const CellRange& range : CellsOfPixels(row, grid.nz, grid.pitch_mm.z, grid.origin_mm.z)) {
      for (int32_t cell = range.begin; cell < range.end; ++cell) {
        table.inner.entries.push_back({0, 0, static_cast<uint16_t>(cell)});
      }
      table.inner.begin.push_back(static_cast<uint32_t>(table.inner.entries.size()));
    }
  }
  table.outer = ColumnScatter(rotor, grid, sampling).Build();
  return table;
}

Vec3 RotorPixelPosition(const Rotor& rotor, int32_t slice, int32_t u, int32_t v) {
  const int32_t panels = static_cast<int32_t>(rotor.panels.size());
  const Rotor::Panel& panel = rotor.panels[static_cast<size_t>(slice % panels)];
  const Direction d = DirectionOf(PanelTurn(rotor, panel, slice / panels));
  constexpr double kUnit = 1.0 / (1 << kDirectionBits);
  const double cos = d.cos * kUnit, sin = d.sin * kUnit;
  const Lean lean = LeanOf(panel);
  const double a = PanelRowU(rotor, panel).CentreMm(u), w = PanelRowV(rotor, panel).CentreMm(v);
  const double e = panel.eccentricity_mm + w * lean.sin;
  return {a * cos - e * sin, a * sin + e * cos, w * lean.cos};
}

}  // namespace voxeld::display
