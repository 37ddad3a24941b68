// The driver, and a device that lies: what it says of itself, its events, its statuses and how transfers end are what a script says.
// Each volume has one outcome, and once the device tells the truth the display shows the newest one.

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/in_process.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

using display::TransferStatus;
using display::Urb;
using sync::kMillisecond;
using sync::kSecond;

constexpr int kMostSteps = 64;

// Around a model: answers and reports as the script has them.
class LyingDevice final : public display::UsbDeviceModel {
 public:
  LyingDevice(std::unique_ptr<display::UsbDeviceModel> device, Script& script)
      : device_(std::move(device)), script_(script) {}

  void TellTheTruth() { truthful_ = true; }

  void SetComplete(Complete complete) override {
    complete_ = std::move(complete);
    device_->SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                                std::span<const std::byte> in) { Answer(id, status, actual, in); });
  }
  void Submit(const Urb& urb) override {
    asked_[urb.id] = {urb.length, urb.out.size()};
    device_->Submit(urb);
  }
  bool Unlink(uint64_t id) override {
    if (!device_->Unlink(id)) return false;
    asked_.erase(id);
    return true;
  }
  void Tick() override { device_->Tick(); }
  sync::TimeNs NextTimeout() const override { return device_->NextTimeout(); }
  display::UsbSpeed speed() const override { return device_->speed(); }
  void Reset() override { device_->Reset(); }
  void SetPlugged(bool plugged) override { device_->SetPlugged(plugged); }
  bool plugged() const override { return device_->plugged(); }
  uint32_t plugs() const override { return device_->plugs(); }

 private:
  struct Asked {
    size_t in = 0, out = 0;
  };

  void Answer(uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
    const Asked asked = std::exchange(asked_[id], {});
    asked_.erase(id);
    const uint8_t lie = truthful_ || !device_->plugged() ? 0 : script_.Byte();
    if (lie < 0x80) return complete_(id, status, actual, in);
    if (lie < 0x90) {  // it ends otherwise
      return complete_(id, static_cast<TransferStatus>(script_.Byte() % 7), 0, {});
    }
    if (asked.in == 0) {  // it took less, or so it says
      return complete_(id, status, static_cast<uint32_t>(script_.Below(65536) % (asked.out + 1)),
                       {});
    }
    std::vector<std::byte> told(in.begin(), in.end());
    if (lie < 0xC0) {  // some bytes are others
      for (int i = lie & 7; i >= 0; --i) {
        const size_t at = script_.Byte();
        const auto value = static_cast<std::byte>(script_.Byte());
        if (at < told.size()) told[at] = value;
      }
    } else if (lie < 0xE0) {  // a number at one of the places where there are some
      const size_t at = size_t{4} * (script_.Byte() % 32);
      const uint64_t value = script_.Number(4);
      for (size_t i = 0; i < 4 && at + i < told.size(); ++i) {
        told[at + i] = static_cast<std::byte>(value >> 8 * i);
      }
    } else {  // nothing of it is true
      const std::string text = script_.Text();
      told.clear();
      for (const char c : text) told.push_back(static_cast<std::byte>(c));
    }
    told.resize(std::min(told.size(), asked.in));
    complete_(id, told.size() < asked.in ? TransferStatus::kShort : TransferStatus::kOk,
              static_cast<uint32_t>(told.size()), told);
  }

  const std::unique_ptr<display::UsbDeviceModel> device_;
  Script& script_;
  Complete complete_;
  std::map<uint64_t, Asked> asked_;
  bool truthful_ = false;
};

// Outcomes of volumes.
struct Ledger final : display::Display::Listener {
  void OnOutcome(const display::VolumeOutcome& outcome) override {
    EXPECT_THAT_HOLDS(owed.erase(outcome.volume) == 1, "volume ", outcome.volume,
                      " has an outcome too many");
  }
  void OnState(display::DisplayState, const std::string& reason) override {
    for (const char c : reason) {
      EXPECT_THAT_HOLDS(static_cast<unsigned char>(c) >= 32, "a reason is not printable");
    }
  }
  void OnHeld(uint64_t volume) override { held = volume; }
  void OnOrdered(uint64_t volume, sync::TimeNs, bool taken) override {
    if (!taken) held = volume;
  }
  std::set<uint64_t> owed;
  uint64_t held = 0;  // by the device; 0: none
};

