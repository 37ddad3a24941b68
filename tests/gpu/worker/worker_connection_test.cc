// Tests messages of a broken owner: the worker answers, or exits, and reads nothing that does not
// exist.
#include "gpu/worker/worker_connection.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <map>
#include <memory>
#include <span>
#include <utility>

#include "display/crc/crc32c.h"
#include "gpu/bulk/segment.h"
#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/target_codec.h"

namespace voxeld::gpu {
namespace {

class WorkerConnectionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    hooks_.make_engine =
        [](const EngineOptions& options) -> absl::StatusOr<std::unique_ptr<Engine>> {
      if (options.kind != EngineKind::kCpu) return absl::FailedPreconditionError("no such engine");
      EngineOptions own = options;
      own.threads = 1;
      return CreateCpuEngine(own, "");
    };
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
    fcntl(ends_[0], F_SETFL, O_NONBLOCK);
    connection_ = NewWorkerConnection(ends_[1], hooks_);
  }
  void TearDown() override {
    connection_ = nullptr;
    close(ends_[0]);
    close(ends_[1]);
  }

  absl::Status Handle(Message message) { return connection_->Handle(message); }
  // Returns the status in the last answer.
  absl::Status Answered() {
    const absl::StatusOr<Message> answer = ReceiveMessage(ends_[0]);
    if (!answer.ok()) return absl::InternalError("no answer");
    return answer->type == MessageType::kDone ? StatusOf(*answer) : absl::OkStatus();
  }
  // For a message with a descriptor.
  void ExpectRefusedAndClosed(Message message) {
    message.fd = dup(ends_[0]);
    const int descriptor = message.fd;
    ASSERT_GE(descriptor, 0);
    EXPECT_EQ(connection_->Handle(message).code(), absl::StatusCode::kInvalidArgument);
    EXPECT_LT(message.fd, 0);
    EXPECT_EQ(fcntl(descriptor, F_GETFD), -1);
  }
  void Open(EngineKind kind, SlicePart part = {}) {
    OpenMessage open;
    open.kind = kind;
    open.part = part;
    ASSERT_TRUE(Handle(MakeMessage(MessageType::kOpen, 1, open)).ok());
  }
  void TellSegment() {
    segment_ = *Segment::Create(4096);
    Message message = MakeMessage(MessageType::kSegment, 0, SegmentMessage{1, 0, 4096});
    message.fd = dup(segment_->fd());
    ASSERT_TRUE(Handle(std::move(message)).ok());
  }
  // Sets a display of 4x4 pixels in 4 slices.
  absl::Status SetTarget() {
    Target target;
    display::PlanarStack stack{.width_px = 4, .height_px = 4};
    stack.positions_mm = {0, 1, 2, 3};
    target.geometry.shape = stack;
    target.geometry.grid = {.nx = 4, .ny = 4, .nz = 4, .pitch_mm = {1, 1, 1}, .origin_mm = {}};
    target.layout = {.slices = 4, .width = 4, .height = 4};
    target.tone.lut.fill(display::Tone::Linear());
    const std::vector<std::byte> bytes = EncodeTarget(target);
    std::memcpy(segment_->bytes().data(), bytes.data(), bytes.size());
    const BulkMessage bulk{1, display::Crc32c(bytes), bytes.size()};
    if (absl::Status ended = Handle(MakeMessage(MessageType::kTarget, 2, bulk)); !ended.ok())
      return ended;
    return Answered();
  }
  absl::Status Frame(uint64_t number) {
    const FrameMessage frame{
        .segment = 1, .frame = number, .holds = 0, .buffer_holds = 0, .pictures = 4, .bytes = 192};
    if (absl::Status ended = Handle(MakeMessage(MessageType::kFrame, 3, frame)); !ended.ok())
      return ended;
    return Answered();
  }

  WorkerHooks hooks_;
  int ends_[2] = {-1, -1};
  std::unique_ptr<WorkerConnection> connection_;
  std::shared_ptr<Segment> segment_;
};

