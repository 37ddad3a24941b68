// Exactly one outcome for every commit and display, and the right one, whatever happens: random
// clients, devices and engines, in one thread under a clock that stands still. What was drawn is
// seen through the engine: a hidden layer carries the number of the newest commit that the scene
// contains, so every frame says what it is of.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Put;
using testing::SceneModel;
using testing::Simulation;
using Kind = CommitOutcome::Kind;
using NotShown = CommitOutcome::NotShown;

constexpr int kDisplays = 2;

struct SentCommit {
  uint64_t session = 0;
  size_t client = 0;
  bool hidden = false;
  // Of each display, when it was applied.
  display::DisplayState state[kDisplays] = {};
  bool pattern[kDisplays] = {};
};

struct DrawnFrame {
  uint64_t contains = 0;  // newest commit
  std::vector<std::string> picture;
};

class RandomRun {
 public:
  explicit RandomRun(uint32_t seed) : random_(seed), sim_({}, kDisplays) {
    for (int d = 0; d < kDisplays; ++d) {
      sim_.engine(d).on_frame = [this, d](uint64_t frame, const SceneModel& scene) {
        frames_[d][frame] = {StampOf(scene), scene.Canonical(true)};
      };
    }
    sim_.display(1).attach_at_once = seed % 2 == 0;
    sim_.Start();
  }

  std::map<Kind, int> kinds;  // outcomes seen, by kind

  void Run(int steps) {
    for (int i = 0; i < steps; ++i) {
      Step();
      CheckSums();
    }
    if (random_() % 2 == 0) Settle();
    EXPECT_TRUE(sim_.core->Stop(sync::kSecond).ok());
    CheckOutcomes();
  }

 private:
  uint32_t Pick(uint32_t n) { return random_() % n; }

  // The newest commit that the scene contains: the greatest number in the layers of stamps.
  static uint64_t StampOf(const SceneModel& scene) {
    uint64_t stamp = 0;
    for (const auto& [id, drawable] : scene.drawables()) {
      if (scene.layers().at(drawable.layer).visible != 0) continue;
      const float x = scene.geometries().at(drawable.geometry).positions[0];
      stamp = std::max(stamp, static_cast<uint64_t>(x));
    }
    return stamp;
  }

  void Step() {
    const int d = static_cast<int>(Pick(kDisplays));
    switch (Pick(16)) {
      case 0:
        if (open_.size() < 4) {
          OpenOptions options;
          options.on_disconnect = DisconnectPolicy::kKeep;  // stamps must stay
          clients_.push_back(sim_.Open(options));
          open_.push_back(clients_.size() - 1);
          closed_.push_back(false);
          sim_.Send(clients_.back(), 0, testing::SetLayer("stamp", false));
        }
        break;
      case 1:
        if (!open_.empty() && Pick(6) == 0) {
          const size_t i = Pick(static_cast<uint32_t>(open_.size()));
          sim_.Close(clients_[open_[i]]);
          closed_[open_[i]] = true;
          open_.erase(open_.begin() + static_cast<std::ptrdiff_t>(i));
        }
        break;
      case 2:
      case 3:
      case 4:
      case 5:
        SendCommit();
        break;
      case 6:
      case 7:
      case 8:
        sim_.Show(d);
        break;
      case 9:
        if (Pick(3) == 0) sim_.display(d).Abort("aborted by the device");
        break;
      case 10:
        if (Pick(4) == 0) {
          if (sim_.display(d).state() == display::DisplayState::kShowing) {
            sim_.display(d).Lose("cable pulled");
          } else if (!sim_.display(d).blanked()) {
            sim_.display(d).Attach();
          }
        }
        break;
      case 11:
        if (Pick(4) == 0) {
          DisplayUpdate update;
          update.blank = !sim_.display(d).blanked();
          EXPECT_TRUE(sim_.Update(update, d == 0 ? "main" : "display1").ok());
        }
        break;
      case 12:
        sim_.engine(d).inline_calls = Pick(3) == 0 && sim_.engine(d).calls.empty();
        break;
      case 13:
      case 14:
        sim_.engine(d).Run();
        break;
      case 15:
        if (Pick(8) == 0) {
          sim_.engine(d).fail = absl::InternalError("the frame failed");
        } else if (Pick(8) == 0) {
          sim_.engine(0).fail = absl::DataLossError("the engine is gone");
        } else if (Pick(8) == 0) {
          DisplayUpdate update;
          update.pattern = pattern_[d] ? TestPattern::kNone : TestPattern::kGrid;
          pattern_[d] = !pattern_[d];
          EXPECT_TRUE(sim_.Update(update, d == 0 ? "main" : "display1").ok());
        }
        break;
    }
    sim_.Advance(static_cast<sync::TimeNs>(Pick(4)) * 10 * sync::kMillisecond);
  }

