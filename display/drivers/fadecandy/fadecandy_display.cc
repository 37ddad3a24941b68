#include "display/drivers/fadecandy/fadecandy_display.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/fadecandy/decoder.h"

namespace voxeld::display::fadecandy {
namespace {

// Limits a fade to this many volumes' time.
constexpr double kLongestFade = 2;

}  // namespace

FadecandyDisplay::FadecandyDisplay(DisplayInfo info, Settings settings, std::vector<Wire> wires,
                                   sync::Clock& clock)
    : Display(std::move(info), clock), settings_(settings) {
  for (Wire& wire : wires) {
    boards_.push_back(
        std::make_unique<Board>(std::move(wire.transport), std::move(wire.serial), clock,
                                [this](const Board& board, std::span<const std::byte> bytes,
                                       bool video) { OnBytes(board, bytes, video); }));
    boards_.back()->set_slice(boards_.size() - 1);
  }
}

FadecandyDisplay::~FadecandyDisplay() { Stop(); }

// ---- life

absl::Status FadecandyDisplay::DoStart() {
  for (const auto& board : boards_) board->transport().SetWake([this] { Wake(); });
  phase_ = Phase::kDetached;
  attach_at_ = clock().Now();
  failed_at_ = 0;
  retry_.Reset();
  had_frame_ = false;
  Wake();
  return absl::OkStatus();
}

void FadecandyDisplay::DoStop() {
  for (const auto& board : boards_) {
    if (phase_ == Phase::kReady) board->Darken();
    board->transport().SetWake(nullptr);
    board->Close();
  }
  phase_ = Phase::kDetached;
  sending_ = Sending{};
}

void FadecandyDisplay::Detach(sync::TimeNs now, const std::string& reason) {
  for (const auto& board : boards_) board->Close();
  phase_ = Phase::kDetached;
  failed_at_ = now;
  attach_at_ = now + retry_.Next();
  const Sending lost = std::exchange(sending_, Sending{});
  DeviceLost(reason, lost.bytes);
}

sync::TimeNs FadecandyDisplay::DoTick(sync::TimeNs now) {
  for (const auto& board : boards_) board->Poll();
  CheckBoards(now);
  if (phase_ == Phase::kDetached) {
    bool arrived = false;
    for (const auto& board : boards_) arrived |= board->transport().TakeArrival();
    // A board that comes and goes is retried no faster than one that fails.
    if (arrived) attach_at_ = std::min(attach_at_, failed_at_ + retry_.first());
    if (now >= attach_at_) TryAttach(now);
  }
  Advance();
  const sync::TimeNs next = Pump();
  return phase_ == Phase::kDetached ? attach_at_ : next;
}

void FadecandyDisplay::CheckBoards(sync::TimeNs now) {
  if (phase_ == Phase::kDetached) return;
  for (const auto& board : boards_) {
    mutable_stats().slices_resent += board->TakeReloads();
    mutable_stats().transfers_failed += board->TakeFailures();
    if (!board->failure().empty()) {
      return Detach(now, absl::StrCat(board->Name(), ": ", board->failure()));
    }
  }
}

sync::TimeNs FadecandyDisplay::Pump() {
  sync::TimeNs next = sync::kNever;
  for (const auto& board : boards_) {
    next = std::min(next, board->Pump());
    if (!board->failure().empty()) next = clock().Now();
  }
  return next;
}

void FadecandyDisplay::OnBytes(const Board& board, std::span<const std::byte> bytes, bool video) {
  mutable_stats().bytes_out += bytes.size();
  if (!video) return;
  sending_.bytes += bytes.size();
  TapOut(kBulkOut, bytes, board.slice());
}

// ---- attach: docs/protocols/fadecandy.md §10

void FadecandyDisplay::TryAttach(sync::TimeNs now) {
  for (const auto& board : boards_) {
    const absl::Status status = board->Open();
    if (status.ok()) continue;
    const std::string reason = absl::StrCat(board->Name(), ": ", status.message());
    // Until a device was found once, keep looking for it.
    if (!absl::IsNotFound(status) || state() != DisplayState::kAttaching)
      return Detach(now, reason);
    NoDevice(reason);
    for (const auto& other : boards_) other->Close();
    failed_at_ = now;
    attach_at_ = now + retry_.Next();
    return;
  }
  Sort();
  phase_ = Phase::kSettingUp;
  complete_frame_ = 0;
  whole_ = !had_frame_;
  dark_ = blanked();
  for (const auto& board : boards_) {
    board->Configure(settings_.flags);
    if (!had_frame_) board->Blacken();
  }
  SetLuts(brightness());
}

void FadecandyDisplay::Sort() {
  const auto any = [](const auto& board) { return board->any_serial(); };
  if (!std::all_of(boards_.begin(), boards_.end(), any)) return;
  std::stable_sort(boards_.begin(), boards_.end(),
                   [](const auto& a, const auto& b) { return a->Serial() < b->Serial(); });
  for (size_t b = 0; b < boards_.size(); ++b) boards_[b]->set_slice(b);
}

void FadecandyDisplay::SetLuts(double brightness) {
  lut_brightness_ = brightness;
  const auto lut = std::make_shared<const Lut>(
      MakeLut(settings_.curve, dark_ ? 0 : brightness * settings_.full_brightness));
  for (const auto& board : boards_) board->SetLut(lut);
}

absl::Status FadecandyDisplay::DoSetBrightness(double brightness) {
  SetLuts(brightness);
  Pump();
  return absl::OkStatus();
}

absl::Status FadecandyDisplay::DoSetBlank(bool blank) {
  // Unblank with a complete image: if none exists yet, after the next volume.
  dark_ = blank || !whole_;
  SetLuts(brightness());
  Pump();
  return absl::OkStatus();
}

std::unique_ptr<WireDecoder> FadecandyDisplay::DoMakeDecoder() const {
  return std::make_unique<FadecandyDecoder>(info().layout);
}

// ---- volumes

void FadecandyDisplay::DoSend(const SliceFramePtr& frame, bool full) {
  const sync::TimeNs now = clock().Now();
  const auto longest_fade = static_cast<sync::TimeNs>(
      kLongestFade * static_cast<double>(sync::kSecond) / info().volumes_per_second);
  const bool fades = (settings_.flags & kNoInterpolation) == 0;
  sending_ = Sending{};
  sending_.frame = frame;
  sending_.last_byte_ns = now;
  had_frame_ |= frame->volume != 0;
  for (size_t b = 0; b < boards_.size(); ++b) {
    if (!full && frame->changed_in[b] <= complete_frame_) continue;
    const sync::TimeNs shown = boards_[b]->shown_ns();
    boards_[b]->Load(std::span(frame->bytes).subspan(b * kFrameBytes, kFrameBytes),
                     fades && (shown == 0 || now - shown > longest_fade));
    sending_.boards.push_back(b);
  }
  mutable_stats().slices_sent += sending_.boards.size();
  if (sending_.boards.empty()) return Done();
  Pump();
}

void FadecandyDisplay::Advance() {
  if (phase_ == Phase::kSettingUp &&
      std::all_of(boards_.begin(), boards_.end(), [](const auto& b) { return b->set_up(); })) {
    phase_ = Phase::kReady;
    ++mutable_stats().attaches;
    // Apply settings that were requested while the boards were set up.
    if (brightness() != lut_brightness_ || blanked() != dark_) {
      dark_ = blanked() || (dark_ && !whole_);  // as in SetBlank
      SetLuts(brightness());
    }
    Attached();
  }
  if (sending_.frame == nullptr) return;
  // Send the last packets together, when all boards have everything else.
  const auto every = [this](auto holds) {
    return std::all_of(sending_.boards.begin(), sending_.boards.end(),
                       [&](size_t b) { return holds(*boards_[b]); });
  };
  if (every([](const Board& b) { return b.shown(); })) return Done();
  if (!every([](const Board& b) { return b.loaded() || b.shown(); })) return;
  sending_.last_byte_ns = clock().Now();
  for (const size_t b : sending_.boards) {
    if (boards_[b]->loaded()) boards_[b]->Show();
  }
}

void FadecandyDisplay::Done() {
  const Sending done = std::exchange(sending_, Sending{});
  complete_frame_ = done.frame->volume;
  whole_ = true;
  retry_.Reset();
  if (dark_ && !blanked()) {
    dark_ = false;
    SetLuts(brightness());
  }
  FrameDone(clock().Now(), Evidence::kEstimated, done.last_byte_ns, done.bytes);
}

}  // namespace voxeld::display::fadecandy
