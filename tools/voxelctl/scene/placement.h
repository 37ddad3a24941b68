// From a file's axes and units into a display: upright, centred, as large as fits.
#pragma once

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

// To space.center, after a turn about z: the map of an instance.
gpu::Affine InstanceTransform(const DisplaySpace& space, double turns);

}  // namespace voxeld::voxelctl
