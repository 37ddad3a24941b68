#include "tools/voxelctl/connection/raw_stream.h"

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/connection/status.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::voxelctl {

class RawStream::Impl {
 public:
  Impl(const std::shared_ptr<grpc::Channel>& channel, std::string address, Interrupt& interrupt)
      : address_(std::move(address)),
        interrupt_(interrupt),
        listener_(interrupt.AddListener([this] { context_.TryCancel(); })),
        stub_(v1::SceneService::NewStub(channel)),
        call_(stub_->Stream(&context_)) {}

  ~Impl() {
    context_.TryCancel();
    if (!ended_) (void)call_->Finish();
    interrupt_.RemoveListener(listener_);
  }

  absl::Status Open(v1::Open open) {
    v1::StreamRequest request;
    *request.mutable_open() = std::move(open);
    request.mutable_open()->set_no_outcomes(true);
    if (!call_->Write(request)) return End();
    sent_ = request.ByteSizeLong();
    while (!opened_.has_value()) {
      if (absl::Status status = Read(); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  uint64_t owner() const { return opened_->owner(); }

  absl::Status Send(const v1::StreamRequest& request) {
    const uint64_t size = request.ByteSizeLong();
    const uint64_t most = opened_->limits().max_message_bytes();
    if (most != 0 && size > most) {
      return absl::ResourceExhaustedError(
          absl::StrCat("a message would have ", size, " bytes, and the server takes ", most,
                       ": raise limits.max_message_bytes in its configuration"));
    }
    // One message may exceed the credit; the next waits until it is applied.
    while (credit_ != 0 && sent_ >= credit_) {
      if (absl::Status status = Read(); !status.ok()) return status;
    }
    if (!call_->Write(request)) return End();
    sent_ += size;
    return absl::OkStatus();
  }

  absl::StatusOr<v1::Accepted> Commit() {
    v1::StreamRequest request;
    request.mutable_commit()->set_frame_id(++frame_);
    if (!call_->Write(request)) return End();
    sent_ += request.ByteSizeLong();
    answer_.reset();
    while (!answer_.has_value()) {
      if (absl::Status status = Read(); !status.ok()) return status;
    }
    if (answer_->has_refused()) {
      return absl::FailedPreconditionError(
          absl::StrCat("refused: ", EscapeForTerminal(answer_->refused().message())));
    }
    return answer_->accepted();
  }

  std::vector<v1::Issue> TakeIssues() { return std::exchange(issues_, {}); }

  absl::Status Close() {
    call_->WritesDone();
    v1::StreamResponse rest;
    while (call_->Read(&rest)) {
    }
    ended_ = true;
    return FromGrpc(call_->Finish(), address_);
  }

 private:
  absl::Status Read() {
    v1::StreamResponse response;
    if (!call_->Read(&response)) return End();
    if (response.has_opened()) {
      opened_ = response.opened();
      credit_ = response.opened().credit_bytes();
    }
    if (response.credit_bytes() != 0) credit_ = response.credit_bytes();
    for (v1::Issue& issue : *response.mutable_issues()) {
      if (issues_.size() < kMostIssues) issues_.push_back(std::move(issue));
    }
    for (v1::Receipt& receipt : *response.mutable_receipts()) {
      if (receipt.frame_id() == frame_ && (receipt.has_accepted() || receipt.has_refused())) {
        answer_ = std::move(receipt);
      }
    }
    return absl::OkStatus();
  }

  absl::Status End() {
    if (ended_) return absl::UnavailableError("the stream has ended");
    ended_ = true;
    const grpc::Status status = call_->Finish();
    if (interrupt_.requested()) return absl::CancelledError("interrupted");
    absl::Status ended = FromGrpc(status, address_);
    return ended.ok() ? absl::UnavailableError("the server ended the stream") : ended;
  }

  const std::string address_;
  Interrupt& interrupt_;
  grpc::ClientContext context_;
  const int listener_;
  const std::unique_ptr<v1::SceneService::Stub> stub_;
  const std::unique_ptr<grpc::ClientReaderWriter<v1::StreamRequest, v1::StreamResponse>> call_;
  std::optional<v1::Opened> opened_;
  std::optional<v1::Receipt> answer_;
  std::vector<v1::Issue> issues_;
  uint64_t sent_ = 0, credit_ = 0, frame_ = 0;
  bool ended_ = false;
};

RawStream::RawStream(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RawStream::~RawStream() = default;

absl::StatusOr<std::unique_ptr<RawStream>> RawStream::Open(std::shared_ptr<grpc::Channel> channel,
                                                           const std::string& address,
                                                           v1::Open open, Interrupt& interrupt) {
  auto impl = std::make_unique<Impl>(channel, address, interrupt);
  if (absl::Status status = impl->Open(std::move(open)); !status.ok()) return status;
  return std::unique_ptr<RawStream>(new RawStream(std::move(impl)));
}

uint64_t RawStream::owner() const { return impl_->owner(); }
absl::Status RawStream::Send(const v1::StreamRequest& request) { return impl_->Send(request); }
absl::StatusOr<v1::Accepted> RawStream::Commit() { return impl_->Commit(); }
std::vector<v1::Issue> RawStream::TakeIssues() { return impl_->TakeIssues(); }
absl::Status RawStream::Close() { return impl_->Close(); }

}  // namespace voxeld::voxelctl
