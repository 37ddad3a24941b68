// A DICOM file's elements, walked before the library that decodes its pixels (DICOM PS3.5, PS3.10).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// What the elements say; texts without the blanks around them.
struct DicomFacts {
  std::string transfer_syntax, series, photometric;
  std::string orientation, spacing, slice_thickness, slices_apart, slope, intercept, window_center,
      window_width;
  // How far apart pixels were on the detector or the scanned film, and how high one is for how wide: used where `spacing` is missing.
  std::string detector_spacing, film_spacing, aspect;
  std::vector<uint32_t> frame_axes;    // elements whose value differs from frame to frame
  std::vector<uint16_t> slice_order;   // the slice of each frame, from 1 on
  std::string frame_offsets;           // of the frames of a dose, along the normal
  std::vector<std::string> positions;  // of the image, or of its frames in their order
  std::vector<std::string> slopes,
      intercepts;  // in sequences: of the frames in their order, or one of all
  // Slices at one place differ in these, of which the first ones count most: TemporalPositionIdentifier, AcquisitionTime, TriggerTime,
  // AcquisitionNumber, EchoNumbers and InstanceNumber.
  std::array<std::string, 6> times;
  uint64_t rows = 0, columns = 0, frames = 1, samples_per_pixel = 1;
  uint16_t bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;
  bool planar = false;      // of several numbers a pixel: all of the first, then all of the second
  bool big_endian = false;  // numbers, those of pixels and palettes too
  bool has_pixels = false;
  // A table: how many entries, from which number on, of how many bits; and where they lie. `palette`: of red, green and blue.
  struct Palette {
    std::vector<uint32_t> descriptor;
    std::pair<size_t, size_t> entries = {0, 0};
  };
  std::array<Palette, 3> palette;
  Palette modality;  // what a stored number means, in place of a slope; no entries: there is none
  uint64_t overlays = 0, display_tables = 0;  // which are not shown
  // Where the pixels lie in the file: as they are, all frames, or compressed, in fragments, of which the first is a table.
  bool compressed = false;
  std::vector<std::pair<size_t, size_t>> pixels;  // from which byte on, how many
};

// Those of a text, with backslashes between them; none if one of them is no finite number.
std::vector<double> DicomNumbers(const std::string& text);

// Whether there is one number a pixel, and that no place in a palette.
bool IsGrey(const DicomFacts& facts);

// Whether it begins as a DICOM file does.
bool LooksLikeDicom(const SourceFile& file);

// InvalidArgument unless every element lies within the file and within what holds it, sequences nest less than 32 deep, the
// numbers of pixels and of bits are ones that are read (grey of 1, 8, 16 or 32 bits, three colours or a palette of 8 or 16,
// kMaxModelSamples at most), and the pixels are there;
// compressed pictures (JPEG, JPEG-LS, JPEG 2000) are of the size that the elements say.
absl::StatusOr<DicomFacts> CheckDicom(const SourceFile& file);

// Whether it begins with an element of DICOM, without the preamble and "DICM" before it.
bool LacksPreamble(const SourceFile& file);

// The file with the preamble, if it lacks it, and without compression, if all of it but its head is compressed ("deflated"; at most
// kMaxDeflated bytes); otherwise nothing.
inline constexpr uint64_t kMaxDeflated = uint64_t{512} << 20;
absl::StatusOr<std::optional<SourceFile>> PlainDicom(const SourceFile& file);

// Appends the samples, and colours if they are, of all frames of a file that has passed its checks. What is compressed is decoded by
// gdcm. InvalidArgument if it cannot be.
absl::Status DecodeDicomPixels(const SourceFile& file, const DicomFacts& facts,
                               SampledVolume* volume);

}  // namespace voxeld::voxelctl
