// What became of every commit on every display, judged by what was asked of the engines, sent to the
// devices and shown: exactly one outcome each, of the kind that the rules allow (rider_book.h).
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
    sync::TimeNs present_at = 0;  // 0: as soon as it may
  };

  // ---- what happened, as it happened
  void Applied(const Commit& commit);
  void Pictured(uint64_t snapshot, size_t picture) { pictures_[snapshot] = picture; }
  void Asked(size_t display, uint64_t volume, uint64_t snapshot);
  void Drawn(size_t display, uint64_t volume, size_t picture);
  void Sent(size_t display, uint64_t volume);
  void Shown(size_t display, uint64_t volume, sync::TimeNs time);
  // Something that may lose volumes; outcomes name `reason` in theirs.
  void Loss(size_t display, const std::string& reason);
  void State(size_t display, display::DisplayState state);
  void Pattern(size_t display, bool on);
  void Removed() { removed_ = true; }  // displays have ended; the core has not

  // An outcome that a client of `session` was told. What is wrong with it; empty: nothing.
  std::string Told(uint64_t session, uint64_t frame_id, uint64_t sequence, uint64_t incarnation,
                   const CommitOutcome& outcome);
  // It comes again: the client did not get it.
  void TakeBack(uint64_t session, uint64_t sequence, uint64_t incarnation,
                const std::string& display);

  // Whether the volume that was shown last looks like that.
  bool ShowsLast(size_t display, size_t picture) const;

  // Outcomes asked for: all, and those told.
  uint64_t owed() const { return owed_; }
  uint64_t told() const { return told_; }
  uint64_t commits() const { return commits_.size(); }
  // Of this incarnation of the session, not told; the first is described.
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
    uint64_t patterns = 0;  // set so far
    std::vector<Volume> volumes;
    std::vector<std::string> losses;
  };
  struct OnDisplay {
    bool told = false;
    std::optional<CommitOutcome::NotShown> not_shown;  // it must be, for this reason
    size_t losses = 0;
    uint64_t patterns = 0;
    uint64_t presented = 0;  // in which volume
  };
  struct Entry {
    Commit commit;
    std::vector<OnDisplay> on;
  };

  Entry* Find(uint64_t session, uint64_t incarnation, uint64_t sequence, size_t* index);
  static Volume* FindVolume(Display& display, uint64_t number);
  // Whether a volume that holds `from` but not `to` (0: not anything) was sent before volume `before`.
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
