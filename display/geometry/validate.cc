#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "display/geometry/cells.h"
#include "display/geometry/corrector.h"
#include "display/geometry/fixed_point.h"
#include "display/geometry/flat_footprints.h"
#include "display/geometry/footprint.h"
#include "display/geometry/limits.h"
#include "display/geometry/planar_stack.h"
#include "display/geometry/rotor.h"

namespace voxeld::display {
namespace {

// Prints as many digits as a configuration needs, so that a value just beyond a limit does not look
// like the limit.
template <typename Value>
std::string Digits(Value value) {
  if constexpr (std::is_floating_point_v<Value>) return absl::StrFormat("%.10g", value);
  return absl::StrCat(value);
}

// Keeps the first error.
class Checker {
 public:
  bool ok() const { return status_.ok(); }
  const absl::Status& status() const { return status_; }

  template <typename Value>
  void Require(bool holds, absl::string_view field, Value value, absl::string_view rule) {
    if (ok() && !holds) {
      status_ = absl::InvalidArgumentError(
          absl::StrCat(field, " is ", Digits(value), ": it must be ", rule));
    }
  }
  void Count(absl::string_view field, int64_t value, int64_t most) {
    if (value < 1 || value > most) Require(false, field, value, absl::StrCat("from 1 to ", most));
  }
  // NaN is outside every range.
  void Number(absl::string_view field, double value, double least, double most) {
    if (!(value >= least && value <= most)) {
      Require(false, field, value,
              absl::StrCat("from ", Digits(least), " to ", Digits(most), " mm"));
    }
  }
  void Pitch(absl::string_view field, double mm) { Number(field, mm, kMinPitchMm, kMaxPitchMm); }
  void Position(absl::string_view field, double mm) {
    Number(field, mm, -kMaxPositionMm, kMaxPositionMm);
  }

