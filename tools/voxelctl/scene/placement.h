// From a file's axes and units into a display: upright, centred, as large as fits.
#pragma once

#include <cmath>
#include <span>

#include "absl/status/statusor.h"
#include "gpu/affine.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// The part of scene space that a display shows: a box, or the upright cylinder in it.
struct DisplaySpace {
  Point3 center;
  Point3 half = {1, 1, 1};
  bool round = false;
};

// Of a display with nx·ny·nz voxels that shows the scene through `scene_to_voxel`. A view that
// turns the scene gets the cube that fits inside. InvalidArgument if the map is singular.
absl::StatusOr<DisplaySpace> VisibleSpace(int nx, int ny, int nz, const gpu::Affine& scene_to_voxel,
                                          bool round);

// What both show; `a` if that is nothing.
DisplaySpace Intersection(const DisplaySpace& a, const DisplaySpace& b);

struct PlacementOptions {
  Up up = Up::kAuto;  // kAuto: each format's own
  bool spin = false;  // leaves room to turn about the vertical axis
  // Every model is fitted by itself; otherwise all share one space, as parts of one thing.
  bool each = false;
};

// Turns, centres and scales the models' vertices in place, so that moved to space.center (and
// turned about z) they lie within `space`. Globes keep their centre. Meshes beside a globe come
// inside it. Every model must have a vertex.
void PlaceModels(std::span<Model> models, const DisplaySpace& space,
                 const PlacementOptions& options);

// One place for models that follow one another: the same map for each, so that they move as they do among themselves.
class FramePlacement {
 public:
  explicit FramePlacement(Up up) : up_(up) {}
  // Takes a model's reach in, before Fit. A few of many are enough where frames are much alike.
  void Measure(const Model& model);
  // Finds the map that puts all that was measured into `space`, as PlaceModels would.
  void Fit(const DisplaySpace& space, bool spin);
  // Turns and moves a model's vertices in place.
  void Place(Model* model) const;

 private:
  const Up up_;  // kAuto: each format's own
  Point3 min_{HUGE_VAL, HUGE_VAL, HUGE_VAL}, max_{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  double scale_ = 1;
};

// To space.center, after a turn about z: the map of an instance.
gpu::Affine InstanceTransform(const DisplaySpace& space, double turns);

}  // namespace voxeld::voxelctl
