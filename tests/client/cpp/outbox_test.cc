// Tests the outbox against a plain model: a server that applies what it receives, and lists of what
// was requested.
#include "client/cpp/src/outbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"
#include "tests/client/cpp/model_server.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Outbox, SendsNothingBeforeTheStreamIsOpen) {
  Outbox outbox(0, 1 << 20);
  ASSERT_TRUE(outbox.Add(Retained(1, "a")).ok());
  EXPECT_FALSE(outbox.Next(0).has_value());
  EXPECT_FALSE(outbox.Ping(0).has_value());
  outbox.StreamOpened(10, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1));
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.waiting_bytes(), 0u);
}

TEST(Outbox, AMessageMayExceedTheCreditOnlyByBeingSentWhileSomeIsLeft) {
  Outbox outbox(0, 1 << 20);
  ASSERT_TRUE(outbox.Add(Retained(1, "a", 1000)).ok());
  outbox.StreamOpened(100, 100);
  EXPECT_FALSE(outbox.has_credit());
  EXPECT_FALSE(outbox.Next(0).has_value());
  EXPECT_FALSE(outbox.Ping(0).has_value()) << "pings are requests as well";
  outbox.Credit(101);
  EXPECT_TRUE(outbox.Next(0).has_value()) << "all of it, for one byte";
  EXPECT_GT(outbox.sent_bytes(), 12'000u);
  EXPECT_FALSE(outbox.Next(0).has_value());
  outbox.Credit(50);  // credit never decreases
  outbox.Credit(outbox.sent_bytes());
  EXPECT_FALSE(outbox.Next(0).has_value());
  outbox.Credit(outbox.sent_bytes() + 1);
  const auto commit = outbox.Next(0);
  ASSERT_TRUE(commit.has_value());
  EXPECT_NE(commit->committed, nullptr);
}

TEST(Outbox, LatestKeepsTheNewestFrameOfEachLayerAndAllThatIsRetained) {
  Outbox outbox(1, 1 << 20);
  outbox.StreamOpened(1, 1);
  ASSERT_TRUE(outbox.Add(FrameOf(1, "a")).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(2, "b")).ok());
  auto both = MakeTransaction({UpsertOf("kept", "x", 1), FrameOperation{"a", {}}}, {});
  both->frame_id = 3;
  ASSERT_TRUE(outbox.Add(both).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(4, "a")).ok());
  const std::vector<Drop> drops = outbox.TakeDrops();
  ASSERT_EQ(drops.size(), 2u);
  EXPECT_EQ(drops[0].frame_id, 1u);
  EXPECT_TRUE(drops[0].whole);
  EXPECT_EQ(drops[1].frame_id, 3u);
  EXPECT_FALSE(drops[1].whole) << "it holds something retained";
  outbox.Credit(1 << 20);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(2, 3, 4));
  EXPECT_THAT(server.retained, ElementsAre("x"));
  EXPECT_EQ(server.frames_applied, 2u);
  EXPECT_THAT(server.layers["a"], ElementsAre("f4"));
  EXPECT_EQ(server.client_drops, 2u);
}

TEST(Outbox, AFrameThatIsBeingSentIsSentWhole) {
  Outbox outbox(1, 1 << 20);
  outbox.StreamOpened(1, 2);
  ModelServer server;
  ASSERT_TRUE(outbox.Add(FrameOf(1, "a")).ok());
  server.Take(outbox.Next(0)->message);  // FrameBegin has been sent
  for (uint64_t frame = 2; frame < 10; ++frame) ASSERT_TRUE(outbox.Add(FrameOf(frame, "a")).ok());
  outbox.Credit(1 << 20);
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1, 9));
  EXPECT_EQ(server.client_drops, 7u);
}

