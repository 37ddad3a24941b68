#include "tools/voxelctl/lights/light_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "display/drivers/wiring/wiring.h"
#include "gpu/affine.h"

namespace voxeld::voxelctl {
namespace {

using Three = std::array<double, 3>;

// The display's volume.
struct Space {
  Three voxels{}, pitch_mm{}, origin_mm{};
  client::Affine to_scene;  // from voxels
  bool round = false;       // the parts far from the z axis are not visible
};

absl::StatusOr<Space> SpaceOf(const v1::DisplayDescription& display) {
  const v1::VoxelGrid& grid = display.geometry().grid();
  const std::string name = EscapeForTerminal(display.name());
  Space space;
  space.voxels = {double(grid.nx()), double(grid.ny()), double(grid.nz())};
  space.pitch_mm = {grid.pitch_mm().x(), grid.pitch_mm().y(), grid.pitch_mm().z()};
  space.origin_mm = {grid.origin_mm().x(), grid.origin_mm().y(), grid.origin_mm().z()};
  space.round = display.geometry().has_rotor() || display.geometry().has_helix();
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!(space.voxels[axis] > 0) || !(space.pitch_mm[axis] > 0)) {
      return absl::FailedPreconditionError(
          absl::StrCat("the display ", name, " has no volume yet"));
    }
  }
  gpu::Affine view;
  if (display.scene_to_voxel().m_size() == 12) {
    std::copy(display.scene_to_voxel().m().begin(), display.scene_to_voxel().m().end(), view.m);
  }
  const double determinant = gpu::Determinant(view);
  if (!std::isfinite(determinant) || determinant == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("the view of the display ", name, " cannot be turned round"));
  }
  for (int row = 0; row < 3; ++row) {
    double* out = space.to_scene.m.data() + row * 4;
    double moved = 0;
    for (int col = 0; col < 3; ++col) {
      out[col] = gpu::Cofactor(view, col, row) / determinant;
      moved += out[col] * view.m[col * 4 + 3];
    }
    out[3] = -moved;
  }
  return space;
}

absl::Status TooMany(size_t lights) {
  return absl::InvalidArgumentError(
      absl::StrCat(lights, " lights; ", kMostLights, " are the most"));
}

}  // namespace

client::Points LightMap::Picture(std::span<const uint8_t> values) const {
  std::vector<uint8_t> colors(light.size() * 3);
  for (size_t i = 0; i < light.size(); ++i) {
    const size_t at = size_t{light[i]} * 3;
    if (at + 3 <= values.size()) std::copy_n(values.data() + at, 3, colors.data() + i * 3);
  }
  client::Points points;
  points.vertices.positions = std::span<const float>(places);
  points.vertices.colors = std::move(colors);
  if (cells) points.splat = client::Points::Splat::kCell;
  return points;
}

absl::StatusOr<LightMap> LightsOf(const v1::DisplayDescription& display) {
  const std::string name = EscapeForTerminal(display.name());
  if (!display.geometry().has_lattice()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the display ", name, " has no lights with numbers: give --size WxHxD, or --layout FILE"));
  }
  const absl::StatusOr<Space> space = SpaceOf(display);
  if (!space.ok()) return space.status();
  const v1::Lattice& lattice = display.geometry().lattice();
  const auto count = static_cast<size_t>(lattice.pixels_size());
  const std::array<const google::protobuf::RepeatedField<double>*, 3> at_mm = {
      &lattice.x_mm(), &lattice.y_mm(), &lattice.z_mm()};
  if (count == 0 || std::any_of(at_mm.begin(), at_mm.end(), [count](const auto* axis) {
        return static_cast<size_t>(axis->size()) != count;
      })) {
    return absl::FailedPreconditionError(absl::StrCat("the display ", name, " names no lights"));
  }
  LightMap map;
  map.lights = size_t{lattice.pixels(static_cast<int>(count) - 1)} + 1;
  if (map.lights > kMostLights) return TooMany(map.lights);
  map.cells = true;
  map.transform = space->to_scene;
  map.where = absl::StrCat("the ", count, " lights of ", name);
  for (size_t i = 0; i < count; ++i) {
    map.light.push_back(lattice.pixels(static_cast<int>(i)));
    for (size_t axis = 0; axis < 3; ++axis) {
      const double voxel =
          ((*at_mm[axis])[static_cast<int>(i)] - space->origin_mm[axis]) / space->pitch_mm[axis];
      map.places.push_back(static_cast<float>(std::floor(voxel)));
    }
  }
  return map;
}

