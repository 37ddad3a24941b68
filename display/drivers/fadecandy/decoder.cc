#include "display/drivers/fadecandy/decoder.h"

#include <algorithm>
#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"
#include "display/drivers/fadecandy/packets.h"

namespace voxeld::display::fadecandy {

FadecandyDecoder::FadecandyDecoder(const FrameLayout& layout)
    : layout_(layout), slices_(static_cast<size_t>(layout.slices)) {
  for (Slice& slice : slices_) slice.filling.resize(kFrameBytes);
}

absl::Status FadecandyDecoder::OnBytes(uint8_t endpoint, std::span<const std::byte> bytes,
                                       size_t device) {
  if (!status_.ok()) return status_;
  if (endpoint != kBulkOut || device >= slices_.size() || bytes.size() % kPacketBytes != 0) {
    return status_ = absl::DataLossError(
               absl::StrCat(bytes.size(), " bytes for endpoint ", endpoint, " of board ", device,
                            "; packets of ", kPacketBytes, " go to endpoint ", kBulkOut,
                            " of boards 0 to ", slices_.size() - 1));
  }
  for (; !bytes.empty() && status_.ok(); bytes = bytes.subspan(kPacketBytes)) {
    status_ = Read(bytes.first<kPacketBytes>(), device);
  }
  return status_;
}

absl::Status FadecandyDecoder::Read(std::span<const std::byte, kPacketBytes> packet,
                                    size_t device) {
  const PacketType type = TypeOf(packet[0]);
  const size_t index = IndexOf(packet[0]);
  const auto fail = [&](auto... what) {
    return absl::DataLossError(absl::StrCat("packet ", index, " of type ", static_cast<int>(type),
                                            " for board ", device, ": ", what...));
  };
  if (type == PacketType::kNothing) return fail("there is no such type");
  if (index >= kFramePackets) return fail("an index is at most ", kLastPacket);
  if (type != PacketType::kVideo) return absl::OkStatus();
  Slice& slice = slices_[device];
  std::memcpy(slice.filling.data() + FrameOffset(index), packet.data() + 1, FrameLength(index));
  slice.have.set(index);
  if (!IsFinal(packet[0])) return absl::OkStatus();
  if (!slice.have.all()) {
    return fail("it ends a frame of which ", kFramePackets - slice.have.count(), " are missing");
  }
  slice.have.reset();
  slice.whole = std::make_shared<const std::vector<std::byte>>(slice.filling);
  slice.fresh = true;
  return absl::OkStatus();
}

std::optional<DecodedVolume> FadecandyDecoder::TakeVolume() {
  const bool whole = std::all_of(slices_.begin(), slices_.end(),
                                 [](const Slice& s) { return s.whole != nullptr; });
  const bool fresh =
      std::any_of(slices_.begin(), slices_.end(), [](const Slice& s) { return s.fresh; });
  if (!whole || !fresh || !status_.ok()) return std::nullopt;
  DecodedVolume decoded;
  decoded.layout = layout_;
  decoded.source = DecodedVolume::Source::kDecodedFromSent;
  for (Slice& slice : slices_) {
    slice.fresh = false;
    decoded.pictures.push_back(slice.whole);
  }
  return decoded;
}

}  // namespace voxeld::display::fadecandy
