// Tests a conversation in which the test is the peer.
#include "gpu/worker/call_channel.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <future>
#include <memory>
#include <optional>

#include "tests/gpu/worker/hand_played_worker.h"
#include "tests/refused_calls.h"

namespace voxeld::gpu {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class CallChannelTest : public ::testing::Test {
 protected:
  CallChannelTest() {
    process_ = *WorkerProcess::Start(worker_.program());
    const int socket = *process_->Connect();
    worker_.Take();
    constexpr int64_t kHour = 3'600'000'000'000;
    channel_ = std::make_unique<CallChannel>(
        process_, socket, eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK), kHour, kHour,
        [this](const absl::Status& status) { lost_.set_value(status); });
  }

  struct Told {
    std::promise<absl::StatusOr<Message>> promise;
    CallChannel::Answered answered() {
      return [this](absl::StatusOr<Message> answer) { promise.set_value(std::move(answer)); };
    }
    absl::StatusOr<Message> get() { return promise.get_future().get(); }
  };
  static Message Ask(int32_t code) {
    return MakeMessage(MessageType::kVoxels, 0, DoneMessage{code});
  }
  static int32_t CodeOf(const Message& message) { return message.As<DoneMessage>()->code; }

  HandPlayedWorker worker_;
  std::shared_ptr<WorkerProcess> process_;
  std::promise<absl::Status> lost_;
  std::unique_ptr<CallChannel> channel_;
};

TEST_F(CallChannelTest, WhatTheSocketDoesNotTakeGoesNextAndOnce) {
  std::optional<RefusedCalls> refused;
  int completed = 0;
  Told first, second;
  channel_->Call(
      Ask(0),
      [&](Message& message) {
        message.body = Ask(++completed).body;
        refused.emplace(SystemCall::kSendmsg, EAGAIN, 2);
      },
      first.answered());
  channel_->Call(Ask(2), nullptr, second.answered());
  const Message one = worker_.Hear(), two = worker_.Hear();
  EXPECT_EQ(CodeOf(one), 1);
  EXPECT_EQ(CodeOf(two), 2);
  worker_.SayDone(one);
  worker_.SayDone(two);
  EXPECT_TRUE(first.get().ok());
  EXPECT_TRUE(second.get().ok());
  std::promise<int> made;
  channel_->Later([&] {
    const int calls = refused->made();
    refused.reset();
    made.set_value(calls);
  });
  EXPECT_EQ(made.get_future().get(), 4) << "twice refused, then both";
  EXPECT_EQ(completed, 1);
}

TEST_F(CallChannelTest, WhatTheWorkerSaidLastComesBeforeItsEnd) {
  Told answered, lost;
  channel_->Call(Ask(1), nullptr, answered.answered());
  const Message asked = worker_.Hear();
  std::optional<RefusedCalls> refused;
  std::promise<void> worked;
  channel_->Call(
      Ask(2),
      [&](Message&) {
        worker_.SayDone(asked, absl::NotFoundError("its last word"));
        channel_->Later([&] {
          refused.reset();
          worked.set_value();
        });
        refused.emplace(SystemCall::kSendmsg, EPIPE);
      },
      lost.answered());
  const absl::StatusOr<Message> last = answered.get();
  ASSERT_TRUE(last.ok()) << last.status();
  EXPECT_EQ(StatusOf(*last), absl::NotFoundError("its last word"));
  const absl::Status end = lost.get().status();
  EXPECT_EQ(end,
            absl::DataLossError("the worker was lost: the other process is gone: Broken pipe"));
  worked.get_future().get();  // the work queued behind it is done all the same
  EXPECT_EQ(lost_.get_future().get(), end);
  EXPECT_TRUE(process_->lost());
}

TEST_F(CallChannelTest, AnAnswerThatNobodyIsOwedIsTheEnd) {
  Told told;
  channel_->Call(Ask(1), nullptr, told.answered());
  const Message asked = worker_.Hear();
  worker_.Say(MakeDone(asked.call + 1, absl::OkStatus()));
  const absl::Status end = told.get().status();
  EXPECT_EQ(end.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(end.message(),
              HasSubstr("the worker was lost: the worker answered call 2, of which"));
}

TEST_F(CallChannelTest, ADescriptorThatComesWithAnAnswerIsClosed) {
  int pipe[2];
  ASSERT_EQ(pipe2(pipe, O_CLOEXEC), 0);
  Told told;
  channel_->Call(Ask(1), nullptr, told.answered());
  Message answer = MakeDone(worker_.Hear().call, absl::OkStatus());
  answer.fd = pipe[1];
  worker_.Say(answer);
  close(pipe[1]);
  EXPECT_TRUE(told.get().ok());
  char byte = 0;
  EXPECT_EQ(read(pipe[0], &byte, 1), 0) << "the other end is not open anywhere";
  close(pipe[0]);
}

TEST_F(CallChannelTest, AfterItsEndCallsAndWorkAreAnsweredAtOnceAndNothingIsSaid) {
  channel_->Fail(absl::DataLossError("it lies"));
  EXPECT_EQ(lost_.get_future().get(), absl::DataLossError("it lies"));
  absl::Status told;
  channel_->Call(Ask(1), nullptr,
                 [&](const absl::StatusOr<Message>& answer) { told = answer.status(); });
  EXPECT_EQ(told, absl::DataLossError("it lies"));
  bool worked = false;
  channel_->Later([&] { worked = true; });
  EXPECT_TRUE(worked);
  const auto segment = *Segment::Create(4096);
  channel_->Tell(Ask(2), segment);
  EXPECT_EQ(segment.use_count(), 1) << "the accompanying segment is not kept";
}

TEST_F(CallChannelTest, ClosingAnswersWhatIsOwedCancelledAndIsNoLoss) {
  Told told;
  channel_->Call(Ask(1), nullptr, told.answered());
  worker_.Hear();
  channel_->Close();
  EXPECT_EQ(told.get().status().code(), absl::StatusCode::kCancelled);
  EXPECT_FALSE(process_->lost()) << "others may use it";
  std::future<absl::Status> lost = lost_.get_future();
  EXPECT_EQ(lost.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  channel_->Close();
}

TEST_F(CallChannelTest, WorkIsDoneBehindWhatWasSentBefore) {
  std::vector<int> order;
  std::promise<void> done;
  channel_->Call(
      Ask(1), [&](Message&) { order.push_back(1); }, [](const auto&) {});
  channel_->Later([&] { order.push_back(2); });
  channel_->Call(
      Ask(3), [&](Message&) { order.push_back(3); }, [](const auto&) {});
  channel_->Later([&] { done.set_value(); });
  done.get_future().get();
  EXPECT_THAT(order, ElementsAre(1, 2, 3));
}

}  // namespace
}  // namespace voxeld::gpu
