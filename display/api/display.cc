#include "display/api/display.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/api/pixels.h"

namespace voxeld::display {
namespace {

constexpr double kMostWatts = 1'000'000;

}  // namespace

std::vector<uint8_t> DecodedVolume::Rgb(int32_t first, int32_t count) const {
  const size_t per_slice =
      static_cast<size_t>(layout.width) * static_cast<size_t>(layout.height) * 3;
  const size_t subs = static_cast<size_t>(layout.sub_frames);
  std::vector<uint8_t> rgb(per_slice * static_cast<size_t>(count));
  std::vector<std::span<const std::byte>> of_slice(subs);
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const size_t slice = static_cast<size_t>(first) + i;
    for (size_t sub = 0; sub < subs; ++sub) of_slice[sub] = *pictures[slice * subs + sub];
    SliceToRgb(layout, of_slice, std::span(rgb).subspan(i * per_slice, per_slice));
  }
  return rgb;
}
namespace {

SliceFramePtr BlackFrame(const FrameLayout& layout) {
  auto frame = std::make_shared<SliceFrame>();
  frame->layout = layout;
  frame->bytes.resize(layout.bytes());
  frame->changed_in.resize(layout.pictures());
  return frame;
}

}  // namespace

const char* DisplayStateName(DisplayState state) {
  switch (state) {
    case DisplayState::kStopped:
      return "stopped";
    case DisplayState::kAttaching:
      return "attaching";
    case DisplayState::kShowing:
      return "showing";
    case DisplayState::kBlanked:
      return "blanked";
    case DisplayState::kLost:
      return "lost";
  }
  return "?";
}

Display::Display(DisplayInfo info, sync::Clock& clock) : info_(std::move(info)), clock_(clock) {}

absl::Status Display::Start(Listener* listener, std::function<void()> wake) {
  if (state_ != DisplayState::kStopped) {
    return absl::FailedPreconditionError(absl::StrCat("display \"", info_.name, "\" is ",
                                                      DisplayStateName(state_),
                                                      "; only a stopped one can be started"));
  }
  listener_ = listener;
  wake_ = std::move(wake);
  newest_ = presented_ = nullptr;
  full_next_ = true;
  last_volume_ = 0;
  resend_at_ = sync::kNever;
  resend_.Reset();
  SetState(DisplayState::kAttaching, "looking for the device");
  const absl::Status status = DoStart();
  if (!status.ok()) {
    SetState(DisplayState::kStopped, std::string(status.message()));
    listener_ = nullptr;
    wake_ = nullptr;
  }
  return status;
}

void Display::Stop() {
  if (state_ == DisplayState::kStopped) return;
  DoStop();
  LoseInFlight("the display was stopped", 0);
  LoseWaiting("the display was stopped");
  FinishCaptures(absl::UnavailableError("the display was stopped"));
  Unwatch();
  SetState(DisplayState::kStopped, "stopped");
  listener_ = nullptr;
  wake_ = nullptr;
}

void Display::Submit(SliceFramePtr frame) {
  if (state_ == DisplayState::kStopped || frame == nullptr) return;
  ++stats_.volumes_submitted;
  if (frame->volume <= last_volume_) {
    return ReportLost(frame->volume,
                      absl::StrCat("volume ", frame->volume, " does not follow volume ",
                                   last_volume_, ": numbers must ascend"),
                      0);
  }
  last_volume_ = frame->volume;
  const FrameLayout& layout = info_.layout;
  if (frame->layout != layout || frame->bytes.size() != layout.bytes() ||
      frame->changed_in.size() != layout.pictures()) {
    return ReportLost(frame->volume, "the volume is not of the display's layout", 0);
  }
  if (blanked_) return ReportLost(frame->volume, "blanked", 0);
  if (waiting_ != nullptr) {
    VolumeOutcome outcome;
    outcome.kind = VolumeOutcome::Kind::kReplaced;
    outcome.volume = waiting_->volume;
    outcome.replaced_by = frame->volume;
    waiting_ = nullptr;
    Report(std::move(outcome));
  }
  waiting_ = std::move(frame);
  SendNext();
}

