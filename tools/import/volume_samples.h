// Functions that the readers of all volume formats share.
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

// Returns the number of bytes per sample.
size_t SampleBytes(SampleType type);

// Checks that each size is 1 to 65536, and that the product is at most kMaxModelSamples. Errors:
// InvalidArgument otherwise.
absl::Status CheckVolumeSize(const SourceFile& file, const std::array<uint64_t, 3>& size);

struct SampleCode {
  SampleType type = SampleType::kU8;
  bool big_endian = false;
  // The number of high bits of an integer that are not part of the value, such as a DICOM overlay;
  // less than all of its bits.
  int spare_bits = 0;
  double slope = 1, intercept = 0;  // value = `intercept` + `slope` · stored
};

// Appends all complete samples in `bytes` to `out`. Non-finite values become not-a-number.
void DecodeSamples(absl::string_view bytes, const SampleCode& code, std::vector<float>* out);

// Appends colours of 3 bytes each (r g b), or of 4 with opacity as the last, to `volume`, and their
// brightness (0 to 255, by ITU-R BT.601) as samples.
void DecodeColors(absl::string_view bytes, size_t bytes_each, SampledVolume* volume);

// The same for channels of any type, with `channels` (3 or 4) per colour. Full intensity is an
// integer type's maximum, and 1 for floats.
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

// Keeps the first of every `each` samples.
void KeepFirstOfEach(size_t each, std::vector<float>* samples);

// Places a volume: `first` is the centre of its first sample, and `steps` lead from one sample to
// the next along each axis. A volume of few layers is made thick enough to be seen: a twentieth of
// its greatest length in total. Errors: InvalidArgument if the result is not finite or has no
// extent.
absl::Status PlaceVolume(const SourceFile& file, const Point3& first,
                         const std::array<Point3, 3>& steps, SampledVolume* volume);

}  // namespace voxeld::voxelctl
