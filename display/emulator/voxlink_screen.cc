#include "display/emulator/voxlink_screen.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace voxeld::display::emulator {
namespace {

using voxlink::BytesOf;
using voxlink::ErrorCode;
using voxlink::EventType;
using voxlink::PacketHeader;
using voxlink::PacketType;
using voxlink::PictureRun;
using voxlink::Reason;

// §6: lists at most this many runs; neighbours with the smallest gap between them are joined first.
void JoinRuns(std::vector<PictureRun>& runs) {
  constexpr size_t kMostRuns = voxlink::kRunsPerEvent * voxlink::kMostMissingEvents;
  if (runs.size() <= kMostRuns) return;
  std::vector<uint32_t> gaps;
  for (size_t i = 1; i < runs.size(); ++i) {
    gaps.push_back(runs[i].first - (runs[i - 1].first + runs[i - 1].count));
  }
  const size_t joins = runs.size() - kMostRuns;
  std::nth_element(gaps.begin(), gaps.begin() + static_cast<ptrdiff_t>(joins - 1), gaps.end());
  const uint32_t widest = gaps[joins - 1];
  std::vector<PictureRun> joined;
  for (const PictureRun& run : runs) {
    if (!joined.empty() && run.first - (joined.back().first + joined.back().count) <= widest) {
      joined.back().count = run.first + run.count - joined.back().first;
    } else {
      joined.push_back(run);
    }
  }
  runs = std::move(joined);
}

}  // namespace

VoxlinkScreen::VoxlinkScreen(uint32_t max_payload, bool watchdog, Emit emit)
    : watchdog_(watchdog), emit_(std::move(emit)), parser_(max_payload) {}

void VoxlinkScreen::Start(const FrameLayout& layout, sync::TimeNs period, sync::TimeNs now) {
  Stop();
  layout_ = layout;
  assembler_.emplace(layout);
  period_ = period;
  epoch_ = now;
  now_ = now;
  heard_ = now;
  running_ = true;
}

void VoxlinkScreen::Stop() {
  running_ = false;
  parser_.Reset();
  assembler_.reset();
  base_ = nullptr;
  waiting_.reset();
  shown_ = nullptr;
  shown_sweep_ = 0;
  shown_start_ = 0;
  last_begun_ = refused_ = complained_ = 0;
  sequence_ = 0;
  sweep_ = 0;
  volumes_shown_ = 0;
  underruns_ = 0;
  watchdog_dark_ = false;
}

void VoxlinkScreen::Consume(std::span<const std::byte> bytes, sync::TimeNs now) {
  now_ = now;
  if (running_) parser_.Feed(bytes, *this);
}

void VoxlinkScreen::HostIsHeard(sync::TimeNs now) {
  heard_ = now;
  SetWatchdogDark(false);
}

void VoxlinkScreen::SetBlank(bool blank) {
  if (blank == blanked_) return;
  blanked_ = blank;
  if (!running_) return;
  emit_(EventType::kLight, 0,
        BytesOf(voxlink::LightEvent{.lit = blank || watchdog_dark_ ? 0u : 1u,
                                    .reason = blank ? 2u : 4u}));
}

void VoxlinkScreen::SetWatchdogDark(bool dark) {
  if (dark == watchdog_dark_) return;
  watchdog_dark_ = dark;
  emit_(EventType::kLight, 0,
        BytesOf(voxlink::LightEvent{.lit = dark || blanked_ ? 0u : 1u, .reason = dark ? 1u : 3u}));
}

void VoxlinkScreen::Advance(sync::TimeNs now) {
  if (!running_) return;
  while (true) {
    const sync::TimeNs sweep_start = epoch_ + static_cast<sync::TimeNs>(sweep_ + 1) * period_;
    const sync::TimeNs dark_at =
        watchdog_ && !watchdog_dark_ ? heard_ + voxlink::kWatchdogNs : sync::kNever;
    if (std::min(sweep_start, dark_at) > now) break;
    if (dark_at <= sweep_start) {
      silence_ = now - heard_;
      SetWatchdogDark(true);
      continue;
    }
    BeginSweep(++sweep_, sweep_start);
    // After a long pause nothing new can have come for the skipped sweeps.
    const auto behind = static_cast<uint64_t>((now - sweep_start) / period_);
    if (behind > 64 && !(waiting_ && waiting_->show)) sweep_ += behind - 1;
  }
  now_ = now;
}

sync::TimeNs VoxlinkScreen::NextTimeout() const {
  if (!running_) return sync::kNever;
  sync::TimeNs next = epoch_ + static_cast<sync::TimeNs>(sweep_ + 1) * period_;
  if (watchdog_ && !watchdog_dark_) next = std::min(next, heard_ + voxlink::kWatchdogNs);
  return next;
}

