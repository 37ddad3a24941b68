// Compares RiderBook with a flat list of riders that is searched from end to end at every event.
#include "daemon/pipeline/rider_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <tuple>

namespace voxeld::daemon {
namespace {

using Kind = CommitOutcome::Kind;

// A reported outcome: (frame id, kind, volume or superseding frame, reason).
using Told = std::tuple<uint64_t, Kind, uint64_t, std::string>;

Told Flatten(const Rider& rider, const CommitOutcome& outcome) {
  return {rider.frame_id, outcome.kind,
          outcome.kind == Kind::kSuperseded ? outcome.by_frame_id : outcome.volume, outcome.reason};
}

class FlatModel {
 public:
  std::map<uint64_t, Told> told;  // by frame id

  void Board(const Rider& rider) { all_.push_back({rider, Place::kWaiting, 0}); }
  void Draw() {
    for (Entry& e : all_) {
      if (e.place == Place::kWaiting) e.place = Place::kDrawing;
    }
    Supersede(Place::kDrawing, 0);
  }
  void Redraw() {
    for (Entry& e : all_) {
      if (e.place == Place::kDrawing) e.place = Place::kWaiting;
    }
  }
  void Submit(uint64_t volume) {
    for (Entry& e : all_) {
      if (e.place == Place::kDrawing)
        std::tie(e.place, e.volume) = std::tuple(Place::kRiding, volume);
    }
    known_.insert({volume, true});
  }
  void Unchanged(uint64_t before) {
    for (Entry& e : all_) {
      if (e.place != Place::kDrawing) continue;
      if (known_.contains(before)) {
        std::tie(e.place, e.volume) = std::tuple(Place::kSame, before);
      } else {
        End(e, Kind::kUnchanged, before, "");
      }
    }
  }
  void LoseUnsubmitted(const std::string& reason, bool waiting) {
    for (Entry& e : all_) {
      if (e.place == Place::kDrawing || (waiting && e.place == Place::kWaiting)) {
        End(e, Kind::kLost, 0, reason);
      }
    }
  }
  void OnOutcome(const display::VolumeOutcome& o) {
    known_.erase(o.volume);
    for (Entry& e : all_) {
      if ((e.place != Place::kRiding && e.place != Place::kSame) || e.volume != o.volume) continue;
      switch (o.kind) {
        case display::VolumeOutcome::Kind::kPresented:
          End(e, e.place == Place::kRiding ? Kind::kPresented : Kind::kUnchanged, o.volume, "");
          break;
        case display::VolumeOutcome::Kind::kLost:
          End(e, Kind::kLost, 0, o.reason);
          break;
        case display::VolumeOutcome::Kind::kReplaced:
          std::tie(e.place, e.volume) = std::tuple(Place::kRiding, o.replaced_by);
          break;
      }
    }
    if (o.kind == display::VolumeOutcome::Kind::kReplaced) Supersede(Place::kRiding, o.replaced_by);
  }
  uint64_t pending() const {
    return std::count_if(all_.begin(), all_.end(),
                         [](const Entry& e) { return e.place != Place::kDone; });
  }

 private:
  enum class Place { kWaiting, kDrawing, kRiding, kSame, kDone };
  struct Entry {
    Rider rider;
    Place place;
    uint64_t volume;
  };

  void End(Entry& e, Kind kind, uint64_t volume, const std::string& reason) {
    e.place = Place::kDone;
    told[e.rider.frame_id] = {e.rider.frame_id, kind, volume, reason};
  }
  // Supersedes all but the newest commit of each session in one place; each by the next one.
  void Supersede(Place place, uint64_t volume) {
    for (size_t i = 0; i < all_.size(); ++i) {
      if (all_[i].place != place || all_[i].volume != volume) continue;
      for (size_t j = i + 1; j < all_.size(); ++j) {
        if (all_[j].place == place && all_[j].volume == volume &&
            all_[j].rider.session == all_[i].rider.session) {
          End(all_[i], Kind::kSuperseded, all_[j].rider.frame_id, "");
          break;
        }
      }
    }
  }

