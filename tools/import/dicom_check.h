// Checks a DICOM file's elements before the library decodes its pixels (DICOM PS3.5, PS3.10).
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

// The values of the elements; texts are trimmed.
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
      intercepts;  // in sequences: one per frame in order, or one for all
  // Slices at the same place differ in these, in descending order of significance:
  // TemporalPositionIdentifier, AcquisitionTime, TriggerTime, AcquisitionNumber, EchoNumbers and
  // InstanceNumber.
  std::array<std::string, 6> times;
  uint64_t rows = 0, columns = 0, frames = 1, samples_per_pixel = 1;
  uint16_t bits_allocated = 0, bits_stored = 0, high_bit = 0;
  bool is_signed = false;
  // For several values per pixel: all first values, then all second values.
  bool planar = false;
  bool big_endian = false;  // applies to values, including those of pixels and palettes
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
  std::vector<std::pair<size_t, size_t>> pixels;  // offset and size
};

// Returns the numbers of a text, which are separated by backslashes; none if one of them is not a
// finite number.
std::vector<double> DicomNumbers(const std::string& text);

// Returns whether there is one value per pixel that is not an index into a palette.
bool IsGrey(const DicomFacts& facts);

// Returns whether the file begins like a DICOM file.
bool LooksLikeDicom(const SourceFile& file);

// Checks the file. Every element must lie within the file and within its container, and sequences
// must nest less than 32 deep. The numbers of pixels and of bits must be supported (grey of 1, 8,
// 16 or 32 bits; three colours or a palette of 8 or 16; at most kMaxModelSamples). The pixels must
// be present, and compressed pictures (JPEG, JPEG-LS, JPEG 2000) must have the size that the
// elements declare. Errors: InvalidArgument otherwise.
absl::StatusOr<DicomFacts> CheckDicom(const SourceFile& file);

// Returns whether the file begins with an element of DICOM, without the preamble and "DICM" before
// it.
bool LacksPreamble(const SourceFile& file);

// Returns the file with a preamble if it lacks one, and decompressed if everything after its header
// is compressed ("deflated"; at most kMaxDeflated bytes); nothing if the file has neither property.
inline constexpr uint64_t kMaxDeflated = uint64_t{512} << 20;
absl::StatusOr<std::optional<SourceFile>> PlainDicom(const SourceFile& file);

// Appends the samples, and the colours if there are any, of all frames of a file that has passed
// its checks. Compressed pixels are decoded by gdcm. Errors: InvalidArgument if they cannot be
// decoded.
absl::Status DecodeDicomPixels(const SourceFile& file, const DicomFacts& facts,
                               SampledVolume* volume);

}  // namespace voxeld::voxelctl
