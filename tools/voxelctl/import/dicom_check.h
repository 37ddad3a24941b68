// A DICOM file's elements, walked before the library that decodes them (DICOM PS3.5, PS3.10).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// What the elements say; texts without the blanks around them.
struct DicomFacts {
  std::string transfer_syntax, series, photometric;
  std::string orientation, spacing, slice_thickness, slope, intercept, window_center, window_width;
  std::vector<std::string> positions;  // of the image, or of its frames in their order
  uint64_t rows = 0, columns = 0, frames = 1, samples_per_pixel = 1;
  uint16_t bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;
  bool has_pixels = false;
  // Where the pixels lie in the file: as they are, all frames, or compressed, in fragments, of which the first is a table.
  bool compressed = false;
  std::vector<std::pair<size_t, size_t>> pixels;  // from which byte on, how many
};

// Whether it begins as a DICOM file does.
bool LooksLikeDicom(const SourceFile& file);

// InvalidArgument unless every element lies within the file and within what holds it, sequences nest less than 32 deep, the
// numbers of pixels and of bits are ones that are read (one number a pixel, kMaxModelSamples at most), and the pixels are there;
// compressed pictures (JPEG, JPEG-LS, JPEG 2000) are of the size that the elements say.
absl::StatusOr<DicomFacts> CheckDicom(const SourceFile& file);

}  // namespace voxeld::voxelctl
