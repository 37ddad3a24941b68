// Several displays of one daemon that show the same volume number, or none.
//
// Their pipelines go by rounds. A round is a volume number and the snapshot that each of them draws as it. Every member sends
// the volume and has its device hold it. When all do, they are ordered to show it at one time: each at the sweep of its
// own that begins nearest to it. A device takes an order only so many sweeps ahead, and says so, so that there is time to
// call it off: if one member has not taken it in time, all are ordered anew, later. Once all have, nothing but the loss of
// a device keeps the volume from being shown, and a lost one shows nothing.
//
// The times, with sweeps of period p, which begin within a spread s of each other (at most p/2 for two displays): devices
// take an order until (ahead − 1)·p before their sweep; then what is left until the first of them begins is halved, for the
// answers' way here, and for the way of a new order.
//
// - A member that is not showing (absent, lost, blanked) is left out, and comes back with the next round. One that is lost may go on
//   showing what it showed until its watchdog darkens it: so long the others show nothing new.
// - A volume that one member cannot have (its engine failed, its device gave it up) is dropped by all, and what it was to show
//   comes with the next.
// - What is shown stays until the next round is.
//
// What this cannot promise: a device that takes an order and whose word of it is late by more than that (a quarter of a sweep at the
// least) may show the volume though the others have been put off; so may one to which the new order comes too late.
// It is counted: `slips`.
//
// Thread-safe. Members are woken when there may be something for them to do; they ask by ToDraw and NextCommand.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "daemon/scene/snapshot.h"
#include "display/api/display.h"
#include "display/sync/backoff.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

// Whether a display can be a member of the group `genlock`, beside one that is (null: it is the first). InvalidArgument says why not.
absl::Status CheckGenlock(const std::string& genlock, const display::Display& display,
                          const display::DisplayInfo* other);

class Genlock {
 public:
  using Member = size_t;

  struct Round {
    uint64_t volume = 0;
    SnapshotPtr snapshot;
  };
  struct Command {
    enum class What : uint8_t { kNothing, kShow, kDrop };
    What what = What::kNothing;
    uint64_t volume = 0;
    sync::TimeNs at = 0;  // kShow: the start of its sweep
    uint32_t ahead = 0;   // kShow: sweeps
    std::string why;      // kDrop
  };
  struct Figures {
    uint64_t volumes = 0;    // shown by all that took part
    uint64_t dropped = 0;    // by all, since one could not have it
    uint64_t postponed = 0;  // orders given anew
    uint64_t slips = 0;      // shown by one at another time than ordered, or not by all
  };

  // `retire` takes snapshots that are done with; may be empty.
  explicit Genlock(sync::Clock& clock,
                   std::function<void(std::shared_ptr<const void>)> retire = {});

  // Before any thread runs. `wake` is thread-safe and cheap.
  Member Add(std::function<void()> wake);

  // Whether its display shows what it is given, and when sweeps begin (0: not known).
  void SetPresent(Member member, bool present);
  void SetSweeps(Member member, sync::TimeNs next, sync::TimeNs period);
  // It has something new to show: that snapshot or a newer one is for the next round.
  void Want(Member member, const SnapshotPtr& snapshot);
  // The round that runs, until it has been held or has ended for this member.
  std::optional<Round> ToDraw(Member member) const;

  void Held(Member member, uint64_t volume);
  void Ordered(Member member, uint64_t volume, sync::TimeNs at, bool taken);
  // A dropped volume was shown all the same.
  void Stray();
  // The volume is shown, or will never be.
  void Shown(Member member, uint64_t volume, sync::TimeNs at);
  void Failed(Member member, uint64_t volume, const std::string& why);

  // What it has to do with a volume; each order is given once.
  Command NextCommand(Member member);
  // Does what is due; when to call again at the latest.
  sync::TimeNs Step();

  Figures figures() const;
  // The newest volume that was shown; 0: none yet.
  uint64_t shown() const;

 private:
  enum class Stage : uint8_t {
    kOut,      // takes no part in this round
    kDrawing,  // draws it or sends it
    kHeld,
    kTaken,  // the newest order
    kShown,
    kFailed,
  };
  struct State {
    std::function<void()> wake;
    bool present = false;
    sync::TimeNs next_sweep = 0, period = 0;
    bool wants = false;
    Stage stage = Stage::kOut;
    sync::TimeNs at = 0;  // in the newest order
    uint64_t told = 0;    // the newest order given to it
    bool told_drop = false;
    sync::TimeNs shown_at = 0;
  };

  bool Any(Stage stage) const VOXELD_REQUIRES(mutex_);
  bool SweepsKnown() const VOXELD_REQUIRES(mutex_);  // of all who take part
  // Goes on as far as it goes now.
  void Decide() VOXELD_REQUIRES(mutex_);
  void Open() VOXELD_REQUIRES(mutex_);
  // The start of its first sweep after that.
  static sync::TimeNs FirstAfter(const State& member, sync::TimeNs after);
  void Order(sync::TimeNs not_before) VOXELD_REQUIRES(mutex_);
  void Drop(const std::string& why) VOXELD_REQUIRES(mutex_);
  void Close() VOXELD_REQUIRES(mutex_);
  void WakeAll() const VOXELD_REQUIRES(mutex_);
  State* Of(Member member, uint64_t volume) VOXELD_REQUIRES(mutex_);

  sync::Clock& clock_;
  const std::function<void(std::shared_ptr<const void>)> retire_;
  mutable sync::Mutex mutex_;
  std::vector<State> members_ VOXELD_GUARDED_BY(mutex_);
  SnapshotPtr wanted_ VOXELD_GUARDED_BY(mutex_);
  bool open_ VOXELD_GUARDED_BY(mutex_) = false;
  Round round_ VOXELD_GUARDED_BY(mutex_);
  uint64_t order_ VOXELD_GUARDED_BY(mutex_) = 0;  // counts orders; 0: none in this round
  int tries_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint32_t ahead_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs first_at_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs last_at_ VOXELD_GUARDED_BY(mutex_) = 0;  // of all members' in the newest order
  sync::TimeNs period_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs deadline_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  bool settled_ VOXELD_GUARDED_BY(mutex_) = false;          // all have taken the order
  std::string dropping_ VOXELD_GUARDED_BY(mutex_);          // why; empty: it is not being dropped
  sync::TimeNs quiet_until_ VOXELD_GUARDED_BY(mutex_) = 0;  // a lost member may show what it showed
  sync::TimeNs open_from_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::Backoff pause_ VOXELD_GUARDED_BY(mutex_){20 * sync::kMillisecond, sync::kSecond};
  uint64_t shown_ VOXELD_GUARDED_BY(mutex_) = 0;
  Figures figures_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon
