#include "tools/voxelctl/commands/captured_volume.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/geometry_wire/geometry_wire.h"
#include "tools/voxelctl/render/render_volume.h"

namespace voxeld::voxelctl {

absl::Status CapturedVolume::Begin(const v1::VolumeHeader& header) {
  if (begun_) return absl::InvalidArgumentError("the server sent two volumes");
  absl::StatusOr<display::Geometry> geometry = daemon::wire::FromWire(header.geometry());
  if (!geometry.ok()) return geometry.status();
  const v1::FrameLayout& layout = header.layout();
  // Each extent is at most 2¹⁴ by the displays' own limits, with allowance for panels; the product
  // fits into 64 bits.
  for (const int32_t extent : {layout.slices(), layout.width(), layout.height()}) {
    if (extent < 1 || extent > 1 << 20) {
      return absl::InvalidArgumentError(absl::StrCat("the server sent a volume of ",
                                                     layout.slices(), " slices of ", layout.width(),
                                                     "x", layout.height()));
    }
  }
  const uint64_t bytes = static_cast<uint64_t>(layout.slices()) *
                         static_cast<uint64_t>(layout.width()) *
                         static_cast<uint64_t>(layout.height()) * 3;
  if (bytes > kMostBytes)
    return absl::InvalidArgumentError(
        absl::StrCat("the volume has ", bytes, " bytes; at most ", kMostBytes, " are taken"));
  begun_ = true;
  header_ = header;
  volume_.display = header.display();
  volume_.number = header.volume();
  volume_.geometry = *std::move(geometry);
  volume_.slices = layout.slices();
  volume_.width = layout.width();
  volume_.height = layout.height();
  volume_.rgb.resize(bytes);
  come_.assign(static_cast<size_t>(layout.slices()), false);
  return absl::OkStatus();
}

absl::Status CapturedVolume::Add(const v1::VolumeChunk& chunk) {
  if (chunk.has_header()) return Begin(chunk.header());
  if (!chunk.has_slices()) return absl::OkStatus();
  if (!begun_)
    return absl::InvalidArgumentError("the server sent slices before the volume's header");
  const std::string& rgb = chunk.slices().rgb();
  const size_t each = volume_.slice_bytes();
  const int64_t first = chunk.slices().first_slice();
  const auto count = static_cast<int64_t>(rgb.size() / each);
  if (rgb.size() % each != 0 || first < 0 || first + count > volume_.slices) {
    return absl::InvalidArgumentError(
        absl::StrCat("the server sent ", rgb.size(), " bytes from slice ", first,
                     " on; the volume has ", volume_.slices, " slices of ", each));
  }
  std::memcpy(volume_.rgb.data() + static_cast<size_t>(first) * each, rgb.data(), rgb.size());
  std::fill_n(come_.begin() + first, count, true);
  return absl::OkStatus();
}

absl::StatusOr<Volume> CapturedVolume::Finish() && {
  if (!begun_) return absl::InvalidArgumentError("the server sent no volume");
  const auto missing = std::count(come_.begin(), come_.end(), false);
  if (missing > 0) {
    return absl::DataLossError(
        absl::StrCat(missing, " of the volume's ", volume_.slices, " slices did not come"));
  }
  const absl::Status status = CheckVolume(volume_);
  if (!status.ok()) return status;
  return std::move(volume_);
}

}  // namespace voxeld::voxelctl