 private:
  absl::Status status_;
};

void CheckPictures(Checker& check, int64_t slices, int64_t width, int64_t height) {
  if (!check.ok()) return;
  const int64_t pixels = slices * width * height;
  check.Require(pixels <= kMaxPixels,
                absl::StrCat("slices·width_px·height_px (", slices, "·", width, "·", height, ")"),
                pixels, absl::StrCat("at most ", kMaxPixels, " pixels"));
}

void CheckStack(Checker& check, const PlanarStack& stack) {
  check.Require(stack.normal == PlanarStack::Normal::kZ || stack.normal == PlanarStack::Normal::kY,
                "normal", static_cast<int>(stack.normal), "kZ (0) or kY (1)");
  check.Count("width_px", stack.width_px, kMaxPixelsPerAxis);
  check.Count("height_px", stack.height_px, kMaxPixelsPerAxis);
  check.Pitch("pitch_u_mm", stack.pitch_u_mm);
  check.Pitch("pitch_v_mm", stack.pitch_v_mm);
  const std::vector<double>& p = stack.positions_mm;
  check.Count("the number of positions_mm", static_cast<int64_t>(p.size()), kMaxSliceSteps);
  check.Require(stack.strokes == 1 || stack.strokes == 2, "strokes", stack.strokes, "1 or 2");
  if (!check.ok()) return;
  check.Require(p.size() % static_cast<size_t>(stack.strokes) == 0, "the number of positions_mm",
                p.size(), "even: as many in each of two strokes");
  const size_t of_stroke = p.size() / static_cast<size_t>(stack.strokes);
  for (size_t s = 0; check.ok() && s < p.size(); ++s) {
    const std::string field = absl::StrCat("positions_mm[", s, "]");
    check.Position(field, p[s]);
    if (s % of_stroke == 0) continue;
    // Each slice continues the direction of its stroke; the second stroke runs the other way.
    const bool first_up = p[1] > p[0], up = s < of_stroke ? first_up : !first_up;
    check.Require(up ? p[s] > p[s - 1] : p[s] < p[s - 1], field, p[s],
                  absl::StrCat(up ? "above" : "below", " positions_mm[", s - 1, "], ", p[s - 1],
                               ": positions ascend or descend strictly within a stroke, and a "
                               "second stroke goes the other way"));
  }
  if (of_stroke == 1) check.Pitch("thickness_mm", stack.thickness_mm);
  CheckPictures(check, static_cast<int64_t>(p.size()), stack.width_px, stack.height_px);
}

void CheckRotor(Checker& check, const Rotor& rotor) {
  check.Count("slices_per_turn", rotor.slices_per_turn, kMaxSliceSteps);
  check.Count("width_px", rotor.width_px, kMaxPixelsPerAxis);
  check.Count("height_px", rotor.height_px, kMaxPixelsPerAxis);
  check.Count("the number of panels", static_cast<int64_t>(rotor.panels.size()), kMaxPanels);
  for (size_t p = 0; check.ok() && p < rotor.panels.size(); ++p) {
    const Rotor::Panel& panel = rotor.panels[p];
    const std::string name = absl::StrCat("panels[", p, "].");
    check.Pitch(name + "pitch_u_mm", panel.pitch_u_mm);
    check.Pitch(name + "pitch_v_mm", panel.pitch_v_mm);
    check.Position(name + "eccentricity_mm", panel.eccentricity_mm);
    check.Position(name + "shift_u_mm", panel.shift_u_mm);
    check.Position(name + "shift_v_mm", panel.shift_v_mm);
    check.Require(std::abs(panel.tilt_deg) <= kMaxTiltDeg, name + "tilt_deg", panel.tilt_deg,
                  absl::StrCat("from -", kMaxTiltDeg, " to ", kMaxTiltDeg));
    check.Require(panel.phase_turns >= 0 && panel.phase_turns < 1, name + "phase_turns",
                  panel.phase_turns, "at least 0 and below 1");
  }
  CheckPictures(check, rotor.slices_per_turn * static_cast<int64_t>(rotor.panels.size()),
                rotor.width_px, rotor.height_px);
}

void CheckLattice(Checker& check, const Lattice& lattice) {
  check.Count("width_px", lattice.width_px, kMaxPixelsPerAxis);
  check.Require(lattice.height_px == 1, "height_px", lattice.height_px,
                "1: a lattice's slices are rows");
  const std::vector<std::optional<Vec3>>& points = lattice.points_mm;
  if (!check.ok()) return;
  const int64_t width = lattice.width_px, pixels = static_cast<int64_t>(points.size());
  check.Require(pixels % width == 0, "the number of points_mm", pixels,
                absl::StrCat("a multiple of width_px, ", width));
  check.Count("the number of points_mm / width_px", pixels / width, kMaxSliceSteps);
  check.Require(pixels <= kMaxLatticePixels, "the number of points_mm", pixels,
                absl::StrCat("at most ", kMaxLatticePixels));
  int64_t lights = 0;
  for (size_t n = 0; check.ok() && n < points.size(); ++n) {
    if (!points[n].has_value()) continue;
    ++lights;
    const std::string name = absl::StrCat("points_mm[", n, "].");
    check.Position(name + "x", points[n]->x);
    check.Position(name + "y", points[n]->y);
    check.Position(name + "z", points[n]->z);
  }
  check.Require(lights > 0, "the number of points_mm that have a light", lights, "1 at least");
  check.Pitch("cell_mm.x", lattice.cell_mm.x);
  check.Pitch("cell_mm.y", lattice.cell_mm.y);
  check.Pitch("cell_mm.z", lattice.cell_mm.z);
}

void CheckHelix(Checker& check, const Helix& helix) {
  check.Count("slices_per_turn", helix.slices_per_turn, kMaxSliceSteps);
  check.Count("width_px", helix.width_px, kMaxPixelsPerAxis);
  check.Count("height_px", helix.height_px, kMaxPixelsPerAxis);
  check.Pitch("pitch_u_mm", helix.pitch_u_mm);
  check.Pitch("pitch_v_mm", helix.pitch_v_mm);
  check.Count("blades", helix.blades, kMaxBlades);
  const double most = check.ok() ? 1.0 / helix.blades : 1;
  check.Require(helix.span_turns >= kMinSpanTurns && helix.span_turns <= most * (1 + 1e-12),
                "span_turns", helix.span_turns,
                absl::StrCat("from ", kMinSpanTurns, " to 1 / blades, ", most,
                             ": blades do not lie over one another"));
  check.Pitch("height_mm", helix.height_mm);
  check.Number("hub_mm", helix.hub_mm, 0, kMaxPositionMm);
  check.Number("radius_mm", helix.radius_mm, kMinPitchMm, kMaxPositionMm);
  check.Require(helix.hub_mm < helix.radius_mm, "hub_mm", helix.hub_mm,
                absl::StrCat("below radius_mm, ", helix.radius_mm));
  check.Require(helix.phase_turns >= 0 && helix.phase_turns < 1, "phase_turns", helix.phase_turns,
                "at least 0 and below 1");
  CheckPictures(check, helix.slices_per_turn, helix.width_px, helix.height_px);
}

void CheckShape(Checker& check, const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    CheckStack(check, *stack);
  } else if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    CheckLattice(check, *lattice);
  } else if (const auto* helix = std::get_if<Helix>(&geometry.shape)) {
    CheckHelix(check, *helix);
  } else {
    CheckRotor(check, std::get<Rotor>(geometry.shape));
  }
}