TEST_F(WorkerConnectionTest, AnEngineThatIsOpenedAnewHasNoTarget) {
  Open(EngineKind::kCpu);
  EXPECT_TRUE(Answered().ok());
  TellSegment();
  ASSERT_TRUE(SetTarget().ok());
  EXPECT_TRUE(Frame(1).ok());
  // Slices that the previous display does not have.
  Open(EngineKind::kCpu, {.begin = 40, .end = 80});
  EXPECT_TRUE(Answered().ok());
  EXPECT_EQ(Frame(2).code(), absl::StatusCode::kFailedPrecondition);
}

TEST_F(WorkerConnectionTest, AnEngineThatCannotBeOpenedLeavesTheOneThatIs) {
  Open(EngineKind::kCpu);
  EXPECT_TRUE(Answered().ok());
  TellSegment();
  ASSERT_TRUE(SetTarget().ok());
  Open(EngineKind::kCuda, {.begin = 40, .end = 80});
  EXPECT_EQ(Answered().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(Frame(1).ok());
}

// A pinned segment is unpinned while it is mapped, also if another takes its name.
TEST_F(WorkerConnectionTest, ASegmentInAnothersPlaceLeavesNothingPinned) {
  std::map<const std::byte*, size_t> pinned;
  hooks_.pin = hooks_.pin_read_only = [&](std::span<std::byte> memory) {
    EXPECT_TRUE(pinned.emplace(memory.data(), memory.size()).second);
  };
  hooks_.unpin = [&](std::span<std::byte> memory) { EXPECT_EQ(pinned.erase(memory.data()), 1u); };
  for (const uint32_t staging : {1u, 1u, 0u}) {
    const auto segment = *Segment::Create(4096);
    Message message = MakeMessage(MessageType::kSegment, 0, SegmentMessage{1, staging, 4096});
    message.fd = dup(segment->fd());
    ASSERT_TRUE(Handle(std::move(message)).ok());
    EXPECT_EQ(pinned.size(), staging);
  }
  for (int i = 0; i < 2; ++i) {
    const auto segment = *Segment::CreateReadOnlyForOthers(4096);
    Message message = MakeMessage(MessageType::kBulkSegment, 0, BulkSegmentMessage{1, 4096});
    message.fd = dup(segment->fd());
    ASSERT_TRUE(Handle(std::move(message)).ok());
    EXPECT_EQ(pinned.size(), 1u);
  }
  connection_ = nullptr;
  EXPECT_TRUE(pinned.empty());
}

TEST_F(WorkerConnectionTest, MoreVoxelsThanCanBeCountedInBytesAreInNoSegment) {
  Open(EngineKind::kCpu);
  TellSegment();
  const VoxelsMessage voxels{1, {0, 0, 0, 4, 4, 4}, uint64_t{1} << 62};
  EXPECT_EQ(Handle(MakeMessage(MessageType::kVoxels, 3, voxels)).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(WorkerConnectionTest, ADescriptorThatNobodyAskedForIsClosed) {
  Open(EngineKind::kCpu);
  ExpectRefusedAndClosed(MakeMessage(MessageType::kDropSegment, 0, SegmentMessage{}));
}

TEST_F(WorkerConnectionTest, ADescriptorWithAMessageThatIsTooShortIsClosed) {
  for (const MessageType type : {MessageType::kSegment, MessageType::kBulkSegment}) {
    Message message;
    message.type = type;
    ExpectRefusedAndClosed(message);
  }
}

TEST_F(WorkerConnectionTest, ADescriptorThatIsNoSegmentIsClosed) {
  ExpectRefusedAndClosed(MakeMessage(MessageType::kSegment, 0, SegmentMessage{1, 0, 4096}));
  ExpectRefusedAndClosed(MakeMessage(MessageType::kBulkSegment, 0, BulkSegmentMessage{1, 4096}));
}

}  // namespace
}  // namespace voxeld::gpu
