// Tests the core with its threads, the CPU engine and the simulated display: everything as in
// production, for the sanitizers and for the light that comes out at the end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <thread>

#include "daemon/core/core.h"
#include "display/drivers/registry.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "tests/daemon/fakes/operations.h"
#include "tests/daemon/fakes/recording_engine.h"
#include "tests/daemon/fakes/scripted_display.h"

namespace voxeld::daemon {
namespace {

using testing::Dots;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::Put;
using Kind = CommitOutcome::Kind;

constexpr sync::TimeNs kGenerous = 60 * sync::kSecond;

sync::SystemClock& TheClock() {
  static sync::SystemClock clock;
  return clock;
}

// Collects in the core's thread; waits in the test's.
class WaitingSink final : public SessionSink {
 public:
  void OnIssue(const Issue& issue) override {
    sync::MutexLock lock(mutex_);
    issues_.push_back(issue);
  }
  void OnReceipt(const Receipt& receipt) override {
    sync::MutexLock lock(mutex_);
    receipts_.push_back(receipt);
    changed_.NotifyAll();
  }
  // Waits for that many receipts. Returns false if that takes too long.
  bool Await(size_t count) {
    return AwaitThat([count](const std::vector<Receipt>& all) { return all.size() >= count; });
  }
  // Waits until that many commits were accepted.
  bool AwaitAccepted(int64_t count) {
    return AwaitThat([count](const std::vector<Receipt>& all) {
      return std::count_if(all.begin(), all.end(), [](const Receipt& receipt) {
               return std::holds_alternative<Accepted>(receipt.what);
             }) >= count;
    });
  }
  bool AwaitThat(const std::function<bool(const std::vector<Receipt>&)>& holds) {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs deadline = TheClock().Now() + kGenerous;
    while (!holds(receipts_)) {
      if (TheClock().Now() >= deadline) return false;
      TheClock().WaitUntil(mutex_, changed_, deadline);
    }
    return true;
  }
  std::vector<Receipt> receipts() {
    sync::MutexLock lock(mutex_);
    return receipts_;
  }
  std::vector<Issue> issues() {
    sync::MutexLock lock(mutex_);
    return issues_;
  }

 private:
  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::vector<Receipt> receipts_ VOXELD_GUARDED_BY(mutex_);
  std::vector<Issue> issues_ VOXELD_GUARDED_BY(mutex_);
};

// Waits for the answer to a query.
template <typename T>
class Answer {
 public:
  Core::Reply<T> reply() {
    return [state = state_](absl::StatusOr<T> result) {
      sync::MutexLock lock(state->mutex);
      state->result = std::move(result);
      state->changed.NotifyAll();
    };
  }
  absl::StatusOr<T> Await() {
    sync::MutexLock lock(state_->mutex);
    const sync::TimeNs deadline = TheClock().Now() + kGenerous;
    while (!state_->result.has_value() && TheClock().Now() < deadline) {
      TheClock().WaitUntil(state_->mutex, state_->changed, deadline);
    }
    if (!state_->result.has_value()) return absl::DeadlineExceededError("no answer");
    return *state_->result;
  }

 private:
  struct State {
    sync::Mutex mutex;
    sync::CondVar changed;
    std::optional<absl::StatusOr<T>> result VOXELD_GUARDED_BY(mutex);
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

class RunningCore {
 public:
  explicit RunningCore(std::vector<std::string> displays = {"main"},
                       uint64_t large_change = kLargeChange) {
    CoreOptions options;
    options.version = "test";
    options.large_change = large_change;
    core.emplace(std::move(options), TheClock());
    for (const std::string& name : displays) {
      display::DisplayOptions made;
      made.name = name;
      made.driver = "simulated";
      auto display = display::CreateDisplay(made, TheClock());
      EXPECT_TRUE(display.ok()) << display.status();
      gpu::EngineOptions engine;
      engine.kind = gpu::EngineKind::kCpu;
      engine.threads = 2;
      const absl::Status added = core->AddDisplay(*std::move(display), engine);
      EXPECT_TRUE(added.ok()) << added;
    }
    const absl::Status started = core->Start();
    EXPECT_TRUE(started.ok()) << started;
    // Commits before the displays are attached would be NOT_SHOWN(absent).
    for (const std::string& name : displays) {
      const sync::TimeNs deadline = TheClock().Now() + kGenerous;
      while (Describe(name).state != display::DisplayState::kShowing &&
             TheClock().Now() < deadline) {
        std::this_thread::yield();
      }
    }
  }

