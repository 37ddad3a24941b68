// The checks of what is seen.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "tests/simulation/reference.h"
#include "tests/simulation/simulation_run.h"

namespace voxeld::simulation {
namespace {

using sync::kMillisecond;
using sync::kSecond;

// A volume is drawn, sent and shown within this time, whatever the device's pace, if nothing
// disturbs it.
constexpr sync::TimeNs kAtRest = 2 * kSecond;
// Faults end; then everything is shown within this time.
constexpr sync::TimeNs kSettles = 120 * kSecond;

}  // namespace

bool SimulationRun::Quiet(size_t d) {
  const sync::TimeNs since = now() - kAtRest;
  return world_->seats()[d].display->state() == display::DisplayState::kShowing &&
         judge_.screen(d).disturbed_until < since && changed_ns_ < since &&
         slow_engines_until_ < since;
}

bool SimulationRun::Idle(size_t d) { return Quiet(d); }

void SimulationRun::CheckQuiet() {
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    const Seat& seat = world_->seats()[d];
    const DisplayNow& is = now_[d];
    if (judge_.screen(d).disturbed_until >= now() - kAtRest) continue;
    std::optional<display::DecodedVolume> seen;
    double brightness = 0;
    seat.carrier->WithDevice([&](display::UsbDeviceModel&) {
      seen = seat.device->Seen();
      brightness = seat.device->brightness();
    });
    // A lying device that has denied having a brightness is darkened by a black picture.
    const bool by_picture = !is.blanked && judge_.screen(d).lied_until >= 0;
    if ((is.blanked || is.brightness == 0) && seen.has_value() &&
        !(by_picture &&
          std::ranges::all_of(seen->Rgb(), [](uint8_t level) { return level == 0; }))) {
      Fail(absl::StrCat("display ", d, " is to be dark, and is lit: its device has brightness ",
                        brightness, ", and is to have ", is.brightness));
    }
    if (is.blanked) continue;
    if (seat.display->state() != display::DisplayState::kShowing) {
      Fail(absl::StrCat("display ", d, " does not show, though nothing disturbs it"));
    }
    // A device that said that it has no brightness is dimmed in another way.
    if (judge_.screen(d).lied_until < 0 && std::abs(brightness - is.brightness) > 1e-4) {
      Fail(absl::StrCat("display ", d, " has brightness ", brightness, ", not ", is.brightness));
    }
    if (Quiet(d) && !judge_.screen(d).pattern) CheckPicture(d);
  }
}

// Checks that the device shows what the plain scene looks like when it is drawn again.
void SimulationRun::CheckPicture(size_t d) {
  ++tally_.pictures_compared;
  const Seat& seat = world_->seats()[d];
  const std::vector<std::byte> expected = DrawPlain(plain_.scene, seat.display->info());
  const display::emulator::VoxlinkScreen& screen = seat.device->screen();
  if (!screen.lit()) {
    return Fail(absl::StrCat(
        "display ", d, " is dark, and nothing darkens it: ", screen.running() ? "" : "not started ",
        screen.shown() == nullptr ? "nothing to show " : "",
        screen.watchdog_dark() ? "its host is silent " : "", screen.blanked() ? "blanked " : ""));
  }
  if (LookOf(screen.shown()->pictures) != LookOf(expected)) {
    return Fail(absl::StrCat("display ", d, " does not show the scene"));
  }
  const DisplayNow& is = now_[d];
  if (is.watch != 0 && is.watched_since < now() - kAtRest && is.watched != LookOf(expected)) {
    Fail(absl::StrCat("who watches display ", d, " sees something else than the scene"));
  }
}