void CheckGrid(Checker& check, const VoxelGrid& grid) {
  check.Count("grid.nx", grid.nx, kMaxCellsPerAxis);
  check.Count("grid.ny", grid.ny, kMaxCellsPerAxis);
  check.Count("grid.nz", grid.nz, kMaxCellsPerAxis);
  check.Pitch("grid.pitch_mm.x", grid.pitch_mm.x);
  check.Pitch("grid.pitch_mm.y", grid.pitch_mm.y);
  check.Pitch("grid.pitch_mm.z", grid.pitch_mm.z);
  check.Position("grid.origin_mm.x", grid.origin_mm.x);
  check.Position("grid.origin_mm.y", grid.origin_mm.y);
  check.Position("grid.origin_mm.z", grid.origin_mm.z);
  if (!check.ok()) return;
  const int64_t cells = int64_t{grid.nx} * grid.ny * grid.nz;
  check.Require(cells <= kMaxCells,
                absl::StrCat("grid.nx·ny·nz (", grid.nx, "·", grid.ny, "·", grid.nz, ")"), cells,
                absl::StrCat("at most ", kMaxCells, " voxels"));
}

void CheckTable(Checker& check, int64_t entries) {
  check.Require(entries <= kMaxFootprintEntries, "the bound on the footprint table", entries,
                absl::StrCat("at most ", kMaxFootprintEntries,
                             " entries: use a coarser grid, or fewer slices or columns of pixels"));
}

void CheckStackInGrid(Checker& check, const PlanarStack& stack, const VoxelGrid& grid) {
  const bool flat = stack.normal == PlanarStack::Normal::kZ;
  const double pitch = flat ? grid.pitch_mm.z : grid.pitch_mm.y;
  const std::vector<double>& p = stack.positions_mm;
  const size_t of_stroke = p.size() / static_cast<size_t>(stack.strokes);
  for (size_t s = 1; check.ok() && s < p.size(); ++s) {
    if (s % of_stroke == 0) continue;
    check.Require(std::abs(p[s] - p[s - 1]) / pitch >= kMinSpacingVoxels,
                  absl::StrCat("positions_mm[", s, "] − positions_mm[", s - 1, "]"),
                  p[s] - p[s - 1],
                  absl::StrCat("at least 1/1024 of the grid's pitch along the normal, ",
                               pitch * kMinSpacingVoxels, " mm"));
  }
  // A column of voxels is in one list of each slice that sees it, and a depth in at most two
  // slices. Each pixel and each slice may add the one that contains its centre.
  const int64_t slices = static_cast<int64_t>(p.size());
  const int64_t depths = 2 * int64_t{flat ? grid.nz : grid.ny} * stack.strokes + slices;
  CheckTable(check, (int64_t{grid.nx} + stack.width_px) * depths);
}

void CheckRotorInGrid(Checker& check, const Rotor& rotor, const VoxelGrid& grid) {
  const double reach = kMaxRotorReach * std::min(grid.pitch_mm.x, grid.pitch_mm.y);
  const auto within = [&](absl::string_view field, double mm) {
    check.Require(std::abs(mm) <= reach, field, mm,
                  absl::StrCat("within ", reach, " mm of the axis, ", kMaxRotorReach,
                               " times the grid's smaller horizontal pitch"));
  };
  within("grid.origin_mm.x", grid.origin_mm.x);
  within("grid.origin_mm.y", grid.origin_mm.y);
  within("the grid's far end along x", grid.origin_mm.x + grid.nx * grid.pitch_mm.x);
  within("the grid's far end along y", grid.origin_mm.y + grid.ny * grid.pitch_mm.y);
  within("the panels' greatest distance from the axis", RadiusMm(rotor));
  // A panel passes a column twice a turn, and each pass is in at most two slices; each pixel may
  // add the column that contains its centre, and a column on the axis is in every slice.
  const int64_t panels = static_cast<int64_t>(rotor.panels.size());
  CheckTable(check, panels * (4 * int64_t{grid.nx} * grid.ny +
                              int64_t{rotor.slices_per_turn} * (int64_t{rotor.width_px} + 1)));
}