  DisplayDescription Describe(const std::string& name) {
    Answer<DisplayDescription> answer;
    core->GetDisplay(name, answer.reply());
    const auto description = answer.Await();
    EXPECT_TRUE(description.ok()) << description.status();
    return description.ok() ? *description : DisplayDescription();
  }
  SessionInfo Open(const std::shared_ptr<SessionSink>& sink, OpenOptions options = {}) {
    Answer<SessionInfo> answer;
    core->OpenSession(std::move(options), 0, sink, answer.reply());
    return *answer.Await();
  }
  Stats GetStats() {
    Answer<Stats> answer;
    core->GetStats(answer.reply());
    return *answer.Await();
  }

  std::optional<Core> core;
};

int LitPixels(const display::DecodedVolume& volume) {
  int lit = 0;
  const std::vector<uint8_t> rgb = volume.Rgb();
  for (size_t i = 0; i + 2 < rgb.size(); i += 3) {
    lit += rgb[i] != 0 || rgb[i + 1] != 0 || rgb[i + 2] != 0;
  }
  return lit;
}

TEST(CoreThreads, WhatACommitPutsUpComesOutOfTheDisplay) {
  RunningCore running;
  auto sink = std::make_shared<WaitingSink>();
  const SessionInfo session = running.Open(sink);
  auto sphere = std::make_shared<GeometryData>();
  sphere->record.kind = gpu::PrimitiveKind::kSphere;
  sphere->record.fill = gpu::Fill::kSolid;
  sphere->record.color = 0xFF0000;
  sphere->record.params[3] = 0.5f;
  for (int axis = 0; axis < 3; ++axis) {
    sphere->min[axis] = -0.5;
    sphere->max[axis] = 0.5;
  }
  std::vector<Operation> all =
      testing::Sequence(0, Put("a", "ball", Entity1(GeometryPtr(sphere))), testing::EndCommit(5));
  session.intake->Take({std::move(all), {}, 100});
  ASSERT_TRUE(sink->Await(2));
  EXPECT_TRUE(sink->issues().empty());
  const std::vector<Receipt> receipts = sink->receipts();
  const auto& accepted = std::get<Accepted>(receipts[0].what);
  const auto& outcome = std::get<CommitOutcome>(receipts[1].what);
  EXPECT_EQ(receipts[1].frame_id, 5u);
  EXPECT_EQ(outcome.kind, Kind::kPresented) << outcome.reason;
  EXPECT_GT(outcome.last_byte_ns, 0);

  Answer<display::DecodedVolume> capture;
  running.core->Capture("main", kGenerous, accepted.snapshot, capture.reply());
  const absl::StatusOr<display::DecodedVolume> volume = capture.Await();
  ASSERT_TRUE(volume.ok()) << volume.status();
  EXPECT_GE(volume->volume, outcome.volume);
  EXPECT_GT(LitPixels(*volume), 100);
  const Stats stats = running.GetStats();
  EXPECT_GT(stats.displays[0].lit_voxels, 100u);
  EXPECT_GT(stats.displays[0].bytes_out, 0u);
  EXPECT_EQ(stats.displays[0].commits_presented, 1u);

  // Removed with its session.
  Answer<bool> closed;
  running.core->CloseSession(session.session, session.incarnation, true,
                             [reply = closed.reply()] { reply(true); });
  EXPECT_TRUE(*closed.Await());
  Answer<EntityPage> list;
  running.core->ListEntities({}, list.reply());
  EXPECT_EQ(list.Await()->layers.size(), 0u);
  EXPECT_TRUE(running.core->Stop(kGenerous).ok());
}

// A thread that frees a guarded geometry waits until the gate is open.
class Gate {
 public:
  GeometryPtr Guard(const GeometryPtr& geometry) {
    return {new GeometryData(*geometry), [state = state_](const GeometryData* data) {
              sync::MutexLock lock(state->mutex);
              state->reached = true;
              state->changed.NotifyAll();
              while (!state->open) state->changed.Wait(state->mutex);
              delete data;
            }};
  }
  bool AwaitReached() {
    sync::MutexLock lock(state_->mutex);
    const sync::TimeNs deadline = TheClock().Now() + kGenerous;
    while (!state_->reached && TheClock().Now() < deadline) {
      TheClock().WaitUntil(state_->mutex, state_->changed, deadline);
    }
    return state_->reached;
  }
  void Open() {
    sync::MutexLock lock(state_->mutex);
    state_->open = true;
    state_->changed.NotifyAll();
  }

