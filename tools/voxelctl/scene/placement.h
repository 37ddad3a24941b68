// Maps a file's axes and units into a display: upright, centred, as large as fits.
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

// Returns the space of a display with nx·ny·nz voxels that shows the scene through
// `scene_to_voxel`. A view that rotates the scene gets the cube that fits inside. Errors:
// InvalidArgument if the map is singular.
absl::StatusOr<DisplaySpace> VisibleSpace(int nx, int ny, int nz, const gpu::Affine& scene_to_voxel,
                                          bool round);

// Returns the space that both show; `a` if that is empty.
DisplaySpace Intersection(const DisplaySpace& a, const DisplaySpace& b);

struct PlacementOptions {
  Up up = Up::kAuto;  // kAuto: each format's own
  bool spin = false;  // reserves space for rotation about the vertical axis
  // Fits every model separately; otherwise all share one space, as parts of one object.
  bool each = false;
};

// Scales models that share one space to one unit of length, where their files have units; a note
// names those without one. Rotates, centres and scales the models' vertices in place, so that they lie within `space` when
// moved to space.center (and rotated about z). Globes keep their centre. Meshes beside a globe are
// placed inside it. Requires: every model has a vertex.
void PlaceModels(std::span<Model> models, const DisplaySpace& space,
                 const PlacementOptions& options);

// One placement for successive models: the same map for each, so their relative motion is
// preserved.
class FramePlacement {
 public:
  explicit FramePlacement(Up up) : up_(up) {}
  // Includes a model's extent, before Fit. If frames are similar, a few of many are enough.
  void Measure(const Model& model);
  // Computes the map that fits everything measured into `space`, as PlaceModels would.
  void Fit(const DisplaySpace& space, bool spin);
  // Rotates and moves a model's vertices in place.
  void Place(Model* model) const;

 private:
  const Up up_;  // kAuto: each format's own
  Point3 min_{HUGE_VAL, HUGE_VAL, HUGE_VAL}, max_{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  double scale_ = 1;
};

// Returns the map of an instance: to space.center, after a rotation about z.
gpu::Affine InstanceTransform(const DisplaySpace& space, double turns);

}  // namespace voxeld::voxelctl
