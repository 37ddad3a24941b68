#include "tests/simulation/eye.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"

namespace voxeld::simulation {
namespace {

constexpr uint64_t kSeed = 0xCBF29CE484222325, kPrime = 0x100000001B3;

uint64_t Hash(uint64_t hash, std::span<const std::byte> bytes) {
  for (const std::byte b : bytes) hash = (hash ^ std::to_integer<uint64_t>(b)) * kPrime;
  return hash;
}

}  // namespace

Look LookOf(std::span<const std::byte> bytes) { return Hash(kSeed, bytes); }

Look LookOf(const std::vector<display::Picture>& pictures) {
  uint64_t hash = kSeed;
  for (const display::Picture& picture : pictures) hash = Hash(hash, *picture);
  return hash;
}

void Eye::Asked(uint64_t volume, uint64_t snapshot, bool pattern, sync::TimeNs now) {
  drawn_.push_back({.volume = volume,
                    .snapshot = snapshot,
                    .oldest_snapshot = snapshot,
                    .asked_ns = now,
                    .pattern = pattern});
}

void Eye::Drew(uint64_t volume, Look look, uint64_t oldest_snapshot, uint64_t snapshot,
               sync::TimeNs now) {
  const auto it = std::find_if(drawn_.rbegin(), drawn_.rend(),
                               [volume](const Drawn& drawn) { return drawn.volume == volume; });
  it->look = look;
  it->oldest_snapshot = oldest_snapshot;
  it->snapshot = snapshot;
  it->drawn_ns = now;
  by_look_[look].push_back(static_cast<size_t>(drawn_.rend() - it) - 1);
}

std::string Eye::Sees(Look look, sync::TimeNs now, bool may_go_back) {
  shown_.push_back({look, now});
  // A display that has had no volume yet shows a black one to captures and watchers.
  if (look == black_ && (newest_shown_ == 0 || may_go_back)) return "";
  const auto found = by_look_.find(look);
  if (found == by_look_.end()) return "the device shows what was never drawn";
  const std::vector<size_t>& like_it = found->second;
  const auto next = std::find_if(like_it.begin(), like_it.end(),
                                 [this](size_t i) { return drawn_[i].volume >= newest_shown_; });
  if (next == like_it.end() && may_go_back) return "";
  if (next == like_it.end()) {
    return absl::StrCat("the device shows volume ", drawn_[like_it.back()].volume,
                        " again, and has shown volume ", newest_shown_);
  }
  newest_shown_ = drawn_[*next].volume;
  if (like_it.size() == 1 && !drawn_[*next].shown.has_value()) drawn_[*next].shown = now;
  return "";
}

const Eye::Drawn* Eye::Find(uint64_t volume) const {
  for (auto it = drawn_.rbegin(); it != drawn_.rend(); ++it) {
    if (it->volume == volume) return &*it;
  }
  return nullptr;
}

void Eye::Blinked(sync::TimeNs from, sync::TimeNs to) { blinks_.emplace_back(from, to); }

bool Eye::WasShown(Look look, sync::TimeNs at, sync::TimeNs tolerance, sync::TimeNs since) const {
  const auto seen = [&](const Shown& shown) {
    return shown.look == look && shown.at >= since && std::abs(shown.at - at) <= tolerance;
  };
  return std::any_of(shown_.begin(), shown_.end(), seen) ||
         std::any_of(blinks_.begin(), blinks_.end(),
                     [at](const auto& blink) { return blink.first <= at && at <= blink.second; });
}

bool Eye::EverShown(Look look, sync::TimeNs since) const {
  return std::any_of(shown_.begin(), shown_.end(),
                     [look](const Shown& shown) { return shown.look == look; }) ||
         (!blinks_.empty() && blinks_.back().second >= since);
}

std::optional<std::pair<uint64_t, uint64_t>> Eye::VolumesLike(Look look) const {
  const auto found = by_look_.find(look);
  if (found == by_look_.end()) return std::nullopt;
  return std::pair(drawn_[found->second.front()].volume, drawn_[found->second.back()].volume);
}

std::optional<Look> Eye::newest() const {
  if (shown_.empty()) return std::nullopt;
  return shown_.back().look;
}

}  // namespace voxeld::simulation
