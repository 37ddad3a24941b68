// Owners take turns: a large commit, many commits or many sessions of one owner do not hold up the others, neither in the
// core nor on a display.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using ::testing::ElementsAre;
using testing::EndCommit;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Optional;
using testing::Put;
using testing::Simulation;

constexpr int kLarge = 20'000;  // operations; many slices

// Passes a commit of that many entities without letting the core run.
void Hand(Simulation::Client& client, int entities, const std::string& layer = "a") {
  std::vector<Operation> all;
  for (int i = 0; i < entities; ++i) all.push_back(Put(layer, absl::StrCat(i)));
  all.push_back(EndCommit(1));
  for (Operation& operation : all) operation.sequence = ++client.last_sequence;
  client.info.intake->Take({std::move(all), {}, 100});
}

// Passes a large commit and lets the core apply its first slice.
void BeginLarge(Simulation& sim, Simulation::Client& client) {
  Hand(client, kLarge);
  sim.core->Turn(0);
  sim.core->Turn(0);
}

// Opens another session of the client's owner.
Simulation::Client OpenAgain(Simulation& sim, const Simulation::Client& client) {
  OpenOptions same;
  same.owner_token = client.info.owner_token;
  return sim.Open(same);
}

size_t CommitsAccepted(const Simulation::Client& client) {
  return client.sink->Of<Accepted>().size();
}

// Returns the number of turns of the core's thread until that many commits of `client` are
// accepted.
int TurnsUntil(Simulation& sim, const Simulation::Client& client, size_t accepted) {
  int turns = 0;
  while (CommitsAccepted(client) < accepted && turns < 1000) {
    sim.core->Turn(0);
    ++turns;
  }
  return turns;
}

TEST(CoreFair, ASmallCommitPassesAnothersLargeOne) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open(), small = sim.Open();
  BeginLarge(sim, large);
  Hand(small, 1, "b");
  EXPECT_LE(TurnsUntil(sim, small, 1), 3);
  EXPECT_EQ(CommitsAccepted(large), 0u);
  sim.core->Step();
  EXPECT_EQ(sim.List().total, kLarge + 1u);
  EXPECT_EQ(CommitsAccepted(large), 1u);
  EXPECT_LT(small.sink->Of<Accepted>()[0].second.snapshot,
            large.sink->Of<Accepted>()[0].second.snapshot);
}

TEST(CoreFair, ManySessionsOfOneOwnerGetOneTurnBetweenThem) {
  Simulation sim;
  sim.Start();
  std::vector<Simulation::Client> many = {sim.Open()};
  while (many.size() < 50) many.push_back(OpenAgain(sim, many[0]));
  auto other = sim.Open();
  for (auto& client : many) {
    for (int i = 0; i < 3; ++i) Hand(client, 1, absl::StrCat("a", client.info.session));
  }
  Hand(other, 1, "b");
  EXPECT_LE(TurnsUntil(sim, other, 1), 3);
  sim.core->Step();
  for (auto& client : many) EXPECT_EQ(CommitsAccepted(client), 3u);
}

TEST(CoreFair, AnOwnersOtherSessionsWaitForItsLargeCommit) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open();
  auto second = OpenAgain(sim, large);
  BeginLarge(sim, large);
  Hand(second, 1);  // replaces one of the others
  Hand(large, 2, "c");
  sim.core->Step();
  ASSERT_EQ(CommitsAccepted(large), 2u);
  ASSERT_EQ(CommitsAccepted(second), 1u);
  EXPECT_LT(large.sink->Of<Accepted>()[0].second.snapshot,
            second.sink->Of<Accepted>()[0].second.snapshot);
  EXPECT_EQ(sim.List().total, kLarge + 2u);
}

TEST(CoreFair, ALargeCommitOfASessionThatEndsIsAppliedFirst) {
  for (const bool taken_up : {false, true}) {
    Simulation sim;
    sim.Start();
    OpenOptions keep;
    keep.on_disconnect = DisconnectPolicy::kKeep;
    auto large = sim.Open(keep);
    auto second = OpenAgain(sim, large);
    BeginLarge(sim, large);
    Hand(second, 1, "b");
    if (taken_up) {
      OpenOptions resume;
      resume.resume_token = large.info.resume_token;
      auto next = sim.Open(resume);
      EXPECT_EQ(next.info.session, large.info.session);
      EXPECT_EQ(next.info.last_frame_id, 1u);
    } else {
      sim.Close(large);
    }
    EXPECT_EQ(sim.List().total, kLarge + 1u);
    EXPECT_EQ(CommitsAccepted(second), 1u);
  }
}