TEST(Outbox, TimedFramesAreNotGivenUp) {
  Outbox outbox(1, 1 << 20);
  for (uint64_t frame = 1; frame <= 3; ++frame) {
    auto timed = FrameOf(frame, "a");
    timed->present_at_ns = 1000 * static_cast<int64_t>(frame);
    ASSERT_TRUE(outbox.Add(timed).ok());
  }
  ASSERT_TRUE(outbox.Add(FrameOf(4, "a")).ok());
  outbox.StreamOpened(1, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1, 2, 3, 4));
  outbox.Scheduled(1);
  outbox.Scheduled(3);
  // The first commit's time has passed: whether it was shown is unknown. The third is sent again,
  // and so is the second, which was not answered.
  EXPECT_THAT(outbox.StreamLost(2000), ElementsAre(1));
  server.Lose();
  outbox.StreamOpened(1, 0);
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(2, 3, 4));
}

TEST(Outbox, AFullBufferRefusesWhatIsRetainedAndLosesNothing) {
  Outbox outbox(1, 10'000);
  ASSERT_TRUE(outbox.Add(Retained(1, "a", 700)).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(2, "l", 10)).ok());
  const absl::Status refused = outbox.Add(Retained(3, "b", 700));
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("of 10000 (buffer_bytes)"));
  EXPECT_THAT(outbox.TakeDrops(), IsEmpty()) << "the newest frame of a layer stays";
  outbox.StreamOpened(1, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1, 2));
  // An outbox that is otherwise empty accepts a commit of any size.
  ASSERT_TRUE(outbox.Add(Retained(4, "huge", 10'000)).ok());
}

TEST(Outbox, ReliableGivesUpFramesOnlyWithoutAConnection) {
  Outbox outbox(0, 10'000);
  outbox.StreamOpened(1, 1);  // no credit
  ASSERT_TRUE(outbox.Add(FrameOf(1, "a", 300)).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(2, "a", 300)).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(outbox.Add(FrameOf(3, "a", 300))));
  outbox.StreamLost(std::nullopt);
  ASSERT_TRUE(outbox.Add(FrameOf(4, "a", 300)).ok());
  const std::vector<Drop> drops = outbox.TakeDrops();
  ASSERT_EQ(drops.size(), 1u);
  EXPECT_EQ(drops[0].frame_id, 1u) << "the oldest";
  outbox.StreamOpened(1, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(2, 4));
}

TEST(Outbox, WhatWasAppliedIsNotSentAgain) {
  Outbox outbox(0, 1 << 20);
  outbox.StreamOpened(1, 0);
  ModelServer server;
  for (uint64_t frame = 1; frame <= 4; ++frame)
    ASSERT_TRUE(outbox.Add(Retained(frame, absl::StrCat(frame))).ok());
  Drain(&outbox, &server);
  EXPECT_NE(outbox.Answered(1), nullptr);
  EXPECT_EQ(outbox.Answered(1), nullptr);
  const uint64_t second_commit = 4;  // a batch and a commit for each
  ASSERT_TRUE(outbox.Add(Retained(5, "5")).ok());
  outbox.StreamLost(std::nullopt);
  server.Lose();
  const auto applied = outbox.Applied(second_commit);
  ASSERT_EQ(applied.size(), 1u);
  EXPECT_EQ(applied[0]->frame_id, 2u);
  EXPECT_EQ(applied[0]->operations.size(), 1u);
  outbox.StreamOpened(1, 0);
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(3, 4, 5));
  EXPECT_THAT(server.retained, ElementsAre("1", "2", "3", "4", "3", "4", "5"));
}

TEST(Outbox, WhatIsPutFirstGoesFirst) {
  Outbox outbox(0, 1 << 20);
  ASSERT_TRUE(outbox.Add(Retained(1, "a")).ok());
  outbox.AddFirst({Retained(10, "x"), Retained(11, "y")});
  outbox.AddFirst({Retained(20, "z")});
  ASSERT_TRUE(outbox.Add(Retained(2, "b")).ok());
  outbox.StreamOpened(1, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(20, 10, 11, 1, 2));
}

TEST(Outbox, RestoringBeginsAnew) {
  Outbox outbox(0, 1 << 20);
  ASSERT_TRUE(outbox.Add(Retained(1, "a")).ok());
  std::vector<std::shared_ptr<Transaction>> restores = {Retained(10, "x"), Retained(11, "y")};
  for (const auto& restore : restores) restore->restores = true;
  outbox.AddFirst(restores);
  outbox.StreamOpened(1, 0);
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(10, 11, 1));
  outbox.StreamLost(std::nullopt);
  const size_t all = outbox.waiting_bytes();
  outbox.DropRestores();
  EXPECT_LT(outbox.waiting_bytes(), all);
  outbox.StreamOpened(1, 0);
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1));
  EXPECT_EQ(outbox.waiting_bytes(), 0u);
}

