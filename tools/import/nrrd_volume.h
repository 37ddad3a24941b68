// Nearly raw raster data (.nrrd, and .nhdr with its samples in a file beside it; Teem's "Definition of NRRD File Format").
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Two or three axes of places, encoded raw, gzip or ascii, with a number at each, or with several, if one more axis, the first, counts
// them: colours, if its kind says so, else the first is taken, and said. One more axis, the last, counts volumes; the first is
// taken. In space by "space directions" or "spacings". Where the space is a
// patient's, the head is up and the face to the front. The samples of a detached header are one file in the header's folder or
// below. InvalidArgument names the field that is wrong.
absl::StatusOr<Model> ReadNrrdVolume(const SourceFile& file);

}  // namespace voxeld::voxelctl