TEST(CoreFair, AnOwnerIsEvictedInTheMidstOfItsCommit) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open(), other = sim.Open();
  auto second = OpenAgain(sim, large);
  BeginLarge(sim, large);
  Hand(second, 1);
  Hand(other, 1, "b");
  OwnerControl control;
  control.owner = large.info.owner;
  control.evict = true;
  sim.core->ControlOwner(control, [](const absl::StatusOr<OwnerInfo>& info) {
    EXPECT_TRUE(info.ok()) << info.status();
  });
  sim.core->Step();
  EXPECT_TRUE(large.sink->ended.has_value());
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_EQ(CommitsAccepted(other), 1u);
}

TEST(CoreFair, WhatAnOperatorSetsMeanwhileHoldsForTheRest) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open();
  BeginLarge(sim, large);
  OwnerControl control;
  control.owner = large.info.owner;
  control.max_entities = 10'000;
  control.hidden = true;
  sim.core->ControlOwner(control, [](const absl::StatusOr<OwnerInfo>&) {});
  sim.core->Step();
  const EntityPage page = sim.List();
  EXPECT_EQ(page.total, 10'000u);
  ASSERT_FALSE(large.sink->issues.empty());
  EXPECT_THAT(large.sink->issues[0].message, HasSubstr("what an operator has set for it is 10000"));
}

constexpr int kWhole = 5'000;  // entities; large for a display

// A display shows owners' commits beside a large one of another owner, which is made ready aside.
class CoreAside : public ::testing::Test {
 protected:
  CoreAside() {
    sim_.engine().on_frame = [this](uint64_t frame, const testing::SceneModel& scene) {
      Volume& drawn = drawn_[frame];
      for (const auto& [id, d] : scene.drawables()) {
        if (scene.layers().at(d.layer).visible == 0) continue;
        const std::vector<float>& positions = scene.geometries().at(d.geometry).positions;
        if (positions.empty()) continue;  // of a test pattern
        const float x = positions[0];
        ++(x == kOfSmall ? drawn.small : x == kOfMore ? drawn.more : drawn.large);
      }
    };
    sim_.Start();
    large_ = sim_.Open();
    small_ = sim_.Open();
    sim_.Send(large_, 1, Put("a", "0", 0));
    sim_.Send(small_, 1, Put("b", "0", kOfSmall));
    ShowAll();
    sim_.hold_aside = true;
  }

  struct Volume {
    int large = 0, small = 0, more = 0;  // entities to be seen
    bool operator==(const Volume&) const = default;
    friend void PrintTo(const Volume& v, std::ostream* out) {
      *out << v.large << " large, " << v.small << " small, " << v.more << " more";
    }
  };

  // Shows the volume that was drawn. Returns: what is in it.
  std::optional<Volume> Show() {
    const display::SliceFramePtr frame = sim_.display().in_flight();
    if (frame == nullptr) return std::nullopt;
    const Volume shown = drawn_.at(frame->volume);
    sim_.Show();
    return shown;
  }
  std::vector<Volume> ShowAll() {
    std::vector<Volume> shown;
    while (const std::optional<Volume> volume = Show()) shown.push_back(*volume);
    return shown;
  }
  void SendLarge(uint64_t frame_id, int entities = kWhole, float x = 0) {
    std::vector<Operation> all;
    for (int i = 0; i < entities; ++i) all.push_back(Put("a", absl::StrCat(i), x));
    all.push_back(EndCommit(frame_id));
    for (Operation& operation : all) operation.sequence = ++large_.last_sequence;
    large_.info.intake->Take({std::move(all), {}, 100});
    sim_.core->Step();
  }
  void SendSmall(uint64_t frame_id) {
    sim_.Send(small_, frame_id, Put("b", absl::StrCat(frame_id), kOfSmall));
  }
  static std::vector<CommitOutcome::Kind> Kinds(const Simulation::Client& client,
                                                uint64_t frame_id) {
    std::vector<CommitOutcome::Kind> kinds;
    for (const CommitOutcome& outcome : client.sink->OutcomesOf(frame_id)) {
      kinds.push_back(outcome.kind);
    }
    return kinds;
  }

  static constexpr float kOfSmall = 5, kOfMore = 7;
  using Kind = CommitOutcome::Kind;
  Simulation sim_;
  Simulation::Client large_, small_;
  std::map<uint64_t, Volume> drawn_;  // by number, shown or not
};

