#include "display/drivers/voxlink/voxlink_display.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/voxlink/decoder.h"

namespace voxeld::display::voxlink {
namespace {

// After this many consecutive failures of its set-up, the device's port is reset.
constexpr int kFailuresToReset = 3;
constexpr sync::TimeNs kReadyLimit = sync::kSecond;
// Earlier than the protocol's 100 ms, to allow for jitter of the owner's thread.
constexpr sync::TimeNs kKeepaliveAfter = 70 * sync::kMillisecond;
constexpr sync::TimeNs kClockWindow = 5 * sync::kSecond;
double NominalPeriod(const DisplayInfo& info) {
  return static_cast<double>(sync::kSecond) / std::max(info.volumes_per_second, 1e-3);
}

// Checks that a configuration descriptor has the protocol's interface with its two endpoints.
absl::Status CheckDescriptor(std::span<const std::byte> descriptor) {
  bool ours = false, out = false, in = false;
  while (descriptor.size() >= 2) {
    const size_t length = std::to_integer<size_t>(descriptor[0]);
    if (length < 2 || length > descriptor.size()) break;
    const auto at = [&](size_t i) { return std::to_integer<int>(descriptor[i]); };
    if (at(1) == 4 && length >= 9) {
      ours = at(5) == kInterfaceClass && at(6) == kInterfaceSubclass && at(7) == kInterfaceProtocol;
    } else if (at(1) == 5 && length >= 7 && ours) {
      out |= at(2) == kBulkOut && (at(3) & 3) == 2;
      in |= at(2) == kInterruptIn && (at(3) & 3) == 3;
    }
    descriptor = descriptor.subspan(length);
  }
  if (out && in) return absl::OkStatus();
  return absl::FailedPreconditionError(
      "the device has no voxlink interface (class FF, subclass 56, protocol 01, bulk OUT 01, "
      "interrupt IN 82)");
}

uint16_t WireBrightness(double brightness) {
  return static_cast<uint16_t>(std::lround(brightness * 65535));
}

}  // namespace

VoxlinkDisplay::VoxlinkDisplay(DisplayInfo info, std::unique_ptr<UsbTransport> transport,
                               sync::Clock& clock, VoxlinkLink::Options options, bool calibrated)
    : Display(std::move(info), clock),
      link_(std::move(transport), clock, this, options),
      calibrated_(calibrated),
      sweeps_(NominalPeriod(this->info())) {}

VoxlinkDisplay::~VoxlinkDisplay() { Stop(); }

void VoxlinkDisplay::ClockMap::Note(uint64_t device_ns, sync::TimeNs host_ns) {
  // A device may report anything: this wraps around.
  const auto difference = static_cast<int64_t>(static_cast<uint64_t>(host_ns) - device_ns);
  if (!known) {
    known = true;
    offset = coming = difference;
    window_end = host_ns + kClockWindow;
  }
  if (host_ns >= window_end) {
    offset = coming;
    coming = difference;
    window_end = host_ns + kClockWindow;
  }
  coming = std::min(coming, difference);
  offset = std::min(offset, difference);
}

// ---- life

absl::Status VoxlinkDisplay::DoStart() {
  link_.transport().SetWake([this] { Wake(); });
  phase_ = Phase::kDetached;
  attach_at_ = clock().Now();
  failed_at_ = 0;
  retry_.Reset();
  failed_setups_ = 0;
  Wake();
  return absl::OkStatus();
}

void VoxlinkDisplay::DoStop() {
  if (phase_ == Phase::kReady) link_.Write(Request::kStop, 0);
  link_.transport().SetWake(nullptr);
  link_.Close();
  phase_ = Phase::kDetached;
  sending_ = Sending{};
}

void VoxlinkDisplay::OnLinkFailed(const std::string& reason) {
  if (phase_ == Phase::kSettingUp || phase_ == Phase::kWaitingReady) ++failed_setups_;
  link_.Close();
  phase_ = Phase::kDetached;
  RetryLater(clock().Now());
  const uint64_t bytes = sending_.bytes;
  sending_ = Sending{};
  sweeps_.Restart();
  DeviceLost(reason, bytes);
}

sync::TimeNs VoxlinkDisplay::DoTick(sync::TimeNs now) {
  link_.Poll();
  mutable_stats().transfers_failed += link_.TakeFailures();
  sweeps_.Advance(now);
  if (phase_ == Phase::kDetached && link_.transport().TakeArrival()) {
    // A device that comes and goes is retried no faster than one that fails.
    attach_at_ = std::min(attach_at_, failed_at_ + retry_.first());
  }
  if (phase_ == Phase::kDetached && now >= attach_at_) TryAttach(now);
  const sync::TimeNs next = Advance(now);
  return link_.failed() ? now : std::min(next, link_.NextTry());
}

sync::TimeNs VoxlinkDisplay::Advance(sync::TimeNs now) {
  if (phase_ == Phase::kDetached) return attach_at_;
  if (phase_ == Phase::kSettingUp) return sync::kNever;  // requests have their own timeout
  if (phase_ == Phase::kWaitingReady) {
    if (now < ready_by_) return ready_by_;
    OnLinkFailed("the device did not start its session");
    return attach_at_;
  }
  const sync::TimeNs check = CheckOnVolume(now);
  if (phase_ != Phase::kReady) return attach_at_;
  Pump();
  return std::min(check, KeepAlive(now));
}

sync::TimeNs VoxlinkDisplay::KeepAlive(sync::TimeNs now) {
  // a completion wakes the display
  if (link_.bulk_in_flight() > 0 || link_.recovering()) return sync::kNever;
  const sync::TimeNs due = link_.last_sent() + kKeepaliveAfter;
  if (now < due) return due;
  if (link_.Room() < sizeof(PacketHeader)) return now + kKeepaliveAfter;
  TransferBytes buffer = link_.TakeBuffer();
  writer_.Plain(buffer, PacketType::kKeepalive, 0);
  mutable_stats().bytes_out += buffer.size();
  TapOut(kBulkOut, buffer);
  link_.Send(std::move(buffer));
  return now + kKeepaliveAfter;
}

// ---- attach: docs/protocols/voxlink.md §9

void VoxlinkDisplay::RetryLater(sync::TimeNs now) {
  failed_at_ = now;
  attach_at_ = now + retry_.Next();
}

void VoxlinkDisplay::TryAttach(sync::TimeNs now) {
  const absl::Status status = link_.Open();
  if (!status.ok()) {
    RetryLater(now);
    const std::string reason(status.message());
    if (absl::IsNotFound(status)) {
      NoDevice(reason);
    } else {
      DeviceLost(reason);
    }
    return;
  }
  phase_ = Phase::kSettingUp;
  capability_bytes_.clear();
  if (failed_setups_ >= kFailuresToReset) {
    failed_setups_ = 0;
    link_.ResetDevice();
  }
  link_.ReadConfiguration();
}

void VoxlinkDisplay::OnConfiguration(std::span<const std::byte> descriptor) {
  const absl::Status status = CheckDescriptor(descriptor);
  if (!status.ok()) return OnLinkFailed(std::string(status.message()));
  link_.Read(Request::kGetCapabilities, 0, kCapabilitiesPage);
}

void VoxlinkDisplay::OnCapabilities(std::span<const std::byte> page) {
  capability_bytes_.insert(capability_bytes_.end(), page.begin(), page.end());
  const size_t total =
      capability_bytes_.size() < sizeof(uint32_t) ? 0 : Load<uint32_t>(capability_bytes_);
  const size_t have = capability_bytes_.size();
  if (total > have && total <= kMaxCapabilities && page.size() == kCapabilitiesPage) {
    return link_.Read(Request::kGetCapabilities, static_cast<uint16_t>(have / kCapabilitiesPage),
                      kCapabilitiesPage);
  }
  absl::StatusOr<DeviceCapabilities> parsed = ParseCapabilities(capability_bytes_);
  if (!parsed.ok()) return OnLinkFailed(std::string(parsed.status().message()));
  const absl::Status fits = CheckCapabilities(*parsed, info().geometry, info().layout, calibrated_);
  if (!fits.ok()) return OnLinkFailed(std::string(fits.message()));
  const double rate_mhz = std::round(info().volumes_per_second * 1000);
  if (rate_mhz < parsed->fixed.min_rate_mhz || rate_mhz > parsed->fixed.max_rate_mhz) {
    return OnLinkFailed(absl::StrCat(
        "the display is configured for ", info().volumes_per_second, " volumes/s; the device has ",
        parsed->fixed.min_rate_mhz / 1000.0, " to ", parsed->fixed.max_rate_mhz / 1000.0));
  }
  const uint32_t holds = kFeatureShowAhead | kFeatureWatchdog;
  if (holding() && (parsed->fixed.features & holds) != holds) {
    return OnLinkFailed(
        "the display is in a genlock, for which its device must have a watchdog (feature bit 0) "
        "and take SHOW ahead "
        "(bit 4); this one does not");
  }
  capabilities_ = *std::move(parsed);
  Configure();
}

void VoxlinkDisplay::Configure() {
  fragment_ = std::min<size_t>(capabilities_.fixed.max_payload, link_.bulk_limit() / 4);
  link_.Write(Request::kStop, 0);
  Mode mode{};
  mode.format = static_cast<uint8_t>(info().layout.format);
  mode.bits = static_cast<uint8_t>(info().layout.bits);
  mode.sub_frames = static_cast<uint8_t>(info().layout.sub_frames);
  mode.rate_mhz = static_cast<uint32_t>(std::lround(info().volumes_per_second * 1000));
  link_.Write(Request::kSetMode, 0, BytesOf(mode));
  if ((capabilities_.fixed.features & kFeatureBrightness) != 0) {
    configured_brightness_ = brightness();
    link_.Write(Request::kSetBrightness, WireBrightness(brightness()));
  } else {
    HasNoBrightness();
  }
  const bool limits = (capabilities_.fixed.features & kFeaturePowerLimit) != 0;
  KeepsPowerLimit(limits);
  configured_power_limit_w_ = power_limit_w();
  if (limits) DoSetPowerLimit(power_limit_w());  // an earlier limit may still be in force
  configured_blank_ = blanked();
  link_.Write(Request::kSetBlank, blanked() ? 1 : 0);
  link_.Write(Request::kStart, 0);
}

void VoxlinkDisplay::Ready() {
  phase_ = Phase::kReady;
  failed_setups_ = 0;
  ++mutable_stats().attaches;
  // Apply settings that were requested since the device was configured.
  if ((capabilities_.fixed.features & kFeatureBrightness) != 0 &&
      brightness() != configured_brightness_) {
    link_.Write(Request::kSetBrightness, WireBrightness(brightness()));
  }
  if (keeps_power_limit() && power_limit_w() != configured_power_limit_w_) {
    DoSetPowerLimit(power_limit_w());
  }
  if (blanked() != configured_blank_) link_.Write(Request::kSetBlank, blanked() ? 1 : 0);
  Attached();
}

void VoxlinkDisplay::OnReply(Request request, std::span<const std::byte> data) {
  if (request == Request::kGetCapabilities) return OnCapabilities(data);
  if (request != Request::kStart) return;
  // The session exists: READY waits for the first read.
  writer_.Restart();
  sending_ = Sending{};
  last_number_ = complete_number_ = complete_frame_ = dropped_ordered_ = 0;
  commands_.clear();
  clock_map_ = ClockMap{};
  sweeps_.Restart();
  session_underruns_ = 0;
  phase_ = Phase::kWaitingReady;
  ready_by_ = clock().Now() + kReadyLimit;
  link_.BeginSession(capabilities_.fixed.receive_buffer);
}

absl::Status VoxlinkDisplay::DoSetBrightness(double brightness) {
  if ((capabilities_.fixed.features & kFeatureBrightness) == 0) {
    return absl::UnimplementedError(
        absl::StrCat("the device of display \"", info().name, "\" has no brightness"));
  }
  link_.Write(Request::kSetBrightness, WireBrightness(brightness));
  return absl::OkStatus();
}

void VoxlinkDisplay::DoSetPowerLimit(double watts) {
  const auto milliwatts = static_cast<uint32_t>(std::lround(watts * 1000));
  link_.Write(Request::kSetPowerLimit, 0, BytesOf(milliwatts));
}

absl::Status VoxlinkDisplay::DoSetBlank(bool blank) {
  if (!blank && holding()) {
    // Stay dark until the genlock's next volume: an unblanked device would show its old one.
    OnLinkFailed("begins anew after it was blanked");
    attach_at_ = clock().Now();
    Wake();
    return absl::OkStatus();
  }
  link_.Write(Request::kSetBlank, blank ? 1 : 0);
  return absl::OkStatus();
}

std::unique_ptr<WireDecoder> VoxlinkDisplay::DoMakeDecoder() const {
  return std::make_unique<VoxlinkDecoder>(info().layout, capabilities_.fixed.max_payload);
}

// ---- events

void VoxlinkDisplay::NoteUnderruns(uint32_t total) {
  if (total <= session_underruns_) return;
  mutable_stats().underruns += total - session_underruns_;
  session_underruns_ = total;
}

void VoxlinkDisplay::OnEvent(const EventHeader& header, std::span<const std::byte> body) {
  clock_map_.Note(header.time_ns, clock().Now());
  const auto fits = [&](size_t size) { return body.size() >= size; };
  switch (static_cast<EventType>(header.type)) {
    case EventType::kReady:
      if (phase_ != Phase::kWaitingReady) return;
      return Ready();
    case EventType::kSweep:
      if (!fits(sizeof(SweepEvent))) break;
      return NoteSweep(Load<SweepEvent>(body));
    case EventType::kUnderrun:
      if (!fits(sizeof(UnderrunEvent))) break;
      return NoteUnderruns(Load<UnderrunEvent>(body).total);
    case EventType::kComplete:
      if (!fits(sizeof(CompleteEvent))) break;
      return OnComplete(Load<CompleteEvent>(body).volume);
    case EventType::kMissing:
      if (!fits(sizeof(MissingEvent))) break;
      return OnMissing(header, Load<MissingEvent>(body));
    case EventType::kAborted:
      if (!fits(sizeof(VolumeEvent))) break;
      return OnRefused(Load<VolumeEvent>(body), false);
    case EventType::kDropped:
      if (!fits(sizeof(VolumeEvent))) break;
      return OnRefused(Load<VolumeEvent>(body), true);
    case EventType::kShown: {
      if (!fits(sizeof(ShownEvent))) break;
      const auto shown = Load<ShownEvent>(body);
      return OnShown(shown.volume, shown.start_ns, (header.flags & kShownDark) != 0);
    }
    case EventType::kOrdered:
      if (!fits(sizeof(OrderedEvent))) break;
      return OnOrdered(Load<OrderedEvent>(body), (header.flags & kOrderTaken) != 0);
    case EventType::kCredit:
    case EventType::kHealth:
    case EventType::kError:  // VOLUME_END reveals what an error damaged
    case EventType::kLight:
    default:  // from a later minor version
      return;
  }
  OnLinkFailed(
      absl::StrCat("event ", static_cast<int>(header.type), " has only ", body.size(), " bytes"));
}

void VoxlinkDisplay::NoteSweep(const SweepEvent& event) {
  NoteUnderruns(event.underruns);
  const sync::TimeNs now = clock().Now(), start = clock_map_.ToHost(event.start_ns);
  if (start < now - kOldestSweep || start > now + kOldestSweep) return;
  sweeps_.Note(event.sweep, start, event.period_ns);
}

std::vector<sync::TimeNs> VoxlinkDisplay::ComingSweeps(int count) const {
  return sweeps_.Coming(clock().Now(), count);
}

}  // namespace voxeld::display::voxlink
