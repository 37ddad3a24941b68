// The host's end of voxlink for conformance cases: requests, packets within the device's credit,
// and events, each of which is checked against docs/protocols/voxlink.md §6 and §7 on arrival. No
// wait exceeds its limit; once the check has failed, calls do nothing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "display/conformance/probe.h"
#include "display/drivers/voxlink/capabilities.h"
#include "display/drivers/voxlink/packet.h"
#include "display/drivers/voxlink/protocol.h"

namespace voxeld::display::voxlink {

// How long a device may take to send an event that is due.
inline constexpr sync::TimeNs kEventLimit = sync::kSecond;

struct Event {
  EventHeader header{};
  std::vector<std::byte> body;
  sync::TimeNs at = 0;  // arrival time, on our clock
  bool awaited = false;
  EventType type() const { return static_cast<EventType>(header.type); }
  // Returns the body, padded with zeros if it is too short (which was reported before).
  template <typename T>
  T As() const {
    std::vector<std::byte> whole = body;
    whole.resize(sizeof(T));
    return Load<T>(whole);
  }
};

// Returns the volume that an event is about, or 0.
uint64_t VolumeOf(const Event& event);
// Returns "ABORTED of volume 7: superseded", for messages.
std::string Describe(const Event& event);

class Session {
 public:
  explicit Session(conformance::Probe& probe);
  // Leaves the device as it is, but stops reading events.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  conformance::Probe& probe() { return probe_; }
  conformance::Check& check() { return probe_.check(); }
  bool ok() { return check().ok(); }

  // ---- requests
  static UsbSetup Setup(Request request, uint16_t value, uint16_t length, bool in);
  // Returns the answer to the request, whatever it is.
  conformance::Answer Get(Request request, uint16_t value, uint16_t length);
  conformance::Answer Put(Request request, uint16_t value = 0,
                          std::span<const std::byte> data = {});
  // Sends a request that must succeed.
  void Do(Request request, uint16_t value = 0, std::span<const std::byte> data = {});
  // Sends a request that must be stalled; GET_STATUS must be answered after it.
  void MustStall(const std::string& what, const UsbSetup& setup,
                 std::span<const std::byte> data = {});
  Status GetStatus();
  Mode GetMode();
  // Returns all pages together, read once.
  const std::vector<std::byte>& CapabilityBytes();
  const DeviceCapabilities& capabilities();
  bool Has(Feature feature) { return (capabilities().fixed.features & feature) != 0; }

  // ---- sessions
  // Returns the mode in which a volume has the fewest bytes.
  Mode SmallestMode();
  FrameLayout LayoutOf(const Mode& mode);
  // Sends SET_MODE (SmallestMode) and START, and awaits READY. Not applicable if a volume is too
  // large, or a sweep too long, to wait for.
  void Start();
  void Start(const Mode& mode);
  // Sends only START, and awaits its READY.
  void Restart();
  const FrameLayout& layout() const { return layout_; }
  uint32_t pictures() const { return static_cast<uint32_t>(layout_.pictures()); }
  sync::TimeNs period() const { return period_; }
  // Bytes sent in this session.
  uint64_t sent() const { return sent_; }

  // ---- packets: gathered, and sent by Flush or by any call that waits
  PacketWriter& writer() { return writer_; }
  void Begin(uint64_t volume, uint64_t base = 0, std::span<const std::byte> bitmap = {});
  // Sends a whole slice image, in fragments that fit; volume and number determine its bytes.
  void Picture(uint64_t volume, uint32_t picture);
  void Fragment(uint64_t volume, uint32_t picture, uint32_t offset,
                std::span<const std::byte> bytes);
  void End(uint64_t volume, bool show = true);
  void Plain(PacketType type, uint64_t volume);
  void Show(uint64_t volume, uint64_t sweep);
  void ShowAhead(uint64_t volume, uint64_t sweep, uint32_t ahead);
  void Whole(uint64_t volume, bool show = true);
  void Raw(std::span<const std::byte> bytes);
  std::vector<std::byte> PictureBytes(uint64_t volume, uint32_t picture) const;
  // Sets the sizes of coming transfers; 0: an empty one. Null: as large as possible.
  void SetSplit(std::function<size_t()> split) { split_ = std::move(split); }
  // Sends an empty packet after each transfer.
  void SetZeroPackets(bool on) { zero_packets_ = on; }
  void Flush();
  // Flushes, and waits until the device has consumed everything.
  void Settle();

  // ---- time and events
  // Sends KEEPALIVEs automatically during waits.
  void SetKeepalive(bool on) { keepalive_ = on; }
  void SetListening(bool on);
  void Pause(sync::TimeNs duration);
  // Later checks only consider events from now on.
  void Mark() { mark_ = log_.size(); }
  const std::vector<Event>& log() const { return log_; }
  // Returns the first event after the mark for which `is` returns true and that was not awaited
  // before; it must come within `limit` after the device has consumed everything sent.
  Event Await(const std::string& expected, sync::TimeNs limit,
              const std::function<bool(const Event&)>& is);
  std::optional<Event> Find(const std::function<bool(const Event&)>& is) const;  // after the mark
  size_t Count(EventType type) const;                                            // after the mark
  std::string Recent() const;  // lists the events after the mark, for messages

  Event ExpectComplete(uint64_t volume);
  void ExpectAborted(uint64_t volume, Reason reason);
  void ExpectAborted(uint64_t volume);
  void ExpectDropped(uint64_t volume, Reason reason);
  Event ExpectShown(uint64_t volume);
  std::vector<PictureRun> ExpectMissing(uint64_t volume);
  ErrorEvent ExpectError(ErrorCode code);
  // Sends a packet with a certain answer: VOLUME_END of a volume that was never started.
  void RoundTrip();
  // After a round trip, expects that no ERROR came after the mark.
  void ExpectNoErrors();

 private:
  void BeginSession();
  void PostReads();
  void CancelReads();
  // Waits until something completes, or until `until`.
  void Step(sync::TimeNs until);
  void TakeEvents();
  void TakeEvent(std::span<const std::byte> bytes);
  void SendNow(std::span<const std::byte> bytes);
  void SendTransfer(std::span<const std::byte> bytes);
  // Waits until credit allows more; returns at least one byte, or the check fails.
  size_t WaitForCredit();
  void KeepAlive();
  // Awaits the answer to VOLUME_END.
  Event AnswerToEnd(uint64_t volume, EventType type, const std::string& expected);

  conformance::Probe& probe_;
  std::optional<std::vector<std::byte>> block_;
  std::optional<DeviceCapabilities> capabilities_;

  bool running_ = false, keepalive_ = true, listening_ = true;
  // Never empty, so that a case can compute with them even if START failed.
  FrameLayout layout_{.slices = 1, .width = 1, .height = 1};
  sync::TimeNs period_ = sync::kSecond;
  PacketWriter writer_;
  std::vector<std::byte> gathered_;
  std::function<size_t()> split_;
  bool zero_packets_ = false;
  uint64_t sent_ = 0, credit_limit_ = 0, told_ = 0;
  sync::TimeNs last_sent_ = 0;

  std::vector<TransferId> reads_;
  std::vector<Event> log_;
  size_t mark_ = 0;
};

// Brings a device to rest: blank, power and brightness as after a reset, no session.
absl::Status BringToRest(conformance::Probe& probe);

}  // namespace voxeld::display::voxlink
