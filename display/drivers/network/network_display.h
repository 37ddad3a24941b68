// The driver of LED lattices behind a network controller. README.md describes its behaviour.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/network/color_order.h"
#include "display/drivers/network/link.h"
#include "display/drivers/network/packets.h"
#include "display/sync/backoff.h"

namespace voxeld::display::network {

class NetworkDisplay final : public Display {
 public:
  struct Settings {
    StreamOptions stream;
    ColorOrder order = ColorOrderOf("rgb");
  };

  // Each slice of `info.layout` is a packet: RGB888 in one image.
  NetworkDisplay(DisplayInfo info, Settings settings, std::unique_ptr<Link> link,
                 sync::Clock& clock);
  ~NetworkDisplay() override;

  std::vector<sync::TimeNs> ComingSweeps(int count) const override;

 private:
  enum class Phase : uint8_t { kClosed, kOpening, kProving, kReady };

  struct Packet {
    std::vector<std::byte> bytes;
    bool volume = false;  // part of the volume being sent, not a repeat
  };

  // The volume being sent.
  struct Sending {
    SliceFramePtr frame;  // null: none
    sync::TimeNs begin_ns = 0, last_byte_ns = 0;
    uint64_t bytes = 0;
  };

  absl::Status DoStart() override;
  void DoStop() override;
  void DoSend(const SliceFramePtr& frame, bool full) override;
  sync::TimeNs DoTick(sync::TimeNs now) override;
  absl::Status DoSetBrightness(double brightness) override;
  absl::Status DoSetBlank(bool blank) override;
  std::unique_ptr<WireDecoder> DoMakeDecoder() const override;

  bool datagrams() const { return settings_.stream.protocol != Protocol::kOpc; }
  sync::TimeNs period() const;
  void Fail(sync::TimeNs now, const std::string& reason);
  void Open(sync::TimeNs now);
  void LookAtLink(sync::TimeNs now);
  // Queues all slices, current or black, after whatever waits.
  void QueueWhole();
  void QueueSlices(const std::vector<int32_t>& slices, bool of_volume);
  // Sets the light for which packets are made; returns true if it changed.
  bool SetLight(double brightness, bool dark);
  std::vector<uint8_t> LightOf(int32_t slice) const;
  // Returns when to try again.
  sync::TimeNs Pump(sync::TimeNs now);
  sync::TimeNs Finish(sync::TimeNs now);

  const Settings settings_;
  const std::unique_ptr<Link> link_;
  PacketWriter writer_;
  Phase phase_ = Phase::kClosed;
  sync::TimeNs open_at_ = 0;
  sync::TimeNs proved_at_ = 0;
  sync::Backoff retry_{100 * sync::kMillisecond, 5 * sync::kSecond};

  std::vector<uint8_t>
      picture_;  // all slices, before brightness and colour order; zeros before the first volume
  std::deque<Packet> queue_;
  size_t taken_ = 0;  // bytes sent of the first packet
  Sending sending_;
  uint64_t complete_frame_ = 0;  // the volume that the controller holds; 0: none
  sync::TimeNs last_sent_ = 0;
  double lit_brightness_ = 1;  // the brightness for which packets are made
  bool dark_ = false;
  std::array<uint8_t, 256> scale_{};  // scales a channel by the brightness
};

}  // namespace voxeld::display::network
