#include "daemon/pipeline/genlock.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {
namespace {

constexpr sync::TimeNs kOrderShare = 4;  // of a period, for an order's way to the device
// Then what is held is dropped: a member that takes no orders must not hold the others' pictures.
constexpr int kMostOrders = 32;
constexpr sync::TimeNs kSweepsPause = 50 * sync::kMillisecond;
// After which a device that is lost is dark, by its watchdog (250 ms from its host's last byte), and a sweep.
constexpr sync::TimeNs kQuiet = 300 * sync::kMillisecond;

}  // namespace

absl::Status CheckGenlock(const std::string& genlock, const display::Display& display,
                          const display::DisplayInfo* other) {
  const display::DisplayInfo& info = display.info();
  if (!display.can_hold()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "display \"", info.name, "\" is in genlock \"", genlock, "\", and displays of driver ",
        info.driver,
        " cannot hold a volume until it is ordered shown; voxlink and simulated ones can"));
  }
  if (other != nullptr && other->volumes_per_second != info.volumes_per_second) {
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", info.name, "\" has ", info.volumes_per_second,
                     " volumes/s and \"", other->name, "\", of the same genlock \"", genlock,
                     "\", ", other->volumes_per_second, "; give them the same rate"));
  }
  return absl::OkStatus();
}

Genlock::Genlock(sync::Clock& clock, std::function<void(std::shared_ptr<const void>)> retire)
    : clock_(clock), retire_(std::move(retire)) {}

Genlock::Member Genlock::Add(std::function<void()> wake) {
  sync::MutexLock lock(mutex_);
  members_.push_back({.wake = std::move(wake)});
  return members_.size() - 1;
}

void Genlock::WakeAll() const {
  for (const State& member : members_) member.wake();
}

bool Genlock::Any(Stage stage) const {
  return std::any_of(members_.begin(), members_.end(),
                     [stage](const State& m) { return m.stage == stage; });
}

bool Genlock::SweepsKnown() const {
  return std::all_of(members_.begin(), members_.end(),
                     [](const State& m) { return m.stage == Stage::kOut || m.period != 0; });
}

Genlock::State* Genlock::Of(Member member, uint64_t volume) {
  State& state = members_[member];
  const bool part = open_ && volume == round_.volume && state.stage != Stage::kOut;
  return part ? &state : nullptr;
}

void Genlock::SetPresent(Member member, bool present) {
  sync::MutexLock lock(mutex_);
  State& state = members_[member];
  if (state.present == present) return;
  state.present = present;
  if (!present) {
    state.wants = false;
    state.next_sweep = state.period = 0;
    // It shows nothing new from now on, and soon nothing: the others are held up no longer than that.
    if (state.stage != Stage::kShown) state.stage = Stage::kOut;
    quiet_until_ = clock_.Now() + kQuiet;
    if (open_ && order_ != 0 && !settled_ && dropping_.empty()) deadline_ = clock_.Now();
  }
  Decide();
}

void Genlock::SetSweeps(Member member, sync::TimeNs next, sync::TimeNs period) {
  sync::MutexLock lock(mutex_);
  State& state = members_[member];
  const bool news = (state.period == 0) != (period == 0);
  state.next_sweep = next;
  state.period = period;
  if (news) Decide();
}

void Genlock::Want(Member member, const SnapshotPtr& snapshot) {
  sync::MutexLock lock(mutex_);
  members_[member].wants = true;
  if (wanted_ == nullptr || wanted_->number < snapshot->number) {
    std::shared_ptr<const void> before = std::exchange(wanted_, snapshot);
    if (retire_ && before != nullptr) retire_(std::move(before));
  }
  Decide();
}

std::optional<Genlock::Round> Genlock::ToDraw(Member member) const {
  sync::MutexLock lock(mutex_);
  if (!open_ || !dropping_.empty() || members_[member].stage != Stage::kDrawing) {
    return std::nullopt;
  }
  return round_;
}

