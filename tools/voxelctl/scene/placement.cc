#include "tools/voxelctl/scene/placement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kMargin = 0.97;       // the outermost voxels stay free
constexpr double kInsideGlobe = 0.62;  // share of its radius

struct Bounds {
  Point3 min{HUGE_VAL, HUGE_VAL, HUGE_VAL};
  Point3 max{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};

  void Add(const Point3& p, double r) {
    min = {std::min(min.x, p.x - r), std::min(min.y, p.y - r), std::min(min.z, p.z - r)};
    max = {std::max(max.x, p.x + r), std::max(max.y, p.y + r), std::max(max.z, p.z + r)};
  }
  // Halves each first, so that the sum stays finite.
  Point3 Center() const {
    return {min.x / 2 + max.x / 2, min.y / 2 + max.y / 2, min.z / 2 + max.z / 2};
  }
};

Point3 Upright(const Point3& p, Up up) {
  switch (up) {
    case Up::kX:
      return {-p.z, p.y, p.x};
    case Up::kY:
      return {p.x, -p.z, p.y};
    case Up::kAuto:
    case Up::kZ:
      return p;
  }
  return p;
}

// How far a group of models extends from its centre.
struct Reach {
  double x = 0, y = 0, z = 0;
  double radius = 0;  // about the vertical axis
  double sphere = 0;  // about the centre

  void Add(const Point3& p, double r) {
    x = std::max(x, std::abs(p.x) + r);
    y = std::max(y, std::abs(p.y) + r);
    z = std::max(z, std::abs(p.z) + r);
    radius = std::max(radius, std::hypot(p.x, p.y) + r);
    sphere = std::max(sphere, std::hypot(p.x, p.y, p.z) + r);
  }
};

double Ratio(double room, double reach) { return reach > 0 ? room / reach : HUGE_VAL; }

double FitScale(const Reach& reach, const DisplaySpace& space, bool round) {
  double scale = Ratio(space.half.z, reach.z);
  if (round) {
    scale = std::min(scale, Ratio(std::min(space.half.x, space.half.y), reach.radius));
  } else {
    scale = std::min({scale, Ratio(space.half.x, reach.x), Ratio(space.half.y, reach.y)});
  }
  // A single point fits at any size.
  return std::isfinite(scale) ? scale * kMargin : 1;
}

template <typename Visit>
void ForEachPosition(std::span<Model*> group, Visit visit) {
  for (Model* model : group) {
    for (Part& part : model->parts) {
      for (Point3& p : part.positions) visit(p);
    }
    for (SampledVolume& volume : model->volumes) {
      for (Point3& p : volume.corners) visit(p);
    }
  }
}

// Thick elements extend beyond their positions.
template <typename Visit>
void ForEachReach(std::span<Model*> group, Visit visit) {
  for (Model* model : group) {
    for (Part& part : model->parts) {
      const double radius = part.thickness / 2;
      for (const Point3& p : part.positions) visit(p, radius);
    }
    for (const SampledVolume& volume : model->volumes) {
      for (const Point3& p : volume.corners) visit(p, 0);
    }
  }
}

void Center(std::span<Model*> group) {
  Bounds bounds;
  ForEachReach(group, [&](const Point3& p, double r) { bounds.Add(p, r); });
  const Point3 center = bounds.Center();
  ForEachPosition(group, [&](Point3& p) { p = {p.x - center.x, p.y - center.y, p.z - center.z}; });
}

void Scale(std::span<Model*> group, double scale) {
  ForEachPosition(group, [&](Point3& p) { p = {p.x * scale, p.y * scale, p.z * scale}; });
  for (Model* model : group) {
    for (Part& part : model->parts) part.thickness *= scale;
  }
}

// Returns the name of a unit that is `metres` long.
std::string UnitName(double metres) {
  static constexpr std::pair<double, absl::string_view> kNames[] = {
      {1, "metres"},         {0.01, "centimetres"}, {0.001, "millimetres"},
      {1e-6, "micrometres"}, {0.0254, "inches"},    {0.3048, "feet"}};
  for (const auto& [unit, name] : kNames) {
    if (std::abs(metres / unit - 1) < 1e-6) return std::string(name);
  }
  return absl::StrCat("units of ", metres, " m");
}

// Scales the models of a group to the unit of the first model that has one. Models without a unit
// are not scaled, and get a note.
void ScaleToOneUnit(std::span<Model*> group) {
  const auto first =
      std::find_if(group.begin(), group.end(), [](const Model* model) { return model->unit > 0; });
  if (first == group.end()) return;
  const double unit = (*first)->unit;
  for (Model* model : group) {
    if (model->unit > 0) {
      if (model->unit != unit) Scale({&model, 1}, model->unit / unit);
    } else {
      AddNote(absl::StrCat("its unit of length is not known; it is shown as if it had ",
                           UnitName(unit), ", as ", (*first)->path),
              model);
    }
  }
}

Reach Measure(std::span<Model*> group) {
  Reach reach;
  ForEachReach(group, [&](const Point3& p, double r) { reach.Add(p, r); });
  return reach;
}

void TurnUpright(Up wanted, Model* model) {
  const Up up = wanted == Up::kAuto ? model->up : wanted;
  for (Part& part : model->parts) {
    for (Point3& p : part.positions) p = Upright(p, up);
    for (Point3& n : part.normals) n = Upright(n, up);
  }
  for (SampledVolume& volume : model->volumes) {
    for (Point3& p : volume.corners) p = Upright(p, up);
  }
}

}  // namespace

