// A host's end of voxlink for conformance cases: requests, packets within the device's credit, and
// events, of which each is held to docs/protocols/voxlink.md §6 and §7 as it comes. Nothing waits
// longer than its limit; after the check has failed nothing is done any more.
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
  sync::TimeNs at = 0;  // when it came, on our clock
  bool awaited = false;
  EventType type() const { return static_cast<EventType>(header.type); }
  // The body, filled up with zeros where it is too short (which was told before).
  template <typename T>
  T As() const {
    std::vector<std::byte> whole = body;
    whole.resize(sizeof(T));
    return Load<T>(whole);
  }
};

// The volume that an event is about, 0 if it is about none.
uint64_t VolumeOf(const Event& event);
// "ABORTED of volume 7: superseded", for messages.
std::string Describe(const Event& event);

class Session {
 public:
  explicit Session(conformance::Probe& probe);
  // Leaves the device as it is, but reads no events any more.
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  conformance::Probe& probe() { return probe_; }
  conformance::Check& check() { return probe_.check(); }
  bool ok() { return check().ok(); }

  // ---- requests
  static UsbSetup Setup(Request request, uint16_t value, uint16_t length, bool in);
  // What the request is answered with, whatever it is.
  conformance::Answer Get(Request request, uint16_t value, uint16_t length);
  conformance::Answer Put(Request request, uint16_t value = 0,
                          std::span<const std::byte> data = {});
  // It must be done.
  void Do(Request request, uint16_t value = 0, std::span<const std::byte> data = {});
  // It must be stalled, and GET_STATUS answered after it.
  void MustStall(const std::string& what, const UsbSetup& setup,
                 std::span<const std::byte> data = {});
  Status GetStatus();
  Mode GetMode();
  // All pages, put together, read once.
  const std::vector<std::byte>& CapabilityBytes();
  const DeviceCapabilities& capabilities();
  bool Has(Feature feature) { return (capabilities().fixed.features & feature) != 0; }

  // ---- sessions
  // The mode in which a volume has the fewest bytes.
  Mode SmallestMode();
  FrameLayout LayoutOf(const Mode& mode);
  // SET_MODE (SmallestMode), START, READY. Not applicable if a volume is too large, or a sweep too
  // long, to be waited for.
  void Start();
  void Start(const Mode& mode);
  // START alone, and its READY.
  void Restart();
  const FrameLayout& layout() const { return layout_; }
  uint32_t pictures() const { return static_cast<uint32_t>(layout_.pictures()); }
  sync::TimeNs period() const { return period_; }
  // Bytes of the session, as sent.
  uint64_t sent() const { return sent_; }

  // ---- packets: gathered, and sent by Flush or by whatever waits
  PacketWriter& writer() { return writer_; }
  void Begin(uint64_t volume, uint64_t base = 0, std::span<const std::byte> bitmap = {});
  // A whole picture, in fragments that fit; its bytes follow from volume and number.
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
  // Sizes of the transfers to come; 0: one without bytes. Null: as large as may be.
  void SetSplit(std::function<size_t()> split) { split_ = std::move(split); }
  // An empty packet follows each transfer.
  void SetZeroPackets(bool on) { zero_packets_ = on; }
  void Flush();
  // Flush, and until the device has consumed everything.
  void Settle();

  // ---- time and events
  // KEEPALIVEs go out by themselves while something is waited for.
  void SetKeepalive(bool on) { keepalive_ = on; }
  void SetListening(bool on);
  void Pause(sync::TimeNs duration);
  // Events from now on count for what follows.
  void Mark() { mark_ = log_.size(); }
  const std::vector<Event>& log() const { return log_; }
  // The first event after the mark for which `is` holds and that was not awaited before; it must come
  // within `limit` once the device has consumed what was sent.
  Event Await(const std::string& expected, sync::TimeNs limit,
              const std::function<bool(const Event&)>& is);
  std::optional<Event> Find(const std::function<bool(const Event&)>& is) const;  // after the mark
  size_t Count(EventType type) const;                                            // after the mark
  std::string Recent() const;  // what came after the mark, for messages

  Event ExpectComplete(uint64_t volume);
  void ExpectAborted(uint64_t volume, Reason reason);
  void ExpectAborted(uint64_t volume);
  void ExpectDropped(uint64_t volume, Reason reason);
  Event ExpectShown(uint64_t volume);
  std::vector<PictureRun> ExpectMissing(uint64_t volume);
  ErrorEvent ExpectError(ErrorCode code);
  // A packet whose answer is certain: VOLUME_END of a volume that nobody began.
  void RoundTrip();
  // After a round trip: no ERROR came after the mark.
  void ExpectNoErrors();

 private:
  void BeginSession();
  void PostReads();
  void CancelReads();
  // Lets things happen until something completes or `until` has come.
  void Step(sync::TimeNs until);
  void TakeEvents();
  void TakeEvent(std::span<const std::byte> bytes);
  void SendNow(std::span<const std::byte> bytes);
  void SendTransfer(std::span<const std::byte> bytes);
  // Until credit allows more; at least one byte, or the check fails.
  size_t WaitForCredit();
  void KeepAlive();
  // The answer to VOLUME_END.
  Event AnswerToEnd(uint64_t volume, EventType type, const std::string& expected);

  conformance::Probe& probe_;
  std::optional<std::vector<std::byte>> block_;
  std::optional<DeviceCapabilities> capabilities_;

  bool running_ = false, keepalive_ = true, listening_ = true;
  // Never nothing, so that a case may reckon with them although START failed.
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
