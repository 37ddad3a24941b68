#include "display/emulator/hostile_device.h"

#include <algorithm>

namespace voxeld::display::emulator {
namespace {

// Damages one answer in this many, so that some attempts get far.
constexpr uint64_t kLieOneIn = 3;
constexpr uint64_t kMostFlips = 8;

}  // namespace

void HostileDevice::SetSeed(std::optional<uint64_t> seed) {
  lying_ = seed.has_value();
  if (lying_) random_.seed(*seed);
}

void HostileDevice::SetComplete(Complete complete) {
  complete_ = std::move(complete);
  device_->SetComplete(
      [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
        OnComplete(id, status, actual, in);
      });
}

void HostileDevice::Submit(const Urb& urb) {
  if (urb.length > 0) asked_[urb.id] = urb.length;
  device_->Submit(urb);
}

bool HostileDevice::Unlink(uint64_t id) {
  if (!device_->Unlink(id)) return false;
  asked_.erase(id);
  return true;
}

void HostileDevice::OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                               std::span<const std::byte> in) {
  uint32_t most = 0;
  if (const auto it = asked_.find(id); it != asked_.end()) {
    most = it->second;
    asked_.erase(it);
  }
  const bool answer = most > 0 && !in.empty() &&
                      (status == TransferStatus::kOk || status == TransferStatus::kShort);
  if (!lying_ || !answer || Below(kLieOneIn) != 0) return complete_(id, status, actual, in);
  ++lies_;
  const std::vector<std::byte> lie = Damaged(in, most);
  const auto size = static_cast<uint32_t>(lie.size());
  complete_(id, size < most ? TransferStatus::kShort : TransferStatus::kOk, size, lie);
}

std::vector<std::byte> HostileDevice::Damaged(std::span<const std::byte> in, size_t most) {
  std::vector<std::byte> lie(in.begin(), in.end());
  const auto any = [this] { return static_cast<std::byte>(Below(256)); };
  switch (Below(6)) {
    case 0:  // bits
      for (uint64_t flips = 1 + Below(kMostFlips); flips > 0; --flips) {
        lie[Below(lie.size())] ^= std::byte{1} << static_cast<int>(Below(8));
      }
      break;
    case 1:  // a byte near the beginning, where lengths, counts and types are
      lie[Below(std::min<size_t>(lie.size(), 16))] = any();
      break;
    case 2:  // extremes
      std::fill_n(lie.begin() + static_cast<ptrdiff_t>(Below(lie.size())), 1,
                  Below(2) == 0 ? std::byte{0} : std::byte{0xFF});
      break;
    case 3:  // truncated
      lie.resize(Below(lie.size()));
      break;
    case 4:  // longer than the answer
      lie.resize(lie.size() + Below(most - std::min(most, lie.size()) + 1), any());
      break;
    default:  // entirely random
      lie.resize(1 + Below(most));
      for (std::byte& byte : lie) byte = any();
      break;
  }
  lie.resize(std::min(lie.size(), most));
  return lie;
}

}  // namespace voxeld::display::emulator
