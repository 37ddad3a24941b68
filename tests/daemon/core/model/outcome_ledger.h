// Judges the outcome of every commit on every display by the requests to the engines, the volumes
// sent to the devices and those shown: exactly one outcome each, of the kind that the rules allow
// (rider_book.h).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "daemon/core/receipt.h"
#include "display/api/outcome.h"

namespace voxeld::daemon::model {

class OutcomeLedger {
 public:
  explicit OutcomeLedger(std::vector<std::string> displays);

  struct Commit {
    uint64_t session = 0, incarnation = 0, sequence = 0, frame_id = 0;
    uint64_t snapshot = 0;
    bool asked = true;  // its client wants outcomes
    bool hidden = false;
    sync::TimeNs present_at = 0;  // 0: as soon as possible
  };

  // ---- events, in the order in which they happen
  void Applied(const Commit& commit);
  void Pictured(uint64_t snapshot, size_t picture) { pictures_[snapshot] = picture; }
  void Asked(size_t display, uint64_t volume, uint64_t snapshot);
  void Drawn(size_t display, uint64_t volume, size_t picture);
  void Sent(size_t display, uint64_t volume);
  void Shown(size_t display, uint64_t volume, sync::TimeNs time);
  // An event that may lose volumes; their outcomes name `reason`.
  void Loss(size_t display, const std::string& reason);
  void State(size_t display, display::DisplayState state);
  void Pattern(size_t display, bool on);
  void Removed() { removed_ = true; }  // the displays have stopped; the core has not

  // A client of `session` received an outcome.
  // Returns: what is wrong with it; empty: nothing.
  std::string Told(uint64_t session, uint64_t frame_id, uint64_t sequence, uint64_t incarnation,
                   const CommitOutcome& outcome);
  // The receipt will be sent again: the client did not get it.
  void TakeBack(uint64_t session, uint64_t sequence, uint64_t incarnation,
                const std::string& display);

  // Returns whether the volume that was shown last has that picture.
  bool ShowsLast(size_t display, size_t picture) const;

  // Outcomes that were requested: all of them, and those reported.
  uint64_t owed() const { return owed_; }
  uint64_t told() const { return told_; }
  uint64_t commits() const { return commits_.size(); }
  // Returns the number of outcomes of this incarnation of the session that were not reported;
  // describes the first in `which`.
  uint64_t Missing(uint64_t session, uint64_t incarnation, std::string* which) const;
  const std::map<CommitOutcome::Kind, uint64_t>& kinds() const { return kinds_; }

 private:
  struct Volume {
    uint64_t number = 0, snapshot = 0;
    std::optional<size_t> picture;
    bool sent = false;
    std::optional<sync::TimeNs> shown;
  };
  struct Display {
    std::string name;
    display::DisplayState state = display::DisplayState::kStopped;
    bool pattern = false;
    uint64_t patterns = 0;  // how many were set so far
    std::vector<Volume> volumes;
    std::vector<std::string> losses;
  };
  struct OnDisplay {
    bool told = false;
    std::optional<CommitOutcome::NotShown> not_shown;  // if set, why it must not be shown
    size_t losses = 0;
    uint64_t patterns = 0;
    uint64_t presented = 0;  // the volume that presented it
  };
  struct Entry {
    Commit commit;
    std::vector<OnDisplay> on;
  };

  Entry* Find(uint64_t session, uint64_t incarnation, uint64_t sequence, size_t* index);
  static Volume* FindVolume(Display& display, uint64_t number);
  // Returns whether a volume with snapshot `from` but not `to` (0: no limit) was sent before volume
  // `before`.
  static bool SentBetween(const Display& display, uint64_t from, uint64_t to, uint64_t before);
  std::string Judge(size_t index, size_t d, const CommitOutcome& outcome);
  std::string JudgePresented(Entry& entry, size_t d, const CommitOutcome& outcome);
  std::string JudgeUnchanged(const Entry& entry, size_t d, const CommitOutcome& outcome);
  std::string JudgeSuperseded(size_t index, size_t d, const CommitOutcome& outcome);

  std::vector<Display> displays_;
  std::vector<Entry> commits_;  // in the order of application
  std::map<std::pair<uint64_t, uint64_t>, std::vector<size_t>> of_stream_;
  std::map<uint64_t, size_t> pictures_;  // by snapshot
  std::map<std::tuple<size_t, uint64_t, uint64_t>, uint64_t>
      presented_;  // display, session, volume
  std::map<CommitOutcome::Kind, uint64_t> kinds_;
  uint64_t owed_ = 0, told_ = 0;
  bool removed_ = false;
};

}  // namespace voxeld::daemon::model
