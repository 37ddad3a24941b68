// Markers for tests.
#pragma once

#include "tools/ros/messages.h"

namespace voxeld::ros1 {

// Returns a marker with ns "n" and id 7, at the origin, with size 1, opaque red.
inline Marker Of(int type) {
  Marker marker;
  marker.ns = "n";
  marker.id = 7;
  marker.type = type;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = 1;
  marker.color.r = marker.color.a = 1;
  return marker;
}

inline void AddPoint(Marker* marker, double x, double y, double z) {
  Point point;
  point.x = x;
  point.y = y;
  point.z = z;
  marker->points.push_back(point);
}

inline void AddColor(Marker* marker, float r, float g, float b, float a = 1) {
  Color color;
  color.r = r;
  color.g = g;
  color.b = b;
  color.a = a;
  marker->colors.push_back(color);
}

}  // namespace voxeld::ros1
