#include "tools/voxelctl/connection/grpc_scene_stream.h"

#include <grpcpp/client_context.h>
#include <grpcpp/support/sync_stream.h>

#include <functional>
#include <optional>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"
#include "tools/voxelctl/connection/commit_ledger.h"
#include "tools/voxelctl/connection/status.h"
#include "tools/voxelctl/text/escape.h"
#include "tools/voxelctl/text/table.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kOpenTime = 15 * sync::kSecond;

class GrpcSceneStream final : public SceneStream {
 public:
  GrpcSceneStream(const std::shared_ptr<grpc::ChannelInterface>& channel, std::string address,
                  Interrupt& interrupt, sync::TimeNs close_time)
      : address_(std::move(address)),
        stub_(v1::SceneService::NewStub(channel)),
        interrupt_(interrupt),
        close_time_(close_time),
        stream_(stub_->Stream(&context_)),
        reader_([this] { ReadAll(); }),
        listener_(interrupt.AddListener([this] {
          sync::MutexLock lock(mutex_);
          changed_.NotifyAll();
        })) {}

  ~GrpcSceneStream() override {
    interrupt_.RemoveListener(listener_);
    if (!reader_.joinable()) return;
    context_.TryCancel();
    reader_.join();
  }

  absl::Status Open(const v1::Open& open) {
    v1::StreamRequest request;
    *request.mutable_open() = open;
    const absl::Status sent = Send(std::move(request));
    if (!sent.ok()) return sent;
    return Wait(clock_.Now() + kOpenTime, "Opened",
                [this]() VOXELD_REQUIRES(mutex_) { return opened_.has_value(); });
  }

  // Written before the first caller can see it, never again.
  const v1::Opened& opened() const override VOXELD_NO_THREAD_SAFETY_ANALYSIS { return *opened_; }

  absl::Status Send(v1::StreamRequest request) override {
    request.set_sequence(++sequence_);
    if (stream_->Write(request)) return absl::OkStatus();
    // The stream has ended: the reader will learn why.
    return Wait(clock_.Now() + close_time_, "the end of the stream", []() { return false; });
  }

  absl::Status Commit(uint64_t* frame_id) override {
    v1::StreamRequest request;
    const uint64_t frame = ++frames_;
    if (frame_id != nullptr) *frame_id = frame;
    request.mutable_commit()->set_frame_id(frame);
    {
      sync::MutexLock lock(mutex_);
      const sync::TimeNs now = clock_.Now();
      request.mutable_commit()->set_send_time_ns(now);
      ledger_.Sent(frame, now);
    }
    return Send(std::move(request));
  }

  bool HasRoom() const override {
    sync::MutexLock lock(mutex_);
    return ledger_.unanswered() < kMostUnanswered;
  }

  absl::Status WaitForRoom(sync::TimeNs deadline) override {
    return Wait(deadline, "receipts", [this]() VOXELD_REQUIRES(mutex_) {
      return ledger_.unanswered() < kMostUnanswered;
    });
  }

  absl::Status WaitAccepted(uint64_t frame_id, sync::TimeNs deadline) override {
    absl::Status status = Wait(deadline, "Accepted", [this, frame_id]() VOXELD_REQUIRES(mutex_) {
      return ledger_.Accepted(frame_id) || ledger_.Refusal(frame_id).has_value();
    });
    if (!status.ok()) return status;
    sync::MutexLock lock(mutex_);
    const std::optional<std::string> refusal = ledger_.Refusal(frame_id);
    if (!refusal) return absl::OkStatus();
    std::string text = absl::StrCat("the server refused the scene: ", *refusal);
    const StreamTally tally = ledger_.Tally();
    for (const v1::Issue& issue : tally.issues)
      absl::StrAppend(&text, "\n  ", DescribeIssue(issue));
    if (tally.issue_count > tally.issues.size()) {
      absl::StrAppend(&text, "\n  and ", tally.issue_count - tally.issues.size(), " more");
    }
    return absl::FailedPreconditionError(text);
  }

