#include "tools/lights/opc_reader.h"

#include <algorithm>

#include "display/drivers/network/protocol.h"

namespace voxeld::lights {
namespace {

constexpr size_t kHeader = display::network::opc::kHeader;

size_t LengthOf(std::span<const uint8_t> header) {
  return kHeader + (size_t{header[2]} << 8 | header[3]);
}

OpcReader::Message MessageOf(std::span<const uint8_t> whole) {
  return {whole[0], whole[1], whole.subspan(kHeader)};
}

}  // namespace

void OpcReader::Add(std::span<const uint8_t> bytes,
                    const std::function<void(const Message&)>& each) {
  const auto take = [&](size_t wanted) {
    const size_t count = std::min(wanted - held_.size(), bytes.size());
    held_.insert(held_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    bytes = bytes.subspan(count);
    return held_.size() == wanted;
  };
  if (!held_.empty()) {
    if (held_.size() < kHeader && !take(kHeader)) return;
    if (!take(LengthOf(held_))) return;
    each(MessageOf(held_));
    held_.clear();
  }
  // Messages that are complete in the received bytes are not copied.
  while (bytes.size() >= kHeader) {
    const size_t length = LengthOf(bytes);
    if (bytes.size() < length) break;
    each(MessageOf(bytes.first(length)));
    bytes = bytes.subspan(length);
  }
  held_.assign(bytes.begin(), bytes.end());
}

}  // namespace voxeld::lights