void VoxlinkScreen::BeginSweep(uint64_t sweep, sync::TimeNs start) {
  if (waiting_ && waiting_->show && waiting_->sweep <= sweep) {
    shown_ = std::move(waiting_->volume);
    ++volumes_shown_;
    waiting_.reset();
    shown_sweep_ = sweep;
    shown_start_ = start;
    emit_(EventType::kShown, blanked_ || watchdog_dark_ ? voxlink::kShownDark : 0,
          BytesOf(voxlink::ShownEvent{
              .volume = shown_->number, .sweep = sweep, .start_ns = static_cast<uint64_t>(start)}));
  } else if (shown_ != nullptr && assembler_->filling()) {
    ++underruns_;
    emit_(EventType::kUnderrun, 0,
          BytesOf(voxlink::UnderrunEvent{.sweep = sweep, .total = underruns_, .reserved = 0}));
  }
  emit_(EventType::kSweep, 0,
        BytesOf(voxlink::SweepEvent{.sweep = sweep,
                                    .start_ns = static_cast<uint64_t>(start),
                                    .shown = shown_ ? shown_->number : 0,
                                    .period_ns = static_cast<uint32_t>(period_),
                                    .underruns = underruns_}));
}

void VoxlinkScreen::Hear(const PacketHeader& header) {
  HostIsHeard(now_);
  if (header.sequence != sequence_) {
    EmitError(ErrorCode::kSequence, header, header.sequence - sequence_);
  }
  sequence_ = header.sequence + 1;
}

void VoxlinkScreen::OnSkipped(size_t bytes) {
  EmitError(ErrorCode::kBadHeader, PacketHeader{}, static_cast<uint32_t>(bytes));
}

void VoxlinkScreen::OnBadPayload(const PacketHeader& header) {
  Hear(header);
  EmitError(ErrorCode::kBadPayload, header, header.length);
}

void VoxlinkScreen::OnPacket(const PacketHeader& header, std::span<const std::byte> payload) {
  Hear(header);
  const auto type = static_cast<PacketType>(header.type);
  const bool plain = type == PacketType::kEnd || type == PacketType::kAbort ||
                     type == PacketType::kDrop || type == PacketType::kKeepalive;
  if ((plain && !payload.empty()) ||
      (type == PacketType::kShow && payload.size() != ((header.flags & voxlink::kShowAhead) != 0
                                                           ? sizeof(voxlink::ShowAheadPayload)
                                                           : sizeof(voxlink::ShowPayload)))) {
    return EmitError(ErrorCode::kBadLength, header, header.length);
  }
  switch (type) {
    case PacketType::kBegin:
      return Begin(header, payload);
    case PacketType::kSlice:
      return Slice(header, payload);
    case PacketType::kEnd:
      return End(header);
    case PacketType::kAbort:
      return Abort(header);
    case PacketType::kShow:
      return Show(header, payload);
    case PacketType::kDrop:
      return Drop(header);
    case PacketType::kKeepalive:
      return;
  }
  EmitError(ErrorCode::kUnknownType, header, header.type);
}

void VoxlinkScreen::Begin(const PacketHeader& header, std::span<const std::byte> payload) {
  const auto refuse = [&](Reason reason, ErrorCode code) {
    refused_ = header.volume;
    refused_reason_ = reason;
    if (code != ErrorCode::kNone) EmitError(code, header, header.length);
    EmitVolume(EventType::kAborted, header.volume, reason);
  };
  if (assembler_->filling() && assembler_->number() != header.volume) {
    EmitVolume(EventType::kAborted, assembler_->number(), Reason::kSuperseded);
  } else if (!assembler_->filling() && header.volume <= last_begun_) {
    return refuse(Reason::kMalformed, ErrorCode::kBadOrder);
  }
  const uint64_t aborted = assembler_->number();
  assembler_->Clear();
  if (header.volume < aborted) return refuse(Reason::kMalformed, ErrorCode::kBadOrder);
  if (payload.size() < sizeof(voxlink::BeginPayload)) {
    return refuse(Reason::kMalformed, ErrorCode::kBadLength);
  }
  const uint64_t base = voxlink::Load<voxlink::BeginPayload>(payload).base;
  if (base != 0 && base != last_complete()) return refuse(Reason::kBadBase, ErrorCode::kNone);
  const ErrorCode code = assembler_->Begin(header, payload, base == 0 ? nullptr : base_);
  if (code != ErrorCode::kNone) return refuse(Reason::kMalformed, code);
  last_begun_ = header.volume;
}

