// Tests how an owner handles each answer of its worker, and the failures of system calls that it
// needs.
#include <dirent.h>
#include <gmock/gmock.h>

#include <cerrno>
#include <future>
#include <limits>

#include "absl/strings/match.h"
#include "display/crc/crc32c.h"
#include "gpu/bulk/bulk_pool.h"
#include "gpu/delta.h"
#include "gpu/worker/frame_slot.h"
#include "gpu/worker/worker_engine.h"
#include "tests/gpu/worker/hand_played_worker.h"
#include "tests/refused_calls.h"

namespace voxeld::gpu {
namespace {

using ::testing::Each;
using ::testing::HasSubstr;

// Returns a copy that shares nothing with a status of another thread. Abseil's own code counts the
// owners and is not instrumented, so ThreadSanitizer does not see that the last one frees it after
// the others have read it.
absl::Status Unshared(const absl::Status& status) {
  return absl::Status(status.code(), status.message());
}
template <typename V>
absl::StatusOr<V> Unshared(absl::StatusOr<V> value) {
  if (value.ok()) return value;
  return Unshared(value.status());
}

// Collects the result of a call.
template <typename T>
class Told {
 public:
  std::function<void(T)> done() {
    return [this](T value) { promise_.set_value(Unshared(std::move(value))); };
  }
  T get() { return promise_.get_future().get(); }

 private:
  std::promise<T> promise_;
};
using ToldStatus = Told<absl::Status>;
using ToldFrame = Told<absl::StatusOr<FrameResult>>;

class WorkerAnswers : public ::testing::Test {
 protected:
  static constexpr size_t kPictures = 4, kBytes = 192;

  WorkerAnswers() {
    options_.kind = EngineKind::kCpu;
    options_.worker = worker_.program();
    options_.worker_deadline_ns = std::numeric_limits<int64_t>::max() / 64;
    options_.lost = [this](const absl::Status& status) { lost_.set_value(status); };
    target_.geometry.shape = display::PlanarStack{.width_px = 4, .height_px = 4};
    target_.layout = {.slices = 4, .width = 4, .height = 4};
  }

  // Makes an engine, and receives the message that opens it.
  Message Open() {
    engine_.reset();
    auto engine =
        CreateRankWorker(options_, std::make_shared<WorkerStaging>(1 << 20),
                         [this](const absl::Status& status) { opened_.push_back(status); });
    EXPECT_TRUE(engine.ok()) << engine.status();
    engine_ = *std::move(engine);
    worker_.Take();
    return worker_.Hear();
  }
  // The same with an engine that exists, and has the target.
  void Ready() {
    const Message open = Open();
    worker_.Say(MakeMessage(MessageType::kReady, open.call, ReadyMessage{}));
    ToldStatus set;
    engine_->SetTarget(target_, set.done());
    worker_.SayDone(worker_.Hear());
    ASSERT_TRUE(set.get().ok());
  }

  void Submit(uint64_t frame, ToldFrame& told, FrameBuffer buffer) {
    engine_->SubmitFrame({frame, 0}, buffer, told.done());
  }
  void Submit(uint64_t frame, ToldFrame& told) { Submit(frame, told, {bytes_, numbers_}); }

  // Returns the answer to a request for a frame, of which the worker has drawn every byte as
  // `value`.
  FrameMessage Draw(std::byte value, const Message& asked) {
    EXPECT_EQ(asked.type, MessageType::kFrame);
    const auto sent = *asked.As<FrameMessage>();
    const FrameBuffer slot = FrameSlot{kPictures, kBytes}.In(worker_.segment(sent.segment));
    std::ranges::fill(slot.bytes, value);
    std::ranges::fill(slot.changed_in, sent.frame);
    const auto executor = MakeFrameExecutor(kBytes);
    const uint32_t crc = FrameCrc(target_.layout, slot, {0, kPictures}, sent.holds, *executor);
    FrameResult result;
    result.frame = sent.frame;
    worker_.Say(MakeMessage(MessageType::kFrameDone, asked.call, FrameDoneMessage{result, crc}));
    return sent;
  }
  FrameMessage Draw(std::byte value) { return Draw(value, worker_.Hear()); }

  // Checks that the engine is lost: the owner was notified, and every later call has the same
  // error.
  void ExpectGone(const std::string& why) {
    EXPECT_THAT(lost_.get_future().get().message(), HasSubstr(why));
    ToldStatus later;
    engine_->SetTarget(target_, later.done());
    const absl::Status status = later.get();
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(status.message(), HasSubstr(why));
    lost_ = {};
  }

