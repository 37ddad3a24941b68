// FramePipeline as the member of a genlock.
#include <vector>

#include "daemon/pipeline/frame_pipeline.h"

namespace voxeld::daemon {

sync::TimeNs FramePipeline::StepGenlock() {
  const std::vector<sync::TimeNs> coming =
      showing() ? display_->ComingSweeps(2) : std::vector<sync::TimeNs>();
  const bool known = coming.size() == 2;
  genlock_->SetSweeps(member_, known ? coming[0] : 0, known ? coming[1] - coming[0] : 0);
  const sync::TimeNs next = genlock_->Step();
  while (true) {
    const Genlock::Command command = genlock_->NextCommand(member_);
    switch (command.what) {
      case Genlock::Command::What::kNothing:
        return next;
      case Genlock::Command::What::kShow:
        display_->OrderShown(command.volume, command.at, command.ahead);
        break;
      case Genlock::Command::What::kDrop:
        dropping_ = command.volume;
        if (in_display_.contains(command.volume)) {
          display_->DropHeld(command.volume, command.why);
        } else {
          genlock_->Failed(member_, command.volume,
                           command.why);  // if it is being drawn: see OnFrame
        }
        break;
    }
  }
}

std::optional<Genlock::Round> FramePipeline::RoundToDraw(bool due) {
  std::optional<Genlock::Round> round = genlock_->ToDraw(member_);
  if (round.has_value() && round->volume > last_volume_) {
    // The commits that it shows are on their way here.
    if (newest_->number < round->snapshot->number) return std::nullopt;
    return round;
  }
  if (due) genlock_->Want(member_, newest_);
  return std::nullopt;
}

bool FramePipeline::IsOfRound(uint64_t volume) const {
  const std::optional<Genlock::Round> round = genlock_->ToDraw(member_);
  return round.has_value() && round->volume == volume;
}

void FramePipeline::OnHeld(uint64_t volume) {
  if (genlock_ != nullptr) genlock_->Held(member_, volume);
}

void FramePipeline::OnOrdered(uint64_t volume, sync::TimeNs at, bool taken) {
  if (genlock_ != nullptr) genlock_->Ordered(member_, volume, at, taken);
}

void FramePipeline::OnStray() {
  if (genlock_ != nullptr) genlock_->Stray();
}

bool FramePipeline::EndRound(const display::VolumeOutcome& outcome) {
  if (outcome.kind == display::VolumeOutcome::Kind::kPresented) {
    genlock_->Shown(member_, outcome.volume, outcome.time_ns);
    return false;
  }
  genlock_->Failed(member_, outcome.volume, outcome.reason);
  return outcome.volume == dropping_ && showing();
}

}  // namespace voxeld::daemon