 private:
  struct State {
    sync::Mutex mutex;
    sync::CondVar changed;
    bool reached VOXELD_GUARDED_BY(mutex) = false, open VOXELD_GUARDED_BY(mutex) = false;
  };
  const std::shared_ptr<State> state_ = std::make_shared<State>();
};

TEST(CoreThreads, WhatTakesLongToFreeHoldsUpNoCommit) {
  Gate gate;
  RunningCore running;
  auto sink = std::make_shared<WaitingSink>();
  const SessionInfo session = running.Open(sink);
  uint64_t sequence = 0;
  const auto commit = [&](EntityData data, uint64_t frame) {
    std::vector<Operation> all =
        testing::Sequence(sequence, Put("a", "dots", std::move(data)), testing::EndCommit(frame));
    sequence += all.size();
    session.intake->Take({std::move(all), {}, 100});
  };
  commit(Entity1(gate.Guard(Dots(0, 0xFFFFFF, 20))), 1);
  EXPECT_TRUE(sink->Await(2)) << "accepted and shown";
  commit(Entity1(Dots(0, 0xFF0000, 20)), 2);
  EXPECT_TRUE(gate.AwaitReached());
  for (uint64_t frame = 3; frame <= 5; ++frame) {
    commit(Entity1(Dots(0, 0x00FF00, 20)), frame);
    EXPECT_TRUE(sink->AwaitAccepted(static_cast<int64_t>(frame)));
  }
  gate.Open();
  EXPECT_TRUE(running.core->Stop(kGenerous).ok());
}

// Hands over a commit in which every one of `entities` has the same content.
void CommitMany(const SessionInfo& session, uint64_t& sequence, const std::string& layer,
                int entities, uint64_t frame) {
  std::vector<Operation> all;
  for (int i = 0; i < entities; ++i) {
    all.push_back(
        Put(layer, std::to_string(i), Entity1(Dots(static_cast<float>(frame % 8) / 10, 0xFFFFFF))));
  }
  all.push_back(testing::EndCommit(frame));
  for (Operation& operation : all) operation.sequence = ++sequence;
  session.intake->Take({std::move(all), {}, 100});
}

TEST(CoreThreads, LargeAndSmallCommitsOfTwoOwnersAllEndWhileTwoEnginesTakeTurns) {
  RunningCore running({"main"}, /*large_change=*/100);
  auto large_sink = std::make_shared<WaitingSink>(), small_sink = std::make_shared<WaitingSink>();
  const SessionInfo large = running.Open(large_sink), small = running.Open(small_sink);
  uint64_t large_sequence = 0, small_sequence = 0;
  constexpr uint64_t kLargeCommits = 8, kSmallCommits = 80;
  CommitMany(small, small_sequence, "small", 1, 1);
  ASSERT_TRUE(small_sink->Await(2));
  for (uint64_t frame = 2; frame <= kSmallCommits; ++frame) {
    if (frame % (kSmallCommits / kLargeCommits) == 0) {
      CommitMany(large, large_sequence, "large", 1000, frame / (kSmallCommits / kLargeCommits));
    }
    CommitMany(small, small_sequence, "small", 1, frame);
    ASSERT_TRUE(small_sink->AwaitAccepted(static_cast<int64_t>(frame)));
  }
  // Accepted, and an outcome.
  EXPECT_TRUE(small_sink->Await(2 * kSmallCommits));
  EXPECT_TRUE(large_sink->Await(2 * kLargeCommits));
  const auto shown = [](WaitingSink& sink, uint64_t frame) {
    const std::vector<Receipt> all = sink.receipts();
    return std::any_of(all.begin(), all.end(), [&](const Receipt& receipt) {
      const auto* outcome = std::get_if<CommitOutcome>(&receipt.what);
      return receipt.frame_id == frame && outcome != nullptr &&
             (outcome->kind == Kind::kPresented || outcome->kind == Kind::kUnchanged);
    });
  };
  EXPECT_TRUE(shown(*small_sink, kSmallCommits));
  EXPECT_TRUE(shown(*large_sink, kLargeCommits));
  EXPECT_TRUE(running.core->Stop(kGenerous).ok());
}

TEST(CoreThreads, StopEndsInTimeWhileALargeChangeIsMadeReady) {
  RunningCore running({"main"}, /*large_change=*/100);
  auto large_sink = std::make_shared<WaitingSink>(), small_sink = std::make_shared<WaitingSink>();
  const SessionInfo large = running.Open(large_sink), small = running.Open(small_sink);
  uint64_t large_sequence = 0, small_sequence = 0;
  CommitMany(small, small_sequence, "small", 1, 1);
  ASSERT_TRUE(small_sink->Await(2));
  CommitMany(large, large_sequence, "large", 5000, 1);
  ASSERT_TRUE(large_sink->AwaitAccepted(1));
  CommitMany(small, small_sequence, "small", 1, 2);
  ASSERT_TRUE(small_sink->AwaitAccepted(2));
  EXPECT_TRUE(running.core->Stop(kGenerous).ok());
  EXPECT_EQ(large_sink->receipts().size(), 2u) << "accepted, and presented or lost";
}

TEST(CoreThreads, ManyClientsAtOnceAndEverySumIsExact) {
  RunningCore running({"one", "two"});
  constexpr int kClients = 4, kCommits = 40;
  std::vector<std::shared_ptr<WaitingSink>> sinks;
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    sinks.push_back(std::make_shared<WaitingSink>());
    clients.emplace_back([&running, sink = sinks.back(), c] {
      const SessionInfo session = running.Open(sink);
      uint64_t sequence = 0;
      for (int i = 1; i <= kCommits; ++i) {
        EntityData data = Entity1(Dots(0, 0xFFFFFF, 20), testing::Scale(0.02, 0.02, 0.02));
        data.transform.m[3] = -0.01 * i;
        data.transform.m[7] = 0.1 * c;
        std::vector<Operation> all;
        if (i % 3 == 0) {
          all = testing::Sequence(sequence, testing::Begin("a"), Put("a", "x", data),
                                  testing::End("a"), testing::EndCommit(i));
        } else {
          all = testing::Sequence(sequence, Put("a", absl::StrCat("e", i % 5), data),
                                  testing::EndCommit(i));
        }
        sequence += all.size();
        session.intake->Take({std::move(all), {}, 100});
        if (i % 10 == 0) {
          running.GetStats();
          DisplayUpdate update;
          update.brightness = 0.5 + 0.01 * c;
          Answer<DisplayDescription> updated;
          running.core->UpdateDisplay("two", update, updated.reply());
          EXPECT_TRUE(updated.Await().ok());
        }
      }
      // Every other client leaves while outcomes are outstanding.
      if (c % 2 == 0) {
        EXPECT_TRUE(sink->Await(kCommits * 3));
      }
      running.core->CloseSession(session.session, session.incarnation, true, nullptr);
    });
  }
  for (std::thread& client : clients) client.join();
  for (int c = 0; c < kClients; c += 2) {
    std::map<std::string, std::set<uint64_t>> told;
    for (const Receipt& receipt : sinks[c]->receipts()) {
      if (const auto* outcome = std::get_if<CommitOutcome>(&receipt.what)) {
        EXPECT_TRUE(told[outcome->display].insert(receipt.frame_id).second);
        EXPECT_NE(outcome->kind, Kind::kLost) << outcome->reason;
        EXPECT_NE(outcome->kind, Kind::kNotShown);
      }
    }
    EXPECT_EQ(told["one"].size(), size_t{kCommits});
    EXPECT_EQ(told["two"].size(), size_t{kCommits});
  }
  // Waits until all outcomes are reported, also those that no client receives any longer.
  const sync::TimeNs deadline = TheClock().Now() + kGenerous;
  Stats stats = running.GetStats();
  while ((stats.sessions > 0 ||
          stats.displays[0].commits_pending + stats.displays[1].commits_pending > 0) &&
         TheClock().Now() < deadline) {
    stats = running.GetStats();
  }
  for (const DisplayFigures& f : stats.displays) {
    EXPECT_EQ(f.commits_owed, uint64_t{kClients * kCommits});
    EXPECT_EQ(f.commits_owed, f.commits_presented + f.commits_unchanged + f.commits_superseded +
                                  f.commits_lost + f.commits_not_shown);
    EXPECT_GT(f.commits_presented, 0u);
  }
  EXPECT_EQ(stats.entities, 0u);
  EXPECT_TRUE(running.core->Stop(kGenerous).ok());
}

TEST(CoreThreads, StopWithWorkOnItsWayEndsInTime) {
  for (int round = 0; round < 5; ++round) {
    RunningCore running;
    auto sink = std::make_shared<WaitingSink>();
    const SessionInfo session = running.Open(sink);
    for (uint64_t i = 1; i <= 10; ++i) {
      session.intake->Take({testing::Sequence(i * 2, Put("a", "x", static_cast<float>(i) / 20),
                                              testing::EndCommit(i)),
                            {},
                            100});
    }
    ASSERT_TRUE(sink->Await(1));
    const sync::TimeNs before = TheClock().Now();
    EXPECT_TRUE(running.core->Stop(kGenerous).ok());
    EXPECT_LT(TheClock().Now() - before, kGenerous);
    size_t accepted = 0, outcomes = 0;
    for (const Receipt& receipt : sink->receipts()) {
      accepted += std::holds_alternative<Accepted>(receipt.what);
      outcomes += std::holds_alternative<CommitOutcome>(receipt.what);
    }
    EXPECT_EQ(accepted, outcomes);
  }
}

// A display that does not stop by itself.
class StuckDisplay final : public display::Display {
 public:
  struct Gate {
    sync::Mutex mutex;
    sync::CondVar changed;
    bool open VOXELD_GUARDED_BY(mutex) = false;
    bool ended VOXELD_GUARDED_BY(mutex) = false;
    // Ticks also wait for the gate; `in_tick` is set in the first of them.
    bool stops_ticks VOXELD_GUARDED_BY(mutex) = false;
    bool in_tick VOXELD_GUARDED_BY(mutex) = false;
  };
  StuckDisplay(std::shared_ptr<Gate> gate, sync::Clock& clock)
      : Display(testing::SmallDisplay("stuck"), clock), gate_(std::move(gate)) {}
  ~StuckDisplay() override {
    sync::MutexLock lock(gate_->mutex);
    gate_->ended = true;
    gate_->changed.NotifyAll();
  }