// Checks that members of a genlock show the same volume at the same time, except for the time
// between their sweeps.
void SimulationRun::CheckGenlock() {
  if (!wrong_.empty()) return;
  const std::vector<Seat>& seats = world_->seats();
  if (seats.size() < 2 || seats[0].genlock.empty()) return;
  const auto newest = [this](size_t d) -> std::optional<std::pair<uint64_t, uint64_t>> {
    const Eye& eye = judge_.screen(d).eye;
    if (!eye.newest().has_value()) return std::nullopt;
    return eye.VolumesLike(*eye.newest());
  };
  const auto first = newest(0), second = newest(1);
  const bool lit = first.has_value() && second.has_value() && !now_[0].blanked && !now_[1].blanked;
  const bool calm =
      judge_.screen(0).disturbed_until < now() && judge_.screen(1).disturbed_until < now();
  // Each shows one of the volumes that have its look; there is one that both may be.
  const bool apart =
      lit && calm && (first->second < second->first || second->second < first->first);
  if (!apart) {
    now_[1].apart_since = 0;
    return;
  }
  if (now_[1].apart_since == 0) now_[1].apart_since = now();
  const double period = kSecond / seats[0].display->info().volumes_per_second;
  if (static_cast<double>(now() - now_[1].apart_since) > 1.5 * period) {
    Fail(absl::StrCat("displays in genlock show volumes ", first->second, " and ", second->second));
  }
}

std::string SimulationRun::WrongWith(size_t d, const display::DecodedVolume& volume) const {
  const Eye& eye = judge_.screen(d).eye;
  const Look look = LookOf(volume.pictures);
  if (volume.volume == 0) return look == eye.black() ? "" : "a volume without a number is lit";
  const Eye::Drawn* drawn = eye.Find(volume.volume);
  if (drawn == nullptr || !drawn->drawn_ns.has_value()) return "a volume that was not drawn";
  if (drawn->look != look) return absl::StrCat("volume ", volume.volume, " looks otherwise");
  if (judge_.screen(d).lied_until < 0 && !eye.EverShown(look, *drawn->drawn_ns))
    return absl::StrCat("volume ", volume.volume, " was not shown");
  return "";
}

void SimulationRun::OnCaptured(size_t d, size_t number,
                               const absl::StatusOr<display::DecodedVolume>& volume) {
  if (!wrong_.empty()) return;
  NoteDisturbances(d);
  Pending& capture = captures_[number];
  Trace(absl::StrCat("    capture ", number, ": ", volume.ok() ? "" : volume.status().ToString()));
  if (std::exchange(capture.answered, true)) return Fail("a capture was answered twice");
  const bool disturbed = capture.asked_ns <= judge_.screen(d).disturbed_until;
  if (volume.ok()) {
    ++tally_.captures;
    const std::string wrong = WrongWith(d, *volume);
    if (!wrong.empty()) return Fail(absl::StrCat("capture ", number, ": ", wrong));
    const Eye::Drawn* drawn = judge_.screen(d).eye.Find(volume->volume);
    if (capture.at_least == 0 || drawn == nullptr) return;
    // A newer snapshot that looks the same is shown by an older volume.
    if (drawn->snapshot < capture.at_least && !drawn->pattern &&
        !judge_.LooksLike(d, drawn->look, capture.at_least)) {
      Fail(absl::StrCat("capture ", number, " of snapshot ", capture.at_least, " shows ",
                        drawn->snapshot));
    }
    return;
  }
  if (absl::IsDeadlineExceeded(volume.status())) {
    if (now() < capture.deadline) Fail("a capture was given up before its time");
    if (!disturbed && capture.deadline - capture.asked_ns > kAtRest &&
        slow_engines_until_ < capture.asked_ns) {
      Fail("a capture was given up, and nothing disturbed it");
    }
    return;
  }
  if (!absl::IsUnavailable(volume.status()) || (!disturbed && !now_[d].blanked)) {
    Fail(absl::StrCat("capture ", number, ": ", volume.status().ToString()));
  }
}

void SimulationRun::CheckCaptures() {
  if (!wrong_.empty()) return;
  for (const Pending& capture : captures_) {
    if (!capture.answered && capture.deadline < now()) Fail("a capture has no answer in time");
  }
}

void SimulationRun::OnWatched(size_t d, const absl::StatusOr<display::DecodedVolume>& volume) {
  if (!wrong_.empty() || stopping_) return;
  DisplayNow& is = now_[d];
  if (!volume.ok()) return Fail(absl::StrCat("a watch ends: ", volume.status().ToString()));
  ++tally_.watched;
  const std::string wrong = WrongWith(d, *volume);
  if (!wrong.empty()) return Fail(absl::StrCat("a watch: ", wrong));
  if (volume->volume < is.watched_volume) {
    return Fail(absl::StrCat("a watch has volume ", volume->volume, " after ", is.watched_volume));
  }
  is.watched_volume = volume->volume;
  is.watched = LookOf(volume->pictures);
  Trace(absl::StrCat("    display ", d, " is seen: volume ", volume->volume));
}