  HandPlayedWorker worker_;
  EngineOptions options_;
  Target target_;
  std::vector<std::byte> bytes_ = std::vector<std::byte>(kBytes);
  std::vector<uint64_t> numbers_ = std::vector<uint64_t>(kPictures);
  std::promise<absl::Status> lost_;
  std::vector<absl::Status> opened_;
  std::unique_ptr<RankWorker> engine_;
};

// ---- the first answer

TEST_F(WorkerAnswers, AnEngineIsThereByTheNameThatFits) {
  const Message open = Open();
  ASSERT_EQ(open.type, MessageType::kOpen);
  ReadyMessage ready{.kind = EngineKind::kCuda};
  std::memset(ready.device, 'G', sizeof(ready.device));
  worker_.Say(MakeMessage(MessageType::kReady, open.call, ready));
  ToldStatus set;
  engine_->SetTarget(target_, set.done());
  worker_.SayDone(worker_.Hear());
  ASSERT_TRUE(set.get().ok());
  EXPECT_THAT(opened_, Each(absl::OkStatus()));
  EXPECT_EQ(engine_->info().kind, EngineKind::kCuda);
  EXPECT_EQ(engine_->info().device, std::string(128, 'G'));
}

TEST_F(WorkerAnswers, AnEngineIsNotThereUnlessItSaysSo) {
  const std::vector<std::pair<std::function<Message(uint64_t)>, const char*>> answers = {
      {[](uint64_t call) { return MakeDone(call, absl::NotFoundError("no such GPU")); },
       "no such GPU"},
      {[](uint64_t call) { return MakeDone(call, absl::OkStatus()); }, "the worker has no engine"},
      {[](uint64_t call) { return MakeMessage(MessageType::kFrameDone, call, ReadyMessage{}); },
       "an answer of another type"},
      {[](uint64_t call) { return MakeMessage(MessageType::kReady, call, EngineKind::kCpu); },
       "the worker's answer is too short"}};
  for (const auto& [answer, why] : answers) {
    opened_.clear();
    worker_.Say(answer(Open().call));
    ExpectGone(why);
    ASSERT_EQ(opened_.size(), 1u);
    EXPECT_THAT(opened_[0].message(), HasSubstr(why));
  }
}

// ---- answers with a status

TEST_F(WorkerAnswers, OfAnotherTypeAreTheEnd) {
  std::vector<uint32_t> voxels(64);
  const std::vector<std::function<void(ToldStatus&)>> calls = {
      [&](ToldStatus& told) { engine_->SetTarget(target_, told.done()); },
      [&](ToldStatus& told) {
        engine_->ReadVoxels({0, 0, 0, 4, 4, 4}, voxels, told.done());
      },
      [&](ToldStatus& told) {
        StagingBlock block = *engine_->AcquireStaging(64);
        engine_->Apply(std::move(block), 0, told.done());
      }};
  for (const auto& call : calls) {
    Ready();
    ToldStatus told;
    call(told);
    worker_.Say(MakeMessage(MessageType::kFrameDone, worker_.Hear().call, DoneMessage{}));
    EXPECT_EQ(told.get(), absl::DataLossError("an answer of another type"));
    ExpectGone("an answer of another type");
  }
}

TEST_F(WorkerAnswers, OfDataLossAreTheEndAndOthersAreNot) {
  Ready();
  ToldStatus first, second;
  engine_->SetTarget(target_, first.done());
  worker_.SayDone(worker_.Hear(), absl::InvalidArgumentError("no such display"));
  EXPECT_EQ(first.get(), absl::InvalidArgumentError("no such display"));
  std::vector<uint32_t> voxels(64, 7);
  engine_->ReadVoxels({0, 0, 0, 4, 4, 4}, voxels, second.done());
  worker_.SayDone(worker_.Hear(), absl::DataLossError("the GPU has a fault"));
  EXPECT_EQ(second.get(), absl::DataLossError("the GPU has a fault"));
  EXPECT_THAT(voxels, Each(7u)) << "nothing of an error answer is used";
  ExpectGone("the GPU has a fault");
}

// ---- invitations

TEST_F(WorkerAnswers, AnInvitationIsOneOrTheReasonWhyNot) {
  Ready();
  const auto invite = [&](const std::function<void(const Message&)>& answer) {
    Told<absl::StatusOr<RankLink::Invitation>> told;
    engine_->Invite("a library", told.done());
    const Message asked = worker_.Hear();
    EXPECT_EQ(asked.type, MessageType::kInvite);
    EXPECT_EQ(asked.TextAfter<InviteMessage>(), "a library");
    answer(asked);
    return told.get();
  };
  InvitedMessage invited;
  invited.invitation.fill(std::byte{0x5C});
  const auto good = invite([&](const Message& asked) {
    worker_.Say(MakeMessage(MessageType::kInvited, asked.call, invited));
  });
  ASSERT_TRUE(good.ok()) << good.status();
  EXPECT_EQ(*good, invited.invitation);
  EXPECT_EQ(invite([&](const Message& asked) {
              worker_.SayDone(asked, absl::NotFoundError("no library"));
            }).status(),
            absl::NotFoundError("no library"));
  const std::vector<std::pair<std::function<void(const Message&)>, const char*>> damaged = {
      {[&](const Message& asked) {
         worker_.Say(MakeMessage(MessageType::kInvited, asked.call, uint32_t{0}));
       },
       "an answer of another type"},
      {[&](const Message& asked) {
         worker_.Say(MakeMessage(MessageType::kVoxels, asked.call, invited));
       },
       "an answer of another type"},
      {[&](const Message& asked) { worker_.SayDone(asked); }, "the worker's invitation is none"}};
  for (const auto& [answer, why] : damaged) {
    EXPECT_EQ(invite(answer).status(), absl::DataLossError(why));
    ExpectGone(why);
    Ready();
  }
  const absl::Status gone = invite([&](const Message&) { worker_.HangUp(); }).status();
  EXPECT_EQ(gone.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(gone.message(), HasSubstr("the worker was lost: the other process has ended"));
}

TEST_F(WorkerAnswers, WhoeverJoinsWithoutAnAnswerThatIsOneIsGone) {
  Ready();
  ToldStatus refused;
  engine_->Join("a library", {}, 0, 2, refused.done());
  worker_.SayDone(worker_.Hear(), absl::NotFoundError("no library"));
  EXPECT_EQ(refused.get(), absl::NotFoundError("no library"));
  ToldStatus damaged;
  engine_->Join("a library", {}, 0, 2, damaged.done());
  worker_.Say(MakeMessage(MessageType::kVoxels, worker_.Hear().call, ReadyMessage{}));
  EXPECT_EQ(damaged.get(), absl::DataLossError("an answer of another type"));
  ExpectGone("an answer of another type");
}

TEST_F(WorkerAnswers, NoVoxelsAreReadIntoNothing) {
  Ready();
  ToldStatus told;
  engine_->ReadVoxels({0, 0, 0, 0, 4, 4}, {}, told.done());
  worker_.SayDone(worker_.Hear());
  EXPECT_TRUE(told.get().ok());
}

// ---- frames

TEST_F(WorkerAnswers, ASegmentHoldsAFrameForTheNextUntilThereIsAnotherTarget) {
  Ready();
  ToldFrame first, second, under_way, after;
  Submit(1, first);
  EXPECT_EQ(Draw(std::byte{1}).holds, 0u);
  ASSERT_TRUE(first.get().ok());
  EXPECT_THAT(bytes_, Each(std::byte{1}));
  Submit(2, second);
  EXPECT_EQ(Draw(std::byte{2}).holds, 1u);
  ASSERT_TRUE(second.get().ok());

  Submit(3, under_way);
  const Message asked = worker_.Hear();
  ToldStatus set;
  engine_->SetTarget(target_, set.done());
  const Message target = worker_.Hear();
  Draw(std::byte{3}, asked);
  ASSERT_TRUE(under_way.get().ok());
  worker_.SayDone(target);
  ASSERT_TRUE(set.get().ok());
  Submit(4, after);
  EXPECT_EQ(Draw(std::byte{4}).holds, 0u) << "it holds pictures of another target";
  ASSERT_TRUE(after.get().ok());
}

TEST_F(WorkerAnswers, ABufferThatIsGreaterHasASegmentOfItsSize) {
  Ready();
  ToldFrame first, greater;
  Submit(1, first);
  Draw(std::byte{1});
  ASSERT_TRUE(first.get().ok());
  std::vector<std::byte> bytes(1 << 20);
  Submit(2, greater, {bytes, numbers_});
  const Message asked = worker_.Hear();
  const auto sent = *asked.As<FrameMessage>();
  EXPECT_EQ(sent.bytes, bytes.size());
  EXPECT_EQ(sent.holds, 0u);
  EXPECT_GE(worker_.segment(sent.segment).size(), bytes.size() + kPictures * sizeof(uint64_t));
  worker_.SayDone(asked, absl::InvalidArgumentError("of another size"));
  EXPECT_EQ(greater.get().status(), absl::InvalidArgumentError("of another size"));
  ToldFrame next;
  Submit(3, next);
  Draw(std::byte{3});
  EXPECT_TRUE(next.get().ok()) << "the engine is unchanged";
}

TEST_F(WorkerAnswers, AFrameForABufferOfTheWrongSizeIsNotBelieved) {
  for (const auto& [bytes, pictures] : {std::pair{kBytes - 1, kPictures},
                                        {kBytes + 1, kPictures},
                                        {kBytes, kPictures - 1},
                                        {kBytes, kPictures + 1}}) {
    Ready();
    bytes_.assign(bytes, std::byte{7});
    numbers_.assign(pictures, 7);
    ToldFrame told;
    Submit(1, told);
    Draw(std::byte{1});
    EXPECT_EQ(told.get().status(),
              absl::DataLossError("the worker took a buffer of the wrong size"));
    EXPECT_THAT(bytes_, Each(std::byte{7}));
    ExpectGone("the wrong size");
  }
}

TEST_F(WorkerAnswers, AFrameBeforeThereIsATargetIsNotBelieved) {
  worker_.Say(MakeMessage(MessageType::kReady, Open().call, ReadyMessage{}));
  ToldFrame told;
  Submit(1, told);
  Draw(std::byte{1});
  EXPECT_EQ(told.get().status(), absl::DataLossError("the worker's answer to a frame is none"));
}

// ---- calls that are not sent

TEST_F(WorkerAnswers, ADeltaThatIsLongerThanItsBlockIsNotSent) {
  Ready();
  ToldStatus told, next;
  engine_->Apply(*engine_->AcquireStaging(64), 65, told.done());
  EXPECT_EQ(told.get().code(), absl::StatusCode::kInvalidArgument);
  engine_->Apply(*engine_->AcquireStaging(64), 0, next.done());
  const Message asked = worker_.Hear();
  EXPECT_EQ(asked.As<BulkMessage>()->size, 0u);
  worker_.SayDone(asked);
  EXPECT_TRUE(next.get().ok());
}

TEST_F(WorkerAnswers, WhatWantsMemoryIsRefusedWithoutAndTheEngineGoesOn) {
  worker_.Say(MakeMessage(MessageType::kReady, Open().call, ReadyMessage{}));
  std::vector<uint32_t> voxels(64);
  {
    const RefusedCalls refused(SystemCall::kMemfdCreate, ENOMEM, 3);
    ToldStatus target, read;
    ToldFrame frame;
    engine_->SetTarget(target_, target.done());
    engine_->ReadVoxels({0, 0, 0, 4, 4, 4}, voxels, read.done());
    Submit(1, frame);
    for (const absl::Status& status : {target.get(), read.get(), frame.get().status()}) {
      EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
      EXPECT_THAT(status.message(), HasSubstr("memfd_create: Cannot allocate memory"));
    }
    EXPECT_EQ(refused.made(), 3);
  }
  ToldStatus target;
  ToldFrame frame;
  engine_->SetTarget(target_, target.done());
  const Message asked = worker_.Hear();
  EXPECT_EQ(asked.type, MessageType::kTarget) << "nothing of the others was sent";
  worker_.SayDone(asked);
  EXPECT_TRUE(target.get().ok());
  Submit(1, frame);
  Draw(std::byte{1});
  EXPECT_TRUE(frame.get().ok());
}

TEST_F(WorkerAnswers, WhatIsRefusedIsToldAtOnceOnceTheWorkerIsGone) {
  Ready();
  worker_.HangUp();
  ExpectGone("the worker was lost");
  ToldStatus told;
  engine_->Apply(*engine_->AcquireStaging(64), 65, told.done());
  EXPECT_EQ(told.get().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(WorkerAnswers, WhatIsRefusedInlineIsToldWithinTheCall) {
  options_.inline_execution = true;
  options_.wait_until_ready = false;
  const auto engine = CreateWorkerEngine(options_, "");
  ASSERT_TRUE(engine.ok()) << engine.status();
  absl::Status told;
  (*engine)->Apply(*(*engine)->AcquireStaging(64), 65, [&](absl::Status status) { told = status; });
  EXPECT_EQ(told.code(), absl::StatusCode::kInvalidArgument);
}

// ---- bulk memory

TEST_F(WorkerAnswers, ABulkSegmentIsNamedOnceAndGivenBackWhenItIsGone) {
  Ready();
  const auto pool = BulkPool::Create({.keep_bytes = 0});
  BulkPool::Fresh fresh = *pool->Allocate(64);
  const uint64_t id = fresh.block.segment()->id();
  for (int i = 0; i < 2; ++i) {
    ToldStatus told;
    StagingBlock block = *engine_->AcquireStaging(64);
    block.Refer({fresh.block});
    engine_->Apply(std::move(block), 0, told.done());
    Message message = worker_.Hear();
    if (i == 0) {
      EXPECT_EQ(message.type, MessageType::kBulkSegment);
      EXPECT_EQ(message.As<BulkSegmentMessage>()->segment, id);
      message = worker_.Hear();
    }
    EXPECT_EQ(message.type, MessageType::kApply);
    worker_.SayDone(message);
    EXPECT_TRUE(told.get().ok());
  }
  fresh = {};
  const Message gone = worker_.Hear();
  EXPECT_EQ(gone.type, MessageType::kDropBulkSegment);
  EXPECT_EQ(gone.As<BulkSegmentMessage>()->segment, id);
}

TEST_F(WorkerAnswers, ABulkSegmentMayOutliveTheEngine) {
  Ready();
  const auto pool = BulkPool::Create({.keep_bytes = 0});
  BulkPool::Fresh fresh = *pool->Allocate(64);
  ToldStatus told;
  StagingBlock block = *engine_->AcquireStaging(64);
  block.Refer({fresh.block});
  engine_->Apply(std::move(block), 0, told.done());
  EXPECT_EQ(worker_.Hear().type, MessageType::kBulkSegment);
  worker_.SayDone(worker_.Hear());
  EXPECT_TRUE(told.get().ok());
  engine_.reset();
  fresh = {};
  EXPECT_EQ(pool->held_bytes(), 0u);
}

TEST_F(WorkerAnswers, WhatTheWorkerCouldNotReadIsNotSent) {
  Ready();
  const auto pool = BulkPool::Create({.shared = false});
  ToldStatus of_this_process, alone, next;
  StagingBlock block = *engine_->AcquireStaging(64);
  block.Refer({pool->Allocate(64)->block});
  engine_->Apply(std::move(block), 0, of_this_process.done());
  const absl::Status refused = of_this_process.get();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(refused.message(), HasSubstr("bulk memory of this process alone"));
  struct {
    RecordHeader header;
    GeometryRecord geometry;
    BulkRef ref;
  } const delta{
      {.op = Op::kPutBulkGeometry, .size = sizeof(delta)}, {.id = 1}, {.segment = 1, .size = 64}};
  block = *engine_->AcquireStaging(sizeof(delta));
  std::memcpy(block.bytes().data(), &delta, sizeof(delta));
  engine_->Apply(std::move(block), sizeof(delta), alone.done());
  EXPECT_EQ(alone.get().code(), absl::StatusCode::kInvalidArgument) << "its block was not sent";
  engine_->Apply(*engine_->AcquireStaging(64), 0, next.done());
  const Message asked = worker_.Hear();
  EXPECT_EQ(asked.type, MessageType::kApply);
  EXPECT_EQ(asked.As<BulkMessage>()->size, 0u);
  worker_.SayDone(asked);
  EXPECT_TRUE(next.get().ok());
}

// ---- a system without resources

int OpenDescriptors() {
  int count = 0;
  DIR* const folder = opendir("/proc/self/fd");
  while (readdir(folder) != nullptr) ++count;
  closedir(folder);
  return count;
}

TEST_F(WorkerAnswers, AnEngineThatWantsWhatTheSystemHasNotIsNotMadeAndKeepsNothing) {
  const std::vector<std::tuple<SystemCall, int, const char*>> wants = {
      {SystemCall::kSocketpair, EMFILE, "no sockets for a worker: Too many open files"},
      {SystemCall::kEventfd, EMFILE, "no event for a worker: Too many open files"},
      {SystemCall::kPthreadCreate, EAGAIN, "no thread for a worker: "}};
  for (const auto& [call, error, why] : wants) {
    if (call == SystemCall::kPthreadCreate && !kRefusesThreads) continue;
    const int before = OpenDescriptors();
    const RefusedCalls refused(call, error);
    const absl::Status status = CreateWorkerEngine(options_, "").status();
    EXPECT_EQ(refused.made(), 1);
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(status.message(), HasSubstr(why));
    EXPECT_EQ(OpenDescriptors(), before) << why;
  }
}

}  // namespace
}  // namespace voxeld::gpu
