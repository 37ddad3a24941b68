// The driver of voxlink 1.x displays, over any USB transport. README.md describes its behaviour;
// the protocol is in docs/protocols/voxlink.md.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "display/api/display.h"
#include "display/drivers/voxlink/capabilities.h"
#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/voxlink_link.h"
#include "display/sync/backoff.h"
#include "display/sync/sweep_clock.h"

namespace voxeld::display::voxlink {

// Reports of sweeps farther from now than this are rejected.
inline constexpr sync::TimeNs kOldestSweep = 60 * sync::kSecond;

class VoxlinkDisplay final : public Display, private VoxlinkLink::Client {
 public:
  // `info` is the required device: attaching to another ends in a state reason that names both.
  // `calibrated`: properties of its assembly may differ (CheckCapabilities).
  VoxlinkDisplay(DisplayInfo info, std::unique_ptr<UsbTransport> transport, sync::Clock& clock,
                 VoxlinkLink::Options options = {}, bool calibrated = false);
  ~VoxlinkDisplay() override;

  std::vector<sync::TimeNs> ComingSweeps(int count) const override;
  std::optional<sync::SweepLock> Sweeps() const override { return sweeps_.lock(); }
  bool can_hold() const override { return true; }

 private:
  enum class Phase : uint8_t { kDetached, kSettingUp, kWaitingReady, kReady };
  enum class Stage : uint8_t { kIdle, kBegin, kPictures, kEnd, kAwaitComplete, kHeld, kAwaitShown };

  // The volume being sent.
  struct Sending {
    Stage stage = Stage::kIdle;
    uint64_t number = 0;  // on the wire
    uint64_t base = 0;
    std::vector<uint32_t> pictures;  // to send in this round
    size_t next = 0;                 // index into `pictures`
    size_t offset = 0;               // in that slice image
    std::vector<bool> announced;
    std::vector<PictureRun> missing;  // listed so far
    int rounds = 0;                   // rounds of re-sending
    int queries = 0;                  // unanswered
    uint64_t bytes = 0;
    sync::TimeNs last_byte_ns = 0;
    uint64_t end_mark = 0;       // kAwaitComplete: link_.sent() after VOLUME_END
    sync::TimeNs answer_by = 0;  // latest time to ask; 0: not known yet
    sync::TimeNs asked_ns = 0;
    bool hold = false;
    uint64_t ordered_sweep = 0;  // in the newest order to show the volume; 0: none
    sync::TimeNs ordered_at = 0;
  };

  // A packet outside a volume being sent: ABORT, SHOW or DROP.
  struct Command {
    PacketType type;
    uint64_t volume;
    uint64_t sweep = 0;  // for SHOW
    uint32_t ahead = 0;
  };

  // Maps the device's clock to ours: the smallest recent difference is the least delayed one.
  struct ClockMap {
    bool known = false;
    int64_t offset = 0, coming = 0;  // of the last complete window and of the current one
    sync::TimeNs window_end = 0;
    void Note(uint64_t device_ns, sync::TimeNs host_ns);
    sync::TimeNs ToHost(uint64_t device_ns) const {
      return static_cast<int64_t>(device_ns + static_cast<uint64_t>(offset));
    }
  };

  absl::Status DoStart() override;
  void DoStop() override;
  void DoSend(const SliceFramePtr& frame, bool full) override;
  sync::TimeNs DoTick(sync::TimeNs now) override;
  absl::Status DoSetBrightness(double brightness) override;
  absl::Status DoSetBlank(bool blank) override;
  bool may_keep_power_limit() const override { return true; }
  void DoSetPowerLimit(double watts) override;
  std::unique_ptr<WireDecoder> DoMakeDecoder() const override;
  void DoOrderShown(sync::TimeNs at, uint32_t ahead) override;
  void DoDropHeld(const std::string& reason) override;

  void OnEvent(const EventHeader& header, std::span<const std::byte> body) override;
  void OnReply(Request request, std::span<const std::byte> data) override;
  void OnConfiguration(std::span<const std::byte> descriptor) override;
  void OnStatus(const Status& status, bool settled) override;
  void OnLinkFailed(const std::string& reason) override;

  sync::TimeNs Advance(sync::TimeNs now);

  // Attach.
  void TryAttach(sync::TimeNs now);
  void RetryLater(sync::TimeNs now);
  void OnCapabilities(std::span<const std::byte> page);
  void Configure();
  void Ready();

  // Volumes.
  void Begin(const SliceFramePtr& frame, bool full);
  void Pump();
  size_t NextPacketSize() const;
  void WritePacket(TransferBytes& out);
  void OnMissing(const EventHeader& header, const MissingEvent& event);
  void OnComplete(uint64_t volume);
  void OnShown(uint64_t volume, uint64_t start_ns, bool dark);
  void OnOrdered(const OrderedEvent& event, bool taken);
  void NoteSweep(const SweepEvent& event);
  void SendCommands();
  void AwaitShown(sync::TimeNs from);
  void OnRefused(const VolumeEvent& event, bool dropped);
  void SendAgain(const char* why);
  void Lose(const std::string& reason);
  sync::TimeNs CheckOnVolume(sync::TimeNs now);
  sync::TimeNs KeepAlive(sync::TimeNs now);
  void NoteUnderruns(uint32_t total);

  VoxlinkLink link_;
  const bool calibrated_;
  Phase phase_ = Phase::kDetached;
  sync::TimeNs attach_at_ = 0;
  sync::TimeNs failed_at_ = 0;
  sync::Backoff retry_{100 * sync::kMillisecond, 5 * sync::kSecond};
  int failed_setups_ = 0;  // consecutive
  sync::TimeNs ready_by_ = 0;
  double configured_brightness_ = 1;  // sent to the device
  double configured_power_limit_w_ = 0;
  bool configured_blank_ = false;
  std::vector<std::byte> capability_bytes_;
  DeviceCapabilities capabilities_;

  PacketWriter writer_;
  Sending sending_;
  uint64_t dropped_ordered_ = 0;   // dropped after it was ordered shown: it may still be shown
  uint64_t last_number_ = 0;       // wire number of the newest volume of this session
  uint64_t complete_number_ = 0;   // the last one that the device completed; 0: none
  uint64_t complete_frame_ = 0;    // the frame that it was
  size_t fragment_ = 0;            // the most bytes of a slice image in one packet
  std::vector<Command> commands_;  // waiting to be sent

  ClockMap clock_map_;
  sync::SweepClock sweeps_;
  uint32_t session_underruns_ = 0;
};

}  // namespace voxeld::display::voxlink
