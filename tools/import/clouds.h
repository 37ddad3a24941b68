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

// Clouds of the Point Cloud Library (.pcd, version 0.7 and before), as text, binary and compressed. Takes the fields x, y, z; rgb or rgba
// (packed, as a float or a whole number) or r, g, b; normal_x, normal_y, normal_z; intensity. Points that are not finite, as of rays that
// met nothing, are left out and counted, and so is a viewpoint: points have the coordinates of the file. With `attributes` the other fields and the intensity are attributes. InvalidArgument names the
// line of the header or the point.
absl::StatusOr<Model> ReadPcdPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
