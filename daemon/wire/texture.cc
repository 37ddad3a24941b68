#include "daemon/wire/texture.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "daemon/pictures/picture.h"
#include "gpu/primitives/texture.h"
#include "gpu/texture_levels.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

MaybeFault AddPicture(const FieldPath& path, const std::string& picture,
                      std::span<const float> places, const DecodeContext& context,
                      GeometryData* out) {
  const auto wrong = [&path](Reason reason, const std::string& why) {
    return Fault{path.ToString(), reason, why};
  };
  const auto file = pictures::PictureFile::Open(picture);
  if (!file.ok()) {
    return wrong(Reason::kInvalidValue, absl::StrCat(std::string(file.status().message()),
                                                     "; give a whole PNG or JPEG file"));
  }
  const auto [width, height] = file->size();
  const uint64_t most = context.limits.max_texture_texels;
  if (width > gpu::kMostTextureSide || height > gpu::kMostTextureSide ||
      uint64_t{width} * height > most) {
    return wrong(
        Reason::kQuotaExceeded,
        absl::StrCat("is a picture of ", width, " × ", height, "; max_texture_texels allows ", most,
                     " in all, and a side has ", gpu::kMostTextureSide, " at most"));
  }
  gpu::GeometryRecord record = out->record;
  record.texture_width = static_cast<uint16_t>(width);
  record.texture_height = static_cast<uint16_t>(height);
  absl::StatusOr<gpu::GeometryArrays> kept = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!kept.ok()) {
    return wrong(Reason::kQuotaExceeded, absl::StrCat("cannot be kept: ", kept.status().message()));
  }
  const absl::StatusOr<std::vector<uint32_t>> pixels = file->Read();
  if (!pixels.ok()) {
    return wrong(Reason::kInvalidValue, absl::StrCat(std::string(pixels.status().message()),
                                                     "; give a whole PNG or JPEG file"));
  }
  std::ranges::copy(out->arrays.positions(), kept->writable_positions().begin());
  std::ranges::copy(out->arrays.indices(), kept->writable_indices().begin());
  std::span<uint32_t> colors = kept->writable_colors();
  std::ranges::copy(out->arrays.colors(), colors.begin());
  colors = colors.subspan(out->arrays.colors().size());
  std::memcpy(colors.data(), places.data(), places.size_bytes());
  colors = colors.subspan(places.size());
  std::ranges::copy(*pixels, colors.begin());
  gpu::FillLevels(width, height, colors);
  out->record = record;
  out->arrays = *std::move(kept);
  return {};
}

MaybeFault ToTexture(const FieldPath& path, const v1::Texture& in, const DecodeContext& context,
                     GeometryData* out) {
  const uint64_t want = uint64_t{out->record.vertex_count} * 2 * sizeof(float);
  if (in.coordinates().size() != want) {
    return Fault{
        FieldPath(path, "coordinates").ToString(), Reason::kSizeMismatch,
        absl::StrCat("has ", ShowBytes(in.coordinates().size(), 2 * sizeof(float), "place"),
                     "; two F32 of each of ", out->record.vertex_count, " vertices take ", want)};
  }
  std::vector<float> places(want / sizeof(float));
  std::memcpy(places.data(), in.coordinates().data(), want);
  const auto bad = std::ranges::find_if(places, [](float place) { return !std::isfinite(place); });
  if (bad != places.end()) {
    return Fault{FieldPath(path, "coordinates", (bad - places.begin()) / 2).ToString(),
                 Reason::kInvalidValue, absl::StrCat("has ", Show(*bad), "; give finite numbers")};
  }
  return AddPicture(FieldPath(path, "picture"), in.picture(), places, context, out);
}

}  // namespace voxeld::daemon::wire
