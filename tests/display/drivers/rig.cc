#include "tests/display/drivers/rig.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "gtest/gtest.h"

namespace voxeld::display {

int Recorder::Count(uint64_t volume) const {
  return static_cast<int>(
      std::count_if(outcomes.begin(), outcomes.end(),
                    [&](const VolumeOutcome& o) { return o.volume == volume; }));
}

const VolumeOutcome* Recorder::Of(uint64_t volume) const {
  for (const VolumeOutcome& outcome : outcomes) {
    if (outcome.volume == volume) return &outcome;
  }
  return nullptr;
}

FrameSource::FrameSource(const FrameLayout& layout, uint32_t seed) : random_(seed) {
  current_.layout = layout;
  current_.bytes.resize(layout.bytes());
  current_.changed_in.resize(layout.pictures());
}

SliceFramePtr FrameSource::Next(double share) {
  ++current_.volume;
  const size_t size = current_.layout.bytes_per_slice();
  std::bernoulli_distribution changes(share);
  const size_t chosen = share > 0 ? random_() % current_.layout.pictures() : SIZE_MAX;
  for (size_t p = 0; p < current_.layout.pictures(); ++p) {
    if (current_.volume > 1 && p != chosen && !changes(random_)) continue;
    current_.changed_in[p] = current_.volume;
    for (size_t i = 0; i < size; ++i) {
      current_.bytes[p * size + i] = static_cast<std::byte>(random_());
    }
  }
  return std::make_shared<SliceFrame>(current_);
}

Rig::Rig(std::map<std::string, std::string> options) {
  DisplayOptions all{.name = "rig", .driver = "simulated", .options = std::move(options)};
  all.options.try_emplace("size", "8x8x6");
  absl::StatusOr<simulated::Parts> parts = simulated::CreateParts(all, clock_, false);
  if (!parts.ok()) throw std::invalid_argument(std::string(parts.status().message()));
  parts_ = *std::move(parts);
}

Rig::~Rig() { parts_.display->Stop(); }

void Rig::Start() {
  const absl::Status status = display().Start(&recorder_, [this] { woken_ = true; });
  ASSERT_TRUE(status.ok()) << status.message();
  Settle();
}

void Rig::Settle() {
  do {
    woken_ = false;
    next_tick_ = display().Tick();
    next_pump_ = transport().Pump();
    if (observer_) observer_();
  } while (woken_ || next_tick_ <= clock_.Now());
}

bool Rig::RunUntil(const std::function<bool()>& done, sync::TimeNs limit) {
  const sync::TimeNs end = clock_.Now() + limit;
  while (true) {
    Settle();
    if (done()) return true;
    const sync::TimeNs next = std::min(next_tick_, next_pump_);
    if (next > end) break;
    clock_.AdvanceTo(next);
  }
  clock_.AdvanceTo(end);
  Settle();
  return done();
}

void Rig::RunFor(sync::TimeNs duration) {
  RunUntil([] { return false; }, duration);
}

bool Rig::RunUntilOutcome(uint64_t volume, sync::TimeNs limit) {
  return RunUntil([&] { return recorder_.Of(volume) != nullptr; }, limit);
}

void Rig::SetPlugged(bool plugged) {
  transport().WithDevice([&](UsbDeviceModel& device) { device.SetPlugged(plugged); });
}

}  // namespace voxeld::display
