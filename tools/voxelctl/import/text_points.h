// Reads point clouds from text: .xyz, .txt, .asc, .pts, .csv.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Reads one point per line, with numbers separated by blanks, tabs, commas or semicolons. # and //
// begin comments, and a line of one number at the beginning is a count and is skipped. The first
// line may name the columns (point_table.h). Otherwise they are x y z, x y z intensity, x y z r g b
// (or a normal, if none of these numbers is beyond −1 to 1 and one is negative), x y z intensity r
// g b, or x y z r g b nx ny nz. Colours range to 255, or to 1 if none of them is greater than 1.
// Errors: InvalidArgument with the line's number.
absl::StatusOr<Model> ReadTextPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
