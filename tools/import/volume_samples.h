// What volumes have in common, whatever file they are from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/import_options.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Bytes of one.
size_t SampleBytes(SampleType type);

// InvalidArgument unless each is 1 to 65536, and together they are kMaxModelSamples at most.
absl::Status CheckVolumeSize(const SourceFile& file, const std::array<uint64_t, 3>& size);

struct SampleCode {
  SampleType type = SampleType::kU8;
  bool big_endian = false;
  // High bits of an integer that are no part of the number, such as a DICOM overlay. Less than all of its bits.
  int spare_bits = 0;
  double slope = 1, intercept = 0;  // a number is `intercept` and `slope` times what is stored
};

// As many as `bytes` holds whole, behind those of `out`. What is not finite becomes not a number.
void DecodeSamples(absl::string_view bytes, const SampleCode& code, std::vector<float>* out);

// Colours of 3 bytes each (r g b), or of 4, the last of which says how opaque it is, behind those of `volume`; their brightness (0 to
// 255, by ITU-R BT.601) as samples.
void DecodeColors(absl::string_view bytes, size_t bytes_each, SampledVolume* volume);

// The same for channels of any type, `channels` (3 or 4) for each colour. Integers reach to the greatest of their type, floats to 1.
void DecodeColors(absl::string_view bytes, const SampleCode& code, size_t channels,
                  SampledVolume* volume);

// The same for numbers that were read as samples of `type`.
void ColorsOf(std::span<const float> numbers, SampleType type, size_t channels,
              SampledVolume* volume);

// Numbers of `planes` planes of the same size, side by side for each place. Each has `bytes_each` bytes.
std::string Interleaved(absl::string_view bytes, size_t planes, size_t bytes_each);

// Appends `count` numbers that are written as text, with blanks or commas between them, after the slope and intercept of `code`.
// InvalidArgument if there are fewer, or a word is no number.
absl::Status ReadTextSamples(const SourceFile& file, absl::string_view text, uint64_t count,
                             const SampleCode& code, std::vector<float>* out);

// Returns: the `count` times `bytes_each` bytes of samples in `all` from byte `from` on.
// InvalidArgument if there are fewer. `count` is kMaxModelSamples at most.
absl::StatusOr<absl::string_view> TakeSamples(const SourceFile& file, absl::string_view all,
                                              uint64_t from, uint64_t count, uint64_t bytes_each);

// Keeps the first of each `each` samples.
void KeepFirstOfEach(size_t each, std::vector<float>* samples);

// Where a volume lies: the centre of its first sample, and from one to the next along each axis. Few layers are made
// thick enough to be seen, a twentieth of the greatest length together.
// InvalidArgument if that is not finite, or spans nothing.
absl::Status PlaceVolume(const SourceFile& file, const Point3& first,
                         const std::array<Point3, 3>& steps, SampledVolume* volume);

}  // namespace voxeld::voxelctl
