// Readers of point clouds in binary files.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads laser scans of the ASPRS (.las, versions 1.0 to 1.4; "LAS Specification 1.4 – R15"): point
// formats 0 to 10, with their colours or otherwise their intensities. Colours have 16 bits, or 8 if
// none is greater than 255, as some programs write them. Withheld points are left out and counted.
// With `attributes`, intensity, classification, return and source become attributes. Compressed
// files (.laz) are refused by name.
absl::StatusOr<Model> ReadLasPoints(const SourceFile& file, bool attributes = false);

// Reads clouds of the Point Cloud Library (.pcd, version 0.7 and earlier), as text, binary and
// compressed. Uses the fields x, y, z; rgb or rgba (packed, as a float or an integer) or r, g, b;
// normal_x, normal_y, normal_z; intensity. Points that are not finite, for example of rays without
// a hit, are left out and counted. With `attributes`, the other fields and the intensity become
// attributes. Errors: InvalidArgument with the line of the header or the point.
absl::StatusOr<Model> ReadPcdPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
