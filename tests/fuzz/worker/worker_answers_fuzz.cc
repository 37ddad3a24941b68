// An engine's owner, and a malicious or broken worker: the owner's calls are answered rightly,
// wrongly, in another order, or not at all. Each call ends once, an accepted frame is what the
// worker drew, and no descriptor leaks.

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <deque>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_join.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/bulk_pool.h"
#include "gpu/bulk/segment.h"
#include "gpu/worker/frame_slot.h"
#include "gpu/worker/message.h"
#include "gpu/worker/worker_engine.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "tests/fuzz/worker/open_descriptors.h"
#include "tests/fuzz/worker/small_target.h"
#include "tests/fuzz/worker/sound_delta.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::gpu;  // NOLINT(google-build-using-namespace)

constexpr int kMostSteps = 64;
constexpr std::byte kUntouched{0xA5};

// The address where workers are reached, in this process as long as it runs.
class Door {
 public:
  Door()
      : path_((std::filesystem::temp_directory_path() /
               absl::StrCat("voxeld-worker-answers-", getpid()))
                  .string()),
        listening_(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    sockaddr_un name = {};
    name.sun_family = AF_UNIX;
    EXPECT_THAT_HOLDS(path_.size() < sizeof(name.sun_path));
    path_.copy(name.sun_path, path_.size());
    unlink(path_.c_str());
    EXPECT_THAT_HOLDS(bind(listening_, reinterpret_cast<sockaddr*>(&name), sizeof(name)) == 0);
    EXPECT_THAT_HOLDS(listen(listening_, 8) == 0);
  }
  ~Door() {
    close(listening_);
    unlink(path_.c_str());
  }
  std::string program() const { return "unix:" + path_; }
  int Accept() const { return accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC); }

 private:
  const std::string path_;
  const int listening_;
};

// A request of the owner's caller, its buffer, and what the worker has drawn for it.
struct Frame {
  FrameRequest request;
  display::FrameLayout layout;
  uint64_t call = 0;
  std::vector<std::byte> bytes, drawn;
  std::vector<uint64_t> changed_in, drawn_in;
};

class Worker {
 public:
  explicit Worker(const Door& door) {
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.worker = door.program();
    options.worker_deadline_ns = std::numeric_limits<int64_t>::max() / 64;
    options.lost = [this](const absl::Status& status) {
      EXPECT_THAT_HOLDS(absl::IsDataLoss(status) && !IsLate(status), status.ToString());
      Tell([this] { ++lost_; });
    };
    auto engine = CreateRankWorker(options, std::make_shared<WorkerStaging>(1 << 20), Call());
    EXPECT_THAT_HOLDS(engine.ok(), engine.status().ToString());
    engine_ = *std::move(engine);
    control_ = door.Accept();
    absl::StatusOr<Message> connect = ReceiveMessage(control_);
    EXPECT_THAT_HOLDS(connect.ok() && connect->type == MessageType::kConnect && connect->fd >= 0);
    connection_ = connect->fd;
    Hear();
  }
  ~Worker() {
    engine_->Close();
    engine_ = nullptr;
    for (const int times : ended_) EXPECT_THAT_HOLDS(times == 1, "a call ended ", times, " times");
    EXPECT_THAT_HOLDS(lost_ <= 1, "lost ", lost_, " times");
    close(connection_);
    close(control_);
  }

  void Run(Script script) {
    for (int i = 0; i < MostSteps(kMostSteps) && !script.done(); ++i) Step(script);
  }

 private:
  // ---- the owner's side

  // Returns a callback for the end of a call, whose error may be in the worker's words.
  std::function<void(const absl::Status&)> Call() {
    ended_.push_back(0);
    return [this, at = ended_.size() - 1](const absl::Status& /*status*/) {
      Tell([this, at] { ++ended_[at]; });
    };
  }
  void Tell(const std::function<void()>& what) {
    sync::MutexLock lock(mutex_);
    what();
    ++told_;
    told_more_.NotifyAll();
  }