TEST(Outbox, KeepsToTheMessagesThatTheServerReads) {
  Outbox outbox(0, 1 << 20);
  std::vector<Operation> operations;
  for (int i = 0; i < 100; ++i) operations.emplace_back(UpsertOf("kept", absl::StrCat(i), 1));
  auto many = MakeTransaction(operations, {});
  ASSERT_EQ(many->pieces[0].messages.size(), 1u);
  many->frame_id = 1;
  ASSERT_TRUE(outbox.Add(many).ok());
  ASSERT_TRUE(outbox.Add(Retained(2, "large", 1000)).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(3, "f", 1000)).ok());
  ASSERT_TRUE(outbox.Add(Retained(4, "small")).ok());
  const auto refused = outbox.KeepTo(1000);
  ASSERT_EQ(refused.size(), 2u);
  EXPECT_EQ(refused[0].first->frame_id, 2u);
  EXPECT_THAT(refused[0].second, HasSubstr("kept/large takes a message of 12"));
  EXPECT_THAT(refused[0].second, HasSubstr("max_message_bytes is 1000"));
  EXPECT_EQ(refused[1].first->frame_id, 3u);
  outbox.StreamOpened(1, 0);
  ModelServer server;
  std::vector<uint64_t> committed;
  while (auto next = outbox.Next(0)) {
    EXPECT_LE(next->message.size(), 1000u);
    if (const auto frame = server.Take(next->message)) committed.push_back(*frame);
  }
  EXPECT_THAT(committed, ElementsAre(1, 4));
  EXPECT_EQ(server.retained.size(), 101u);
  EXPECT_EQ(server.retained[99], "99");
  EXPECT_EQ(outbox.waiting_bytes(), 0u);
}

TEST(Outbox, AnEncodingAnewLeavesOutWhatWasGivenUp) {
  Outbox outbox(1, 1 << 20);
  auto both =
      MakeTransaction({FrameOperation{"a", {UpsertOf("a", "old", 1)}}, UpsertOf("kept", "x", 1),
                       UpsertOf("kept", "y", 1), FrameOperation{"b", {UpsertOf("b", "f", 1)}}},
                      {});
  both->frame_id = 1;
  ASSERT_TRUE(outbox.Add(both).ok());
  ASSERT_TRUE(outbox.Add(FrameOf(2, "a")).ok());  // the batch of the first one is dropped
  EXPECT_TRUE(outbox.KeepTo(100).empty());
  outbox.StreamOpened(1, 0);
  ASSERT_TRUE(outbox.Add(FrameOf(3, "b")).ok());  // and now its other batch
  ModelServer server;
  EXPECT_THAT(Drain(&outbox, &server), ElementsAre(1, 2, 3));
  EXPECT_EQ(server.frames_applied, 2u);
  EXPECT_THAT(server.retained, ElementsAre("x", "y"));
  EXPECT_EQ(outbox.waiting_bytes(), 0u);
}

