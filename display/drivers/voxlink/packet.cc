#include "display/drivers/voxlink/packet.h"

#include <algorithm>

#include "display/crc/crc32c.h"

namespace voxeld::display::voxlink {
namespace {

constexpr size_t kHeaderSize = sizeof(PacketHeader);

size_t PacketSize(std::span<const std::byte> header) {
  return kHeaderSize + Load<PacketHeader>(header).length;
}

}  // namespace

template <typename Bytes>
void PacketWriter::Put(Bytes& out, PacketHeader header, std::span<const std::byte> head,
                       std::span<const std::byte> tail) {
  header.magic = kMagic;
  header.sequence = sequence_++;
  header.length = static_cast<uint32_t>(head.size() + tail.size());
  header.payload_crc = Crc32c(tail, Crc32c(head));
  header.header_crc = Crc32c(std::as_bytes(std::span(&header, 1)).first(kHeaderCrcOffset));
  Append(out, header);
  AppendBytes(out, head);
  AppendBytes(out, tail);
}

template <typename Bytes>
void PacketWriter::Slice(Bytes& out, uint64_t volume, uint32_t slice, uint16_t sub_frame,
                         uint32_t offset, std::span<const std::byte> payload) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(PacketType::kSlice);
  header.volume = volume;
  header.slice = slice;
  header.sub_frame = sub_frame;
  header.offset = offset;
  Put(out, header, payload, {});
}

template <typename Bytes>
void PacketWriter::Begin(Bytes& out, uint64_t volume, uint64_t base, uint32_t pictures,
                         std::span<const std::byte> bitmap) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(PacketType::kBegin);
  header.volume = volume;
  const BeginPayload begin{.base = base, .pictures = pictures, .reserved = 0};
  Put(out, header, std::as_bytes(std::span(&begin, 1)), bitmap);
}

template <typename Bytes>
void PacketWriter::End(Bytes& out, uint64_t volume, bool show) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(PacketType::kEnd);
  header.flags = show ? kEndShow : 0;
  header.volume = volume;
  Put(out, header, {}, {});
}

template <typename Bytes>
void PacketWriter::Show(Bytes& out, uint64_t volume, uint64_t sweep) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(PacketType::kShow);
  header.volume = volume;
  const ShowPayload show{.sweep = sweep};
  Put(out, header, std::as_bytes(std::span(&show, 1)), {});
}

template <typename Bytes>
void PacketWriter::ShowAhead(Bytes& out, uint64_t volume, uint64_t sweep, uint32_t ahead) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(PacketType::kShow);
  header.flags = kShowAhead;
  header.volume = volume;
  const ShowAheadPayload show{.sweep = sweep, .ahead = ahead, .reserved = 0};
  Put(out, header, std::as_bytes(std::span(&show, 1)), {});
}

template <typename Bytes>
void PacketWriter::Plain(Bytes& out, PacketType type, uint64_t volume) {
  PacketHeader header{};
  header.type = static_cast<uint8_t>(type);
  header.volume = volume;
  Put(out, header, {}, {});
}

using Vector = std::vector<std::byte>;
template void PacketWriter::Slice(TransferBytes&, uint64_t, uint32_t, uint16_t, uint32_t,
                                  std::span<const std::byte>);
template void PacketWriter::Begin(TransferBytes&, uint64_t, uint64_t, uint32_t,
                                  std::span<const std::byte>);
template void PacketWriter::End(TransferBytes&, uint64_t, bool);
template void PacketWriter::Show(TransferBytes&, uint64_t, uint64_t);
template void PacketWriter::ShowAhead(TransferBytes&, uint64_t, uint64_t, uint32_t);
template void PacketWriter::Plain(TransferBytes&, PacketType, uint64_t);
template void PacketWriter::Slice(Vector&, uint64_t, uint32_t, uint16_t, uint32_t,
                                  std::span<const std::byte>);
template void PacketWriter::Begin(Vector&, uint64_t, uint64_t, uint32_t,
                                  std::span<const std::byte>);
template void PacketWriter::End(Vector&, uint64_t, bool);
template void PacketWriter::Show(Vector&, uint64_t, uint64_t);
template void PacketWriter::ShowAhead(Vector&, uint64_t, uint64_t, uint32_t);
template void PacketWriter::Plain(Vector&, PacketType, uint64_t);

void PacketParser::Reset() {
  partial_.clear();
  skipped_ = 0;
}

bool PacketParser::SoundHeader(std::span<const std::byte> bytes) const {
  const auto header = Load<PacketHeader>(bytes);
  return header.magic == kMagic && header.length <= max_payload_ &&
         header.header_crc == Crc32c(bytes.first(kHeaderCrcOffset));
}

void PacketParser::FlushSkipped(Sink& sink) {
  if (skipped_ == 0) return;
  sink.OnSkipped(skipped_);
  skipped_ = 0;
}

void PacketParser::Deliver(std::span<const std::byte> packet, Sink& sink) {
  const auto header = Load<PacketHeader>(packet);
  const std::span<const std::byte> payload = packet.subspan(kHeaderSize);
  if (Crc32c(payload) == header.payload_crc) {
    sink.OnPacket(header, payload);
  } else {
    sink.OnBadPayload(header);
  }
}

void PacketParser::Feed(std::span<const std::byte> bytes, Sink& sink) {
  while (!bytes.empty()) {
    if (partial_.empty()) {
      // Parse directly from the caller's bytes, as long as whole packets lie in them.
      if (bytes.size() >= kHeaderSize) {
        if (!SoundHeader(bytes)) {
          const auto next = std::find(bytes.begin() + 1, bytes.end(), std::byte{kMagic & 0xFF});
          const size_t skip = static_cast<size_t>(next - bytes.begin());
          skipped_ += skip;
          bytes = bytes.subspan(skip);
          continue;
        }
        FlushSkipped(sink);
        const size_t size = PacketSize(bytes);
        if (bytes.size() >= size) {
          Deliver(bytes.first(size), sink);
          bytes = bytes.subspan(size);
          continue;
        }
      }
      partial_.assign(bytes.begin(), bytes.end());
      break;
    }
    // Take only as many bytes as the started packet needs.
    const bool have_header = partial_.size() >= kHeaderSize;
    const size_t need = have_header ? PacketSize(partial_) : kHeaderSize;
    const size_t take = std::min(bytes.size(), need - partial_.size());
    partial_.insert(partial_.end(), bytes.begin(), bytes.begin() + static_cast<ptrdiff_t>(take));
    bytes = bytes.subspan(take);
    if (partial_.size() < need) break;
    if (!have_header) {
      if (!SoundHeader(partial_)) {
        const auto next = std::find(partial_.begin() + 1, partial_.end(), std::byte{kMagic & 0xFF});
        skipped_ += static_cast<size_t>(next - partial_.begin());
        partial_.erase(partial_.begin(), next);
        continue;
      }
      FlushSkipped(sink);
      if (PacketSize(partial_) > kHeaderSize) continue;
    }
    Deliver(partial_, sink);
    partial_.clear();
  }
  FlushSkipped(sink);
}

}  // namespace voxeld::display::voxlink
