// A display whose device is controlled by the test. Time advances only when the test advances it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "display/api/display.h"

namespace voxeld::daemon::testing {

inline display::DisplayInfo SmallDisplay(std::string name) {
  display::DisplayInfo info;
  info.name = std::move(name);
  info.driver = "scripted";
  display::PlanarStack stack;
  stack.width_px = 8;
  stack.height_px = 8;
  stack.positions_mm = {-0.5, 0.5};
  info.geometry.shape = stack;
  info.geometry.grid = {8, 8, 2, {1, 1, 1}, {-4, -4, -1}};
  info.layout = {2, 8, 8, 1, display::PixelFormat::kRgb888};
  info.tone.SetCurve(display::Tone::Linear());
  info.volumes_per_second = 30;
  return info;
}

class ScriptedDisplay final : public display::Display {
 public:
  ScriptedDisplay(display::DisplayInfo info, sync::Clock& clock)
      : Display(std::move(info), clock), now_(clock) {}

  // ---- the device's behaviour
  bool attach_at_once = true;
  sync::TimeNs show_after_ns = -1;  // if ≥ 0, each volume is shown that long after it was sent
  absl::Status refuse_brightness, refuse_blank;

  void Attach() { Attached(); }
  void Lose(const std::string& reason) { DeviceLost(reason); }
  void FailTransfers(uint64_t count) { mutable_stats().transfers_failed += count; }
  // Shows the volume in flight. Returns false if no volume is in flight.
  bool Show() {
    if (in_flight() == nullptr) return false;
    FrameDone(now_.Now(), display::Evidence::kDevice, now_.Now() - sync::kMillisecond, 100);
    return true;
  }
  bool Abort(const std::string& reason) {
    if (in_flight() == nullptr) return false;
    FrameLost(reason, 50);
    return true;
  }
  using Display::in_flight;
  using Display::tapped;
  // The sweeps that it announces, if their period is not 0.
  sync::TimeNs sweep_start_ns = 0, sweep_period_ns = 0;
  std::vector<sync::TimeNs> ComingSweeps(int count) const override {
    std::vector<sync::TimeNs> coming;
    if (sweep_period_ns == 0) return coming;
    sync::TimeNs next = sweep_start_ns;
    while (next <= now_.Now()) next += sweep_period_ns;
    for (int i = 0; i < count; ++i) coming.push_back(next + i * sweep_period_ns);
    return coming;
  }

  int sent = 0;  // volumes sent, for any reason
  std::function<void(uint64_t volume)> on_send;

 protected:
  absl::Status DoStart() override {
    if (attach_at_once) Attached();
    return absl::OkStatus();
  }
  void DoStop() override {}
  void DoSend(const display::SliceFramePtr& frame, bool) override {
    ++sent;
    if (on_send) on_send(frame->volume);
    sent_at_ = now_.Now();
  }
  sync::TimeNs DoTick(sync::TimeNs now) override {
    if (show_after_ns < 0 || in_flight() == nullptr) return sync::kNever;
    if (now < sent_at_ + show_after_ns) return sent_at_ + show_after_ns;
    Show();
    return now;
  }
  absl::Status DoSetBrightness(double) override { return refuse_brightness; }
  absl::Status DoSetBlank(bool) override { return refuse_blank; }
  std::unique_ptr<display::WireDecoder> DoMakeDecoder() const override {
    // Every volume differs from the one before in its first picture.
    struct Decoder final : display::WireDecoder {
      explicit Decoder(const display::FrameLayout& layout) : layout(layout) {}
      absl::Status OnBytes(uint8_t, std::span<const std::byte>, size_t) override {
        return absl::OkStatus();
      }
      std::optional<display::DecodedVolume> TakeVolume() override {
        display::DecodedVolume decoded{.volume = 0, .layout = layout};
        for (size_t i = 0; i < layout.pictures(); ++i) {
          std::vector<std::byte> picture(layout.bytes_per_slice());
          if (i == 0) picture[0] = static_cast<std::byte>(++volumes);
          decoded.pictures.push_back(
              std::make_shared<const std::vector<std::byte>>(std::move(picture)));
        }
        return decoded;
      }
      const display::FrameLayout layout;
      uint8_t volumes = 0;
    };
    return std::make_unique<Decoder>(info().layout);
  }

 private:
  sync::Clock& now_;
  sync::TimeNs sent_at_ = 0;
};

}  // namespace voxeld::daemon::testing