  std::vector<Entry> all_;          // in order of application
  std::map<uint64_t, bool> known_;  // volumes without an outcome
};

TEST(RiderBook, AgreesWithAFlatListOverRandomEvents) {
  for (uint32_t seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    std::map<uint64_t, Told> told;
    RiderBook book("d", [&](const Rider& rider, const CommitOutcome& outcome) {
      EXPECT_EQ(outcome.display, "d");
      EXPECT_TRUE(told.emplace(rider.frame_id, Flatten(rider, outcome)).second)
          << "reported twice, frame " << rider.frame_id;
    });
    FlatModel model;
    uint64_t frame = 0, volume = 0, newest = 0;
    std::vector<uint64_t> open;  // submitted and without an outcome, in ascending order
    bool drawing = false;
    for (int step = 0; step < 300; ++step) {
      switch (random() % 8) {
        case 0:
        case 1:
        case 2: {
          const Rider rider{1 + random() % 3, ++frame, frame, 0};
          book.Board(rider);
          model.Board(rider);
          break;
        }
        case 3:
          if (drawing) break;
          drawing = true;
          book.Draw();
          model.Draw();
          break;
        case 4:
          if (!std::exchange(drawing, false)) break;
          if (random() % 3 == 0 && newest != 0) {
            book.Unchanged(newest);
            model.Unchanged(newest);
          } else {
            newest = ++volume;
            book.Submit(newest);
            model.Submit(newest);
            open.push_back(newest);
          }
          break;
        case 5:
        case 6: {
          if (open.empty()) break;
          display::VolumeOutcome outcome;
          const size_t i = random() % open.size();
          outcome.volume = open[i];
          const bool newer = i + 1 < open.size();
          switch (random() % 3) {
            case 0:
              outcome.kind = display::VolumeOutcome::Kind::kPresented;
              break;
            case 1:
              outcome.kind = display::VolumeOutcome::Kind::kLost;
              outcome.reason = "three slices are missing";
              if (outcome.volume == newest) newest = 0;
              break;
            case 2:
              if (!newer) continue;
              outcome.kind = display::VolumeOutcome::Kind::kReplaced;
              outcome.replaced_by = open[i + 1];
              break;
          }
          open.erase(open.begin() + static_cast<std::ptrdiff_t>(i));
          book.OnOutcome(outcome);
          model.OnOutcome(outcome);
          break;
        }
        case 7: {
          if (random() % 3 != 0) break;
          if (drawing && random() % 2 == 0) {
            book.Redraw();
            model.Redraw();
          } else {
            const bool waiting = random() % 2 == 0;
            book.LoseUnsubmitted("lost", waiting);
            model.LoseUnsubmitted("lost", waiting);
          }
          drawing = false;
          break;
        }
      }
      ASSERT_EQ(told, model.told) << "seed " << seed << " step " << step;
      ASSERT_EQ(book.pending(), model.pending());
      const RiderBook::Counts& c = book.counts();
      ASSERT_EQ(c.owed, frame);
      ASSERT_EQ(c.owed,
                c.presented + c.unchanged + c.superseded + c.lost + c.not_shown + book.pending());
    }
  }
}

TEST(RiderBook, ReplacedByWhatHasEndedIsLost) {
  std::vector<Told> told;
  RiderBook book("d",
                 [&](const Rider& r, const CommitOutcome& o) { told.push_back(Flatten(r, o)); });
  book.Board({1, 5, 9, 0});
  book.Draw();
  book.Submit(1);
  display::VolumeOutcome outcome;
  outcome.kind = display::VolumeOutcome::Kind::kReplaced;
  outcome.volume = 1;
  outcome.replaced_by = 2;
  book.OnOutcome(outcome);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(std::get<1>(told[0]), Kind::kLost);
  EXPECT_THAT(std::get<3>(told[0]), ::testing::HasSubstr("volume 2"));
  EXPECT_EQ(book.pending(), 0u);
}

Rider RiderOf(uint64_t session, uint64_t frame, uint64_t snapshot) {
  Rider rider;
  rider.session = session;
  rider.frame_id = rider.sequence = frame;
  rider.snapshot = snapshot;
  return rider;
}

TEST(RiderBook, WhatTheSnapshotDoesNotContainWaits) {
  std::vector<Told> told;
  RiderBook book("d",
                 [&](const Rider& r, const CommitOutcome& o) { told.push_back(Flatten(r, o)); });
  book.Board(RiderOf(1, 1, 4));
  book.Board(RiderOf(2, 2, 5));
  book.Board(RiderOf(1, 3, 6));
  book.Draw(5);
  book.Submit(1);
  display::VolumeOutcome shown;
  shown.kind = display::VolumeOutcome::Kind::kPresented;
  shown.volume = 1;
  book.OnOutcome(shown);
  ASSERT_EQ(told.size(), 2u);
  EXPECT_EQ(std::get<0>(told[0]), 1u);
  EXPECT_EQ(std::get<0>(told[1]), 2u);
  EXPECT_EQ(book.pending(), 1u);
  book.Draw(6);
  book.Submit(2);
  shown.volume = 2;
  book.OnOutcome(shown);
  EXPECT_EQ(std::get<0>(told.back()), 3u);
}

TEST(RiderBook, OfAnOwnerWhoIsHeldBackWhatItsOlderPartDoesNotContainWaits) {
  std::vector<Told> told;
  RiderBook book("d",
                 [&](const Rider& r, const CommitOutcome& o) { told.push_back(Flatten(r, o)); });
  for (uint64_t frame = 1; frame <= 4; ++frame) {
    Rider rider = RiderOf(frame % 2, frame, frame);
    rider.owner = 10 + frame % 2;
    book.Board(rider);
  }
  book.Draw(4, {{11, 1}});
  book.Submit(1);
  // The other owner's two are in it, of which the later supersedes the earlier.
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0], (Told{2, Kind::kSuperseded, 4, ""}));
  book.Draw(4);
  book.Submit(2);
  display::VolumeOutcome shown;
  shown.kind = display::VolumeOutcome::Kind::kPresented;
  shown.volume = 1;
  book.OnOutcome(shown);
  shown.volume = 2;
  book.OnOutcome(shown);
  EXPECT_THAT(told, ::testing::UnorderedElementsAre(
                        Told{2, Kind::kSuperseded, 4, ""}, Told{1, Kind::kPresented, 1, ""},
                        Told{4, Kind::kPresented, 1, ""}, Told{3, Kind::kPresented, 2, ""}));
}