void VoxlinkScreen::Slice(const PacketHeader& header, std::span<const std::byte> payload) {
  if (header.volume == refused_ || header.volume == last_complete()) return;
  const ErrorCode code = assembler_->Slice(header, payload);
  if (code == ErrorCode::kNone) return;
  if (code == ErrorCode::kNotFilling &&
      std::exchange(complained_, header.volume) == header.volume) {
    return;
  }
  EmitError(code, header, header.offset);
}

void VoxlinkScreen::End(const PacketHeader& header) {
  if (header.volume != 0 && header.volume == last_complete()) {
    return emit_(EventType::kComplete, 0, BytesOf(voxlink::CompleteEvent{.volume = header.volume}));
  }
  if (header.volume == 0 || header.volume != assembler_->number()) {
    return EmitVolume(EventType::kAborted, header.volume,
                      header.volume == refused_ ? refused_reason_ : Reason::kUnknownVolume);
  }
  voxlink::VolumePtr volume = assembler_->Finish();
  if (volume == nullptr) return EmitMissing();
  assembler_->Clear();
  if (waiting_) EmitVolume(EventType::kDropped, waiting_->volume->number, Reason::kSuperseded);
  base_ = volume;
  waiting_ = Waiting{.volume = std::move(volume), .show = (header.flags & voxlink::kEndShow) != 0};
  emit_(EventType::kComplete, 0, BytesOf(voxlink::CompleteEvent{.volume = header.volume}));
}

void VoxlinkScreen::Abort(const PacketHeader& header) {
  if (header.volume == last_complete()) return;
  if (header.volume == assembler_->number()) assembler_->Clear();
  EmitVolume(EventType::kAborted, header.volume, Reason::kByHost);
}

void VoxlinkScreen::Show(const PacketHeader& header, std::span<const std::byte> payload) {
  if (!waiting_ || waiting_->volume->number != header.volume) {
    return EmitVolume(EventType::kDropped, header.volume, Reason::kUnknownVolume);
  }
  if ((header.flags & voxlink::kShowAhead) == 0) {
    waiting_->show = true;
    waiting_->sweep = voxlink::Load<voxlink::ShowPayload>(payload).sweep;
    return;
  }
  const auto order = voxlink::Load<voxlink::ShowAheadPayload>(payload);
  const bool taken = order.sweep >= sweep_ && order.sweep - sweep_ >= order.ahead;
  if (taken) {
    waiting_->show = true;
    waiting_->sweep = order.sweep;
  }
  emit_(EventType::kOrdered, taken ? voxlink::kOrderTaken : 0,
        BytesOf(voxlink::OrderedEvent{.volume = header.volume, .sweep = order.sweep}));
}

void VoxlinkScreen::Drop(const PacketHeader& header) {
  if (!waiting_ || waiting_->volume->number != header.volume) {
    return EmitVolume(EventType::kDropped, header.volume, Reason::kUnknownVolume);
  }
  waiting_.reset();
  base_ = nullptr;
  EmitVolume(EventType::kDropped, header.volume, Reason::kByHost);
}

void VoxlinkScreen::EmitMissing() {
  std::vector<PictureRun> runs = assembler_->Missing();
  JoinRuns(runs);
  for (size_t at = 0; at < runs.size(); at += voxlink::kRunsPerEvent) {
    voxlink::MissingEvent event{};
    event.volume = assembler_->number();
    event.runs = static_cast<uint32_t>(std::min(voxlink::kRunsPerEvent, runs.size() - at));
    for (size_t i = 0; i < event.runs; ++i) event.run[i] = runs[at + i];
    const bool last = at + event.runs == runs.size();
    emit_(EventType::kMissing, last ? voxlink::kMissingLast : 0, BytesOf(event));
  }
}

void VoxlinkScreen::EmitVolume(EventType type, uint64_t volume, Reason reason) {
  emit_(type, 0,
        BytesOf(voxlink::VolumeEvent{
            .volume = volume, .reason = static_cast<uint32_t>(reason), .reserved = 0}));
}

void VoxlinkScreen::EmitError(ErrorCode code, const PacketHeader& header, uint32_t detail) {
  ++errors_;
  emit_(EventType::kError, 0,
        BytesOf(voxlink::ErrorEvent{
            .code = static_cast<uint32_t>(code),
            .sequence = header.sequence,
            .volume = header.volume,
            .picture = header.slice * static_cast<uint32_t>(layout_.sub_frames) + header.sub_frame,
            .detail = detail}));
}

}  // namespace voxeld::display::emulator
