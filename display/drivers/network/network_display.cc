#include "display/drivers/network/network_display.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "display/drivers/network/decoder.h"

namespace voxeld::display::network {
namespace {

// If no controller is at the address, the network reports that within this time.
constexpr sync::TimeNs kProof = 50 * sync::kMillisecond;
// The kernel had no room for a datagram: it has some once others were sent.
constexpr sync::TimeNs kAgain = sync::kMillisecond;
// How often to check for returned errors.
constexpr sync::TimeNs kLook = 100 * sync::kMillisecond;
constexpr int kEndPackets = 3;  // E1.31 §6.2.6

std::array<uint8_t, 256> ScaleOf(double brightness) {
  std::array<uint8_t, 256> scale{};
  for (size_t v = 0; v < scale.size(); ++v) {
    scale[v] = static_cast<uint8_t>(std::lround(static_cast<double>(v) * brightness));
  }
  return scale;
}

}  // namespace

NetworkDisplay::NetworkDisplay(DisplayInfo info, Settings settings, std::unique_ptr<Link> link,
                               sync::Clock& clock)
    : Display(std::move(info), clock),
      settings_(std::move(settings)),
      link_(std::move(link)),
      writer_(settings_.stream, this->info().layout.width),
      picture_(this->info().layout.bytes()),
      scale_(ScaleOf(1)) {}

NetworkDisplay::~NetworkDisplay() { Stop(); }

sync::TimeNs NetworkDisplay::period() const {
  return static_cast<sync::TimeNs>(static_cast<double>(sync::kSecond) / info().volumes_per_second);
}

// ---- life

absl::Status NetworkDisplay::DoStart() {
  link_->SetWake([this] { Wake(); });
  phase_ = Phase::kClosed;
  open_at_ = clock().Now();
  retry_.Reset();
  picture_.assign(picture_.size(), 0);
  complete_frame_ = 0;
  Wake();
  return absl::OkStatus();
}

// Turns off the lights and ends the stream, as far as the kernel has room.
void NetworkDisplay::DoStop() {
  if (phase_ == Phase::kReady && taken_ == 0) {
    picture_.assign(picture_.size(), 0);
    queue_.clear();
    QueueWhole();
    for (int i = 0; i < kEndPackets; ++i) {
      for (int32_t slice = 0; slice < info().layout.slices; ++slice) {
        std::vector<std::byte> end = writer_.End(slice, LightOf(slice));
        if (!end.empty()) queue_.push_back({std::move(end), false});
      }
    }
    while (!queue_.empty()) {
      const absl::StatusOr<size_t> sent = link_->Send(queue_.front().bytes);
      if (!sent.ok() || *sent < queue_.front().bytes.size()) break;
      queue_.pop_front();
    }
  }
  link_->SetWake(nullptr);
  link_->Close();
  phase_ = Phase::kClosed;
  queue_.clear();
  taken_ = 0;
  sending_ = Sending{};
}

void NetworkDisplay::Fail(sync::TimeNs now, const std::string& reason) {
  link_->Close();
  phase_ = Phase::kClosed;
  open_at_ = now + retry_.Next();
  queue_.clear();
  taken_ = 0;
  const Sending lost = std::exchange(sending_, Sending{});
  if (state() == DisplayState::kAttaching) return NoDevice(reason);
  if (state() != DisplayState::kLost) DeviceLost(reason, lost.bytes);
}

void NetworkDisplay::Open(sync::TimeNs now) {
  if (const absl::Status status = link_->Open(); !status.ok()) {
    return Fail(now, std::string(status.message()));
  }
  phase_ = Phase::kOpening;
}

void NetworkDisplay::LookAtLink(sync::TimeNs now) {
  if (phase_ == Phase::kClosed) return;
  const absl::StatusOr<Link::State> link = link_->Poll();
  if (!link.ok()) return Fail(now, std::string(link.status().message()));
  if (phase_ == Phase::kOpening && *link == Link::State::kOpen) {
    phase_ = Phase::kProving;
    proved_at_ = sync::kNever;
    SetLight(brightness(), blanked());
    // Repeat the former content, or black if there was none.
    QueueWhole();
    if (writer_.Leap()) QueueWhole();
  }
  if (phase_ == Phase::kProving && queue_.empty()) {
    if (proved_at_ == sync::kNever) proved_at_ = datagrams() ? now + kProof : now;
    if (now < proved_at_) return;
    phase_ = Phase::kReady;
    if (SetLight(brightness(), blanked())) QueueWhole();
    ++mutable_stats().attaches;
    Attached();
  }
}

sync::TimeNs NetworkDisplay::DoTick(sync::TimeNs now) {
  if (phase_ == Phase::kClosed && now >= open_at_) Open(now);
  LookAtLink(now);
  if (phase_ == Phase::kClosed) return open_at_;
  if (phase_ == Phase::kOpening) return now + kLook;
  const bool silent =
      datagrams() && phase_ == Phase::kReady && queue_.empty() && now - last_sent_ >= kRefreshNs;
  if (silent) QueueWhole();
  sync::TimeNs next = Pump(now);
  if (phase_ == Phase::kClosed) return open_at_;
  if (phase_ == Phase::kProving && queue_.empty()) {
    next = std::min(next, proved_at_ == sync::kNever ? now : proved_at_);
  }
  next = std::min(next, Finish(now));
  const sync::TimeNs look =
      datagrams() ? std::min(now + kLook, last_sent_ + kRefreshNs) : now + kLook;
  return std::min(next, std::max(look, now + kAgain));
}

// ---- packets

bool NetworkDisplay::SetLight(double brightness, bool dark) {
  if (brightness == lit_brightness_ && dark == dark_) return false;
  lit_brightness_ = brightness;
  dark_ = dark;
  scale_ = ScaleOf(brightness);
  return true;
}

std::vector<uint8_t> NetworkDisplay::LightOf(int32_t slice) const {
  const size_t bytes = info().layout.bytes_per_slice();
  const uint8_t* const from = picture_.data() + static_cast<size_t>(slice) * bytes;
  std::vector<uint8_t> light(bytes);
  if (dark_) return light;
  for (size_t i = 0; i < bytes; ++i) {
    light[i] = scale_[from[i / 3 * 3 + settings_.order[i % 3]]];
  }
  return light;
}

void NetworkDisplay::QueueSlices(const std::vector<int32_t>& slices, bool of_volume) {
  for (size_t i = 0; i < slices.size(); ++i) {
    queue_.push_back(
        {writer_.Pixels(slices[i], LightOf(slices[i]), i + 1 == slices.size()), of_volume});
  }
  if (std::vector<std::byte> sync = writer_.Sync(); !sync.empty()) {
    queue_.push_back({std::move(sync), of_volume});
  }
}

void NetworkDisplay::QueueWhole() {
  std::vector<int32_t> all(static_cast<size_t>(info().layout.slices));
  std::iota(all.begin(), all.end(), 0);
  QueueSlices(all, false);
}

sync::TimeNs NetworkDisplay::Pump(sync::TimeNs now) {
  while (!queue_.empty()) {
    const Packet& packet = queue_.front();
    const absl::StatusOr<size_t> sent = link_->Send(std::span(packet.bytes).subspan(taken_));
    if (!sent.ok()) {
      Fail(now, std::string(sent.status().message()));
      return open_at_;
    }
    mutable_stats().bytes_out += *sent;
    if (packet.volume) sending_.bytes += *sent;
    taken_ += *sent;
    if (taken_ < packet.bytes.size()) return datagrams() ? now + kAgain : sync::kNever;
    if (packet.volume) {
      TapOut(0, packet.bytes);
      sending_.last_byte_ns = now;
    }
    last_sent_ = now;
    taken_ = 0;
    queue_.pop_front();
  }
  return sync::kNever;
}

// ---- volumes

void NetworkDisplay::DoSend(const SliceFramePtr& frame, bool full) {
  const sync::TimeNs now = clock().Now();
  sending_ = Sending{frame, now, now, 0};
  std::vector<int32_t> slices;
  const size_t bytes = info().layout.bytes_per_slice();
  for (int32_t slice = 0; slice < info().layout.slices; ++slice) {
    const size_t s = static_cast<size_t>(slice);
    if (!full && frame->changed_in[s] <= complete_frame_) continue;
    std::transform(frame->bytes.begin() + static_cast<ptrdiff_t>(s * bytes),
                   frame->bytes.begin() + static_cast<ptrdiff_t>((s + 1) * bytes),
                   picture_.begin() + static_cast<ptrdiff_t>(s * bytes),
                   [](std::byte b) { return std::to_integer<uint8_t>(b); });
    slices.push_back(slice);
  }
  mutable_stats().slices_sent += slices.size();
  if (!slices.empty()) QueueSlices(slices, true);
  Wake();
}

// A volume is shown from its last packet on, and lasts its period before the next one is sent:
// nothing else paces a network.
sync::TimeNs NetworkDisplay::Finish(sync::TimeNs now) {
  if (sending_.frame == nullptr || !queue_.empty()) return sync::kNever;
  const sync::TimeNs end = sending_.begin_ns + period();
  if (now < end) return end;
  const Sending done = std::exchange(sending_, Sending{});
  complete_frame_ = done.frame->volume;
  retry_.Reset();
  FrameDone(done.last_byte_ns, Evidence::kEstimated, done.last_byte_ns, done.bytes);
  return now;
}

absl::Status NetworkDisplay::DoSetBrightness(double brightness) {
  if (SetLight(brightness, dark_)) QueueWhole();
  Wake();
  return absl::OkStatus();
}

absl::Status NetworkDisplay::DoSetBlank(bool blank) {
  if (SetLight(lit_brightness_, blank)) QueueWhole();
  Wake();
  return absl::OkStatus();
}

std::unique_ptr<WireDecoder> NetworkDisplay::DoMakeDecoder() const {
  return std::make_unique<NetworkDecoder>(info().layout, settings_.stream, settings_.order);
}

std::vector<sync::TimeNs> NetworkDisplay::ComingSweeps(int count) const {
  std::vector<sync::TimeNs> sweeps;
  if (phase_ != Phase::kReady) return sweeps;
  const sync::TimeNs now = clock().Now();
  const sync::TimeNs first =
      sending_.frame != nullptr ? std::max(now, sending_.begin_ns + period()) : now;
  for (int i = 0; i < count; ++i) sweeps.push_back(first + i * period());
  return sweeps;
}

}  // namespace voxeld::display::network