// Faults end, and every display is lit: then everything is shown, and no outcome is outstanding.
void SimulationRun::Settle() {
  Trace("everything settles");
  if (plain_.memory_full) FillMemory(false);
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    const Seat& seat = world_->seats()[d];
    seat.engine->fail.reset();
    seat.engine->fail_staging = false;
    if (now_[d].lies) Lie(d, false, 0);
    seat.carrier->WithDevice([&](display::UsbDeviceModel& device) {
      seat.faults->Clear();
      device.SetPlugged(true);
    });
    now_[d].plugged = true;
    world_->Touch(d);
    if (now_[d].blanked)
      DoToDisplay({daemon::model::ActionKind::kBlank, 0, 0}, world_->chance(), d);
    if (judge_.screen(d).pattern) {
      DoToDisplay({daemon::model::ActionKind::kPattern, 0, 0}, world_->chance(), d);
    }
  }
  EverybodyReads();
  const sync::TimeNs end = now() + kSettles;
  const auto waits = [this](size_t d) { return !Quiet(d); };
  const auto timed = [this] {
    return std::any_of(plain_.sessions.begin(), plain_.sessions.end(), [](const auto& entry) {
      return entry.second.waits() || !entry.second.timed.empty();
    });
  };
  bool over = false;
  while (wrong_.empty() && !over) {
    Advance(200 * kMillisecond);
    over = !timed();
    for (size_t d = 0; d < now_.size(); ++d) over = over && !waits(d);
    if (now() > end) return Fail("things do not settle, though faults have ended");
  }
  if (!wrong_.empty()) return;
  CheckStats();
  CheckQuiet();
  CheckNobodyWaits();
  CheckUndisturbed();
}

// Checks that, where no device was ever disturbed, nothing was sent twice, and each was found once.
void SimulationRun::CheckUndisturbed() {
  if (scenario_.device_faults || scenario_.transport_faults || scenario_.lies || scenario_.jumps) {
    return;
  }
  const daemon::Stats stats = AskStats();
  for (size_t d = 0; d < now_.size() && wrong_.empty(); ++d) {
    const daemon::DisplayFigures& figures = stats.displays[d];
    if (figures.slices_resent != 0) {
      Fail(absl::StrCat("display ", d, " was sent ", figures.slices_resent,
                        " slices again, and nothing was amiss"));
    }
    // A member of a genlock starts again when it is lit again.
    if (figures.attaches != 1 && world_->seats()[d].genlock.empty()) {
      Fail(absl::StrCat("display ", d, " was found ", figures.attaches, " times"));
    }
  }
}

void SimulationRun::Leave() {
  EverybodyLeaves();
  if (wrong_.empty()) Jump(31 * kSecond);
  EvictEverybody();
  if (!wrong_.empty()) return;
  const sync::TimeNs end = now() + kSettles;
  // The scene is empty; some runs check that as well.
  const bool looks = scenario_.seed % 4 == 0;
  bool over = false;
  while (wrong_.empty() && !over) {
    Advance(200 * kMillisecond);
    const daemon::Stats stats = AskStats();
    over = std::all_of(stats.displays.begin(), stats.displays.end(),
                       [](const auto& figures) { return figures.commits_pending == 0; });
    for (size_t d = 0; d < now_.size() && looks; ++d) over = over && Quiet(d);
    if (now() > end) return Fail("what is owed to those who have left does not come to an end");
  }
  if (!wrong_.empty()) return;
  CheckQuiet();
  const daemon::Stats stats = AskStats();
  CheckNothingIsHeld(judge_.owed(), judge_.told() + stats.outcomes_undelivered);
  stopping_ = true;
  if (wrong_.empty() && !core().Stop(kSecond).ok()) Fail("the core does not stop");
  if (core().budget()->used_bytes() != 0) {
    Fail(absl::StrCat("the core has stopped, and ", core().budget()->used_bytes(),
                      " bytes are held"));
  }
}

}  // namespace voxeld::simulation
