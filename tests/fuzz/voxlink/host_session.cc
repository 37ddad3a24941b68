#include "tests/fuzz/voxlink/host_session.h"

#include <optional>
#include <utility>

#include "tests/fuzz/exchanges.h"

namespace voxeld::fuzz {

using sync::kMillisecond;

HostSession::HostSession(Script& script) : script_(script) {
  display::PlanarStack stack{.width_px = 3, .height_px = 2};
  stack.positions_mm = {0, 1, 2, 3};
  display::emulator::VoxlinkDeviceConfig config;
  config.geometry.shape = stack;
  config.volumes_per_second = 10;
  config.receive_buffer = 65536;
  config.max_payload = 1024;
  config.max_sub_frames = 2;
  const uint8_t how = script_.Byte();
  holding_ = how % 4 == 1;
  rare_ = (how >> 2 & 3) != 0;
  LyingDevice::Ways ways{.rarity = static_cast<uint8_t>(how >> 2 & 3)};
  if ((how & 0x80) != 0) {
    ways.sequence_shift = 0u - script_.Byte();
    ways.time_shift = 0u - script_.Byte() * uint64_t{100} * kMillisecond;
  }
  auto screen = std::make_unique<display::emulator::VoxlinkDevice>(config, clock_);
  screen_ = screen.get();
  auto lying = std::make_unique<LyingDevice>(std::move(screen), clock_, script_, ways);
  device_ = lying.get();
  display::InProcessTransport::Options options;
  options.own_thread = false;
  auto transport = std::make_unique<display::InProcessTransport>(std::move(lying), clock_, options);
  cable_ = transport.get();
  info_.name = "fuzz";
  info_.driver = "voxlink";
  info_.geometry = config.geometry;
  info_.layout = {.slices = 4, .width = 3, .height = 2, .sub_frames = 1};
  info_.volumes_per_second = 10;
  display_ =
      std::make_unique<display::voxlink::VoxlinkDisplay>(info_, std::move(transport), clock_);
}

void HostSession::Run() {
  if (holding_) display_->SetHolding();
  EXPECT_THAT_HOLDS(display_->Start(&ledger_, [this] { woken_ = true; }).ok());
  // As for captures: the driver's own bytes never break the protocol.
  display_->Watch(
      [](const absl::StatusOr<display::DecodedVolume>& volume) { ExpectSays(volume.status()); });
  Pass(0);
  for (int step = 0; step < MostSteps(64) && !script_.done(); ++step) Step();
  device_->TellTheTruth();
  Plug(false);
  Pass(kMillisecond);
  Plug(true);
  (void)display_->SetBlank(false);
  (void)display_->SetBrightness(1);
  (void)display_->SetPowerLimit(0);
  Submit(script_.Byte());
  // Longer than the longest back-off.
  for (int i = 0; i < 120 && !ShowsTheNewest(); ++i) {
    Order(clock_.Now(), 0);
    Pass(100 * kMillisecond);
  }
  EXPECT_THAT_HOLDS(ledger_.owed.empty(), "volume ", *ledger_.owed.begin(),
                    " has no outcome: ", display_->state_reason());
  EXPECT_THAT_HOLDS(ShowsTheNewest(), display_->state_reason());
  display_->Stop();
  EXPECT_THAT_HOLDS(ledger_.owed.empty());
  const display::DisplayStats& stats = display_->stats();
  EXPECT_THAT_HOLDS(stats.volumes_submitted == volume_);
  EXPECT_THAT_HOLDS(
      stats.volumes_presented + stats.volumes_replaced + stats.volumes_lost == volume_,
      "the volumes do not add up");
  exchanges->attaches += stats.attaches;
  exchanges->transfers_failed += stats.transfers_failed;
  exchanges->slices_resent += stats.slices_resent;
  exchanges->volumes_shown += stats.volumes_presented;
  exchanges->volumes_lost += stats.volumes_lost;
  ++exchanges->overcome;
}

bool HostSession::ShowsTheNewest() const {
  if (display_->state() != display::DisplayState::kShowing || !ledger_.owed.empty()) return false;
  const auto seen = screen_->Seen();
  if (!seen.has_value()) return false;
  for (size_t p = 0; p < seen->pictures.size(); ++p) {
    const auto* const picture = newest_->bytes.data() + p * info_.layout.bytes_per_slice();
    if (!std::equal(seen->pictures[p]->begin(), seen->pictures[p]->end(), picture)) return false;
  }
  return true;
}

void HostSession::Order(sync::TimeNs at, uint32_t ahead) {
  if (const uint64_t held = std::exchange(ledger_.held, 0); holding_ && held != 0) {
    display_->OrderShown(held, at, ahead);
  }
}

void HostSession::Step() {
  switch (script_.Byte() % 10) {
    case 0:
    case 1:
      Submit(script_.Byte());
      break;
    case 2:
    case 3:
      Pass(script_.Byte() * kMillisecond);
      break;
    case 4:
      Plug(rare_ ? script_.Byte() % 8 != 0 : script_.Flag());
      break;
    case 5:
      (void)display_->SetBlank(rare_ ? script_.Byte() % 8 == 0 : script_.Flag());
      break;
    case 6:
      (void)display_->SetBrightness(script_.Byte() / 255.0);
      (void)display_->SetPowerLimit(script_.Byte());
      break;
    case 7:
      Order(clock_.Now() + script_.Byte() * 10 * kMillisecond, script_.Byte() % 4);
      break;
    case 8:
      if (const uint64_t held = ledger_.held; holding_ && held != 0 && script_.Flag()) {
        ledger_.held = 0;
        display_->DropHeld(held, "fuzz");
      }
      break;
    default:
      Pass(script_.Byte() * 10 * kMillisecond);
      break;
  }
  Settle();
}

void HostSession::Submit(uint8_t value) {
  auto frame = std::make_shared<display::SliceFrame>();
  frame->layout = info_.layout;
  frame->volume = ++volume_;
  frame->bytes.assign(info_.layout.bytes(), static_cast<std::byte>(value));
  frame->changed_in.assign(info_.layout.pictures(), volume_);
  newest_ = frame;
  ledger_.owed.insert(volume_);
  display_->Submit(frame);
}

void HostSession::Plug(bool plugged) {
  cable_->WithDevice([&](display::UsbDeviceModel& model) {
    if (model.plugged() != plugged) model.SetPlugged(plugged);
  });
}

void HostSession::Settle() {
  sync::TimeNs tick = 0;
  int rounds = 0;
  do {
    EXPECT_THAT_HOLDS(++rounds < 10'000, "the driver does not come to rest");
    woken_ = false;
    tick = display_->Tick();
    next_ = std::min(tick, cable_->Pump());
  } while (woken_ || tick <= clock_.Now());
}

void HostSession::Pass(sync::TimeNs duration) {
  const sync::TimeNs end = clock_.Now() + duration;
  while (true) {
    Settle();
    if (next_ > end) break;
    clock_.AdvanceTo(next_);
  }
  clock_.AdvanceTo(end);
  Settle();
}

}  // namespace voxeld::fuzz
