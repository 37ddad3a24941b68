// Reads files that contain only samples.
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/import/volume_samples.h"
#include "tools/import/volumes.h"

namespace voxeld::voxelctl {

absl::StatusOr<Model> ReadRawVolume(const SourceFile& file,
                                    const std::optional<RawLayout>& layout) {
  if (!layout) {
    return FileError(file, absl::StrCat("holds ", file.bytes.size(), " bytes and no word of what"),
                     "say it: --size 256x256x128 --type u8, u16, i16 or f32 (--big-endian)");
  }
  if (absl::Status status = CheckVolumeSize(file, layout->size); !status.ok()) return status;
  const auto& [nx, ny, nz] = layout->size;
  const uint64_t bytes = nx * ny * nz * SampleBytes(layout->type);
  if (file.bytes.size() != bytes) {
    return FileError(file,
                     absl::StrCat("has ", file.bytes.size(), " bytes; ", nx, " by ", ny, " by ", nz,
                                  " samples of ", SampleBytes(layout->type), " take ", bytes),
                     "another --size or --type is expected");
  }
  Model model;
  model.path = file.path;
  model.format = "raw samples";
  model.up = Up::kZ;
  SampledVolume volume;
  for (size_t axis = 0; axis < 3; ++axis)
    volume.size[axis] = static_cast<uint32_t>(layout->size[axis]);
  DecodeSamples(file.bytes, {.type = layout->type, .big_endian = layout->big_endian},
                &volume.samples);
  const absl::Status status =
      PlaceVolume(file, {}, {Point3{1, 0, 0}, Point3{0, 1, 0}, Point3{0, 0, 1}}, &volume);
  if (!status.ok()) return status;
  model.volumes.push_back(std::move(volume));
  return model;
}

}  // namespace voxeld::voxelctl
