#include "tests/display/usb/transport_rig.h"

#include <algorithm>
#include <utility>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

class MemorySink final : public ByteSink {
 public:
  explicit MemorySink(std::shared_ptr<std::vector<std::byte>> bytes) : bytes_(std::move(bytes)) {}
  absl::Status Write(std::span<const std::byte> bytes) override {
    bytes_->insert(bytes_->end(), bytes.begin(), bytes.end());
    return absl::OkStatus();
  }

 private:
  const std::shared_ptr<std::vector<std::byte>> bytes_;
};

}  // namespace

std::unique_ptr<PacketRecorder> MemoryRecording::MakeRecorder() {
  return std::make_unique<PacketRecorder>(std::make_unique<MemorySink>(bytes_),
                                          PacketRecorder::Options{});
}

DisplayInfo SmallDisplay() { return Rig().display().info(); }

EmulatedCable::EmulatedCable(sync::Clock& clock) {
  const DisplayInfo info = SmallDisplay();
  emulator::VoxlinkDeviceConfig config;
  config.geometry = info.geometry;
  config.volumes_per_second = info.volumes_per_second;
  auto emulated = std::make_unique<emulator::VoxlinkDevice>(config, clock);
  device = emulated.get();
  InProcessTransport::Options options;
  options.own_thread = false;
  transport = std::make_unique<InProcessTransport>(std::move(emulated), clock, options);
  pump = transport.get();
}

TransportRig::TransportRig(std::unique_ptr<UsbTransport> transport, sync::FakeClock& clock,
                           std::vector<Pump> pumps)
    : clock_(clock),
      pumps_(std::move(pumps)),
      display_(SmallDisplay(), std::move(transport), clock) {}

void TransportRig::Start() {
  const absl::Status status = display_.Start(&recorder_, [this] { woken_ = true; });
  ASSERT_TRUE(status.ok()) << status;
  Settle();
}

void TransportRig::Settle() {
  sync::TimeNs tick = 0;
  do {
    woken_ = false;
    tick = display_.Tick();
    next_ = tick;
    for (const Pump& pump : pumps_) next_ = std::min(next_, pump());
  } while (woken_ || tick <= clock_.Now());
}

bool TransportRig::RunUntil(const std::function<bool()>& done, sync::TimeNs limit) {
  const sync::TimeNs end = clock_.Now() + limit;
  while (true) {
    Settle();
    if (done()) return true;
    if (next_ > end) break;
    clock_.AdvanceTo(next_);
  }
  clock_.AdvanceTo(end);
  Settle();
  return done();
}

void TransportRig::RunFor(sync::TimeNs duration) {
  RunUntil([] { return false; }, duration);
}

}  // namespace voxeld::display