void Genlock::Held(Member member, uint64_t volume) {
  sync::MutexLock lock(mutex_);
  State* const state = Of(member, volume);
  if (state == nullptr || state->stage != Stage::kDrawing) return;
  state->stage = Stage::kHeld;
  Decide();
}

void Genlock::Ordered(Member member, uint64_t volume, sync::TimeNs at, bool taken) {
  sync::MutexLock lock(mutex_);
  State* const state = Of(member, volume);
  if (state == nullptr || order_ == 0 || at != state->at || settled_) return;
  if (taken) {
    state->stage = Stage::kTaken;
  } else {
    deadline_ = clock_.Now();  // there is no use in waiting for the others
  }
  Decide();
}

void Genlock::Stray() {
  sync::MutexLock lock(mutex_);
  ++figures_.slips;
}

void Genlock::Shown(Member member, uint64_t volume, sync::TimeNs at) {
  sync::MutexLock lock(mutex_);
  State* const state = Of(member, volume);
  if (state == nullptr) return;
  state->stage = Stage::kShown;
  state->shown_at = at;
  Decide();
}

void Genlock::Failed(Member member, uint64_t volume, const std::string& why) {
  sync::MutexLock lock(mutex_);
  State* const state = Of(member, volume);
  if (state == nullptr || state->stage == Stage::kShown) return;
  state->stage = Stage::kFailed;
  if (dropping_.empty() && !settled_) Drop(why);
  Decide();
}

Genlock::Command Genlock::NextCommand(Member member) {
  sync::MutexLock lock(mutex_);
  State& state = members_[member];
  if (!open_ || state.stage == Stage::kOut) return {};
  if (!dropping_.empty()) {
    const bool over = state.stage == Stage::kFailed || state.stage == Stage::kShown;
    if (over || std::exchange(state.told_drop, true)) return {};
    return {.what = Command::What::kDrop, .volume = round_.volume, .why = dropping_};
  }
  if (order_ == 0 || state.told == order_) return {};
  state.told = order_;
  return {.what = Command::What::kShow, .volume = round_.volume, .at = state.at, .ahead = ahead_};
}

sync::TimeNs Genlock::Step() {
  sync::MutexLock lock(mutex_);
  Decide();
  if (!open_) {
    const bool wanted = std::any_of(members_.begin(), members_.end(),
                                    [](const State& m) { return m.present && m.wants; });
    return wanted ? open_from_ : sync::kNever;
  }
  return deadline_;
}

void Genlock::Decide() {
  if (open_) {
    const bool over = std::all_of(members_.begin(), members_.end(), [](const State& m) {
      return m.stage == Stage::kOut || m.stage == Stage::kShown || m.stage == Stage::kFailed;
    });
    if (over) Close();
  }
  if (!open_) return Open();
  if (!dropping_.empty() || settled_) return;
  if (Any(Stage::kDrawing)) return;
  if (order_ != 0 && !Any(Stage::kHeld)) {
    // Those that have taken an order from before a member was lost are put off all the same.
    const bool quiet = first_at_ >= quiet_until_;
    if (quiet) {
      settled_ = true;
      deadline_ = sync::kNever;
      return;
    }
  }
  const bool first = order_ == 0 && (deadline_ == sync::kNever || SweepsKnown());
  if (!first && clock_.Now() < deadline_) return;
  if (order_ != 0) ++figures_.postponed;
  if (!first && ++tries_ == kMostOrders) {
    return Drop("a display of the genlock took no order to show it");
  }
  Order(order_ == 0 ? 0 : last_at_ + period_ / 2);
}

void Genlock::Open() {
  const bool wanted = std::any_of(members_.begin(), members_.end(),
                                  [](const State& m) { return m.present && m.wants; });
  if (!wanted || clock_.Now() < open_from_) return;
  round_ = {round_.volume + 1, wanted_};
  for (State& member : members_) {
    member.stage = member.present ? Stage::kDrawing : Stage::kOut;
    member.wants = member.wants && !member.present;
    member.told = 0;
    member.told_drop = false;
  }
  open_ = true;
  order_ = 0;
  tries_ = 0;
  settled_ = false;
  deadline_ = sync::kNever;
  dropping_.clear();
  WakeAll();
}

