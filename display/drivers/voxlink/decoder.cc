#include "display/drivers/voxlink/decoder.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display::voxlink {

VoxlinkDecoder::VoxlinkDecoder(const FrameLayout& layout, uint32_t max_payload)
    : layout_(layout), parser_(max_payload), assembler_(layout) {}

absl::Status VoxlinkDecoder::OnBytes(uint8_t endpoint, std::span<const std::byte> bytes,
                                     size_t /*device*/) {
  if (!status_.ok()) return status_;
  if (endpoint != kBulkOut) {
    status_ = absl::DataLossError(
        absl::StrCat("bytes on endpoint ", endpoint, "; packets go to endpoint ", kBulkOut));
    return status_;
  }
  parser_.Feed(bytes, *this);
  bytes_ += bytes.size();
  return status_;
}

std::optional<DecodedVolume> VoxlinkDecoder::TakeVolume() {
  if (!std::exchange(fresh_, false) || !status_.ok()) return std::nullopt;
  DecodedVolume decoded;
  decoded.volume = complete_->number;
  decoded.layout = layout_;
  decoded.pictures = complete_->pictures;
  decoded.source = DecodedVolume::Source::kDecodedFromSent;
  return decoded;
}

void VoxlinkDecoder::Fail(const PacketHeader& header, const char* what) {
  if (!status_.ok()) return;
  status_ = absl::DataLossError(absl::StrCat(
      PacketTypeName(header.type), " number ", header.sequence, " (volume ", header.volume,
      ", slice ", header.slice, ".", header.sub_frame, ", offset ", header.offset, ", length ",
      header.length, ") in the bytes after ", bytes_, ": ", what));
}

void VoxlinkDecoder::OnSkipped(size_t bytes) {
  if (!status_.ok()) return;
  status_ = absl::DataLossError(
      absl::StrCat(bytes, " bytes that are no packet, in the bytes after ", bytes_));
}

void VoxlinkDecoder::OnBadPayload(const PacketHeader& header) {
  Fail(header, "the payload's CRC is wrong");
}

void VoxlinkDecoder::OnPacket(const PacketHeader& header, std::span<const std::byte> payload) {
  if (!status_.ok()) return;
  if (sequence_.has_value() && header.sequence != *sequence_) {
    return Fail(header, "the sequence is broken");
  }
  sequence_ = header.sequence + 1;
  switch (static_cast<PacketType>(header.type)) {
    case PacketType::kBegin:
      return Begin(header, payload);
    case PacketType::kSlice: {
      const ErrorCode code = assembler_.Slice(header, payload);
      if (code != ErrorCode::kNone) Fail(header, ErrorCodeName(code));
      return;
    }
    case PacketType::kEnd:
      if (!payload.empty()) return Fail(header, ErrorCodeName(ErrorCode::kBadLength));
      return End(header);
    case PacketType::kShow:
      if (payload.size() !=
          ((header.flags & kShowAhead) != 0 ? sizeof(ShowAheadPayload) : sizeof(ShowPayload))) {
        Fail(header, ErrorCodeName(ErrorCode::kBadLength));
      }
      return;
    case PacketType::kAbort:
      if (header.volume == assembler_.number()) assembler_.Clear();
      [[fallthrough]];
    case PacketType::kDrop:
    case PacketType::kKeepalive:
      if (!payload.empty()) Fail(header, ErrorCodeName(ErrorCode::kBadLength));
      return;
  }
  Fail(header, ErrorCodeName(ErrorCode::kUnknownType));
}

void VoxlinkDecoder::Begin(const PacketHeader& header, std::span<const std::byte> payload) {
  if (payload.size() < sizeof(BeginPayload)) {
    return Fail(header, ErrorCodeName(ErrorCode::kBadLength));
  }
  const uint64_t base = Load<BeginPayload>(payload).base;
  if (base != 0 && (complete_ == nullptr || complete_->number != base)) {
    return Fail(header, "the base is not the last whole volume");
  }
  if (complete_ != nullptr && header.volume <= complete_->number) {
    return Fail(header, "the volume's number does not ascend");
  }
  const ErrorCode code = assembler_.Begin(header, payload, base == 0 ? nullptr : complete_);
  if (code != ErrorCode::kNone) Fail(header, ErrorCodeName(code));
}

void VoxlinkDecoder::End(const PacketHeader& header) {
  if (header.volume != assembler_.number()) {
    return Fail(header, ErrorCodeName(ErrorCode::kNotFilling));
  }
  VolumePtr volume = assembler_.Finish();
  if (volume == nullptr) return Fail(header, "slices that were announced did not come");
  complete_ = std::move(volume);
  fresh_ = true;
}

}  // namespace voxeld::display::voxlink
