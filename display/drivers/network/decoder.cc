#include "display/drivers/network/decoder.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display::network {

NetworkDecoder::NetworkDecoder(const FrameLayout& layout, StreamOptions stream, ColorOrder order)
    : layout_(layout),
      stream_(std::move(stream)),
      order_(order),
      slices_(static_cast<size_t>(layout.slices)) {}

absl::Status NetworkDecoder::OnBytes(uint8_t /*endpoint*/, std::span<const std::byte> bytes,
                                     size_t /*device*/) {
  if (!status_.ok()) return status_;
  const std::optional<ReadPacket> packet = Read(stream_, layout_.slices, layout_.width, bytes);
  if (!packet) {
    return status_ = absl::DataLossError(
               absl::StrCat("a packet of ", bytes.size(), " bytes is none of this stream"));
  }
  if (packet->kind != ReadPacket::Kind::kPixels) return absl::OkStatus();
  std::vector<std::byte> picture(packet->rgb.size());
  for (size_t i = 0; i < picture.size(); ++i) {
    picture[i / 3 * 3 + order_[i % 3]] = packet->rgb[i];
  }
  slices_[static_cast<size_t>(packet->slice)] =
      std::make_shared<const std::vector<std::byte>>(std::move(picture));
  fresh_ = true;
  return absl::OkStatus();
}

std::optional<DecodedVolume> NetworkDecoder::TakeVolume() {
  const bool whole = std::all_of(slices_.begin(), slices_.end(),
                                 [](const Picture& slice) { return slice != nullptr; });
  if (!whole || !status_.ok() || !std::exchange(fresh_, false)) return std::nullopt;
  DecodedVolume decoded;
  decoded.layout = layout_;
  decoded.pictures = slices_;
  decoded.source = DecodedVolume::Source::kDecodedFromSent;
  return decoded;
}

}  // namespace voxeld::display::network