TEST_F(CoreAside, OthersAreShownWhileALargeChangeIsMadeReadyWhichIsThenShownWhole) {
  SendLarge(2);
  EXPECT_EQ(CommitsAccepted(large_), 2u);
  EXPECT_THAT(ShowAll(), IsEmpty());
  for (uint64_t frame = 2; frame < 5; ++frame) {
    SendSmall(frame);
    EXPECT_THAT(ShowAll(), ElementsAre(Volume{1, int(frame), 0}));
    EXPECT_THAT(Kinds(small_, frame), ElementsAre(Kind::kPresented));
  }
  EXPECT_THAT(Kinds(large_, 2), IsEmpty());
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 4, 0}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
  SendSmall(5);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 5, 0}));
}

TEST_F(CoreAside, TheFirstVolumeAfterwardsIsSentWholeAndWhatFollowsIsNot) {
  SendLarge(2);
  EXPECT_TRUE(sim_.RunAside());
  for (const bool first : {true, false}) {
    const display::SliceFramePtr frame = sim_.display().in_flight();
    ASSERT_NE(frame, nullptr);
    for (const uint64_t number : frame->changed_in) EXPECT_EQ(number, frame->volume);
    ShowAll();
    if (first) SendSmall(2);
  }
}

TEST_F(CoreAside, CommitsOfTheSameOwnerWaitInTheirOrder) {
  SendLarge(2);
  sim_.Send(large_, 3, Put("c", "0", kOfMore));
  SendSmall(2);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{1, 2, 0}));
  EXPECT_TRUE(sim_.RunAside());
  // The later one is small, and is in the first volume that has the large one.
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 2, 1}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kSuperseded));
  EXPECT_THAT(Kinds(large_, 3), ElementsAre(Kind::kPresented));
}

TEST_F(CoreAside, ALargeChangeAfterALargeChangeIsShownAfterIt) {
  SendLarge(2);
  SendLarge(3, kWhole, kOfMore);
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(Show(), Optional(Volume{kWhole, 1, 0}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
  SendSmall(2);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 2, 0}));
  EXPECT_THAT(Kinds(large_, 3), IsEmpty());
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{0, 2, kWhole}));
  EXPECT_THAT(Kinds(large_, 3), ElementsAre(Kind::kPresented));
  EXPECT_EQ(sim_.engine().engines, 2) << "the two take turns";
}

TEST_F(CoreAside, LargeChangesOfTwoOwnersAreShownOneAfterTheOtherAndNothingGoesBack) {
  auto third = sim_.Open();
  SendLarge(2);
  SendSmall(2);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{1, 2, 0}));
  std::vector<Operation> all;
  for (int i = 0; i < kWhole; ++i) all.push_back(Put("b", absl::StrCat("x", i), kOfMore));
  all.push_back(EndCommit(3));
  for (Operation& operation : all) operation.sequence = ++small_.last_sequence;
  small_.info.intake->Take({std::move(all), {}, 100});
  sim_.core->Step();
  sim_.Send(third, 1, Put("d", "0", kOfSmall));
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{1, 3, 0}));
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 3, 0}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
  EXPECT_THAT(Kinds(small_, 3), IsEmpty());
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 3, kWhole}));
  EXPECT_THAT(Kinds(small_, 3), ElementsAre(Kind::kPresented));
}

TEST_F(CoreAside, WhatOthersChangedMuchMeanwhileIsMadeReadyBeforeItTakesOver) {
  SendLarge(2);
  constexpr int kEach = 1000, kCommits = 5;
  for (int commit = 0; commit < kCommits; ++commit) {
    std::vector<Operation> all;
    for (int i = 0; i < kEach; ++i) {
      all.push_back(Put("b", absl::StrCat("x", commit * kEach + i), kOfMore));
    }
    all.push_back(EndCommit(10 + commit));
    for (Operation& operation : all) operation.sequence = ++small_.last_sequence;
    small_.info.intake->Take({std::move(all), {}, 100});
    sim_.core->Step();
    EXPECT_THAT(ShowAll(), ElementsAre(Volume{1, 1, (commit + 1) * kEach}));
  }
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), IsEmpty());
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 1, kCommits * kEach}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
}

TEST_F(CoreAside, ACaptureThatWantsTheLargeCommitWaitsForIt) {
  SendLarge(2);
  std::optional<absl::StatusOr<display::DecodedVolume>> captured;
  const uint64_t snapshot = large_.sink->Of<Accepted>()[1].second.snapshot;
  sim_.core->Capture("", sync::kSecond, snapshot,
                     [&](auto volume) { captured = std::move(volume); });
  sim_.core->Step();
  SendSmall(2);
  ShowAll();
  EXPECT_FALSE(captured.has_value());
  EXPECT_TRUE(sim_.RunAside());
  ShowAll();
  ASSERT_TRUE(captured.has_value());
  EXPECT_TRUE(captured->ok()) << captured->status();
}

