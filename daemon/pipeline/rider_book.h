// Which commits ride in which volume, and what each is told: exactly one outcome for every commit
// that was owed one, by the rules in order:
//
//   1. absent, removed or blanked when it was applied, or all its operations in hidden layers:
//      NOT_SHOWN.
//   2. Otherwise it rides in the first volume drawn from a snapshot that contains it. Of one
//      session's commits that ride in one volume the newest gets the volume's outcome; the others
//      are SUPERSEDED by it, at once.
//   3. The volume's bytes equal those of the volume before: UNCHANGED(that one) once that was
//      presented, LOST if it is lost; if it is replaced, such riders ride in what replaces it.
//   4. The volume is replaced in the mailbox: its riders ride in the one that replaces it,
//      by rule 2.
//   5. It is lost: LOST(reason). Otherwise PRESENTED.
//
// Single-threaded; tells outcomes by the function it is given, inside the calls.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "daemon/core/receipt.h"
#include "display/api/outcome.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// A commit on its way to a display.
struct Rider {
  uint64_t session = 0;
  uint64_t frame_id = 0;
  uint64_t sequence = 0;
  uint64_t incarnation = 0;  // of the session; sequences begin anew with each
  bool asked = true;         // its client wants the outcomes
  Stages stages;             // up to applied_ns
  uint64_t snapshot = 0;     // the first that contains it
  uint64_t owner = 0;
};

class RiderBook {
 public:
  using Tell = std::function<void(const Rider&, const CommitOutcome&)>;

  struct Counts {
    uint64_t owed = 0, presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0;
  };

  RiderBook(std::string display, Tell tell);

  // A commit was applied: it waits for the next volume to be drawn. In the order of application.
  void Board(const Rider& rider);
  // It was applied, but by rule 1 will not be shown.
  void NotShown(const Rider& rider, CommitOutcome::NotShown why);

  // Those that wait and are in `snapshot` ride in the volume that is about to be drawn from it. For an owner in `held` the
  // volume shows the older snapshot of that number, and the owner's later commits keep waiting.
  void Draw(uint64_t snapshot = UINT64_MAX, const std::map<uint64_t, uint64_t>& held = {});
  // The volume under way comes to nothing: its riders wait again, before those who came later.
  void Redraw();
  // `volume`, submitted, comes to nothing, and what it shows will be drawn again: its riders wait as above.
  void Reboard(uint64_t volume);
  // `volume`, drawn, goes to the display; its outcome comes by OnOutcome. Of `drawn`: from drawing_ns
  // to sliced_ns.
  void Submit(uint64_t volume, const Stages& drawn = {});
  // The volume under way came out the same as `before`,
  // the one submitted last (and not lost since).
  void Unchanged(uint64_t before);
  // Every rider of a volume not submitted yet, and with `waiting` those that wait for one, is LOST.
  void LoseUnsubmitted(const std::string& reason, bool waiting);
  // Those that wait are not shown after all.
  void HideWaiting();

  void OnOutcome(const display::VolumeOutcome& outcome);

  const Counts& counts() const { return counts_; }
  uint64_t pending() const;

 private:
  struct Volume {
    std::vector<Rider> riders;     // at most one a session
    std::vector<Rider> unchanged;  // drawn later, with the same bytes
    Stages drawn;
  };

  void Give(const Rider& rider, CommitOutcome outcome);
  void Lose(std::vector<Rider>& riders, const std::string& reason);
  // Adds `later` to `riders`, by rule 2.
  void Merge(std::vector<Rider>& riders, const std::vector<Rider>& later);

  const std::string display_;
  const Tell tell_;
  Counts counts_;
  std::vector<Rider> waiting_;
  std::vector<Rider> drawing_;
  std::map<uint64_t, Volume> submitted_;  // without an outcome yet
};

}  // namespace voxeld::daemon