sync::TimeNs Display::Tick() {
  if (state_ == DisplayState::kStopped) return sync::kNever;
  ExpireCaptures(clock_.Now());
  sync::TimeNs next = DoTick(clock_.Now());
  if (state_ == DisplayState::kShowing && in_flight_ == nullptr) {
    SendNext();
    if (in_flight_ != nullptr) next = clock_.Now();
    next = std::min(next, resend_at_);
  }
  for (const PendingCapture& capture : captures_) next = std::min(next, capture.deadline);
  return next;
}

absl::Status Display::SetBrightness(double brightness) {
  if (!(brightness >= 0 && brightness <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("brightness is ", brightness, "; it must be from 0 to 1"));
  }
  const absl::Status status = attached() ? DoSetBrightness(brightness) : absl::OkStatus();
  if (status.ok()) brightness_ = brightness;
  return status;
}

absl::Status Display::SetPowerLimit(double watts) {
  if (!(watts >= 0 && watts <= kMostWatts)) {
    return absl::InvalidArgumentError(
        absl::StrCat("power_limit_w is ", watts, "; it must be from 0 (none) to ", kMostWatts));
  }
  power_limit_w_ = watts;
  if (may_keep_power_limit() && (!attached() || keeps_power_limit_)) {
    if (attached()) DoSetPowerLimit(watts);
    return absl::OkStatus();
  }
  return absl::UnimplementedError(
      absl::StrCat("the device of display \"", info_.name, "\" keeps no power limit"));
}

absl::Status Display::SetBlank(bool blank) {
  if (blank == blanked_) return absl::OkStatus();
  if (attached()) {
    if (absl::Status status = DoSetBlank(blank); !status.ok()) return status;
  }
  blanked_ = blank;
  if (blank) {
    // The outcome is decided now; the driver may still finish sending, and the volume it sends is
    // what is shown when the display is unblanked.
    if (in_flight_ != nullptr && owed_) {
      owed_ = false;
      ReportLost(in_flight_->volume, "blanked", 0);
    }
    LoseWaiting("blanked");
    FinishCaptures(absl::UnavailableError("the display was blanked"));
    if (holding_ && in_flight_ != nullptr) DoDropHeld("blanked");
  }
  if (!attached()) return absl::OkStatus();
  if (blank) {
    SetState(DisplayState::kBlanked, "blanked");
  } else {
    SetState(DisplayState::kShowing, "showing");
    if (full_next_ && newest_ != nullptr && !holding_ && !held_) resend_at_ = clock_.Now();
    SendNext();
  }
  return absl::OkStatus();
}

template <typename Goes>
std::vector<Display::PendingCapture> Display::TakeCaptures(Goes goes) {
  std::vector<PendingCapture> taken;
  std::copy_if(captures_.begin(), captures_.end(), std::back_inserter(taken), goes);
  std::erase_if(captures_, goes);
  if (captures_.empty() && !watcher_) decoder_ = nullptr;
  return taken;
}

void Display::Capture(sync::TimeNs timeout, CaptureDone done, CaptureId id) {
  if (state_ != DisplayState::kShowing && state_ != DisplayState::kAttaching) {
    return done(absl::UnavailableError(absl::StrCat(
        "display \"", info_.name, "\" is ", DisplayStateName(state_), ": ", state_reason_)));
  }
  const sync::TimeNs now = clock_.Now();
  captures_.push_back(
      {timeout < sync::kNever - now ? now + timeout : sync::kNever, std::move(done), id});
  SendNext();
}

void Display::CancelCapture(CaptureId id) {
  for (const PendingCapture& capture :
       TakeCaptures([id](const PendingCapture& pending) { return pending.id == id; })) {
    capture.done(absl::CancelledError("the capture was cancelled"));
  }
}

void Display::Watch(Watcher watcher) {
  watcher_ = std::move(watcher);
  watch_due_ = true;
  SendNext();
}

void Display::Unwatch() {
  watcher_ = nullptr;
  watch_due_ = false;
  if (captures_.empty()) decoder_ = nullptr;
}

void Display::TellWatcher(const absl::StatusOr<DecodedVolume>& volume) {
  if (!watcher_) return;
  watch_due_ = false;
  const Watcher watcher = volume.ok() ? watcher_ : std::exchange(watcher_, nullptr);
  watcher(volume);
}

