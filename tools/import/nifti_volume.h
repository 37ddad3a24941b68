// Volumes of neuroimaging (.nii, .nii.gz, .hdr and .img; NIfTI-1 and NIfTI-2, in one file or two).
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Numbers of any type but complex ones and those of 128 bits, and colours, scaled as the header says, where its sform or else its qform puts them, with the head up and the face to
// the front. Of several volumes the first, and said. Takes no more memory than these samples, whatever a compressed file holds. Of two files either may be given.
// InvalidArgument names the field that is wrong.
absl::StatusOr<Model> ReadNiftiVolume(const SourceFile& file);

}  // namespace voxeld::voxelctl
