// Parses shapes as people type them.
//
//   SHAPE NAME=VALUE …      a primitive of the protocol by its fields, as "torus radius=0.6 tube_radius=0.2 color=orange"
//   EXPRESSION              anything else: the surface of an implicit shape, as "x^2+y^2-z = 0 where x^2+y^2 <= 1"
//
// NAME is a field of the primitive; or color, priority, erase, label, lifetime (s); or at, scale
// and turn (degrees about x, y and z, in this order), which place it. A VALUE with spaces is
// written in quotes, "…" or '…'. Vectors are x,y,z, or one number for all three; boxes two corners
// x,y,z:x,y,z; vertices x,y,z x,y,z …; thicknesses numbers of voxels, or of the shape's units with
// the suffix u; colours #rrggbb or plain names; pictures the path of a PNG or JPEG file, or base64:
// and its bytes. A boundary is x,y,z of each vertex, preceded by the axis and its form: "y b_spline
// 1,0,0 …". Numbers of grids and heights have their field's type: "grid.type=u8 grid.samples=…", or
// otherwise single precision; file: and a path mean a file's bytes of that type, little-endian. No
// field may be given twice.
//
//   clip_plane a= b= c= d=, clip_box center= size= at= scale= turn=, clip_cylinder start= end= radius=
//                           not shapes, but what the others are clipped to
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// Errors: InvalidArgument with what was not understood, and what would have been valid.
absl::StatusOr<v1::Entity> ParseShapeText(absl::string_view text);
// Adds a part of a clip. Returns false if `text` is not one.
absl::StatusOr<bool> ParseClipText(absl::string_view text, v1::Clip* out);

}  // namespace voxeld::voxelctl