void Display::Attached() {
  full_next_ = true;
  resend_.Reset();
  held_ = waiting_ == nullptr && listener_->HasNewer();
  resend_at_ = newest_ != nullptr && !held_ ? clock_.Now() : sync::kNever;
  if (blanked_) {
    SetState(DisplayState::kBlanked, "blanked");
  } else {
    SetState(DisplayState::kShowing, "showing");
    SendNext();
  }
}

void Display::ShowCurrent() {
  if (!std::exchange(held_, false)) return;
  if (newest_ != nullptr) resend_at_ = clock_.Now();
  SendNext();
}

void Display::NoDevice(const std::string& reason) {
  if (state_ == DisplayState::kAttaching) SetState(state_, reason);
}

void Display::DeviceLost(const std::string& reason, uint64_t bytes) {
  SetState(DisplayState::kLost, reason);
  decoder_ = nullptr;
  full_next_ = true;
  resend_at_ = sync::kNever;
  LoseInFlight(reason, bytes);
  if (holding_) LoseWaiting(reason);  // of a genlock round that continues without this display
  FinishCaptures(absl::UnavailableError(absl::StrCat("the display was lost: ", reason)));
}

void Display::OrderShown(uint64_t volume, sync::TimeNs at, uint32_t ahead) {
  if (in_flight_ == nullptr || !in_flight_held_ || in_flight_->volume != volume) return;
  DoOrderShown(at, ahead);
}

void Display::DropHeld(uint64_t volume, const std::string& reason) {
  if (waiting_ != nullptr && waiting_->volume == volume) return LoseWaiting(reason);
  if (in_flight_ != nullptr && owed_ && in_flight_->volume == volume) DoDropHeld(reason);
}

void Display::FrameHeld() {
  in_flight_held_ = true;
  if (owed_) listener_->OnHeld(in_flight_->volume);
}

void Display::FrameStray() { listener_->OnStray(); }

void Display::FrameOrdered(sync::TimeNs at, bool taken) {
  if (in_flight_ != nullptr && owed_) listener_->OnOrdered(in_flight_->volume, at, taken);
}

void Display::FrameDone(sync::TimeNs shown_ns, Evidence evidence, sync::TimeNs last_byte_ns,
                        uint64_t bytes) {
  if (in_flight_ == nullptr) return;
  const SliceFramePtr frame = std::move(in_flight_);
  in_flight_ = nullptr;
  resend_.Reset();
  if (owed_ && due_ != 0 && shown_ns > due_ + due_period_ / 2) ++stats_.volumes_late;
  // our own black volume is not a base for the volumes that the engine counts
  full_next_ = frame->volume == 0;
  if (owed_) {
    owed_ = false;
    presented_ = frame;
    VolumeOutcome outcome;
    outcome.kind = VolumeOutcome::Kind::kPresented;
    outcome.volume = frame->volume;
    outcome.time_ns = shown_ns;
    outcome.evidence = evidence;
    outcome.last_byte_ns = last_byte_ns;
    outcome.bytes_sent = bytes;
    Report(std::move(outcome));
  }
  if (decoder_ != nullptr) {
    const absl::StatusOr<DecodedVolume> seen = Decoded(frame->volume);
    TellWatcher(seen);
    FinishCaptures(seen);
  }
  SendNext();
}

absl::StatusOr<DecodedVolume> Display::Decoded(uint64_t volume) {
  if (!decoder_status_.ok()) return decoder_status_;
  std::optional<DecodedVolume> decoded = decoder_->TakeVolume();
  if (!decoded.has_value()) {
    return absl::InternalError(absl::StrCat("the bytes sent hold no whole volume, though volume ",
                                            volume, " was reported shown"));
  }
  decoded->volume = volume;
  return *std::move(decoded);
}

void Display::FrameLost(const std::string& reason, uint64_t bytes) {
  if (in_flight_ == nullptr) return;
  full_next_ = true;
  resend_at_ = holding_ ? sync::kNever : clock_.Now() + resend_.Next();
  decoder_ = nullptr;
  LoseInFlight(reason, bytes);
  SendNext();
}

void Display::TapOut(uint8_t endpoint, std::span<const std::byte> bytes, size_t device) {
  if (decoder_ == nullptr || !decoder_status_.ok()) return;
  decoder_status_ = decoder_->OnBytes(endpoint, bytes, device);
}

