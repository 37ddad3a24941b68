#include "tests/display/drivers/fadecandy/fadecandy_rig.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/fadecandy/fadecandy.h"
#include "gtest/gtest.h"

namespace voxeld::display::fadecandy {

FadecandyDisplay::Settings FadecandyRig::Straight() {
  return {.curve = {.gamma = 1}, .flags = kNoDither | kNoInterpolation};
}

FadecandyRig::FadecandyRig(size_t boards, FadecandyDisplay::Settings settings, bool any_serial) {
  DisplayInfo info;
  info.name = "rig";
  info.driver = "fadecandy";
  info.layout = {.slices = static_cast<int32_t>(boards), .width = kPixels, .height = 1};
  info.volumes_per_second = 60;
  std::vector<FadecandyDisplay::Wire> wires;
  for (size_t i = 0; i < boards; ++i) {
    const auto step = static_cast<int>(i);
    const std::string serial(1, static_cast<char>(any_serial ? 'Z' - step : 'A' + step));
    auto device = std::make_unique<emulator::FadecandyDevice>(
        emulator::FadecandyDeviceConfig{.serial = serial, .refresh_ns = kRefresh}, clock_);
    BoardParts parts{.device = device.get()};
    auto hostile = std::make_unique<emulator::HostileDevice>(std::move(device));
    parts.hostile = hostile.get();
    auto faults = std::make_unique<emulator::FaultInjector>(std::move(hostile),
                                                            emulator::FaultPlan{}, clock_);
    parts.faults = faults.get();
    InProcessTransport::Options options;
    options.own_thread = false;
    options.identity.serial = serial;
    auto transport = std::make_unique<InProcessTransport>(std::move(faults), clock_, options);
    parts.transport = transport.get();
    wires.push_back({std::move(transport), any_serial ? "" : serial});
    boards_.push_back(parts);
  }
  display_ =
      std::make_unique<FadecandyDisplay>(std::move(info), settings, std::move(wires), clock_);
}

FadecandyRig::~FadecandyRig() { display_->Stop(); }

void FadecandyRig::Start() {
  ASSERT_TRUE(display_->Start(&recorder_, [this] { woken_ = true; }).ok());
  Settle();
}

void FadecandyRig::SetPlugged(size_t board, bool plugged) {
  transport(board).WithDevice([&](UsbDeviceModel& device) { device.SetPlugged(plugged); });
}

void FadecandyRig::Settle() {
  do {
    woken_ = false;
    next_tick_ = display_->Tick();
    next_pump_ = sync::kNever;
    for (const BoardParts& board : boards_) {
      next_pump_ = std::min(next_pump_, board.transport->Pump());
    }
    if (observer_) observer_();
  } while (woken_ || next_tick_ <= clock_.Now());
}

bool FadecandyRig::RunUntil(const std::function<bool()>& done, sync::TimeNs limit) {
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

void FadecandyRig::RunFor(sync::TimeNs duration) {
  RunUntil([] { return false; }, duration);
}

bool FadecandyRig::RunUntilOutcome(uint64_t volume, sync::TimeNs limit) {
  return RunUntil([&] { return recorder_.Of(volume) != nullptr; }, limit);
}

bool FadecandyRig::Sees(size_t board, const SliceFrame& frame) const {
  const auto output = boards_[board].device->Output();
  for (size_t i = 0; i < kFrameBytes; ++i) {
    const int value = std::to_integer<int>(frame.bytes[board * kFrameBytes + i]);
    // (257·value + 128) / 256
    if (output[i] != std::min(255, value < 128 ? value : value + 1)) return false;
  }
  return true;
}

bool FadecandyRig::Sees(const SliceFrame& frame) const {
  for (size_t b = 0; b < boards_.size(); ++b) {
    if (!Sees(b, frame)) return false;
  }
  return true;
}

bool FadecandyRig::IsDark(size_t board) const {
  const auto output = boards_[board].device->Output();
  return std::all_of(output.begin(), output.end(), [](uint8_t value) { return value == 0; });
}

absl::StatusOr<std::unique_ptr<Display>> CreateEmulated(const DisplayOptions& options,
                                                        sync::Clock& clock) {
  return CreateOver(options, clock, [&](const BoardPlace& board) {
    InProcessTransport::Options carrier;
    carrier.identity.serial =
        board.serial.empty() ? absl::StrCat("SIMULATED", board.index) : board.serial;
    return std::make_unique<InProcessTransport>(
        std::make_unique<emulator::FadecandyDevice>(
            emulator::FadecandyDeviceConfig{.serial = carrier.identity.serial}, clock),
        clock, carrier);
  });
}

}  // namespace voxeld::display::fadecandy
