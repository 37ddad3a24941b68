// The numbers or colours of a DICOM file's pixels.
#pragma once

#include "absl/status/status.h"
#include "tools/import/dicom_check.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Appends the samples, and colours if they are, of all frames of a file that has passed its checks. What is compressed is decoded by
// gdcm in a process of its own (contained.h). InvalidArgument if it cannot be.
absl::Status DecodeDicomPixels(const SourceFile& file, const DicomFacts& facts,
                               SampledVolume* volume);

}  // namespace voxeld::voxelctl