TEST_F(CoreAside, AnOwnerAloneIsDrawnAsItComes) {
  sim_.Close(small_);
  ShowAll();
  SendLarge(2);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 0, 0}));
  EXPECT_EQ(sim_.engine().engines, 1);
}

TEST_F(CoreAside, WhatCannotBeMadeReadyIsDrawnAsItComes) {
  SendLarge(2);
  sim_.engine().fail_staging = true;
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 1, 0}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
  // For a while nothing is tried again.
  SendLarge(3, kWhole, kOfMore);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{0, 1, kWhole}));
  EXPECT_TRUE(sim_.aside.empty());
  sim_.Advance(11 * sync::kSecond);
  SendLarge(4);
  EXPECT_THAT(ShowAll(), IsEmpty());
  EXPECT_TRUE(sim_.RunAside());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 1, 0}));
}

TEST_F(CoreAside, WithoutAnEngineToBeHadItIsDrawnAsItComes) {
  sim_.make_engine_fails = absl::ResourceExhaustedError("no engine, as planned");
  SendLarge(2);
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 1, 0}));
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kPresented));
}

TEST_F(CoreAside, ATestPatternAndALostDisplayEndTheWaiting) {
  SendLarge(2);
  DisplayUpdate pattern;
  pattern.pattern = TestPattern::kWhite;
  ASSERT_TRUE(sim_.Update(pattern).ok());
  EXPECT_THAT(Kinds(large_, 2), ElementsAre(Kind::kNotShown));
  ShowAll();
  pattern.pattern = TestPattern::kNone;
  ASSERT_TRUE(sim_.Update(pattern).ok());
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{kWhole, 1, 0}));

  SendLarge(3, kWhole, kOfMore);
  sim_.display().Lose("unplugged");
  sim_.core->Step();
  EXPECT_THAT(Kinds(large_, 3), ElementsAre(Kind::kLost));
  sim_.display().Attach();
  sim_.core->Step();
  EXPECT_THAT(ShowAll(), ElementsAre(Volume{0, 1, kWhole}));
  while (sim_.RunAside()) {
  }
  EXPECT_THAT(ShowAll(), IsEmpty());
}

TEST_F(CoreAside, TheOtherEngineIsLetGoSomeSecondsLaterAndItsMemoryIsGivenBack) {
  sim_.engine().memory_bytes = 1'000'000;
  const uint64_t before = sim_.GetStats().memory.engines;
  SendLarge(2);
  EXPECT_TRUE(sim_.RunAside());
  ShowAll();
  const uint64_t both = sim_.GetStats().memory.engines;
  EXPECT_GE(both, 1'000'000u + before);
  sim_.Advance(31 * sync::kSecond);
  SendSmall(2);
  ShowAll();
  const uint64_t one = sim_.GetStats().memory.engines;
  EXPECT_LT(one, both);
  EXPECT_GE(one, 1'000'000u);
}

// Owners, each of whose commits replaces all that the owner has by entities that bear the commit's number. So every volume
// tells which commit of each owner it shows, and whether it shows it whole.
class ManyAside {
 public:
  explicit ManyAside(uint32_t seed) : random_(seed), sim_({}, 1, nullptr, {}, /*large_change=*/6) {
    sim_.engine().on_frame = [this](uint64_t frame, const testing::SceneModel& scene) {
      std::map<int, std::multiset<int>>& drawn = drawn_[frame];
      for (const auto& [id, d] : scene.drawables()) {
        const auto x = static_cast<int>(scene.geometries().at(d.geometry).positions.at(0));
        drawn[x / kMostCommits].insert(x % kMostCommits);
      }
    };
    sim_.Start();
    sim_.hold_aside = true;
    for (int owner = 0; owner < kOwners; ++owner) clients_.push_back(sim_.Open());
  }