TEST(RiderBook, RidersOfAVolumeThatIsDrawnAgainRideAgainBeforeLaterOnes) {
  std::vector<Told> told;
  RiderBook book("d",
                 [&](const Rider& r, const CommitOutcome& o) { told.push_back(Flatten(r, o)); });
  book.Board(RiderOf(1, 1, 1));
  book.Draw(1);
  book.Submit(1);
  book.Board(RiderOf(1, 2, 2));
  book.Reboard(1);
  book.Reboard(7);  // does not exist
  EXPECT_TRUE(told.empty());
  EXPECT_EQ(book.pending(), 2u);
  book.Draw(2);
  book.Submit(2);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0], (Told{1, Kind::kSuperseded, 2, ""}));
  EXPECT_EQ(book.counts().owed, 2u);
}

TEST(RiderBook, WhatWaitsMayBeHidden) {
  std::vector<CommitOutcome> told;
  RiderBook book("d", [&](const Rider&, const CommitOutcome& o) { told.push_back(o); });
  book.Board({1, 1, 1, 0});
  book.Draw();
  book.Board({1, 2, 2, 0});
  book.HideWaiting();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0].kind, Kind::kNotShown);
  EXPECT_EQ(told[0].why, CommitOutcome::NotShown::kHidden);
  EXPECT_EQ(book.pending(), 1u);
}

}  // namespace
}  // namespace voxeld::daemon