  void SendCommit() {
    if (open_.empty()) return;
    const size_t client = open_[Pick(static_cast<uint32_t>(open_.size()))];
    SentCommit commit;
    commit.client = client;
    commit.hidden = Pick(5) == 0;
    for (int d = 0; d < kDisplays; ++d) {
      commit.state[d] = sim_.display(d).state();
      commit.pattern[d] = pattern_[d];
    }
    sent_.push_back(commit);
    const uint64_t number = sent_.size();
    const auto stamp = Put("stamp", "s", static_cast<float>(number));
    if (commit.hidden) {
      sim_.Send(clients_[client], number, stamp);
    } else {
      // Few different pictures, so that many come out the same.
      sim_.Send(clients_[client], number, stamp, Put("seen", "x", static_cast<float>(Pick(2))));
    }
  }

  // Everything comes back and is shown; then the display holds the scene as it is.
  void Settle() {
    for (int d = 0; d < kDisplays; ++d) {
      DisplayUpdate update;
      update.blank = false;
      update.pattern = TestPattern::kNone;
      EXPECT_TRUE(sim_.Update(update, d == 0 ? "main" : "display1").ok());
      if (sim_.display(d).state() != display::DisplayState::kShowing) sim_.display(d).Attach();
      sim_.engine(d).fail.reset();
      pattern_[d] = false;
    }
    for (int i = 0; i < 20; ++i) {
      for (int d = 0; d < kDisplays; ++d) {
        sim_.engine(d).Run();
        sim_.Show(d);
      }
      sim_.Advance(sync::kSecond);
    }
    for (int d = 0; d < kDisplays; ++d) {
      const auto newest = frames_[d].rbegin();
      EXPECT_EQ(newest->second.contains, sent_.size());
      EXPECT_EQ(sim_.GetStats().displays[d].commits_pending, 0u);
    }
    undelivered_ = sim_.GetStats().outcomes_undelivered;
  }

  void CheckSums() {
    const Stats stats = sim_.GetStats();
    EXPECT_EQ(stats.commits_accepted, sent_.size());
    for (const DisplayFigures& f : stats.displays) {
      ASSERT_EQ(f.commits_owed, sent_.size());
      ASSERT_EQ(f.commits_owed, f.commits_presented + f.commits_unchanged + f.commits_superseded +
                                    f.commits_lost + f.commits_not_shown + f.commits_pending);
    }
  }

  void CheckOutcomes() {
    size_t undelivered = 0;
    for (uint64_t number = 1; number <= sent_.size(); ++number) {
      const SentCommit& commit = sent_[number - 1];
      const auto outcomes = clients_[commit.client].sink->OutcomesOf(number);
      std::map<std::string, CommitOutcome> by_display;
      for (const CommitOutcome& outcome : outcomes) {
        ASSERT_TRUE(by_display.emplace(outcome.display, outcome).second) << "told twice";
      }
      for (int d = 0; d < kDisplays; ++d) {
        const auto it = by_display.find(d == 0 ? "main" : "display1");
        if (it == by_display.end()) {
          ASSERT_TRUE(closed_[commit.client]) << "commit " << number << " was told nothing";
          ++undelivered;
          continue;
        }
        CheckOutcome(number, commit, d, it->second);
      }
    }
    EXPECT_EQ(undelivered, undelivered_.value_or(undelivered));
  }

