// What a layer is cut to, as its client says it.
#pragma once

#include <algorithm>
#include <cstdint>

#include "gpu/delta.h"

namespace voxeld::daemon {

// Around `center` before the transform, which has an inverse; sizes are greater than 0.
struct ClipBox {
  double center[3] = {}, size[3] = {};
  gpu::Affine transform;
  bool operator==(const ClipBox&) const = default;
};

// Round, from one point to another; the radius is greater than 0.
struct ClipCylinder {
  double start[3] = {}, end[3] = {}, radius = 0;
  bool operator==(const ClipCylinder&) const = default;
};

// Of the scene: only what lies in all of them is drawn.
struct Clip {
  static constexpr uint32_t kBoxPlanes = 6, kCylinderPlanes = 2;
  static constexpr uint32_t kMostBoxes = gpu::kMaxClipPlanes / kBoxPlanes;

  uint32_t count = 0, boxes_count = 0, cylinders_count = 0;
  gpu::ClipPlane planes[gpu::kMaxClipPlanes];
  ClipBox boxes[kMostBoxes];
  ClipCylinder cylinders[gpu::kMaxClipCylinders];

  bool empty() const { return count == 0 && boxes_count == 0 && cylinders_count == 0; }
  // That it becomes: gpu::kMaxClipPlanes at most.
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

// As engines have it: planes, and cylinders without ends. False if a part has no inverse or does not stay finite.
bool PutClip(const Clip& clip, gpu::LayerRecord& record);

}  // namespace voxeld::daemon