TEST(Outbox, RefusalsAreOfTheRequestsThatTheyName) {
  Outbox outbox(0, 1 << 20);
  for (const uint64_t frame : {1, 2, 3}) {
    auto transaction =
        MakeTransaction({UpsertOf("l", "a", 1), TransformOperation{"l", "a", Affine()}}, {});
    transaction->frame_id = frame;
    ASSERT_TRUE(outbox.Add(transaction).ok());
  }
  outbox.StreamOpened(1, 0);
  std::vector<uint64_t> sequences;
  for (int i = 0; i < 8; ++i) sequences.push_back(outbox.Next(0)->sequence);
  EXPECT_EQ(outbox.Refused(sequences[4], "l", "a")->frame_id, 2u);
  EXPECT_EQ(outbox.Refused(sequences[3], "l", "a", /*applied=*/true)->frame_id, 2u);
  EXPECT_EQ(outbox.Refused(sequences[7], "l", "a")->frame_id, 3u) << "it is being sent";
  EXPECT_TRUE(outbox.Answered(1)->GetRefusals().refused.empty());
  EXPECT_EQ(outbox.Refused(sequences[0], "l", "a"), nullptr) << "it has its answer";
  const Refusals refusals = outbox.Answered(2)->GetRefusals();
  ASSERT_EQ(refusals.requests.size(), 2u);
  EXPECT_EQ(refusals.requests[1].sequence, sequences[4]);
  EXPECT_EQ(refusals.requests[1].operations, 1u);
  EXPECT_EQ(refusals.refused.size(), 1u);
}

// Everything at random: commits of all sorts, credit in small pieces, late answers, lost streams
// that are resumed or not.
class OutboxAtRandom : public testing::TestWithParam<std::tuple<int, int>> {};

