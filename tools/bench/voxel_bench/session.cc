#include "tools/bench/voxel_bench/session.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kOpenLimit = 30 * sync::kSecond;
constexpr char kStream[] = "/voxeld.v1.SceneService/Stream";

}  // namespace

Session::Session(Loop& loop, const Connection& connection, const v1::Open& open)
    : loop_(loop),
      open_(open),
      call_(loop, connection, kStream,
            {.writable = [this] { OnWritable(); },
             .message = [this](std::string_view bytes) { OnMessage(bytes); },
             .ended =
                 [this](const absl::Status& status) {
                   if (!status_.ok()) return;
                   status_ =
                       status.ok() ? absl::UnavailableError("the daemon ended the stream") : status;
                 }}) {}

void Session::OnWritable() {
  if (!asked_) {
    asked_ = true;
    v1::StreamRequest request;
    *request.mutable_open() = open_;
    const Message message(request);
    credit_.Sent(message.bytes());
    asked_ns_ = Now();
    return call_.Write(message);
  }
  if (Ready() && ready_) ready_();
}

void Session::OnMessage(std::string_view bytes) {
  v1::StreamResponse response;
  if (!response.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    status_ = absl::DataLossError("an answer that is no StreamResponse");
    return;
  }
  const bool was_ready = Ready();
  if (response.has_opened() && !opened_) {
    opened_ns_ = Now();
    opened_ = std::move(*response.mutable_opened());
    credit_.Told(opened_->credit_bytes());
  }
  credit_.Told(response.credit_bytes());
  for (const v1::Issue& issue : response.issues()) {
    ++tally_.issues;
    if (status_.ok()) {
      status_ = absl::FailedPreconditionError(
          absl::StrCat("the daemon refused ", issue.field(), ": ", issue.message()));
    }
  }
  for (const v1::Receipt& receipt : response.receipts()) {
    tally_.Told(receipt);
    if (receipt_) receipt_(receipt);
  }
  if (!was_ready && Ready() && ready_) ready_();
}

absl::Status Session::WaitOpened() {
  const absl::Status waited =
      loop_.RunUntil(Now() + kOpenLimit, [this] { return opened_.has_value() || !status_.ok(); });
  if (!status_.ok()) return status_;
  if (!waited.ok()) return waited;
  const sync::TimeNs server = opened_->server_time_ns();
  if (server < asked_ns_ || server > opened_ns_) {
    return absl::FailedPreconditionError(
        absl::StrCat("the daemon's clock (", server, " ns) is not this process's: asked at ",
                     asked_ns_, " ns, answered by ", opened_ns_, " ns; run both on one machine"));
  }
  return absl::OkStatus();
}

absl::Status Session::WaitSettled(sync::TimeNs limit) {
  const absl::Status waited =
      loop_.RunUntil(Now() + limit, [this] { return tally_.Settled() || !status_.ok(); });
  if (!status_.ok()) return status_;
  if (waited.ok() || !absl::IsDeadlineExceeded(waited)) return waited;
  return absl::DeadlineExceededError(
      absl::StrCat("of ", tally_.sent, " commits ", tally_.answered(), " are answered, of ",
                   tally_.owed, " outcomes ", tally_.outcomes(), " have come"));
}

void Session::Send(const Message& message, bool more) {
  // If the credit would hold back the next message, this one must be flushed.
  more = more && credit_.MaySendAfter(message.bytes());
  credit_.Sent(message.bytes());
  call_.Write(message, more);
}

Message Session::CommitMessage(uint64_t frame_id, sync::TimeNs sent_ns, uint64_t client_drops) {
  v1::StreamRequest request;
  v1::Commit* commit = request.mutable_commit();
  commit->set_frame_id(frame_id);
  commit->set_send_time_ns(sent_ns);
  commit->set_client_drops(client_drops);
  return Message(request);
}

uint64_t Session::Commit(sync::TimeNs sent_ns, uint64_t client_drops) {
  const uint64_t frame = ++tally_.sent;
  Send(CommitMessage(frame, sent_ns, client_drops));
  return frame;
}

// ------------------------------------------------------------------------------------ frame sender

FrameSender::FrameSender(Session& session, std::vector<std::vector<Message>> frames,
                         WhenBehind when_behind, bool gather)
    : session_(session), frames_(std::move(frames)), when_behind_(when_behind), gather_(gather) {
  session_.OnReady([this] { Pump(); });
}

void FrameSender::Due(uint64_t count) {
  waiting_ += count;
  if (when_behind_ == WhenBehind::kLatest && waiting_ > 1) {
    dropped_ += waiting_ - 1;
    untold_ += waiting_ - 1;
    waiting_ = 1;
  }
  Pump();
}

void FrameSender::SetEndless(bool endless) {
  endless_ = endless;
  Pump();
}

void FrameSender::Pump() {
  while (session_.Ready()) {
    if (part_ == 0) {
      if (waiting_ == 0 && !endless_) break;
      if (waiting_ > 0) --waiting_;
      ++begun_;
      sent_ns_.push_back(Now());
    }
    const std::vector<Message>& frame = frames_[(begun_ - 1) % frames_.size()];
    if (part_ < frame.size()) {
      session_.Send(frame[part_++], gather_);
    } else {
      part_ = 0;
      session_.Commit(sent_ns_.back(), std::exchange(untold_, 0));
    }
  }
}

}  // namespace voxeld::bench
