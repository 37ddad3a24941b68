#include "tests/display/emulator/carriers/puppet.h"

#include <algorithm>
#include <utility>

namespace voxeld::display::emulator {

uint64_t Puppet::Only(uint8_t endpoint) const {
  uint64_t found = 0;
  for (const auto& [id, seen] : pending) {
    if (seen.urb.endpoint == endpoint && std::exchange(found, id) != 0) return 0;
  }
  return found;
}

void Puppet::End(uint64_t id, TransferStatus status, uint32_t actual,
                 std::span<const std::byte> in) {
  pending.erase(id);
  complete_(id, status, actual, in);
}

void Puppet::Submit(const Urb& urb) {
  if (!plugged_) return complete_(urb.id, TransferStatus::kDisconnected, 0, {});
  Seen& seen = pending[urb.id];
  seen.urb = urb;
  seen.urb.out = {};
  seen.out.assign(urb.out.begin(), urb.out.end());
  if (!answers_descriptors || urb.endpoint != 0 || urb.setup.request_type != 0x80 ||
      urb.setup.request != 6) {
    return;
  }
  const size_t index = urb.setup.value & 0xFFu;
  const std::vector<std::byte>& answer = urb.setup.value >> 8 == 1   ? descriptors_.device
                                         : urb.setup.value >> 8 == 2 ? descriptors_.configuration
                                                                     : descriptors_.strings[index];
  const size_t size = std::min<size_t>(answer.size(), urb.length);
  End(urb.id, TransferStatus::kShort, static_cast<uint32_t>(size), std::span(answer).first(size));
}

bool Puppet::Unlink(uint64_t id) {
  if (pending.erase(id) == 0) return false;
  unlinked.push_back(id);
  return true;
}

void Puppet::EndAll(TransferStatus status) {
  for (const auto& [id, seen] : std::exchange(pending, {})) complete_(id, status, 0, {});
}

void Puppet::Reset() {
  ++resets;
  EndAll(TransferStatus::kCancelled);
}

void Puppet::SetPlugged(bool plugged) {
  plugged_ = plugged;
  if (plugged) ++plugs_;
  if (!plugged) EndAll(TransferStatus::kDisconnected);
}

}  // namespace voxeld::display::emulator