sync::TimeNs Genlock::FirstAfter(const State& member, sync::TimeNs after) {
  const sync::TimeNs ahead = after - member.next_sweep;
  // The quotient rounded down, of either sign, and one more.
  const sync::TimeNs sweeps = ahead / member.period - (ahead % member.period < 0 ? 1 : 0) + 1;
  return member.next_sweep + sweeps * member.period;
}

void Genlock::Order(sync::TimeNs not_before) {
  const auto in = [](const State& m) { return m.stage != Stage::kOut; };
  if (!SweepsKnown()) {
    deadline_ = clock_.Now() + kSweepsPause;  // or as soon as they are known
    return;
  }
  // The first member that takes part leads.
  const State& leads = *std::find_if(members_.begin(), members_.end(), in);
  period_ = leads.period;
  sync::TimeNs first = 0, last = 0;
  const auto place = [&](sync::TimeNs leader_at) VOXELD_REQUIRES(mutex_) {
    first = last = leader_at;
    for (State& member : members_) {
      if (!in(member)) continue;
      member.at = FirstAfter(member, leader_at - period_ / 2);
      first = std::min(first, member.at);
      last = std::max(last, member.at);
    }
  };
  sync::TimeNs at =
      FirstAfter(leads, std::max({clock_.Now(), not_before, quiet_until_ + period_ / 2}));
  for (place(at);; place(at += period_)) {
    ahead_ = last - first <= period_ / 2 ? 2 : 3;
    if (first - (ahead_ - 1) * period_ >= clock_.Now() + period_ / kOrderShare) break;
  }
  const sync::TimeNs cutoff = last - (ahead_ - 1) * period_;
  deadline_ = cutoff + (first - cutoff) / 2;
  first_at_ = first;
  last_at_ = last;
  ++order_;
  for (State& member : members_) {
    if (member.stage == Stage::kTaken) member.stage = Stage::kHeld;
  }
  WakeAll();
}

void Genlock::Drop(const std::string& why) {
  dropping_ = why.empty() ? "another display of the genlock could not have it" : why;
  deadline_ = sync::kNever;
  WakeAll();
}

void Genlock::Close() {
  open_ = false;
  size_t shown = 0, failed = 0, apart = 0;
  for (State& member : members_) {
    if (member.stage == Stage::kShown) {
      ++shown;
      const sync::TimeNs off = member.shown_at - member.at;
      if (off > period_ / 2 || off < -period_ / 2) ++apart;
    }
    failed += member.stage == Stage::kFailed ? 1 : 0;
    member.stage = Stage::kOut;
  }
  if (shown > 0 && failed + apart > 0) {
    ++figures_.slips;
  } else if (shown > 0) {
    ++figures_.volumes;
  }
  if (shown > 0) shown_ = round_.volume;
  if (failed > 0) {
    ++figures_.dropped;
    open_from_ = clock_.Now() + pause_.Next();
    // Whoever had it is to draw it again.
    for (State& member : members_) member.wants = member.wants || member.present;
    if (wanted_ == nullptr || wanted_->number < round_.snapshot->number) wanted_ = round_.snapshot;
  } else {
    pause_.Reset();
    open_from_ = 0;
  }
  std::shared_ptr<const void> done = std::exchange(round_.snapshot, nullptr);
  if (retire_ && done != nullptr) retire_(std::move(done));
}

Genlock::Figures Genlock::figures() const {
  sync::MutexLock lock(mutex_);
  return figures_;
}

uint64_t Genlock::shown() const {
  sync::MutexLock lock(mutex_);
  return shown_;
}

}  // namespace voxeld::daemon