TEST_P(OutboxAtRandom, KeepsWhatItPromises) {
  const auto [keep_frames, seed] = GetParam();
  std::mt19937 random(static_cast<unsigned>(seed));
  const auto below = [&random](size_t n) { return static_cast<size_t>(random() % n); };
  constexpr size_t kBuffer = 40'000;
  Outbox outbox(static_cast<uint64_t>(keep_frames), kBuffer);
  ModelServer server;

  std::vector<std::string> retained;       // requested and accepted
  std::map<std::string, uint64_t> newest;  // the newest accepted frame of each layer
  std::map<uint64_t, size_t> frames_of;    // commit → frames
  std::set<uint64_t> answered_set;
  std::vector<uint64_t> unanswered;
  std::set<uint64_t> dropped_whole;
  uint64_t frames = 0, drops = 0, credit = 0, sent = 0, frame_id = 0;
  bool open = false, lost_ever = false;

  const auto note_drops = [&] {
    for (const Drop& drop : outbox.TakeDrops()) {
      drops += drop.frames;
      if (drop.whole) dropped_whole.insert(drop.frame_id);
    }
  };
  const auto send = [&] {
    const auto next = outbox.Next(0);
    if (!next.has_value()) return false;
    EXPECT_TRUE(open);
    EXPECT_TRUE(credit == 0 || sent < credit) << sent << " of " << credit;
    sent += next->message.size();
    EXPECT_EQ(outbox.sent_bytes(), sent);
    if (const auto frame = server.Take(next->message)) {
      EXPECT_FALSE(answered_set.contains(*frame));
      EXPECT_FALSE(dropped_whole.contains(*frame));
      unanswered.push_back(*frame);
    }
    return true;
  };
  const auto connect = [&] {
    outbox.StreamOpened(50, credit = 51 + below(5000));
    sent = 50;
    open = true;
    note_drops();
  };

  for (int step = 0; step < 3000; ++step) {
    switch (below(8)) {
      case 0:
      case 1:
      case 2: {
        std::vector<Operation> operations;
        std::vector<std::string> ids;
        std::set<std::string> layers;
        ++frame_id;
        if (below(2) == 0) {
          ids.push_back(absl::StrCat("r", frame_id));
          operations.emplace_back(UpsertOf("kept", ids.back(), 1 + below(50)));
        }
        for (const char* layer : {"a", "b", "c"}) {
          if (below(3) != 0) continue;
          layers.insert(layer);
          operations.emplace_back(
              FrameOperation{layer, {UpsertOf(layer, absl::StrCat("f", frame_id), 1 + below(50))}});
        }
        const bool was_empty = outbox.empty();
        auto transaction = MakeTransaction(std::move(operations), {});
        transaction->frame_id = frame_id;
        const absl::Status added = outbox.Add(transaction);
        note_drops();
        EXPECT_TRUE(added.ok() || !was_empty);
        if (!added.ok()) break;
        if (!was_empty) {
          EXPECT_LE(outbox.waiting_bytes(), kBuffer);
        }
        retained.insert(retained.end(), ids.begin(), ids.end());
        for (const std::string& layer : layers) newest[layer] = frame_id;
        frames += layers.size();
        frames_of[frame_id] = layers.size();
        break;
      }
      case 3:
      case 4:
        for (size_t i = below(6); i > 0 && send(); --i) {
        }
        break;
      case 5:
        if (open) outbox.Credit(credit += below(3000));
        break;
      case 6:
        for (size_t i = below(4); i > 0 && !unanswered.empty(); --i) {
          EXPECT_NE(outbox.Answered(unanswered.front()), nullptr);
          answered_set.insert(unanswered.front());
          unanswered.erase(unanswered.begin());
        }
        break;
      default:
        if (below(20) != 0) break;
        if (open) {
          EXPECT_THAT(outbox.StreamLost(std::nullopt), IsEmpty());
          server.Lose();
          open = false;
          lost_ever = true;
          if (below(2) == 0) {
            // The session is resumed: the client learns what was applied.
            EXPECT_EQ(outbox.Applied(server.last_commit).size(), unanswered.size());
            answered_set.insert(unanswered.begin(), unanswered.end());
          } else {
            // It is not resumed, and what was not answered counts as not received.
            std::erase_if(server.commits, [&](uint64_t frame) {
              return std::count(unanswered.begin(), unanswered.end(), frame) > 0;
            });
          }
          unanswered.clear();
        } else {
          connect();
        }
    }
  }
  if (!open) connect();
  // One last commit reports all drops.
  auto last = Retained(++frame_id, "last");
  while (!outbox.Add(last).ok()) {
    outbox.Credit(credit += 1000);
    while (send()) {
    }
  }
  note_drops();
  retained.push_back("last");
  outbox.Credit(credit += 1'000'000'000);
  while (send()) {
  }
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.waiting_bytes(), 0u);

  // Retained operations are never lost, and first arrive in the order in which they were requested.
  std::vector<std::string> first_time;
  std::set<std::string> seen;
  for (const std::string& id : server.retained) {
    if (seen.insert(id).second) first_time.push_back(id);
  }
  EXPECT_EQ(first_time, retained);
  // The newest frame of each layer has arrived.
  for (const auto& [layer, frame] : newest)
    EXPECT_THAT(server.layers[layer], ElementsAre(absl::StrCat("f", frame)));
  // Drops are reported, and nothing else is missing.
  EXPECT_GE(server.client_drops, drops) << "those of lost commits are reported again";
  std::set<uint64_t> arrived(server.commits.begin(), server.commits.end());
  for (const auto& [frame, count] : frames_of)
    EXPECT_NE(arrived.contains(frame), dropped_whole.contains(frame)) << frame;
  if (!lost_ever) {
    EXPECT_EQ(server.frames_applied + drops, frames);
    EXPECT_EQ(server.client_drops, drops);
  }
  if (keep_frames > 0) {
    EXPECT_GT(drops, 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(Policies, OutboxAtRandom,
                         testing::Combine(testing::Values(0, 1, 3), testing::Range(1, 9)));

}  // namespace
}  // namespace voxeld::client