 protected:
  absl::Status DoStart() override { return absl::OkStatus(); }
  void DoStop() override {
    sync::MutexLock lock(gate_->mutex);
    while (!gate_->open) gate_->changed.Wait(gate_->mutex);
  }
  void DoSend(const display::SliceFramePtr&, bool) override {}
  sync::TimeNs DoTick(sync::TimeNs) override {
    sync::MutexLock lock(gate_->mutex);
    gate_->in_tick = gate_->stops_ticks;
    gate_->changed.NotifyAll();
    while (gate_->stops_ticks && !gate_->open) gate_->changed.Wait(gate_->mutex);
    return sync::kNever;
  }
  absl::Status DoSetBrightness(double) override { return absl::OkStatus(); }
  absl::Status DoSetBlank(bool) override { return absl::OkStatus(); }
  std::unique_ptr<display::WireDecoder> DoMakeDecoder() const override { return nullptr; }

 private:
  const std::shared_ptr<Gate> gate_;
};

TEST(CoreThreads, StopNamesWhatHadNotEndedAndLeavesItAlone) {
  auto gate = std::make_shared<StuckDisplay::Gate>();
  {
    CoreOptions options;
    options.make_engine = [](const gpu::EngineOptions&) {
      return std::make_unique<testing::RecordingEngine>(std::make_shared<testing::EngineScript>());
    };
    Core core(std::move(options), TheClock());
    ASSERT_TRUE(core.AddDisplay(std::make_unique<StuckDisplay>(gate, TheClock()), {}).ok());
    ASSERT_TRUE(core.Start().ok());
    const absl::Status status = core.Stop(400 * sync::kMillisecond);
    EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
    EXPECT_THAT(status.message(), HasSubstr("display \"stuck\""));
    EXPECT_THAT(status.message(), ::testing::Not(HasSubstr("core")));
  }
  // Its thread continues, and cleans up, when it can; by then the core no longer exists.
  sync::MutexLock lock(gate->mutex);
  gate->open = true;
  gate->changed.NotifyAll();
  while (!gate->ended) gate->changed.Wait(gate->mutex);
}

TEST(CoreThreads, WhatADisplayWasAskedIsAnsweredAlsoWhenTheCoreHasGone) {
  auto gate = std::make_shared<StuckDisplay::Gate>();
  Answer<Stats> stats;
  Answer<std::vector<DisplayDescription>> displays;
  {
    CoreOptions options;
    options.make_engine = [](const gpu::EngineOptions&) {
      return std::make_unique<testing::RecordingEngine>(std::make_shared<testing::EngineScript>());
    };
    Core core(std::move(options), TheClock());
    ASSERT_TRUE(core.AddDisplay(std::make_unique<StuckDisplay>(gate, TheClock()), {}).ok());
    ASSERT_TRUE(core.Start().ok());
    {
      sync::MutexLock lock(gate->mutex);
      gate->stops_ticks = true;
    }
    core.GetDisplay("stuck", [](const absl::StatusOr<DisplayDescription>&) {});  // makes it tick
    {
      sync::MutexLock lock(gate->mutex);
      while (!gate->in_tick) gate->changed.Wait(gate->mutex);
    }
    core.GetStats(stats.reply());
    core.ListDisplays(displays.reply());
    Answer<EntityPage> asked;  // once this is answered, the display has been asked
    core.ListEntities({}, asked.reply());
    ASSERT_TRUE(asked.Await().ok());
    EXPECT_FALSE(core.Stop(400 * sync::kMillisecond).ok());
  }
  {
    sync::MutexLock lock(gate->mutex);
    gate->open = true;
    gate->changed.NotifyAll();
    while (!gate->ended) gate->changed.Wait(gate->mutex);
  }
  EXPECT_TRUE(stats.Await().ok());
  EXPECT_TRUE(displays.Await().ok());
}

}  // namespace
}  // namespace voxeld::daemon