  // The first frame drawn from a scene that contains commit `number`; 0: none was.
  uint64_t FirstFrameWith(int d, uint64_t number) const {
    for (const auto& [frame, drawn] : frames_[d]) {
      if (drawn.contains >= number) return frame;
    }
    return 0;
  }

  void CheckOutcome(uint64_t number, const SentCommit& commit, int d,
                    const CommitOutcome& outcome) {
    SCOPED_TRACE(::testing::Message() << "commit " << number << " on display " << d);
    ++kinds[outcome.kind];
    // Rule 1 decides alone.
    std::optional<NotShown> why;
    if (commit.state[d] == display::DisplayState::kBlanked) {
      why = NotShown::kBlanked;
    } else if (commit.state[d] != display::DisplayState::kShowing) {
      why = NotShown::kAbsent;
    } else if (commit.hidden || commit.pattern[d]) {
      why = NotShown::kHidden;
    }
    if (why.has_value()) {
      EXPECT_EQ(outcome.kind, Kind::kNotShown);
      EXPECT_EQ(outcome.why, *why);
      return;
    }
    const uint64_t first = FirstFrameWith(d, number);
    switch (outcome.kind) {
      case Kind::kPresented: {
        ASSERT_TRUE(frames_[d].contains(outcome.volume));
        EXPECT_EQ(outcome.volume, first);  // the first drawn with it
        break;
      }
      case Kind::kUnchanged: {
        ASSERT_TRUE(frames_[d].contains(outcome.volume));
        ASSERT_NE(first, 0u);
        EXPECT_LT(outcome.volume, first);
        EXPECT_EQ(frames_[d].at(outcome.volume).picture, frames_[d].at(first).picture);
        break;
      }
      case Kind::kSuperseded: {
        ASSERT_GT(outcome.by_frame_id, number);
        const SentCommit& by = sent_[outcome.by_frame_id - 1];
        EXPECT_EQ(by.client, commit.client);
        EXPECT_FALSE(by.hidden);
        // They rode in one volume: no frame was drawn with the one and without the other.
        EXPECT_EQ(FirstFrameWith(d, outcome.by_frame_id), first);
        break;
      }
      case Kind::kLost:
        EXPECT_FALSE(outcome.reason.empty());
        break;
      case Kind::kNotShown:
        EXPECT_EQ(outcome.why, NotShown::kHidden);  // a test pattern came before it was drawn
        break;
    }
  }

  std::mt19937 random_;
  Simulation sim_;
  std::vector<Simulation::Client> clients_;
  std::vector<bool> closed_;
  std::vector<size_t> open_;
  std::vector<SentCommit> sent_;  // commit n is sent_[n − 1]; its frame id is n
  std::map<uint64_t, DrawnFrame> frames_[kDisplays];
  bool pattern_[kDisplays] = {};
  std::optional<uint64_t> undelivered_;  // by the core's count, once nothing was pending any more
};

TEST(CoreRandom, EveryCommitGetsExactlyOneRightOutcome) {
  std::map<Kind, int> kinds;
  for (uint32_t seed = 1; seed <= 150; ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    RandomRun run(seed);
    run.Run(150);
    if (::testing::Test::HasFailure()) return;
    for (const auto& [kind, count] : run.kinds) kinds[kind] += count;
  }
  // Every kind has been met, often.
  for (const Kind kind :
       {Kind::kPresented, Kind::kUnchanged, Kind::kSuperseded, Kind::kLost, Kind::kNotShown}) {
    EXPECT_GT(kinds[kind], 100) << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace voxeld::daemon