  void Step(Script& script) {
    switch (script.Byte() % 16) {
      case 0: {
        const Target target = SmallTarget(script);
        layout_ = target.layout;
        engine_->SetTarget(target, Call());
        return Hear();
      }
      case 1:
        return Apply(SoundDelta(script), 0, {});
      case 2: {
        const std::string text = script.Text();
        const auto* const data = reinterpret_cast<const std::byte*>(text.data());
        return Apply({data, data + text.size()}, script.Byte(), {});
      }
      case 3:
        return Submit(script);
      case 4: {
        const VoxelBox box{0, 0, 0, script.Byte() % 5, 4, 4};
        voxels_.emplace_back(script.Byte());
        engine_->ReadVoxels(box, voxels_.back(), Call());
        return Hear();
      }
      case 5:
        engine_->Invite(script.Text(),
                        [told = Call()](const absl::StatusOr<RankLink::Invitation>& answer) {
                          told(answer.status());
                        });
        return Hear();
      case 6:
        engine_->Join(script.Text(), {}, script.Byte() % 3, script.Byte() % 3, Call());
        return Hear();
      case 7: {
        const Message asked = Owed(script);
        Say(MakeDone(asked.call, absl::OkStatus()));
        return;
      }
      case 8: {
        const Message asked = Owed(script);
        const DoneMessage done{static_cast<int8_t>(script.Byte())};
        Say(MakeMessage(MessageType::kDone, asked.call, done, script.Text()));
        return;
      }
      case 9:
        return Draw(script);
      case 10: {
        const Message asked = Owed(script);
        ReadyMessage ready{.kind = static_cast<EngineKind>(script.Byte() % 3)};
        script.Text().copy(ready.device, sizeof(ready.device));
        Say(MakeMessage(MessageType::kReady, asked.call, ready));
        return;
      }
      case 11:
        Say(MakeMessage(MessageType::kInvited, Owed(script).call, InvitedMessage{}));
        return;
      case 12: {  // any message, with a descriptor or without; or what is not a message
        Message message;
        message.type = static_cast<MessageType>(script.Byte());
        message.call = script.Flag() ? Owed(script).call : script.Byte();
        const std::string text = script.Text();
        const auto* const data = reinterpret_cast<const std::byte*>(text.data());
        message.body.assign(data, data + std::min<size_t>(text.size(), 4096));
        const uint8_t how = script.Byte();
        if ((how & 1) != 0) message.fd = control_;
        if ((how & 6) == 2) message.body.resize(4097);
        Say(message, (how & 6) == 4 ? std::min<size_t>(text.size(), 15) : SIZE_MAX);
        return;
      }
      case 13:
        return ApplyWithBulk(script);
      case 14:
        (void)engine_->info();
        return AskMuch(script);
      default:
        if (script.Flag()) {
          shutdown(connection_, SHUT_RDWR);
        } else {
          engine_->GiveUp(absl::DataLossError("given up"));
        }
        return AwaitLoss();
    }
  }

  // `beyond`: that many bytes more than the block has.
  void Apply(const std::vector<std::byte>& delta, size_t beyond, std::vector<BulkBlock> blocks) {
    auto block = engine_->AcquireStaging(std::max<size_t>(1, delta.size()));
    EXPECT_THAT_HOLDS(block.ok() || absl::IsResourceExhausted(block.status()));
    if (!block.ok()) return;
    std::copy(delta.begin(), delta.end(), block->bytes().begin());
    block->Refer(std::move(blocks));
    engine_->Apply(*std::move(block), delta.size() + beyond, Call());
    Hear();
  }

  // Uses a block of a pool that is shared, or of one that is not; the pool is then destroyed or
  // stays.
  void ApplyWithBulk(Script& script) {
    const uint8_t how = script.Byte();
    if (pools_.empty()) {
      pools_ = {BulkPool::Create({.keep_bytes = 0}),
                BulkPool::Create({.keep_bytes = 0, .shared = false})};
    }
    auto fresh = pools_[how & 1]->Allocate(64);
    EXPECT_THAT_HOLDS(fresh.ok(), fresh.status().ToString());
    if ((how & 2) != 0) kept_.push_back(fresh->block);
    if ((how & 4) != 0) kept_.clear();
    Apply(SoundDelta(script), 0, {std::move(fresh->block)});
  }

