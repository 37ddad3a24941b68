// The light of an emulated voxlink display: packets in, volumes shown sweep by sweep, events out.
// It follows docs/protocols/voxlink.md §5, §6 and §8 and does not depend on USB.
//
// Single-threaded; its time advances only by Advance.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "display/api/slice_frame.h"
#include "display/drivers/voxlink/assembler.h"
#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/sync/clock.h"

namespace voxeld::display::emulator {

class VoxlinkScreen final : private voxlink::PacketParser::Sink {
 public:
  // `body` is valid during the call.
  using Emit =
      std::function<void(voxlink::EventType type, uint8_t flags, std::span<const std::byte> body)>;

  VoxlinkScreen(uint32_t max_payload, bool watchdog, Emit emit);

  // START and STOP (§4.5): all state is reset, nothing is shown; the first sweep begins one period
  // after `now`. Times are the device's.
  void Start(const FrameLayout& layout, sync::TimeNs period, sync::TimeNs now);
  void Stop();
  bool running() const { return running_; }

  // Consumes bytes from the receive buffer, in order. Call Advance(now) first.
  void Consume(std::span<const std::byte> bytes, sync::TimeNs now);
  // Notes that the receive buffer still holds bytes, so the host is not silent.
  void HostIsHeard(sync::TimeNs now);
  void SetBlank(bool blank);

  // Processes the sweeps that have begun and the darkness that is due, up to and including `now`.
  void Advance(sync::TimeNs now);
  sync::TimeNs NextTimeout() const;

  bool blanked() const { return blanked_; }
  bool watchdog_dark() const { return watchdog_dark_; }
  // How long the host had been silent when the display last went dark for that, measured when the
  // model ran, which may be late. 0: never.
  sync::TimeNs silence() const { return silence_; }
  // Returns whether light is emitted: a volume is shown and nothing darkens it.
  bool lit() const { return running_ && shown_ != nullptr && !blanked_ && !watchdog_dark_; }
  const voxlink::VolumePtr& shown() const { return shown_; }
  uint64_t filling() const { return assembler_ ? assembler_->number() : 0; }
  uint64_t last_complete() const { return base_ ? base_->number : 0; }
  uint64_t shown_sweep() const { return shown_sweep_; }
  sync::TimeNs shown_start() const { return shown_start_; }
  uint64_t volumes_shown() const { return volumes_shown_; }  // since START
  uint32_t underruns() const { return underruns_; }
  uint64_t errors() const { return errors_; }  // ERROR events

 private:
  // A complete volume that waits for its sweep, or for SHOW.
  struct Waiting {
    voxlink::VolumePtr volume;
    bool show = false;
    uint64_t sweep = 0;
  };

  void OnPacket(const voxlink::PacketHeader& header, std::span<const std::byte> payload) override;
  void OnBadPayload(const voxlink::PacketHeader& header) override;
  void OnSkipped(size_t bytes) override;
  void Hear(const voxlink::PacketHeader& header);

  void Begin(const voxlink::PacketHeader& header, std::span<const std::byte> payload);
  void Slice(const voxlink::PacketHeader& header, std::span<const std::byte> payload);
  void End(const voxlink::PacketHeader& header);
  void Abort(const voxlink::PacketHeader& header);
  void Show(const voxlink::PacketHeader& header, std::span<const std::byte> payload);
  void Drop(const voxlink::PacketHeader& header);

  void BeginSweep(uint64_t sweep, sync::TimeNs start);
  void SetWatchdogDark(bool dark);
  void EmitMissing();
  void EmitVolume(voxlink::EventType type, uint64_t volume, voxlink::Reason reason);
  void EmitError(voxlink::ErrorCode code, const voxlink::PacketHeader& header, uint32_t detail);

  const bool watchdog_;
  const Emit emit_;
  voxlink::PacketParser parser_;
  FrameLayout layout_;
  bool running_ = false;
  sync::TimeNs now_ = 0;

  std::optional<voxlink::VolumeAssembler> assembler_;
  voxlink::VolumePtr base_;  // the last volume reported complete
  std::optional<Waiting> waiting_;
  voxlink::VolumePtr shown_;
  uint64_t shown_sweep_ = 0;
  sync::TimeNs shown_start_ = 0;

  uint64_t last_begun_ = 0;
  uint64_t refused_ = 0;  // the volume whose BEGIN was refused: its slices are ignored
  voxlink::Reason refused_reason_ = voxlink::Reason::kMalformed;
  uint64_t complained_ = 0;  // volume for whose unexpected slices an ERROR was already sent
  uint32_t sequence_ = 0;    // expected of the next packet

  sync::TimeNs period_ = sync::kSecond;
  sync::TimeNs epoch_ = 0;  // sweep n begins at epoch_ + n·period_
  uint64_t sweep_ = 0;      // the last one begun
  uint64_t volumes_shown_ = 0;
  uint32_t underruns_ = 0;

  sync::TimeNs heard_ = 0;
  sync::TimeNs silence_ = 0;
  bool watchdog_dark_ = false;
  bool blanked_ = false;
  uint64_t errors_ = 0;
};

}  // namespace voxeld::display::emulator