absl::StatusOr<DisplaySpace> VisibleSpace(int nx, int ny, int nz, const gpu::Affine& scene_to_voxel,
                                          bool round) {
  const double* m = scene_to_voxel.m;
  const double determinant = gpu::Determinant(scene_to_voxel);
  if (!std::isfinite(determinant) || determinant == 0) {
    return absl::InvalidArgumentError(absl::StrCat("the display's view has determinant ",
                                                   determinant, "; it must not be singular"));
  }
  const std::array<double, 3> half_voxels = {nx / 2.0, ny / 2.0, nz / 2.0};
  const std::array<double, 3> offset = {half_voxels[0] - m[3], half_voxels[1] - m[7],
                                        half_voxels[2] - m[11]};
  // The centre, from the inverse of the linear part by cofactors.
  const auto inverse_row = [&](size_t r) {
    const size_t a = (r + 1) % 3, b = (r + 2) % 3;
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) {
      const size_t d = (c + 1) % 3, e = (c + 2) % 3;
      sum += (m[d * 4 + a] * m[e * 4 + b] - m[d * 4 + b] * m[e * 4 + a]) / determinant * offset[c];
    }
    return sum;
  };
  DisplaySpace space;
  space.round = round;
  space.center = {inverse_row(0), inverse_row(1), inverse_row(2)};
  const bool diagonal = m[1] == 0 && m[2] == 0 && m[4] == 0 && m[6] == 0 && m[8] == 0 && m[9] == 0;
  if (diagonal) {
    space.half = {half_voxels[0] / std::abs(m[0]), half_voxels[1] / std::abs(m[5]),
                  half_voxels[2] / std::abs(m[10])};
  } else {
    double half = HUGE_VAL;
    for (size_t r = 0; r < 3; ++r) {
      half = std::min(half, half_voxels[r] / (std::abs(m[r * 4]) + std::abs(m[r * 4 + 1]) +
                                              std::abs(m[r * 4 + 2])));
    }
    space.half = {half, half, half};
  }
  return space;
}

DisplaySpace Intersection(const DisplaySpace& a, const DisplaySpace& b) {
  DisplaySpace common;
  common.round = a.round || b.round;
  const auto along = [&](double Point3::*axis) {
    const double low = std::max(a.center.*axis - a.half.*axis, b.center.*axis - b.half.*axis);
    const double high = std::min(a.center.*axis + a.half.*axis, b.center.*axis + b.half.*axis);
    common.center.*axis = (low + high) / 2;
    common.half.*axis = (high - low) / 2;
    return high > low;
  };
  const bool meet = along(&Point3::x) && along(&Point3::y) && along(&Point3::z);
  return meet ? common : a;
}

void PlaceModels(std::span<Model> models, const DisplaySpace& space,
                 const PlacementOptions& options) {
  const bool round = space.round || options.spin;
  const double globe = kMargin * std::min({space.half.x, space.half.y, space.half.z});
  std::vector<std::vector<Model*>> groups;
  bool has_globe = false;
  for (Model& model : models) {
    if (model.globe) {
      Model* one = &model;
      Scale({&one, 1}, globe);
      has_globe = true;
      continue;
    }
    TurnUpright(options.up, &model);
    if (options.each || groups.empty()) groups.emplace_back();
    groups.back().push_back(&model);
  }
  for (std::vector<Model*>& group : groups) {
    ScaleToOneUnit(group);
    Center(group);
    const Reach first = Measure(group);
    // Scales to unit size first, so that neither huge nor tiny units lose the ratios below.
    if (first.sphere > 0) Scale(group, 1 / first.sphere);
    const Reach reach = Measure(group);
    Scale(group, has_globe ? Ratio(globe * kInsideGlobe, std::max(reach.sphere, 1e-9))
                           : FitScale(reach, space, round));
  }
}

void FramePlacement::Measure(const Model& model) {
  const Up up = up_ == Up::kAuto ? model.up : up_;
  Bounds bounds{min_, max_};
  for (const Part& part : model.parts) {
    for (const Point3& p : part.positions) bounds.Add(Upright(p, up), part.thickness / 2);
  }
  for (const SampledVolume& volume : model.volumes) {
    for (const Point3& p : volume.corners) bounds.Add(Upright(p, up), 0);
  }
  min_ = bounds.min;
  max_ = bounds.max;
}

void FramePlacement::Fit(const DisplaySpace& space, bool spin) {
  Reach reach;
  reach.x = max_.x / 2 - min_.x / 2;
  reach.y = max_.y / 2 - min_.y / 2;
  reach.z = max_.z / 2 - min_.z / 2;
  reach.radius = std::hypot(reach.x, reach.y);
  scale_ = FitScale(reach, space, space.round || spin);
}

void FramePlacement::Place(Model* model) const {
  TurnUpright(up_, model);
  const Point3 center = Bounds{min_, max_}.Center();
  ForEachPosition({&model, 1}, [&](Point3& p) {
    p = {p.x - center.x, p.y - center.y, p.z - center.z};
  });
  Scale({&model, 1}, scale_);
}

gpu::Affine InstanceTransform(const DisplaySpace& space, double turns) {
  const double angle = turns * 2 * std::numbers::pi;
  const double c = std::cos(angle), s = std::sin(angle);
  return {{c, -s, 0, space.center.x, s, c, 0, space.center.y, 0, 0, 1, space.center.z}};
}

}  // namespace voxeld::voxelctl
