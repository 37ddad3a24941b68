// A shaft with a conical head: the union of two cones (cone.h).
//
// Guarantee: as in gpu/implicit/field.h, with shells mitred past the head's rim and the tip.
#pragma once

#include "gpu/primitives/cone.h"

namespace voxeld::gpu {

struct Arrow {
  implicit::Vector start, end;                   // must differ
  double shaft_radius = 0;                       // drawn at least a voxel thick
  double head_length = 0.25, head_radius = 0.1;  // > 0, the length at most the whole length

  implicit::FieldShape Make(implicit::Graph& g) const {
    const double length = implicit::Length(end - start);
    const implicit::Vector neck = end - (head_length / length) * (end - start);
    implicit::FieldShape head = Cone{neck, end, head_radius, 0}.Make(g);
    if (!(head_length < length)) return head;
    // The shaft extends into the head, so that no wall is between them.
    const implicit::Vector into = end - (head_length / length / 2) * (end - start);
    const implicit::FieldShape shaft = Cone{start, into, shaft_radius, shaft_radius}.Make(g);
    head.surface = g.Min(head.surface, shaft.surface);
    const auto least = [](double a, double b) { return std::min(a, b); };
    const auto most = [](double a, double b) { return std::max(a, b); };
    head.min = {least(head.min.x, shaft.min.x), least(head.min.y, shaft.min.y),
                least(head.min.z, shaft.min.z)};
    head.max = {most(head.max.x, shaft.max.x), most(head.max.y, shaft.max.y),
                most(head.max.z, shaft.max.z)};
    return head;
  }
};

}  // namespace voxeld::gpu