  void Run(int steps) {
    for (int step = 0; step < steps && !::testing::Test::HasFailure(); ++step) {
      switch (Below(8)) {
        case 0:
          while (ShowOne()) {
          }
          break;
        case 1:
          sim_.RunAside();
          break;
        case 2:
          if (Below(8) == 0) Update();
          break;
        case 3:
          if (Below(16) == 0) sim_.engine().fail_staging = true;
          if (Below(4) == 0) sim_.Advance(Below(4) * sync::kSecond);
          break;
        case 4:
        case 5:
          ShowOne();
          break;
        default:
          Commit(Below(kOwners));
      }
    }
    sim_.engine().fail_staging = false;
    for (int i = 0; i < 2; ++i) {
      do {
        while (ShowOne()) {
        }
      } while (sim_.RunAside());
      sim_.Advance(2 * sync::kSecond);  // an engine that failed is tried again
    }
    for (int owner = 0; owner < kOwners; ++owner) {
      EXPECT_EQ(shown_[owner], commits_[owner]) << "at rest everything is shown";
      for (int commit = 1; commit <= commits_[owner]; ++commit) {
        const auto outcomes = clients_[owner].sink->OutcomesOf(uint64_t(commit));
        ASSERT_EQ(outcomes.size(), 1u) << "of commit " << commit << " of owner " << owner;
        if (outcomes[0].kind != CommitOutcome::Kind::kPresented) continue;
        EXPECT_EQ(in_volume_.at(outcomes[0].volume)[owner], commit);
      }
    }
  }

  int engines() { return sim_.engine().engines; }

 private:
  static constexpr int kOwners = 3, kMostCommits = 1000;

  int Below(int end) { return std::uniform_int_distribution<>(0, end - 1)(random_); }

  void Commit(int owner) {
    Simulation::Client& client = clients_[owner];
    const int commit = ++commits_[owner];
    const int size = sizes_[owner][commit] = Below(3) == 0 ? 5 + Below(10) : 1 + Below(3);
    const int first = Below(4);
    std::vector<Operation> all = {testing::DeleteAllOf("a")};
    for (int i = first; i < first + size; ++i) {
      all.push_back(Put("a", absl::StrCat(i), static_cast<float>(owner * kMostCommits + commit)));
    }
    all.push_back(EndCommit(uint64_t(commit)));
    for (Operation& operation : all) operation.sequence = ++client.last_sequence;
    client.info.intake->Take({std::move(all), {}, 100});
    sim_.core->Step();
  }

  void Update() {
    DisplayUpdate update;
    update.view.emplace();
    update.view->transform = testing::Shift(Below(3));
    ASSERT_TRUE(sim_.Update(update).ok());
  }

  bool ShowOne() {
    const display::SliceFramePtr frame = sim_.display().in_flight();
    if (frame == nullptr) return false;
    for (const auto& [owner, numbers] : drawn_.at(frame->volume)) {
      const int commit = *numbers.begin();
      EXPECT_EQ(*numbers.rbegin(), commit) << "a volume shows parts of two commits";
      EXPECT_EQ(static_cast<int>(numbers.size()), sizes_[owner][commit]) << "not whole";
      EXPECT_GE(commit, shown_[owner]) << "an owner's scene went back";
      shown_[owner] = commit;
    }
    in_volume_[frame->volume] = shown_;
    // A device that is sent what changed since the volume that it has.
    const size_t size = frame->layout.bytes_per_slice();
    device_.resize(frame->bytes.size());
    for (size_t picture = 0; picture < frame->changed_in.size(); ++picture) {
      const auto from = frame->bytes.begin() + static_cast<ptrdiff_t>(picture * size);
      const auto to = device_.begin() + static_cast<ptrdiff_t>(picture * size);
      if (frame->changed_in[picture] > device_has_) std::copy_n(from, size, to);
    }
    EXPECT_EQ(device_, frame->bytes) << "volume " << frame->volume;
    device_has_ = frame->volume;
    return sim_.Show();
  }

  std::mt19937 random_;
  Simulation sim_;
  std::vector<Simulation::Client> clients_;
  std::map<int, int> commits_, shown_;       // by owner
  std::map<int, std::map<int, int>> sizes_;  // by owner and commit
  std::map<uint64_t, std::map<int, int>> in_volume_;
  std::map<uint64_t, std::map<int, std::multiset<int>>> drawn_;  // by number
  std::vector<std::byte> device_;
  uint64_t device_has_ = 0;
};

TEST(CoreAsideRandom, EveryVolumeShowsWholeCommitsInEachOwnersOrder) {
  int engines = 0;
  for (uint32_t seed = 1; seed <= 200 && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    ManyAside many(seed);
    many.Run(150);
    engines += many.engines() - 1;
  }
  EXPECT_GT(engines, 100) << "large changes are made ready aside";
}

}  // namespace
}  // namespace voxeld::daemon
