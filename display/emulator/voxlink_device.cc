#include "display/emulator/voxlink_device.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <variant>

#include "display/geometry/footprint.h"

namespace voxeld::display::emulator {
namespace {

using voxlink::BytesOf;
using voxlink::EventType;
using voxlink::kBulkOut;
using voxlink::kInterruptIn;
using voxlink::Request;

constexpr size_t kMostEvents = 1024;  // beyond this, the host sees a gap in their numbers
// bytes between two reads of the clock, when the rate is limited
constexpr size_t kDrainStep = 16384;
constexpr sync::TimeNs kHealthPeriod = sync::kSecond;
constexpr uint32_t kMaxPowerMw = 60'000;

uint32_t ToMilliHertz(double rate) {
  return static_cast<uint32_t>(std::clamp(std::lround(rate * 1000), 1L, 1'000'000'000L));
}

std::vector<std::byte> MakeCapabilities(const VoxlinkDeviceConfig& config) {
  voxlink::DeviceCapabilities device;
  device.geometry = config.geometry;
  voxlink::Capabilities& fixed = device.fixed;
  fixed.version = voxlink::kVersion;
  fixed.formats = config.formats;
  const int32_t height =
      std::visit([](const auto& shape) { return shape.height_px; }, config.geometry.shape);
  if (height % 2 != 0) {
    fixed.formats &= static_cast<uint8_t>(~(1u << static_cast<int>(PixelFormat::kHub75)));
  }
  fixed.max_sub_frames = config.max_sub_frames;
  fixed.features = voxlink::kFeatureTemperature | voxlink::kFeatureShowAhead |
                   (config.brightness ? voxlink::kFeatureBrightness : 0u) |
                   (config.power_limit ? voxlink::kFeaturePowerLimit : 0u) |
                   (config.watchdog ? voxlink::kFeatureWatchdog : 0u);
  fixed.receive_buffer = config.receive_buffer;
  fixed.max_payload = config.max_payload;
  fixed.volume_buffers = 3;
  fixed.nominal_rate_mhz = ToMilliHertz(config.volumes_per_second);
  fixed.min_rate_mhz = std::max(1u, fixed.nominal_rate_mhz / 4);
  fixed.max_rate_mhz = fixed.nominal_rate_mhz;
  fixed.max_power_mw = kMaxPowerMw;
  fixed.keepalive_ms = static_cast<uint16_t>(voxlink::kKeepaliveNs / sync::kMillisecond);
  fixed.watchdog_ms =
      config.watchdog ? static_cast<uint16_t>(voxlink::kWatchdogNs / sync::kMillisecond) : 0;
  return voxlink::EncodeCapabilities(device);
}

// Returns whether an OUT request's wValue and length match the table of §4.
bool FitsTable(const UsbSetup& setup, size_t length) {
  switch (static_cast<Request>(setup.request)) {
    case Request::kSetMode:
      return setup.value == 0 && length == sizeof(voxlink::Mode);
    case Request::kStart:
    case Request::kStop:
      return setup.value == 0 && length == 0;
    case Request::kSetBrightness:
      return length == 0;
    case Request::kSetPowerLimit:
      return setup.value == 0 && length == sizeof(uint32_t);
    case Request::kSetBlank:
      return setup.value <= 1 && length == 0;
    default:
      return false;
  }
}

}  // namespace

VoxlinkDevice::VoxlinkDevice(VoxlinkDeviceConfig config, sync::Clock& clock)
    : config_(std::move(config)),
      descriptors_(MakeDescriptors(config_.speed, config_.serial)),
      capabilities_(MakeCapabilities(config_)),
      clock_(clock),
      boot_(clock.Now()),
      screen_(config_.max_payload, config_.watchdog,
              [this](EventType type, uint8_t flags, std::span<const std::byte> body) {
                Queue(type, flags, body);
              }) {
  ResetMode();
}

void VoxlinkDevice::ResetMode() {
  SetMode(BytesOf(voxlink::Mode{.format = static_cast<uint8_t>(std::countr_zero(config_.formats)),
                                .sub_frames = 1}));
}

void VoxlinkDevice::SetPlugged(bool plugged) {
  if (plugged == plugged_) return;
  plugged_ = plugged;
  if (plugged) {
    ++plugs_;
    boot_ = clock_.Now();
  }
  configuration_ = 0;
  Forget(TransferStatus::kDisconnected);
}

void VoxlinkDevice::Reset() { Forget(TransferStatus::kCancelled); }

void VoxlinkDevice::Forget(TransferStatus status) {
  StopSession();
  halted_.clear();
  brightness_ = 65535;
  power_limit_mw_ = 0;
  screen_.SetBlank(false);
  ResetMode();
  std::deque<Waiting> pending;
  pending.swap(bulk_);
  pending.insert(pending.end(), interrupt_.begin(), interrupt_.end());
  interrupt_.clear();
  for (const Waiting& urb : pending) complete_(urb.id, status, 0, {});
}

void VoxlinkDevice::Submit(const Urb& urb) {
  if (!plugged_) return complete_(urb.id, TransferStatus::kDisconnected, 0, {});
  Tick();
  if (urb.endpoint == 0) return Control(urb);
  if (halted_.contains(urb.endpoint)) return complete_(urb.id, TransferStatus::kStall, 0, {});
  if (urb.endpoint == kBulkOut) {
    bulk_.push_back({urb.id, urb.out, 0});
    AcceptBulk();
  } else if (urb.endpoint == kInterruptIn) {
    interrupt_.push_back({urb.id, {}, urb.length});
  } else {
    return complete_(urb.id, TransferStatus::kStall, 0, {});
  }
  DeliverEvents();
}

bool VoxlinkDevice::Unlink(uint64_t id) {
  const auto match = [id](const Waiting& urb) { return urb.id == id; };
  return std::erase_if(bulk_, match) + std::erase_if(interrupt_, match) > 0;
}

void VoxlinkDevice::Tick() {
  if (!plugged_) return;
  DrainBuffer();
  screen_.Advance(DeviceNow());
  AcceptBulk();
  if (screen_.running() && DeviceNow() >= health_at_) {
    health_at_ = DeviceNow() + kHealthPeriod;
    Queue(EventType::kHealth, 0,
          BytesOf(voxlink::HealthEvent{
              .temperature = config_.temperature, .reserved = 0, .power_mw = 0}));
  }
  DeliverEvents();
}

sync::TimeNs VoxlinkDevice::NextTimeout() const {
  if (!plugged_ || !screen_.running()) return sync::kNever;
  sync::TimeNs next = std::min(screen_.NextTimeout(), health_at_);
  const size_t waiting = buffer_.size() - buffer_begin_;
  if (waiting > 0 && config_.bytes_per_second > 0) {
    const auto step = static_cast<double>(std::min(waiting, kDrainStep));
    next = std::min(next,
                    drained_at_ + static_cast<sync::TimeNs>(std::ceil(
                                      step * 1e9 / static_cast<double>(config_.bytes_per_second))));
  }
  return next == sync::kNever ? next : next + boot_;
}

// ---- bulk OUT: docs/protocols/voxlink.md §7

void VoxlinkDevice::AcceptBulk() {
  while (!bulk_.empty()) {
    const Waiting urb = bulk_.front();
    const size_t space = config_.receive_buffer - (buffer_.size() - buffer_begin_);
    const bool direct = config_.bytes_per_second == 0;
    if (!direct && urb.out.size() > space && space < config_.receive_buffer) return;  // NAK
    bulk_.pop_front();
    if (screen_.running()) Receive(urb.out);
    complete_(urb.id, TransferStatus::kOk, static_cast<uint32_t>(urb.out.size()), {});
  }
}

void VoxlinkDevice::Receive(std::span<const std::byte> bytes) {
  received_ += bytes.size();
  if (received_ > announced_) {
    credit_excess_ += received_ - std::max(announced_, received_ - bytes.size());
    Queue(EventType::kError, 0,
          BytesOf(voxlink::ErrorEvent{
              .code = static_cast<uint32_t>(voxlink::ErrorCode::kCreditExceeded)}));
  }
  if (config_.bytes_per_second == 0) {
    consumed_ += bytes.size();
    screen_.Consume(bytes, DeviceNow());
    return;
  }
  if (buffer_begin_ == buffer_.size()) {
    buffer_.clear();
    buffer_begin_ = 0;
    drained_at_ = DeviceNow();
  }
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

void VoxlinkDevice::DrainBuffer() {
  const sync::TimeNs end = DeviceNow();
  while (buffer_begin_ < buffer_.size()) {
    // Drain step by step, so that a sweep begins between the bytes received before and after it.
    const size_t step = std::min(buffer_.size() - buffer_begin_, kDrainStep);
    const sync::TimeNs at =
        drained_at_ +
        static_cast<sync::TimeNs>(std::ceil(static_cast<double>(step) * 1e9 /
                                            static_cast<double>(config_.bytes_per_second)));
    if (at > end) break;
    screen_.HostIsHeard(at);
    screen_.Advance(at);
    consumed_ += step;
    screen_.Consume(std::span(buffer_).subspan(buffer_begin_, step), at);
    buffer_begin_ += step;
    drained_at_ = at;
  }
  if (buffer_begin_ < buffer_.size()) screen_.HostIsHeard(end);
  if (buffer_begin_ > config_.receive_buffer) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<ptrdiff_t>(buffer_begin_));
    buffer_begin_ = 0;
  }
}

// ---- interrupt IN: §6

void VoxlinkDevice::Queue(EventType type, uint8_t flags, std::span<const std::byte> body) {
  if (type == EventType::kSweep) {
    // Only the newest sweep is useful.
    std::erase_if(events_, [](const Event& event) { return event.type == EventType::kSweep; });
  }
  if (events_.size() >= kMostEvents) {
    events_.pop_front();
    ++event_sequence_;
  }
  events_.push_back({type, flags, {body.begin(), body.end()}});
}

void VoxlinkDevice::DeliverEvents() {
  if (!screen_.running()) return;
  while (!interrupt_.empty() && !events_.empty()) {
    const Event event = std::move(events_.front());
    events_.pop_front();
    DeliverEvent(event);
  }
  if (!interrupt_.empty() && CreditLimit() - announced_ >= config_.receive_buffer / 4) {
    DeliverEvent({EventType::kCredit, 0, {}});
  }
}

void VoxlinkDevice::DeliverEvent(const Event& event) {
  announced_ = CreditLimit();
  voxlink::EventHeader header{};
  header.type = static_cast<uint8_t>(event.type);
  header.flags = event.flags;
  header.length = static_cast<uint16_t>(sizeof(header) + event.body.size());
  header.sequence = event_sequence_++;
  header.time_ns = static_cast<uint64_t>(DeviceNow());
  header.credit_limit = announced_;
  std::vector<std::byte> bytes;
  voxlink::Append(bytes, header);
  voxlink::AppendBytes(bytes, event.body);
  const Waiting urb = interrupt_.front();
  interrupt_.pop_front();
  if (bytes.size() > urb.length) {
    complete_(urb.id, TransferStatus::kOverflow, urb.length, std::span(bytes).first(urb.length));
  } else {
    complete_(urb.id, bytes.size() < urb.length ? TransferStatus::kShort : TransferStatus::kOk,
              static_cast<uint32_t>(bytes.size()), bytes);
  }
}

// ---- requests: §3 and §4

void VoxlinkDevice::Control(const Urb& urb) {
  const UsbSetup& setup = urb.setup;
  if ((setup.request_type & 0x80) != 0) {
    const std::optional<std::vector<std::byte>> reply = ReadRequest(setup);
    if (!reply) return complete_(urb.id, TransferStatus::kStall, 0, {});
    const size_t count = std::min<size_t>({setup.length, urb.length, reply->size()});
    complete_(urb.id, count < urb.length ? TransferStatus::kShort : TransferStatus::kOk,
              static_cast<uint32_t>(count), std::span(*reply).first(count));
  } else {
    const bool done = urb.out.size() == setup.length && WriteRequest(setup, urb.out);
    complete_(urb.id, done ? TransferStatus::kOk : TransferStatus::kStall,
              done ? static_cast<uint32_t>(urb.out.size()) : 0, {});
  }
  DeliverEvents();
}

std::optional<std::vector<std::byte>> VoxlinkDevice::Descriptor(uint16_t value) const {
  const size_t index = value & 0xFF;
  switch (value >> 8) {
    case 1:
      return descriptors_.device;
    case 2:
      return index == 0 ? std::optional(descriptors_.configuration) : std::nullopt;
    case 3:
      return index < descriptors_.strings.size() ? std::optional(descriptors_.strings[index])
                                                 : std::nullopt;
    case 15:
      return descriptors_.bos;
    default:
      return std::nullopt;
  }
}

std::optional<std::vector<std::byte>> VoxlinkDevice::ReadRequest(const UsbSetup& setup) {
  const auto bytes = [](std::initializer_list<uint8_t> values) {
    std::vector<std::byte> out;
    for (const uint8_t value : values) out.push_back(std::byte{value});
    return out;
  };
  switch (setup.request_type << 8 | setup.request) {
    case 0x8006:  // GET_DESCRIPTOR
      return Descriptor(setup.value);
    case 0x8000:  // GET_STATUS: self-powered
      return bytes({1, 0});
    case 0x8100:
      return bytes({0, 0});
    case 0x8200:
      return bytes({static_cast<uint8_t>(halted_.contains(setup.index & 0xFF) ? 1 : 0), 0});
    case 0x8008:  // GET_CONFIGURATION
      return bytes({configuration_});
    case 0x810A:  // GET_INTERFACE
      return bytes({0});
    case 0xC000 | voxlink::kMsVendorCode:
      if (setup.index != voxlink::kMsDescriptorIndex) return std::nullopt;
      return descriptors_.ms_os_20;
    default:
      break;
  }
  if (setup.request_type != voxlink::kRequestIn || setup.index != 0) return std::nullopt;
  switch (static_cast<Request>(setup.request)) {
    case Request::kGetCapabilities: {
      const size_t begin = setup.value * voxlink::kCapabilitiesPage;
      if (begin >= capabilities_.size()) return std::nullopt;
      const size_t end = std::min(begin + voxlink::kCapabilitiesPage, capabilities_.size());
      return std::vector<std::byte>(capabilities_.begin() + static_cast<ptrdiff_t>(begin),
                                    capabilities_.begin() + static_cast<ptrdiff_t>(end));
    }
    case Request::kGetStatus:
      if (setup.value != 0) return std::nullopt;
      return StatusBytes();
    case Request::kGetMode:
      if (setup.value != 0) return std::nullopt;
      return BytesOf(voxlink::Mode{.format = static_cast<uint8_t>(layout_.format),
                                   .sub_frames = static_cast<uint8_t>(layout_.sub_frames),
                                   .bits = static_cast<uint8_t>(layout_.bits),
                                   .reserved0 = 0,
                                   .rate_mhz = rate_mhz_,
                                   .reserved1 = {}});
    default:
      return std::nullopt;
  }
}

bool VoxlinkDevice::WriteRequest(const UsbSetup& setup, std::span<const std::byte> data) {
  switch (setup.request_type << 8 | setup.request) {
    case 0x0009:  // SET_CONFIGURATION
      if (setup.value > 1) return false;
      configuration_ = static_cast<uint8_t>(setup.value);
      halted_.clear();
      StopSession();
      return true;
    case 0x010B:  // SET_INTERFACE
      return setup.value == 0 && setup.index == 0;
    case 0x0201:  // CLEAR_FEATURE(ENDPOINT_HALT)
      if (setup.value != 0) return false;
      halted_.erase(setup.index & 0xFF);
      return true;
    case 0x0203:  // SET_FEATURE(ENDPOINT_HALT)
      if (setup.value != 0) return false;
      halted_.insert(setup.index & 0xFF);
      return true;
    case 0x0030:  // SET_SEL
    case 0x0031:  // SET_ISOCH_DELAY
      return true;
    default:
      break;
  }
  if (setup.request_type != voxlink::kRequestOut || setup.index != 0) return false;
  if (!FitsTable(setup, data.size())) return false;
  switch (static_cast<Request>(setup.request)) {
    case Request::kSetMode:
      return SetMode(data);
    case Request::kStart:
      StartSession();
      return true;
    case Request::kStop:
      StopSession();
      return true;
    case Request::kSetBrightness:
      brightness_ = setup.value;
      return true;
    case Request::kSetPowerLimit:
      power_limit_mw_ = voxlink::Load<uint32_t>(data);
      return true;
    case Request::kSetBlank:
      screen_.SetBlank(setup.value == 1);
      return true;
    default:
      return false;
  }
}

bool VoxlinkDevice::SetMode(std::span<const std::byte> data) {
  if (screen_.running()) return false;
  auto mode = voxlink::Load<voxlink::Mode>(data);
  const auto fixed = voxlink::Load<voxlink::Capabilities>(capabilities_);
  if (mode.rate_mhz == 0) mode.rate_mhz = fixed.nominal_rate_mhz;
  if (mode.format > 7 || (fixed.formats >> mode.format & 1) == 0 || mode.sub_frames < 1 ||
      mode.sub_frames > fixed.max_sub_frames || mode.rate_mhz < fixed.min_rate_mhz ||
      mode.rate_mhz > fixed.max_rate_mhz) {
    return false;
  }
  const FrameLayout layout{.slices = static_cast<int32_t>(fixed.slices),
                           .width = static_cast<int32_t>(fixed.width),
                           .height = static_cast<int32_t>(fixed.height),
                           .sub_frames = mode.sub_frames,
                           .format = static_cast<PixelFormat>(mode.format),
                           .bits = mode.bits};
  if (!ValidateFormat(layout).ok()) return false;
  layout_ = layout;
  rate_mhz_ = mode.rate_mhz;
  return true;
}

void VoxlinkDevice::StartSession() {
  StopSession();
  drained_at_ = DeviceNow();
  health_at_ = DeviceNow() + kHealthPeriod;
  const sync::TimeNs period = 1'000 * sync::kSecond / static_cast<sync::TimeNs>(rate_mhz_);
  screen_.Start(layout_, period, DeviceNow());
  Queue(
      EventType::kReady, 0,
      BytesOf(voxlink::ReadyEvent{
          .version = voxlink::kVersion, .reserved = 0, .receive_buffer = config_.receive_buffer}));
}

void VoxlinkDevice::StopSession() {
  screen_.Stop();
  buffer_.clear();
  buffer_begin_ = 0;
  received_ = consumed_ = announced_ = 0;
  events_.clear();
  event_sequence_ = 0;
}

std::vector<std::byte> VoxlinkDevice::StatusBytes() {
  voxlink::Status status{};
  status.running = screen_.running() ? 1 : 0;
  status.flags = static_cast<uint8_t>((screen_.blanked() ? voxlink::kStatusBlanked : 0) |
                                      (screen_.watchdog_dark() ? voxlink::kStatusWatchdogDark : 0));
  status.event_sequence = event_sequence_;
  status.time_ns = static_cast<uint64_t>(DeviceNow());
  status.bytes_received = received_;
  if (screen_.running()) status.credit_limit = announced_ = CreditLimit();
  status.filling = screen_.filling();
  status.last_complete = screen_.last_complete();
  status.shown = screen_.shown() ? screen_.shown()->number : 0;
  status.shown_sweep = screen_.shown_sweep();
  status.shown_start_ns = static_cast<uint64_t>(screen_.shown_start());
  status.underruns = screen_.underruns();
  status.temperature = config_.temperature;
  return BytesOf(status);
}

std::optional<DecodedVolume> VoxlinkDevice::Seen() const {
  if (!screen_.lit() || brightness_ == 0) return std::nullopt;
  DecodedVolume seen;
  seen.volume = screen_.shown()->number;
  seen.layout = layout_;
  seen.pictures = screen_.shown()->pictures;
  seen.source = DecodedVolume::Source::kReportedByDevice;
  return seen;
}

}  // namespace voxeld::display::emulator
