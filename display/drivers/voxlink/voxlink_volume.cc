// How VoxlinkDisplay sends volumes: docs/protocols/voxlink.md §5 and §10.

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/voxlink/voxlink_display.h"

namespace voxeld::display::voxlink {
namespace {

constexpr sync::TimeNs kAnswerLimit = 500 * sync::kMillisecond;
constexpr int kMostQueries = 4;

}  // namespace

void VoxlinkDisplay::DoSend(const SliceFramePtr& frame, bool full) {
  Begin(frame, full);
  Pump();
}

void VoxlinkDisplay::Begin(const SliceFramePtr& frame, bool full) {
  // Keep the counts of this frame (it may be sent again under another number).
  const uint64_t bytes = sending_.bytes;
  const int rounds = sending_.rounds;
  sending_ = Sending{};
  sending_.bytes = bytes;
  sending_.rounds = rounds;
  sending_.stage = Stage::kBegin;
  sending_.number = ++last_number_;
  sending_.hold = holds_in_flight();
  sending_.base = full ? 0 : complete_number_;
  const size_t pictures = info().layout.pictures();
  sending_.announced.assign(pictures, true);
  sending_.pictures.reserve(pictures);
  for (size_t p = 0; p < pictures; ++p) {
    if (sending_.base != 0 && frame->changed_in[p] <= complete_frame_) {
      sending_.announced[p] = false;
    } else {
      sending_.pictures.push_back(static_cast<uint32_t>(p));
    }
  }
  mutable_stats().slices_sent += sending_.pictures.size();
}

size_t VoxlinkDisplay::NextPacketSize() const {
  switch (sending_.stage) {
    case Stage::kBegin:
      return sizeof(PacketHeader) + sizeof(BeginPayload) +
             (sending_.base == 0 ? 0 : (sending_.announced.size() + 7) / 8);
    case Stage::kPictures:
      return sizeof(PacketHeader) +
             std::min(fragment_, info().layout.bytes_per_slice() - sending_.offset);
    default:
      return sizeof(PacketHeader);
  }
}

void VoxlinkDisplay::WritePacket(TransferBytes& out) {
  const FrameLayout& layout = info().layout;
  switch (sending_.stage) {
    case Stage::kBegin: {
      std::vector<std::byte> bitmap;
      if (sending_.base != 0) {
        bitmap.resize((sending_.announced.size() + 7) / 8);
        for (size_t p = 0; p < sending_.announced.size(); ++p) {
          if (sending_.announced[p]) bitmap[p / 8] |= std::byte{1} << (p % 8);
        }
      }
      writer_.Begin(out, sending_.number, sending_.base,
                    static_cast<uint32_t>(sending_.announced.size()), bitmap);
      sending_.stage = sending_.pictures.empty() ? Stage::kEnd : Stage::kPictures;
      return;
    }
    case Stage::kPictures: {
      const size_t subs = static_cast<size_t>(layout.sub_frames);
      const size_t size = layout.bytes_per_slice();
      const size_t picture = sending_.pictures[sending_.next];
      const size_t length = std::min(fragment_, size - sending_.offset);
      writer_.Slice(
          out, sending_.number, static_cast<uint32_t>(picture / subs),
          static_cast<uint16_t>(picture % subs), static_cast<uint32_t>(sending_.offset),
          std::span(in_flight()->bytes).subspan(picture * size + sending_.offset, length));
      sending_.offset += length;
      if (sending_.offset < size) return;
      sending_.offset = 0;
      if (++sending_.next == sending_.pictures.size()) sending_.stage = Stage::kEnd;
      return;
    }
    case Stage::kEnd:
      writer_.End(out, sending_.number, !sending_.hold);
      sending_.stage = Stage::kAwaitComplete;
      return;
    default:
      return;
  }
}

void VoxlinkDisplay::SendCommands() {
  while (!commands_.empty() && link_.Room() >= sizeof(PacketHeader) + sizeof(ShowAheadPayload)) {
    const Command command = commands_.front();
    commands_.erase(commands_.begin());
    TransferBytes buffer = link_.TakeBuffer();
    if (command.type == PacketType::kShow) {
      writer_.ShowAhead(buffer, command.volume, command.sweep, command.ahead);
    } else {
      writer_.Plain(buffer, command.type, command.volume);
    }
    mutable_stats().bytes_out += buffer.size();
    TapOut(kBulkOut, buffer);
    link_.Send(std::move(buffer));
  }
}

void VoxlinkDisplay::Pump() {
  SendCommands();
  if (!commands_.empty()) return;
  const auto has_packet = [this] {
    return sending_.stage != Stage::kIdle && sending_.stage < Stage::kAwaitComplete;
  };
  while (has_packet() && NextPacketSize() <= link_.Room()) {
    const size_t limit = std::min(link_.Room(), std::max(kTransferBytes, NextPacketSize()));
    TransferBytes buffer = link_.TakeBuffer();
    while (has_packet() && buffer.size() + NextPacketSize() <= limit) WritePacket(buffer);
    sending_.bytes += buffer.size();
    sending_.last_byte_ns = clock().Now();
    mutable_stats().bytes_out += buffer.size();
    TapOut(kBulkOut, buffer);
    link_.Send(std::move(buffer));
    if (sending_.stage == Stage::kAwaitComplete) {
      sending_.end_mark = link_.sent();
      sending_.answer_by = 0;
    }
  }
}

void VoxlinkDisplay::OnComplete(uint64_t volume) {
  if (volume != sending_.number || sending_.stage == Stage::kIdle ||
      sending_.stage >= Stage::kHeld) {
    return;
  }
  link_.NoteProgress();
  complete_number_ = volume;
  complete_frame_ = in_flight()->volume;
  sending_.queries = 0;
  if (sending_.hold) {
    sending_.stage = Stage::kHeld;
    return FrameHeld();
  }
  AwaitShown(clock().Now());
}

void VoxlinkDisplay::AwaitShown(sync::TimeNs from) {
  sending_.stage = Stage::kAwaitShown;
  const sync::TimeNs period =
      sweeps_.known() ? std::llround(sweeps_.lock().period_ns) : sync::kSecond;
  sending_.answer_by = from + 2 * period + kAnswerLimit;
}

void VoxlinkDisplay::DoOrderShown(sync::TimeNs at, uint32_t ahead) {
  if (sending_.stage < Stage::kHeld) return;
  if (!sweeps_.known()) return FrameOrdered(at, false);
  sending_.ordered_at = at;
  sending_.ordered_sweep = sweeps_.Nearest(at);
  commands_.push_back({PacketType::kShow, sending_.number, sending_.ordered_sweep, ahead});
  Pump();
}

void VoxlinkDisplay::OnOrdered(const OrderedEvent& event, bool taken) {
  if (event.volume != sending_.number || sending_.stage < Stage::kHeld ||
      event.sweep != sending_.ordered_sweep) {
    return;
  }
  if (taken) AwaitShown(std::max(clock().Now(), sending_.ordered_at));
  FrameOrdered(sending_.ordered_at, taken);
}

void VoxlinkDisplay::DoDropHeld(const std::string& reason) {
  if (sending_.stage == Stage::kIdle) return;
  const bool held = sending_.stage >= Stage::kHeld;
  commands_.push_back({held ? PacketType::kDrop : PacketType::kAbort, sending_.number});
  if (held) complete_number_ = 0;
  if (sending_.ordered_sweep != 0) dropped_ordered_ = sending_.number;
  Lose(reason);
  Pump();
}

void VoxlinkDisplay::OnShown(uint64_t volume, uint64_t start_ns, bool dark) {
  if (volume == dropped_ordered_) {
    dropped_ordered_ = 0;
    if (!dark) FrameStray();
  }
  if (volume != sending_.number || sending_.stage == Stage::kIdle) return;
  OnComplete(volume);  // its own event may have been lost
  retry_.Reset();
  if (dark && !blanked()) return Lose("the device was dark when the volume's sweep began");
  const Sending done = std::exchange(sending_, Sending{});
  // A device may report anything.
  const sync::TimeNs now = clock().Now();
  const sync::TimeNs shown =
      std::clamp(clock_map_.ToHost(start_ns), now - kOldestSweep, now + kOldestSweep);
  FrameDone(shown, Evidence::kDevice, done.last_byte_ns, done.bytes);
}

void VoxlinkDisplay::OnMissing(const EventHeader& header, const MissingEvent& event) {
  if (event.volume != sending_.number || sending_.stage != Stage::kAwaitComplete) return;
  for (size_t i = 0; i < std::min<size_t>(event.runs, kRunsPerEvent); ++i) {
    sending_.missing.push_back(event.run[i]);
  }
  if ((header.flags & kMissingLast) == 0) return;
  const std::vector<PictureRun> runs = std::exchange(sending_.missing, {});
  if (++sending_.rounds > kMaxResends) {
    commands_.push_back({PacketType::kAbort, sending_.number});
    return Lose(
        absl::StrCat("slices did not arrive, though they were sent ", kMaxResends, " times again"));
  }
  sending_.pictures.clear();
  sending_.next = sending_.offset = 0;
  for (const PictureRun& run : runs) {
    const uint64_t end =
        std::min<uint64_t>(uint64_t{run.first} + run.count, sending_.announced.size());
    for (uint64_t p = run.first; p < end; ++p) {
      if (sending_.announced[p]) sending_.pictures.push_back(static_cast<uint32_t>(p));
    }
  }
  mutable_stats().slices_resent += sending_.pictures.size();
  sending_.stage = sending_.pictures.empty() ? Stage::kEnd : Stage::kPictures;
  link_.Recover();  // bytes were lost: ask how many the device received
}

void VoxlinkDisplay::OnRefused(const VolumeEvent& event, bool dropped) {
  if (event.volume != sending_.number || sending_.stage == Stage::kIdle) return;
  if (dropped) return Lose(absl::StrCat("the device dropped it: ", ReasonName(event.reason)));
  if (event.reason == static_cast<uint32_t>(Reason::kBadBase)) complete_number_ = 0;
  SendAgain(ReasonName(event.reason));
}

void VoxlinkDisplay::SendAgain(const char* why) {
  if (++sending_.rounds > kMaxResends) {
    return Lose(absl::StrCat("the device refused it ", kMaxResends, " times: ", why));
  }
  Begin(in_flight(), true);
  mutable_stats().slices_resent += sending_.pictures.size();
  link_.Recover();
}

void VoxlinkDisplay::Lose(const std::string& reason) {
  const Sending lost = std::exchange(sending_, Sending{});
  FrameLost(reason, lost.bytes);
}

void VoxlinkDisplay::OnStatus(const Status& status, bool settled) {
  NoteUnderruns(status.underruns);
  if (phase_ == Phase::kWaitingReady && status.running != 0) {
    return Ready();  // READY itself was lost
  }
  if (sending_.stage == Stage::kIdle) return;
  sending_.end_mark = std::min(sending_.end_mark, link_.sent());  // lost bytes are not counted
  if (status.shown == sending_.number) return OnShown(status.shown, status.shown_start_ns, false);
  if (status.last_complete == sending_.number) return OnComplete(status.last_complete);
  if (!settled || sending_.stage == Stage::kBegin) return;
  if (status.filling != sending_.number) return SendAgain("its beginning was lost");
  if (sending_.stage == Stage::kAwaitComplete) {  // the list of missing images was lost: ask again
    sending_.missing.clear();
    sending_.stage = Stage::kEnd;
  }
}

sync::TimeNs VoxlinkDisplay::CheckOnVolume(sync::TimeNs now) {
  if (sending_.stage == Stage::kIdle || sending_.stage == Stage::kHeld) return sync::kNever;
  if (sending_.stage == Stage::kAwaitComplete && sending_.answer_by == 0 &&
      link_.consumed() >= sending_.end_mark) {
    sending_.answer_by = now + kAnswerLimit;
  }
  const bool waiting = sending_.stage >= Stage::kAwaitComplete && sending_.answer_by != 0;
  const sync::TimeNs due =
      std::max(waiting ? sending_.answer_by : link_.last_progress() + kAnswerLimit,
               sending_.asked_ns + kAnswerLimit);
  if (now < due) return due;
  if (link_.last_progress() > sending_.asked_ns && !waiting) sending_.queries = 0;
  if (++sending_.queries > kMostQueries) {
    OnLinkFailed("the device takes no more bytes, or does not show what it has");
    return now;
  }
  sending_.asked_ns = now;
  link_.AskStatus();
  return now + kAnswerLimit;
}

}  // namespace voxeld::display::voxlink