  absl::Status WaitSettled(sync::TimeNs deadline) override {
    sync::MutexLock lock(mutex_);
    while (ledger_.unanswered() > 0 && !ended_ && clock_.Now() < deadline) {
      clock_.WaitUntil(mutex_, changed_, deadline);
    }
    if (ledger_.unanswered() == 0) return absl::OkStatus();
    if (ended_) return *ended_;
    return absl::DeadlineExceededError(absl::StrCat(
        Counted(ledger_.unanswered(), "commit has", "commits have"), " no outcome yet"));
  }

  StreamTally tally() const override {
    sync::MutexLock lock(mutex_);
    return ledger_.Tally();
  }

  std::vector<int64_t> latencies_ns() const override {
    sync::MutexLock lock(mutex_);
    return ledger_.latencies_ns();
  }

  absl::Status Close() override {
    stream_->WritesDone();
    const sync::TimeNs deadline = clock_.Now() + close_time_;
    sync::MutexLock lock(mutex_);
    while (!ended_ && clock_.Now() < deadline) clock_.WaitUntil(mutex_, changed_, deadline);
    if (!ended_)
      return absl::DeadlineExceededError(absl::StrCat(
          "voxeld at ", address_, " did not end the stream in ", Duration(close_time_)));
    return *ended_;
  }

 private:
  void ReadAll() {
    v1::StreamResponse response;
    while (stream_->Read(&response)) {
      sync::MutexLock lock(mutex_);
      if (response.has_opened() && !opened_) opened_ = response.opened();
      for (const v1::Issue& issue : response.issues()) ledger_.Told(issue);
      for (const v1::Receipt& receipt : response.receipts()) {
        ledger_.Answered(receipt, clock_.Now());
      }
      changed_.NotifyAll();
    }
    const absl::Status status = FromGrpc(stream_->Finish(), address_);
    sync::MutexLock lock(mutex_);
    ended_ = status;
    changed_.NotifyAll();
  }

  template <typename Done>
  absl::Status Wait(sync::TimeNs deadline, const char* what, Done done) VOXELD_EXCLUDES(mutex_) {
    sync::MutexLock lock(mutex_);
    while (!done()) {
      if (ended_) {
        return ended_->ok() ? absl::UnavailableError(
                                  absl::StrCat("voxeld at ", address_, " ended the stream"))
                            : *ended_;
      }
      if (interrupt_.requested()) return absl::CancelledError("interrupted");
      if (clock_.Now() >= deadline) {
        return absl::DeadlineExceededError(
            absl::StrCat("waited in vain for ", what, " from voxeld at ", address_));
      }
      clock_.WaitUntil(mutex_, changed_, deadline);
    }
    return absl::OkStatus();
  }

  const std::string address_;
  mutable sync::SystemClock clock_;
  std::unique_ptr<v1::SceneService::Stub> stub_;
  Interrupt& interrupt_;
  const sync::TimeNs close_time_;
  grpc::ClientContext context_;
  uint64_t sequence_ = 0, frames_ = 0;

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::optional<v1::Opened> opened_ VOXELD_GUARDED_BY(mutex_);
  CommitLedger ledger_ VOXELD_GUARDED_BY(mutex_);
  std::optional<absl::Status> ended_ VOXELD_GUARDED_BY(mutex_);

  std::unique_ptr<grpc::ClientReaderWriter<v1::StreamRequest, v1::StreamResponse>> stream_;
  std::thread reader_;
  const int listener_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SceneStream>> OpenGrpcSceneStream(
    std::shared_ptr<grpc::ChannelInterface> channel, const std::string& address,
    const v1::Open& open, Interrupt& interrupt, sync::TimeNs close_time) {
  auto stream =
      std::make_unique<GrpcSceneStream>(std::move(channel), address, interrupt, close_time);
  const absl::Status status = stream->Open(open);
  if (!status.ok()) return status;
  return stream;
}

std::string DescribeIssue(const v1::Issue& issue) {
  std::string text;
  if (!issue.layer().empty()) absl::StrAppend(&text, EscapeForTerminal(issue.layer()));
  if (!issue.id().empty()) absl::StrAppend(&text, "/", EscapeForTerminal(issue.id()));
  if (!issue.field().empty())
    absl::StrAppend(&text, text.empty() ? "" : ", ", EscapeForTerminal(issue.field()));
  if (!text.empty()) text += ": ";
  return absl::StrCat(text, EscapeForTerminal(issue.message()));
}

}  // namespace voxeld::voxelctl
