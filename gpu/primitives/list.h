// The list of all primitives. To add one, add its header, its kind in gpu/delta.h, and a line here
// (the compiler reports a missing one).
//
// A primitive is a type with
//   kKind                            its PrimitiveKind
//   Count(source)                    how many items a drawable has
//   EmitTiles(source, i, grid, f)    calls f(tile) for every tile that item i may touch
//   EmitVoxels(source, i, box, f)    calls f(x, y, z, rgb) for exactly the voxels of item i in a
//                                    box inside the volume (repetition is allowed)
//   CanonicalMap(record)             for a solid only
#pragma once

#include <type_traits>

#include "gpu/primitives/box.h"
#include "gpu/primitives/cylinder.h"
#include "gpu/primitives/filled.h"
#include "gpu/primitives/implicit.h"
#include "gpu/primitives/points.h"
#include "gpu/primitives/samples.h"
#include "gpu/primitives/segments.h"
#include "gpu/primitives/sphere.h"
#include "gpu/primitives/triangles.h"

namespace voxeld::gpu {

// Calls f(std::type_identity<Primitive>{}) for the primitive of `kind`.
template <class F>
VOXELD_HD decltype(auto) WithPrimitive(PrimitiveKind kind, F&& f) {
  switch (kind) {
    case PrimitiveKind::kPoints:
      return f(std::type_identity<Points>{});
    case PrimitiveKind::kSegments:
    case PrimitiveKind::kCurves:
      return f(std::type_identity<Segments>{});
    case PrimitiveKind::kTriangles:
    case PrimitiveKind::kPatches:
      return f(std::type_identity<Triangles>{});
    case PrimitiveKind::kBox:
      return f(std::type_identity<Box>{});
    case PrimitiveKind::kSphere:
      return f(std::type_identity<Sphere>{});
    case PrimitiveKind::kCylinder:
      return f(std::type_identity<Cylinder>{});
    case PrimitiveKind::kImplicit:
      return f(std::type_identity<Implicit>{});
    case PrimitiveKind::kSamples:
      return f(std::type_identity<Samples>{});
    case PrimitiveKind::kFilled:
      return f(std::type_identity<Filled>{});
  }
  __builtin_unreachable();  // ReadDelta rejects other kinds
}

template <class Primitive>
inline constexpr bool kIsSolid = requires(const GeometryRecord& g) { Primitive::CanonicalMap(g); };

// Whether it is evaluated through the inverse of its map, and draws nothing if the map has no
// inverse.
template <class Primitive>
inline constexpr bool kIsInverted =
    kIsSolid<Primitive> || Primitive::kKind == PrimitiveKind::kImplicit ||
    Primitive::kKind == PrimitiveKind::kSamples;

}  // namespace voxeld::gpu
