// The clip of a layer as the client specifies it.
#pragma once

#include <algorithm>
#include <cstdint>

#include "gpu/delta.h"

namespace voxeld::daemon {

// A box around `center` before the transform. Requires: the transform has an inverse; sizes are
// greater than 0.
struct ClipBox {
  double center[3] = {}, size[3] = {};
  gpu::Affine transform;
  bool operator==(const ClipBox&) const = default;
};

// A cylinder between two points. Requires: the radius is greater than 0.
struct ClipCylinder {
  double start[3] = {}, end[3] = {}, radius = 0;
  bool operator==(const ClipCylinder&) const = default;
};

// In scene coordinates. Only what lies inside all parts is drawn.
struct Clip {
  static constexpr uint32_t kBoxPlanes = 6, kCylinderPlanes = 2;
  static constexpr uint32_t kMostBoxes = gpu::kMaxClipPlanes / kBoxPlanes;

  uint32_t count = 0, boxes_count = 0, cylinders_count = 0;
  gpu::ClipPlane planes[gpu::kMaxClipPlanes];
  ClipBox boxes[kMostBoxes];
  ClipCylinder cylinders[gpu::kMaxClipCylinders];

  bool empty() const { return count == 0 && boxes_count == 0 && cylinders_count == 0; }
  // Returns: the number of planes for the engine; gpu::kMaxClipPlanes at most.
  uint32_t planes_in_all() const {
    return count + kBoxPlanes * boxes_count + kCylinderPlanes * cylinders_count;
  }
  bool operator==(const Clip& other) const {
    return std::equal(planes, planes + count, other.planes, other.planes + other.count) &&
           std::equal(boxes, boxes + boxes_count, other.boxes, other.boxes + other.boxes_count) &&
           std::equal(cylinders, cylinders + cylinders_count, other.cylinders,
                      other.cylinders + other.cylinders_count);
  }
};

// Converts the clip to the engine's form: planes, and cylinders without ends. Returns: false if a
// part has no inverse or does not stay finite.
bool PutClip(const Clip& clip, gpu::LayerRecord& record);

}  // namespace voxeld::daemon