absl::StatusOr<LightMap> LightsInBox(std::array<int, 3> size,
                                     const v1::DisplayDescription& display) {
  const absl::StatusOr<Space> space = SpaceOf(display);
  if (!space.ok()) return space.status();
  LightMap map;
  map.lights = size_t(size[0]) * size_t(size[1]) * size_t(size[2]);
  if (map.lights > kMostLights) return TooMany(map.lights);
  map.cells = true;
  map.where = absl::StrCat(size[0], "×", size[1], "×", size[2], " lights in ",
                           EscapeForTerminal(display.name()));
  Three volume_mm{};
  double cell_mm = std::numeric_limits<double>::max();
  for (size_t axis = 0; axis < 3; ++axis) {
    volume_mm[axis] = space->voxels[axis] * space->pitch_mm[axis];
    cell_mm = std::min(cell_mm, volume_mm[axis] / size[axis]);
  }
  if (space->round) {
    cell_mm = std::min(cell_mm, std::min(volume_mm[0], volume_mm[1]) /
                                    std::hypot(double(size[0]), double(size[1])));
  }
  client::Affine to_voxels;
  for (size_t axis = 0; axis < 3; ++axis) {
    to_voxels.m[axis * 5] = cell_mm / space->pitch_mm[axis];
    to_voxels.m[axis * 4 + 3] =
        (volume_mm[axis] - cell_mm * size[axis]) / 2 / space->pitch_mm[axis];
  }
  map.transform = space->to_scene * to_voxels;
  for (int z = 0; z < size[2]; ++z) {
    for (int y = 0; y < size[1]; ++y) {
      for (int x = 0; x < size[0]; ++x) {
        map.light.push_back(static_cast<uint32_t>(map.light.size()));
        map.places.insert(map.places.end(), {float(x), float(y), float(z)});
      }
    }
  }
  return map;
}

absl::StatusOr<LightMap> LightsOfLayout(std::string_view json,
                                        const v1::DisplayDescription& display) {
  constexpr auto kNumbers = static_cast<int32_t>(kMostLights);
  const absl::StatusOr<display::Lattice> lattice = display::wiring::ParseLayout(
      json, {.a_slice = kNumbers, .slices = 1, .a_strip = kNumbers, .unit = "layout"}, 1);
  if (!lattice.ok()) return lattice.status();
  const absl::StatusOr<Space> space = SpaceOf(display);
  if (!space.ok()) return space.status();
  Three low = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  double radius = 0;
  const auto for_each = [&lattice](const auto& visit) {
    for (size_t i = 0; i < lattice->points_mm.size(); ++i) {
      if (const auto& point = lattice->points_mm[i]; point.has_value()) {
        visit(i, Three{point->x, point->y, point->z});
      }
    }
  };
  for_each([&](size_t, const Three& point) {
    for (size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], point[axis]);
      high[axis] = std::max(high[axis], point[axis]);
    }
  });
  const auto from_middle = [&](const Three& point, size_t axis) {
    return point[axis] - (low[axis] / 2 + high[axis] / 2);
  };
  for_each([&](size_t, const Three& point) {
    radius = std::max(radius, std::hypot(from_middle(point, 0), from_middle(point, 1)));
  });
  // The outermost lights are in the centres of the outermost voxels.
  double scale = HUGE_VAL;
  const auto fit = [&](size_t axis, double reach) {
    const double room = (space->voxels[axis] - 1) * space->pitch_mm[axis] / 2;
    if (reach > 0) scale = std::min(scale, room / reach);
  };
  for (size_t axis = 0; axis < 3; ++axis) fit(axis, (high[axis] - low[axis]) / 2);
  if (space->round) {
    fit(0, radius);
    fit(1, radius);
  }
  if (!std::isfinite(scale)) scale = 1;  // there is only one light
  LightMap map;
  map.transform = space->to_scene;
  for_each([&](size_t i, const Three& point) {
    map.lights = i + 1;
    map.light.push_back(static_cast<uint32_t>(i));
    for (size_t axis = 0; axis < 3; ++axis) {
      map.places.push_back(static_cast<float>(
          space->voxels[axis] / 2 + from_middle(point, axis) * scale / space->pitch_mm[axis]));
    }
  });
  map.where = absl::StrCat("the ", map.light.size(), " lights of the layout in ",
                           EscapeForTerminal(display.name()));
  return map;
}

}  // namespace voxeld::voxelctl