  // Makes calls, possibly more than there is room for, before the worker receives the first.
  void AskMuch(Script& script) {
    const int calls = script.Byte() % 96;
    const auto told = [](const std::function<void(const absl::Status&)>& ended) {
      return
          [ended](const absl::StatusOr<RankLink::Invitation>& answer) { ended(answer.status()); };
    };
    for (int i = 0; i < calls; ++i) engine_->Invite(std::string(4000, 'a'), told(Call()));
    for (int i = 0; i < calls; ++i) Hear();
  }

  void Submit(Script& script) {
    Frame& frame = frames_.emplace_back();
    frame.request = {.frame = script.Byte(), .buffer_holds = script.Byte()};
    frame.layout = layout_;
    const uint8_t off = script.Byte();
    frame.bytes.assign(layout_.bytes() + off % 3, kUntouched);
    frame.changed_in.resize(layout_.pictures() + off / 3 % 3);
    engine_->SubmitFrame(frame.request, {frame.bytes, frame.changed_in},
                         [&frame, told = Call()](const absl::StatusOr<FrameResult>& result) {
                           if (result.ok()) LookAt(frame, *result);
                           told(result.status());
                         });
    Hear();
    if (!owed_.empty() && owed_.back().type == MessageType::kFrame) frame.call = owed_.back().call;
  }

  // ---- the worker's side

  // Reads what the owner sends for the call that was made last, or that call's end without it.
  void Hear() {
    for (;;) {
      {
        sync::MutexLock lock(mutex_);
        if (ended_.back() != 0) return;
        if (lost_ != 0) {
          while (ended_.back() == 0) told_more_.Wait(mutex_);
          return;
        }
      }
      pollfd waiting{connection_, POLLIN, 0};
      poll(&waiting, 1, 1);
      if ((waiting.revents & POLLIN) == 0) continue;
      absl::StatusOr<Message> message = ReceiveMessage(connection_);
      if (!message.ok()) continue;  // the owner has disconnected, and will report it
      if (message->type == MessageType::kSegment) {
        const auto named = *message->As<SegmentMessage>();
        segments_[named.segment] = *Segment::Adopt(message->fd, named.size);
      } else if (message->type == MessageType::kDropSegment) {
        segments_.erase(message->As<SegmentMessage>()->segment);
      } else if (message->type == MessageType::kBulkSegment) {
        close(message->fd);
      } else if (message->type != MessageType::kDropBulkSegment) {
        EXPECT_THAT_HOLDS(message->fd < 0, "a descriptor with a call");
        owed_.push_back(*std::move(message));
        return;
      }
    }
  }

  // Returns an unanswered call, or one with another number if every call is answered.
  Message Owed(Script& script) {
    if (owed_.empty()) {
      Message none;
      none.call = script.Byte();
      return none;
    }
    const size_t at = script.Byte() % owed_.size();
    Message asked = std::move(owed_[at]);
    owed_.erase(owed_.begin() + static_cast<ptrdiff_t>(at));
    return asked;
  }

  // Draws a frame in the segment that was named for it, and reports it rightly or wrongly.
  void Draw(Script& script) {
    const Message asked = Owed(script);
    const auto sent = asked.As<FrameMessage>().value_or(FrameMessage{});
    FrameDoneMessage done;
    done.result.frame = sent.frame;
    const auto frame = std::ranges::find(frames_, asked.call, &Frame::call);
    const auto segment = segments_.find(sent.segment);
    if (frame != frames_.end() && segment != segments_.end()) {
      const size_t pictures = frame->layout.pictures();
      const FrameBuffer slot =
          FrameSlot{pictures, frame->layout.bytes()}.In(segment->second->bytes());
      std::ranges::fill(slot.bytes, static_cast<std::byte>(script.Byte()));
      for (uint64_t& number : slot.changed_in) number = script.Byte();
      const auto executor = MakeFrameExecutor(slot.bytes.size());
      done.crc = FrameCrc(frame->layout, slot, {0, pictures}, sent.holds, *executor);
      frame->drawn.assign(slot.bytes.begin(), slot.bytes.end());
      frame->drawn_in.assign(slot.changed_in.begin(), slot.changed_in.end());
    }
    const uint8_t wrong = script.Byte();
    if (wrong == 1) ++done.crc;
    if (wrong == 2) ++done.result.frame;
    Say(MakeMessage(MessageType::kFrameDone, asked.call, done));
  }

