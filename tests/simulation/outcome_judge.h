// Judges the outcome of every commit on every display by the requests to the engines and by what
// was seen of the devices: exactly one outcome each, of a kind that the rules of rider_book.h
// allow.
//
// With scripted displays the outcome is known exactly (tests/daemon/core/model/outcome_ledger.h);
// here devices fail by themselves, so that some outcomes may be one or another, and a volume may be
// LOST only on a display that something has disturbed.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "daemon/core/receipt.h"
#include "display/api/outcome.h"
#include "tests/daemon/core/model/outcome_ledger.h"
#include "tests/simulation/eye.h"

namespace voxeld::simulation {

using daemon::CommitOutcome;
using Applied = daemon::model::OutcomeLedger::Commit;

class OutcomeJudge {
 public:
  struct Screen {
    std::string name;
    Eye eye;
    sync::TimeNs disturbed_until = 0;
    sync::TimeNs lied_until = -1;  // what its device reported until then may be untrue
    sync::TimeNs tolerance = 0;  // for the times that its device reports while nothing disturbs it
    bool pattern = false;
    uint64_t patterns = 0;                                // how many were set so far
    bool pattern_changes = false, blank_changes = false;  // a change is on its way to the display
  };

  explicit OutcomeJudge(std::vector<Screen> screens) : screens_(std::move(screens)) {}

  Screen& screen(size_t d) { return screens_[d]; }
  const Screen& screen(size_t d) const { return screens_[d]; }

  // ---- events, in the order in which they happen
  void OnApplied(const Applied& commit, sync::TimeNs now);
  // Records the visible scene of a snapshot; equal numbers mean equal scenes.
  void Pictured(uint64_t snapshot, uint64_t picture) { pictures_[snapshot] = picture; }
  // The display's thread, in this state, starts to take the commits that were posted to it.
  void Boards(size_t d, display::DisplayState state);
  // It has taken them.
  void Boarded(size_t d, display::DisplayState state);
  void Removed() { removed_ = true; }  // the displays have stopped; the core has not
  void Disturb(size_t d, sync::TimeNs until);

  // A client received an outcome.
  // Returns: what is wrong with it; empty: nothing.
  std::string Told(uint64_t session, const daemon::Receipt& receipt, const CommitOutcome& outcome,
                   sync::TimeNs now);
  // The receipt will be sent again: the client did not get it.
  void TakeBack(uint64_t session, const daemon::Receipt& receipt);

  // Returns whether snapshot `to`, or a newer one, has this look on a display.
  bool LooksLike(size_t d, Look look, uint64_t to) const;
  uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const;
  uint64_t owed() const { return owed_; }
  uint64_t told() const { return told_; }
  uint64_t commits() const { return commits_.size(); }
  const std::map<CommitOutcome::Kind, uint64_t>& kinds() const { return kinds_; }

 private:
  // The outcomes that a commit may have, as bits.
  static constexpr uint32_t kRides = 1u << 16;
  static uint32_t Bit(CommitOutcome::NotShown why) { return 1u << static_cast<uint32_t>(why); }

  struct OnScreen {
    bool told = false;
    uint32_t may = 0;
    uint64_t patterns = 0;
    uint64_t presented = 0;  // the volume that presented it
  };
  struct Entry {
    Applied commit;
    sync::TimeNs applied_ns = 0;
    std::vector<OnScreen> on;
  };

  uint32_t May(const Entry& entry, size_t d, display::DisplayState state) const;
  Entry* Find(uint64_t session, const daemon::Receipt& receipt, size_t* index);
  // Returns whether a volume with snapshot `from` but not `to` (0: no limit), older than volume
  // `before`, was certainly shown.
  static bool ShownBetween(const Eye& eye, uint64_t from, uint64_t to, uint64_t before);
  // Returns whether a volume with this look was drawn of a scene equal to that of snapshot `from`
  // or a newer one.
  bool SameScene(const Eye& eye, Look look, uint64_t from) const;
  std::string Judge(size_t index, size_t d, const CommitOutcome& outcome, sync::TimeNs now);
  std::string JudgePresented(Entry& entry, size_t d, const CommitOutcome& outcome,
                             sync::TimeNs now);
  std::string JudgeUnchanged(const Entry& entry, size_t d, const CommitOutcome& outcome) const;
  std::string JudgeSuperseded(size_t index, size_t d, const CommitOutcome& outcome) const;

  std::vector<Screen> screens_;
  std::vector<Entry> commits_;  // in the order of application
  std::vector<size_t> boarding_from_ = std::vector<size_t>(screens_.size(), 0);
  std::vector<size_t> boarding_to_ = std::vector<size_t>(screens_.size(), 0);
  std::map<std::pair<uint64_t, uint64_t>, std::vector<size_t>> of_stream_;
  std::map<uint64_t, uint64_t> pictures_;                           // by snapshot
  std::map<std::pair<size_t, uint64_t>, uint64_t> last_presented_;  // display, session: volume
  std::set<uint64_t> taken_back_;  // sessions whose outcomes may come out of their order
  std::map<CommitOutcome::Kind, uint64_t> kinds_;
  uint64_t owed_ = 0, told_ = 0;
  bool removed_ = false;
};

}  // namespace voxeld::simulation