class Host {
 public:
  explicit Host(Script& script) : script_(script) {
    display::PlanarStack stack{.width_px = 3, .height_px = 2};
    stack.positions_mm = {0, 1, 2, 3};
    display::emulator::VoxlinkDeviceConfig config;
    config.geometry.shape = stack;
    config.volumes_per_second = 10;
    config.receive_buffer = 65536;
    config.max_payload = 1024;
    config.max_sub_frames = 2;
    auto screen = std::make_unique<display::emulator::VoxlinkDevice>(config, clock_);
    screen_ = screen.get();
    auto lying = std::make_unique<LyingDevice>(std::move(screen), script_);
    device_ = lying.get();
    display::InProcessTransport::Options options;
    options.own_thread = false;
    auto transport =
        std::make_unique<display::InProcessTransport>(std::move(lying), clock_, options);
    cable_ = transport.get();
    info_.name = "fuzz";
    info_.driver = "voxlink";
    info_.geometry = config.geometry;
    info_.layout = {.slices = 4, .width = 3, .height = 2, .sub_frames = 1};
    info_.volumes_per_second = 10;
    display_ =
        std::make_unique<display::voxlink::VoxlinkDisplay>(info_, std::move(transport), clock_);
  }
  ~Host() { display_->Stop(); }

  void Run() {
    holding_ = script_.Byte() % 4 == 1;
    if (holding_) display_->SetHolding();
    EXPECT_THAT_HOLDS(display_->Start(&ledger_, [this] { woken_ = true; }).ok());
    // As captures have it: the driver's own bytes never break the protocol.
    display_->Watch(
        [](const absl::StatusOr<display::DecodedVolume>& volume) { ExpectSays(volume.status()); });
    Pass(0);
    for (int step = 0; step < kMostSteps && !script_.done(); ++step) Step();
    device_->TellTheTruth();
    Plug(false);
    Pass(kMillisecond);
    Plug(true);
    (void)display_->SetBlank(false);
    (void)display_->SetBrightness(1);
    (void)display_->SetPowerLimit(0);
    Submit(script_.Byte());
    // Beyond the longest back-off.
    for (int i = 0; i < 120 && !ShowsTheNewest(); ++i) {
      Order(clock_.Now(), 0);
      Pass(100 * kMillisecond);
    }
    EXPECT_THAT_HOLDS(ledger_.owed.empty(), "volume ", *ledger_.owed.begin(),
                      " has no outcome: ", display_->state_reason());
    EXPECT_THAT_HOLDS(ShowsTheNewest(), display_->state_reason());
    display_->Stop();
    EXPECT_THAT_HOLDS(ledger_.owed.empty());
  }

 private:
  bool ShowsTheNewest() const {
    if (display_->state() != display::DisplayState::kShowing || !ledger_.owed.empty()) return false;
    const auto seen = screen_->Seen();
    if (!seen.has_value()) return false;
    for (size_t p = 0; p < seen->pictures.size(); ++p) {
      const auto* const picture = newest_->bytes.data() + p * info_.layout.bytes_per_slice();
      if (!std::equal(seen->pictures[p]->begin(), seen->pictures[p]->end(), picture)) return false;
    }
    return true;
  }

  void Order(sync::TimeNs at, uint32_t ahead) {
    if (const uint64_t held = std::exchange(ledger_.held, 0); holding_ && held != 0) {
      display_->OrderShown(held, at, ahead);
    }
  }

  void Step() {
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
        Plug(script_.Flag());
        break;
      case 5:
        (void)display_->SetBlank(script_.Flag());
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

  void Submit(uint8_t value) {
    auto frame = std::make_shared<display::SliceFrame>();
    frame->layout = info_.layout;
    frame->volume = ++volume_;
    frame->bytes.assign(info_.layout.bytes(), static_cast<std::byte>(value));
    frame->changed_in.assign(info_.layout.pictures(), volume_);
    newest_ = frame;
    ledger_.owed.insert(volume_);
    display_->Submit(frame);
  }

  void Plug(bool plugged) {
    cable_->WithDevice([&](display::UsbDeviceModel& model) {
      if (model.plugged() != plugged) model.SetPlugged(plugged);
    });
  }

  void Settle() {
    sync::TimeNs tick = 0;
    int rounds = 0;
    do {
      EXPECT_THAT_HOLDS(++rounds < 10'000, "the driver does not come to rest");
      woken_ = false;
      tick = display_->Tick();
      next_ = std::min(tick, cable_->Pump());
    } while (woken_ || tick <= clock_.Now());
  }

  void Pass(sync::TimeNs duration) {
    const sync::TimeNs end = clock_.Now() + duration;
    while (true) {
      Settle();
      if (next_ > end) break;
      clock_.AdvanceTo(next_);
    }
    clock_.AdvanceTo(end);
    Settle();
  }

  Script& script_;
  sync::FakeClock clock_;
  Ledger ledger_;
  display::DisplayInfo info_;
  display::emulator::VoxlinkDevice* screen_ = nullptr;
  LyingDevice* device_ = nullptr;
  display::InProcessTransport* cable_ = nullptr;
  std::unique_ptr<display::voxlink::VoxlinkDisplay> display_;
  std::shared_ptr<display::SliceFrame> newest_;
  uint64_t volume_ = 0;
  bool holding_ = false;
  bool woken_ = false;
  sync::TimeNs next_ = 0;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Script script(data, size);
  voxeld::fuzz::Host(script).Run();
  return 0;
}