  // Sends a message, or its first bytes, and waits until the owner has reacted to it.
  void Say(const Message& message, size_t most = SIZE_MAX) {
    int64_t told = 0;
    {
      sync::MutexLock lock(mutex_);
      if (lost_ != 0) return;
      told = told_;
    }
    if (most == SIZE_MAX) {
      if (!SendMessage(connection_, message).ok()) return AwaitLoss();
    } else if (send(connection_, &message.call, std::min(most, sizeof(message.call)),
                    MSG_NOSIGNAL) < 0) {
      return AwaitLoss();
    }
    sync::MutexLock lock(mutex_);
    while (told_ == told) told_more_.Wait(mutex_);
  }
  void AwaitLoss() {
    sync::MutexLock lock(mutex_);
    while (lost_ == 0) told_more_.Wait(mutex_);
  }

  // An accepted frame is what was drawn for that very call, and the rest of the buffer is not
  // written.
  static void LookAt(const Frame& frame, const FrameResult& result) {
    EXPECT_THAT_HOLDS(result.frame == frame.request.frame);
    EXPECT_THAT_HOLDS(!frame.drawn_in.empty(), "a frame that nobody drew");
    EXPECT_THAT_HOLDS(frame.bytes.size() == frame.drawn.size());
    EXPECT_THAT_HOLDS(frame.changed_in == frame.drawn_in, "numbers ",
                      absl::StrJoin(frame.changed_in, " "), "; drawn ",
                      absl::StrJoin(frame.drawn_in, " "));
    const size_t size = frame.drawn.size() / frame.drawn_in.size();
    for (size_t i = 0; i < frame.drawn.size(); ++i) {
      const bool is_new = frame.drawn_in[i / size] > frame.request.buffer_holds;
      EXPECT_THAT_HOLDS(frame.bytes[i] == (is_new ? frame.drawn[i] : kUntouched), "byte ", i);
    }
  }

  sync::Mutex mutex_;
  sync::CondVar told_more_;
  std::deque<int> ended_;  // for each call, how often it ended
  int lost_ = 0;
  int64_t told_ = 0;  // counts the ends of calls and of the engine
  std::deque<Frame> frames_;
  std::deque<std::vector<uint32_t>> voxels_;
  std::vector<std::shared_ptr<BulkPool>> pools_;
  std::vector<BulkBlock> kept_;
  display::FrameLayout layout_{.slices = 4, .width = 4, .height = 4};  // of the last target
  int control_ = -1, connection_ = -1;
  std::map<uint32_t, std::shared_ptr<Segment>> segments_;
  std::vector<Message> owed_;
  std::unique_ptr<RankWorker> engine_;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const voxeld::fuzz::Door door;
  // The first engine opens descriptors that stay open.
  static const bool begun = [] {
    voxeld::fuzz::Worker(door).Run(voxeld::fuzz::Script(nullptr, 0));
    return true;
  }();
  EXPECT_THAT_HOLDS(begun);
  const auto before = voxeld::fuzz::OpenDescriptors();
  voxeld::fuzz::Worker(door).Run(voxeld::fuzz::Script(data, size));
  const auto after = voxeld::fuzz::OpenDescriptors();
  EXPECT_THAT_HOLDS(after.size() == before.size(), "of ", before.size(), " descriptors there are ",
                    after.size(), "; ", absl::StrJoin(after, ", "));
  return 0;
}
