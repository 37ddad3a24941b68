#include "display/drivers/geometry_options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "display/geometry/corrector.h"
#include "display/geometry/keystone.h"
#include "display/geometry/motion.h"

namespace voxeld::display {
namespace {

constexpr int32_t kMostSlices = 16384;
constexpr double kMostNumber = 1e6;
// As many as fit into a voxlink device's description of itself.
constexpr size_t kMostLights = 40'000;

void ReadPositions(OptionReader& reader, double slice_pitch, int32_t slices, PlanarStack& planar) {
  const auto motion =
      static_cast<Motion::Kind>(reader.Choice("motion", {"stepped", "sawtooth", "sine"}, 0));
  const size_t strokes = reader.Choice("strokes", {"up", "down", "both"}, 0);
  Motion sweep{.kind = motion,
               .slices = slices,
               .slice_pitch_mm = slice_pitch,
               .travel_mm = reader.Number("travel_mm", slices * slice_pitch, 1e-6, kMostNumber),
               .dead_begin = reader.Number("dead_begin", 0, 0, 0.9),
               .dead_end = reader.Number("dead_end", 0, 0, 0.9),
               .down = strokes == 1};
  if (sweep.dead_begin + sweep.dead_end > 0.95) {
    reader.Refuse("dead_end", "so that with dead_begin 0.95 of a stroke at the most are dark");
    return;
  }
  if (motion == Motion::Kind::kStepped) {
    for (const char* const key : {"travel_mm", "dead_begin", "dead_end"}) {
      if (reader.has(key)) reader.Refuse(key, "left out where the motion is stepped");
    }
  } else if (reader.has("slice_pitch_mm")) {
    reader.Refuse("slice_pitch_mm", "left out where there is a motion: travel_mm says how far");
  }
  planar.strokes = strokes == 2 ? 2 : 1;
  planar.positions_mm = PositionsOf(sweep);
  if (planar.strokes == 2) {
    sweep.down = true;
    const std::vector<double> down = PositionsOf(sweep);
    planar.positions_mm.insert(planar.positions_mm.end(), down.begin(), down.end());
  }
}

Geometry ReadPlanar(OptionReader& reader, double pitch) {
  PlanarStack planar;
  planar.normal = static_cast<PlanarStack::Normal>(reader.Choice("normal", {"z", "y"}, 0));
  planar.positions_mm = reader.Numbers("positions_mm");
  const bool listed = !planar.positions_mm.empty();
  const double slice_pitch = reader.Number("slice_pitch_mm", pitch, 1e-6, kMostNumber);
  const auto count = static_cast<int32_t>(
      std::min<size_t>(planar.positions_mm.size(), static_cast<size_t>(kMostSlices)));
  const std::vector<int32_t> size =
      reader.Size("size", {128, 128, listed ? count : 128}, listed ? 2 : 3, 3);
  planar.width_px = size[0];
  planar.height_px = size[1];
  planar.pitch_u_mm = planar.pitch_v_mm = pitch;
  planar.thickness_mm = slice_pitch;
  if (listed) {
    for (const char* const key :
         {"slice_pitch_mm", "motion", "travel_mm", "dead_begin", "dead_end"}) {
      if (reader.has(key)) reader.Refuse(key, "left out where positions_mm are listed");
    }
    const size_t strokes = reader.Choice("strokes", {"up", "down", "both"}, 0);
    if (strokes == 1) reader.Refuse("strokes", "both, or left out: positions_mm say which way");
    planar.strokes = strokes == 2 ? 2 : 1;
    if (size.size() == 3 && static_cast<size_t>(size[2]) != planar.positions_mm.size()) {
      reader.Refuse("size", absl::StrCat("of ", planar.positions_mm.size(),
                                         " slices, as many as positions_mm, or WxH"));
    }
  } else {
    ReadPositions(reader, slice_pitch, size[2], planar);
  }
  planar.mirror_u = reader.Flag("mirror_u", false);
  planar.mirror_v = reader.Flag("mirror_v", false);
  return {.shape = std::move(planar), .grid = {}, .correction = {}};
}

Geometry ReadRotor(OptionReader& reader, double pitch) {
  Rotor rotor;
  const std::vector<int32_t> size = reader.Size("size", {128, 128}, 2, 2);
  rotor.width_px = size[0];
  rotor.height_px = size[1];
  rotor.slices_per_turn = static_cast<int32_t>(reader.Integer("slices", 360, 1, kMostSlices));
  rotor.clockwise = reader.Flag("clockwise", false);
  std::vector<double> eccentricity = reader.Numbers("eccentricity");
  if (eccentricity.empty()) eccentricity.push_back(0);
  if (eccentricity.size() > 16) {
    reader.Refuse("eccentricity", "a list of 1 to 16 panels");
    eccentricity.resize(16);
  }
  const size_t panels = eccentricity.size();
  const auto list = [&](const std::string& key) {
    std::vector<double> values = reader.Numbers(key);
    if (!values.empty() && values.size() != panels) {
      reader.Refuse(key, absl::StrCat("a list of ", panels, ", as eccentricity has panels"));
    }
    values.resize(panels);
    return values;
  };
  const std::vector<double> phase = list("panel_phase"), shift_u = list("shift_u"),
                            shift_v = list("shift_v"), tilt = list("tilt");
  std::vector<double> pitch_u = list("panel_pitch_u_mm"), pitch_v = list("panel_pitch_v_mm");
  for (std::vector<double>* const pitches : {&pitch_u, &pitch_v}) {
    const char* const key = pitches == &pitch_u ? "panel_pitch_u_mm" : "panel_pitch_v_mm";
    if (!reader.has(key)) std::fill(pitches->begin(), pitches->end(), pitch);
  }
  const std::vector<bool> mirror_u = reader.Flags("mirror_u", panels),
                          mirror_v = reader.Flags("mirror_v", panels);
  for (size_t p = 0; p < panels; ++p) {
    if (!(phase[p] >= 0 && phase[p] < 1)) reader.Refuse("panel_phase", "turns from 0 to below 1");
    rotor.panels.push_back({.pitch_u_mm = pitch_u[p],
                            .pitch_v_mm = pitch_v[p],
                            .eccentricity_mm = eccentricity[p] * pitch,
                            .shift_u_mm = shift_u[p] * pitch,
                            .shift_v_mm = shift_v[p] * pitch,
                            .phase_turns = phase[p],
                            .mirror_u = mirror_u[p],
                            .mirror_v = mirror_v[p],
                            .tilt_deg = static_cast<float>(tilt[p])});
  }
  return {.shape = std::move(rotor), .grid = {}, .correction = {}};
}

Geometry ReadHelix(OptionReader& reader, double pitch) {
  Helix helix;
  const std::vector<int32_t> size = reader.Size("size", {128, 128}, 2, 2);
  helix.width_px = size[0];
  helix.height_px = size[1];
  helix.pitch_u_mm = helix.pitch_v_mm = pitch;
  helix.slices_per_turn = static_cast<int32_t>(reader.Integer("slices", 180, 1, kMostSlices));
  helix.blades = static_cast<int32_t>(reader.Integer("blades", 1, 1, 10));
  helix.span_turns = reader.Number("span", 1.0 / helix.blades, 0.1, 1);
  const double radius = pitch * std::min(size[0], size[1]) / 2;
  helix.radius_mm = reader.Number("radius_mm", radius, 1e-4, kMostNumber);
  helix.hub_mm = reader.Number("hub_mm", 0, 0, kMostNumber);
  helix.height_mm = reader.Number("travel_mm", 2 * helix.radius_mm, 1e-4, 1e4);
  helix.phase_turns = reader.Number("phase", 0, 0, 1);
  helix.left_handed = reader.Flag("left_handed", false);
  helix.clockwise = reader.Flag("clockwise", false);
  helix.mirror_u = reader.Flag("mirror_u", false);
  helix.mirror_v = reader.Flag("mirror_v", false);
  return {.shape = helix, .grid = {}, .correction = {}};
}

// Reads lights in rows, layer by layer, or at given points.
Geometry ReadLattice(OptionReader& reader, double pitch) {
  Lattice lattice;
  const std::vector<double> points = reader.Numbers("points_mm");
  const std::vector<int32_t> size = reader.Size("size", {8, 8, 8}, 3, 3);
  const double cell = reader.Number("cell_mm", pitch, 1e-4, 1e4);
  lattice.cell_mm = {cell, cell, cell};
  const auto width = static_cast<int32_t>(reader.Integer("width", 64, 1, kMostSlices));
  if (!points.empty()) {
    if (points.size() % 3 != 0) reader.Refuse("points_mm", "x;y;z of each light");
    if (reader.has("size")) reader.Refuse("size", "left out where points_mm are listed");
    lattice.width_px = width;
    for (size_t i = 0; i + 2 < points.size(); i += 3) {
      lattice.points_mm.push_back(Vec3{points[i], points[i + 1], points[i + 2]});
    }
    // Pad the last slice, which may have fewer lights.
    while (lattice.points_mm.size() % static_cast<size_t>(width) != 0) {
      lattice.points_mm.emplace_back();
    }
    if (lattice.points_mm.size() > kMostLights) {
      reader.Refuse("points_mm", absl::StrCat("at most ", kMostLights, " places for lights"));
    }
    return {.shape = std::move(lattice), .grid = {}, .correction = {}};
  }
  if (reader.has("width")) reader.Refuse("width", "left out where points_mm are not listed");
  if (int64_t{size[0]} * size[1] > kMostSlices ||
      int64_t{size[0]} * size[1] * size[2] > int64_t{kMostLights}) {
    reader.Refuse("size", absl::StrCat("at most ", kMostSlices, " lights in a layer and ",
                                       kMostLights, " in all"));
    return {.shape = std::move(lattice), .grid = {}, .correction = {}};
  }
  lattice.width_px = size[0] * size[1];
  for (int32_t z = 0; z < size[2]; ++z) {
    for (int32_t y = 0; y < size[1]; ++y) {
      for (int32_t x = 0; x < size[0]; ++x) {
        lattice.points_mm.push_back(Vec3{(x - (size[0] - 1) / 2.0) * pitch,
                                         (y - (size[1] - 1) / 2.0) * pitch,
                                         (z - (size[2] - 1) / 2.0) * pitch});
      }
    }
  }
  return {.shape = std::move(lattice), .grid = {}, .correction = {}};
}

void ReadKeystone(OptionReader& reader, const Geometry& geometry, Correction& correction) {
  const std::vector<double> corners = reader.Numbers("keystone_mm");
  if (corners.empty()) return;
  const std::optional<PicturePlace> half = HalfPicture(geometry);
  if (!half || corners.size() % 8 != 0) {
    return reader.Refuse("keystone_mm",
                         "where the corners (−u −v), (+u −v), (+u +v), (−u +v) of the picture are, "
                         "u and v of each, once or for each slice; of a planar stack or a helix");
  }
  for (size_t i = 0; i < corners.size(); i += 8) {
    std::array<PicturePlace, 4> to;
    for (size_t c = 0; c < 4; ++c) to[c] = {corners[i + 2 * c], corners[i + 2 * c + 1]};
    const std::optional<Homography> found = HomographyOfCorners(*half, to);
    if (!found) {
      return reader.Refuse("keystone_mm", "four corners of which no three lie in a line");
    }
    correction.homographies.push_back(found->m);
  }
}

void ReadDisplacement(OptionReader& reader, Correction& correction) {
  const std::vector<double> at = reader.Numbers("displacement_mm");
  if (at.empty()) return;
  const std::vector<int32_t> size = reader.Size("displacement_size", {2, 2, 2}, 3, 3);
  const std::vector<double> low = reader.Numbers("displacement_low_mm"),
                            high = reader.Numbers("displacement_high_mm");
  if (low.size() != 3) return reader.Refuse("displacement_low_mm", "x;y;z of the first place");
  if (high.size() != 3) return reader.Refuse("displacement_high_mm", "x;y;z of the last place");
  if (at.size() % 3 != 0) return reader.Refuse("displacement_mm", "x;y;z of each place");
  DisplacementGrid& grid = correction.displacement.emplace();
  grid = {size[0], size[1], size[2], {low[0], low[1], low[2]}, {high[0], high[1], high[2]}, {}};
  for (size_t i = 0; i < at.size(); i += 3) grid.at_mm.push_back({at[i], at[i + 1], at[i + 2]});
}

void ReadCorrection(OptionReader& reader, Geometry& geometry) {
  Correction correction;
  const std::vector<double> affine = reader.Numbers("affine");
  if (!affine.empty() && affine.size() != 12) {
    reader.Refuse("affine", "12 numbers, three rows of four, millimetres in the fourth");
  } else if (!affine.empty()) {
    std::copy(affine.begin(), affine.end(), correction.affine.begin());
  }
  ReadKeystone(reader, geometry, correction);
  ReadDisplacement(reader, correction);
  if (correction != Correction()) geometry.correction = std::move(correction);
}

}  // namespace

Geometry ReadGeometry(OptionReader& reader, double pitch) {
  const size_t kind = reader.Choice("geometry", {"planar", "rotor", "helix", "lattice"}, 0);
  Geometry geometry = kind == 0   ? ReadPlanar(reader, pitch)
                      : kind == 1 ? ReadRotor(reader, pitch)
                      : kind == 2 ? ReadHelix(reader, pitch)
                                  : ReadLattice(reader, pitch);
  ReadCorrection(reader, geometry);
  return geometry;
}

}  // namespace voxeld::display