void CheckLatticeInGrid(Checker& check, const Lattice& lattice, const VoxelGrid& grid) {
  // Upper bound of the voxel centres in a box, plus the voxel that contains the light.
  const auto centres = [](double cell_mm, double pitch_mm, int32_t cells) {
    const double most = std::min(cell_mm / pitch_mm, static_cast<double>(cells));
    return std::min(static_cast<int64_t>(most) + 1, int64_t{cells});
  };
  const int64_t box = centres(lattice.cell_mm.x, grid.pitch_mm.x, grid.nx) *
                      centres(lattice.cell_mm.y, grid.pitch_mm.y, grid.ny) *
                      centres(lattice.cell_mm.z, grid.pitch_mm.z, grid.nz);
  const int64_t lights =
      std::count_if(lattice.points_mm.begin(), lattice.points_mm.end(),
                    [](const std::optional<Vec3>& point) { return point.has_value(); });
  CheckTable(check, lights * (box + 1));
}

// Each pixel has a list, and a voxel is in two of them each time that it is passed.
void CheckFlatInGrid(Checker& check, const Geometry& geometry) {
  const auto [width, height] = std::visit(
      [](const auto& shape) { return std::pair(shape.width_px, shape.height_px); }, geometry.shape);
  const int64_t lists = int64_t{SliceCount(geometry)} * FlatRow(width) * height;
  check.Require(lists <= kMaxFlatPixels,
                absl::StrCat("slices·width_px·height_px, rows in whole bytes (",
                             SliceCount(geometry), "·", FlatRow(width), "·", height, ")"),
                lists,
                absl::StrCat("at most ", kMaxFlatPixels,
                             " where footprints are kept pixel by pixel: of a helix, of tilted "
                             "panels, with a correction"));
  int64_t passes = 2;
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) passes = 2 * stack->strokes;
  if (const auto* rotor = std::get_if<Rotor>(&geometry.shape)) {
    passes = 4 * static_cast<int64_t>(rotor->panels.size());
  }
  if (const auto* helix = std::get_if<Helix>(&geometry.shape)) passes = 2 * helix->blades;
  const VoxelGrid& grid = geometry.grid;
  // A voxel on the rotation axis is passed in every slice, and so may be the one beside it.
  CheckTable(check, passes * grid.nx * grid.ny * grid.nz + lists +
                        2 * int64_t{grid.nz} * SliceCount(geometry));
}

}  // namespace

absl::Status ValidateShape(const Geometry& geometry) {
  Checker check;
  CheckShape(check, geometry);
  return check.ok() ? CheckCorrection(geometry) : check.status();
}

absl::Status ValidateGeometry(const Geometry& geometry) {
  Checker check;
  CheckShape(check, geometry);
  CheckGrid(check, geometry.grid);
  if (!check.ok()) return check.status();
  if (absl::Status status = CheckCorrection(geometry); !status.ok()) return status;
  if (IsFlat(geometry)) CheckFlatInGrid(check, geometry);
  if (!check.ok()) return check.status();
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    CheckStackInGrid(check, *stack, geometry.grid);
  } else if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    CheckLatticeInGrid(check, *lattice, geometry.grid);
  } else if (std::holds_alternative<Helix>(geometry.shape)) {
    return check.status();
  } else {
    CheckRotorInGrid(check, std::get<Rotor>(geometry.shape), geometry.grid);
  }
  return check.status();
}

absl::Status ValidateFormat(const FrameLayout& layout) {
  const auto wrong = [](const char* field, int64_t value, const char* right) {
    return absl::InvalidArgumentError(
        absl::StrCat("layout.", field, " is ", value, ", must be ", right));
  };
  if (static_cast<uint8_t>(layout.format) >= kPixelFormats) {
    return wrong("format", static_cast<int64_t>(layout.format), "0 to 4");
  }
  if (layout.bits < 0 || layout.bits > 8) return wrong("bits", layout.bits, "0 to 8");
  if (layout.format == PixelFormat::kRgb332 && layout.bits_per_channel() != 3) {
    return wrong("bits", layout.bits, "0 or 3, as rgb332 has");
  }
  if (layout.format == PixelFormat::kPlanes24 && layout.bits_per_channel() != 1) {
    return wrong("bits", layout.bits, "0 or 1, as planes24 has");
  }
  if (layout.format == PixelFormat::kHub75 && layout.height % 2 != 0) {
    return wrong("height", layout.height, "even, as hub75 has");
  }
  return absl::OkStatus();
}

}  // namespace voxeld::display