void Display::SetState(DisplayState state, const std::string& reason) {
  if (state == state_ && reason == state_reason_) return;
  state_ = state;
  state_reason_ = reason;
  if (state == DisplayState::kShowing || state == DisplayState::kBlanked) {
    resend_.Reset();
  }
  if (listener_ != nullptr) listener_->OnState(state_, state_reason_);
}

void Display::Report(VolumeOutcome outcome) {
  switch (outcome.kind) {
    case VolumeOutcome::Kind::kPresented:
      ++stats_.volumes_presented;
      break;
    case VolumeOutcome::Kind::kReplaced:
      ++stats_.volumes_replaced;
      break;
    case VolumeOutcome::Kind::kLost:
      ++stats_.volumes_lost;
      break;
  }
  if (outcome.time_ns == 0) outcome.time_ns = clock_.Now();
  listener_->OnOutcome(outcome);
}

void Display::ReportLost(uint64_t volume, const std::string& reason, uint64_t bytes) {
  VolumeOutcome outcome;
  outcome.kind = VolumeOutcome::Kind::kLost;
  outcome.volume = volume;
  outcome.reason = reason;
  outcome.bytes_sent = bytes;
  Report(std::move(outcome));
}

void Display::LoseInFlight(const std::string& reason, uint64_t bytes) {
  const SliceFramePtr frame = std::move(in_flight_);
  in_flight_ = nullptr;
  if (frame != nullptr && std::exchange(owed_, false)) ReportLost(frame->volume, reason, bytes);
}

void Display::LoseWaiting(const std::string& reason) {
  const SliceFramePtr frame = std::move(waiting_);
  waiting_ = nullptr;
  if (frame != nullptr) ReportLost(frame->volume, reason, 0);
}

void Display::SendNext() {
  if (sending_) return;  // a driver that ends a volume inside DoSend returns to the loop below
  sending_ = true;
  while (state_ == DisplayState::kShowing && in_flight_ == nullptr) {
    const bool owed = waiting_ != nullptr;
    if (owed) {
      newest_ = std::move(waiting_);
      waiting_ = nullptr;
      held_ = false;
    } else {
      if (held_) break;
      const bool asked = !captures_.empty() || watch_due_;
      const bool due = resend_at_ == sync::kNever ? asked : resend_at_ <= clock_.Now();
      if (!due || (newest_ == nullptr && !asked)) break;
    }
    // A capture must not show a volume that was not ordered shown.
    const SliceFramePtr& next = holding_ && !owed ? presented_ : newest_;
    in_flight_ = next != nullptr ? next : BlackFrame(info_.layout);
    owed_ = owed;
    in_flight_held_ = false;
    due_ = 0;
    if (!holds_in_flight()) {
      const std::vector<sync::TimeNs> coming = ComingSweeps(2);
      if (coming.size() == 2) due_ = coming[0], due_period_ = coming[1] - coming[0];
    }
    resend_at_ = sync::kNever;
    // A watcher has the previous volume as the base of the next; a capture starts without one.
    const bool begins = !captures_.empty() || (watcher_ && decoder_ == nullptr);
    if (begins || !watcher_) {
      decoder_status_ = absl::OkStatus();
      decoder_ = begins ? DoMakeDecoder() : nullptr;
    }
    DoSend(SliceFramePtr(in_flight_), full_next_ || begins);
  }
  sending_ = false;
}

void Display::FinishCaptures(const absl::StatusOr<DecodedVolume>& result) {
  if (!watcher_) decoder_ = nullptr;
  const std::vector<PendingCapture> captures = std::move(captures_);
  captures_.clear();
  for (const PendingCapture& capture : captures) capture.done(result);
}

void Display::ExpireCaptures(sync::TimeNs now) {
  for (const PendingCapture& capture :
       TakeCaptures([now](const PendingCapture& pending) { return pending.deadline <= now; })) {
    capture.done(absl::DeadlineExceededError(
        absl::StrCat("no volume was shown in time; display \"", info_.name, "\" is ",
                     DisplayStateName(state_), ": ", state_reason_)));
  }
}

}  // namespace voxeld::display
