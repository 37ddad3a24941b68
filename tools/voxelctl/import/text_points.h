// Reads point clouds from text: .xyz, .txt, .asc, .pts, .csv.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// A point a line, numbers parted by blanks, tabs, commas or semicolons; # and // begin comments at the beginning of a line and after a
// blank; a line of one whole number at the beginning is a count, and the model's note says if it is wrong. Columns are what a first line of names says
// (point_table.h); without one x y z, x y z intensity, x y z r g b (or a normal, where no number of these is
// beyond −1 to 1 and one is negative), x y z intensity r g b, or x y z r g b nx ny nz. Colours go to 255, or, where none of them is
// greater than 1, to 1.
// InvalidArgument with the line's number.
absl::StatusOr<Model> ReadTextPoints(const SourceFile& file, bool attributes = false);

}  // namespace voxeld::voxelctl
