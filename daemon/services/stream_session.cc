#include "daemon/services/stream_session.h"

#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {

void StreamSession::Start() {
  context_.calls.Add(shared_from_this());
  sync::MutexLock lock(mutex_);
  Read();
}

void StreamSession::Read() {
  if (port_ == nullptr || reading_ || reads_done_ || unprocessed_ >= kMaxUnprocessed) return;
  if (unprocessed_local_ >= kMaxUnprocessed * core_.limits().max_message_bytes) return;
  if (state_ != State::kNew && state_ != State::kOpen) return;
  reading_ = true;
  port_->Read();
}

void StreamSession::OnMessage(std::span<const std::string_view> slices) {
  uint64_t bytes = 0;
  for (const std::string_view slice : slices) bytes += slice.size();
  uint64_t previous = 0;
  std::shared_ptr<const wire::MemorySource> memory;
  {
    sync::MutexLock lock(mutex_);
    if (state_ != State::kNew && state_ != State::kOpen) return;
    previous = sequence_;
    memory = local_.memory();
  }
  wire::Decoded decoded = wire::DecodeStreamRequest(slices, core_.limits(), previous, memory.get());
  if (!decoded.status.ok()) return End(decoded.status);
  if (decoded.open.has_value()) {
    OpenOptions open = *std::exchange(decoded.open, std::nullopt);
    return TakeOpen(std::move(open), std::move(decoded), bytes);
  }
  TakeOperations(std::move(decoded), bytes);
}

void StreamSession::TakeOpen(OpenOptions open, wire::Decoded decoded, uint64_t bytes) {
  bool first = false;
  {
    sync::MutexLock lock(mutex_);
    first = state_ == State::kNew;
    if (first) {
      sequence_ = decoded.sequence;
      no_outcomes_ = open.no_outcomes;
      client_name_ = open.client_name;
      state_ = State::kOpening;
      reading_ = false;
    }
  }
  if (!first) {
    decoded.refused.Add({decoded.sequence,
                         {},
                         {},
                         "open",
                         Reason::kOutOfOrder,
                         "open came a second time; a stream is opened once, by its first message"},
                        core_.limits().max_issues_per_commit);
    return TakeOperations(std::move(decoded), bytes);
  }
  core_.OpenSession(std::move(open), shared_from_this(),
                    [self = shared_from_this()](const absl::StatusOr<SessionInfo>& info) {
                      self->OnOpened(info);
                    });
}

void StreamSession::OnOpened(const absl::StatusOr<SessionInfo>& info) {
  if (!info.ok()) return End(info.status());
  bool abandoned = false;
  {
    sync::MutexLock lock(mutex_);
    session_ = info->session;
    abandoned = state_ != State::kOpening;  // ended meanwhile
    if (!abandoned) {
      v1::StreamResponse response;
      v1::Opened* opened = response.mutable_opened();
      opened->set_session(info->session);
      opened->set_owner(info->owner);
      opened->set_server_version(context_.version);
      opened->set_server_time_ns(context_.clock.Now());
      wire::Encode(core_.limits(), opened->mutable_limits());
      opened->mutable_displays()->Assign(info->displays.begin(), info->displays.end());
      local_ = local::LocalSession(context_.local.get(), session_);
      opened->set_local_socket(local_.path());
      opened->set_local_token(local_.token());
      state_ = State::kOpen;
      Queue(response);
      Read();
      if (context_.log != nullptr) {
        context_.log->Info("session opened", {{"session", std::to_string(session_)},
                                              {"owner", std::to_string(info->owner)},
                                              {"client", client_name_}});
      }
    }
  }
  if (abandoned) CloseSession();
}

void StreamSession::TakeOperations(wire::Decoded decoded, uint64_t bytes) {
  SessionId session = 0;
  bool early = false;
  {
    sync::MutexLock lock(mutex_);
    early = state_ == State::kNew;
    if (!early && state_ != State::kOpen) return;
    if (!early) {
      sequence_ = decoded.sequence;
      session = session_;
      ++unprocessed_;
      unprocessed_local_ += decoded.local_bytes;
      for (const Operation& operation : decoded.operations) {
        if (std::holds_alternative<Commit>(operation.op)) ++unanswered_;
      }
    }
  }
  if (early) {
    return End(absl::FailedPreconditionError(
        "the first message of a stream must be open; the operation was not carried out"));
  }
  core_.Handle(session, std::move(decoded.operations), std::move(decoded.refused), bytes,
               [self = shared_from_this(), local_bytes = decoded.local_bytes] {
                 self->OnProcessed(local_bytes);
               });
  // Only now: a message that came in on another thread would overtake this one.
  sync::MutexLock lock(mutex_);
  reading_ = false;
  Read();
}

void StreamSession::OnProcessed(uint64_t local_bytes) {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    --unprocessed_;
    unprocessed_local_ -= local_bytes;
    Read();
    close = Drained();
  }
  if (close) CloseSession();
}

void StreamSession::OnReadsDone() {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    reading_ = false;
    reads_done_ = true;
    if (state_ == State::kNew) {
      close = Close(absl::FailedPreconditionError(
          "the stream ended before its first message, which must be open"));
    } else if (state_ == State::kOpen) {
      state_ = State::kDraining;
      if (port_ != nullptr) port_->SetAlarm(context_.limits.drain_limit_ns);
      close = Drained();
    }
  }
  if (close) CloseSession();
}

bool StreamSession::Drained() {
  if (state_ != State::kDraining || unprocessed_ > 0 || unanswered_ > 0 || outcomes_owed_ > 0) {
    return false;
  }
  return Close(absl::OkStatus());
}

void StreamSession::OnAlarm() {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    if (state_ == State::kDraining) {
      close = Close(absl::OkStatus());
    } else if (state_ == State::kClosing || state_ == State::kFlushing) {
      Finish();
    }
  }
  if (close) CloseSession();
}

void StreamSession::OnCancel() {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    cancelled_ = true;
    queue_.clear();
    queued_bytes_ = 0;
    close = Close(absl::CancelledError("the client is gone"));
  }
  if (close) CloseSession();
  sync::MutexLock lock(mutex_);
  if (state_ == State::kClosing) state_ = State::kFlushing;  // nobody is there to wait with
  FinishIfFlushed();
}

void StreamSession::End(const absl::Status& status) {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    close = Close(status);
  }
  if (close) CloseSession();
}

bool StreamSession::Close(const absl::Status& status) {
  if (ending_) return false;
  ending_ = true;
  end_ = status;
  // Without a session (also while one is being opened: OnOpened gives it back)
  // nothing is waited for.
  const bool session = session_ != 0;
  state_ = session ? State::kClosing : State::kFlushing;
  if (port_ != nullptr) port_->SetAlarm(context_.limits.drain_limit_ns);
  if (!session) FinishIfFlushed();
  return session;
}

void StreamSession::CloseSession() {
  SessionId session = 0;
  local::LocalSession local;  // ends without the lock
  {
    sync::MutexLock lock(mutex_);
    session = session_;
    std::swap(local, local_);
    if (port_ != nullptr && context_.log != nullptr) {
      context_.log->Info("session closed", {{"session", std::to_string(session)},
                                            {"client", client_name_},
                                            {"why", end_.ToString()}});
    }
  }
  core_.CloseSession(session, [self = shared_from_this()] { self->OnClosed(); });
}

void StreamSession::OnClosed() {
  sync::MutexLock lock(mutex_);
  if (state_ == State::kClosing) state_ = State::kFlushing;
  FinishIfFlushed();
}

void StreamSession::FinishIfFlushed() {
  if (state_ == State::kFlushing && queue_.empty() && !writing_) Finish();
}

void StreamSession::Finish() {
  if (state_ == State::kFinished) return;
  state_ = State::kFinished;
  queue_.clear();
  queued_bytes_ = 0;
  if (port_ != nullptr) port_->Finish(end_);
}

void StreamSession::OnPortDone() {
  {
    sync::MutexLock lock(mutex_);
    port_ = nullptr;
  }
  context_.calls.Remove(this);
}

void StreamSession::OnIssue(const Issue& issue) {
  v1::StreamResponse response;
  wire::Encode(issue, response.add_issues());
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    Queue(response);
    close = Overrun();
  }
  if (close) CloseSession();
}

void StreamSession::OnReceipt(const Receipt& receipt) {
  v1::StreamResponse response;
  wire::Encode(receipt, response.add_receipts());
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    if (std::holds_alternative<CommitOutcome>(receipt.what)) {
      if (outcomes_owed_ > 0) --outcomes_owed_;
    } else {
      if (unanswered_ > 0) --unanswered_;
      const auto* accepted = std::get_if<Accepted>(&receipt.what);
      if (accepted != nullptr && !no_outcomes_) outcomes_owed_ += accepted->displays.size();
    }
    Queue(response);
    close = Overrun() || Drained();
  }
  if (close) CloseSession();
}

void StreamSession::Queue(const v1::StreamResponse& response) {
  if (port_ == nullptr || cancelled_ || state_ == State::kFinished) return;
  queue_.push_back(response.SerializeAsString());
  queued_bytes_ += queue_.back().size();
  WriteNext();
}

bool StreamSession::Overrun() {
  if (port_ == nullptr) return false;
  if (queue_.size() <= context_.limits.max_queued_answers &&
      queued_bytes_ <= context_.limits.max_queued_bytes) {
    return false;
  }
  core_.CountOverrun();
  const bool close = !ending_;
  if (close) {
    ending_ = true;
    end_ = absl::ResourceExhaustedError(
        absl::StrCat("the client left more than ", queue_.size() - 1, " answers (", queued_bytes_,
                     " bytes) unread; read the stream while writing to it"));
  }
  Finish();
  return close;
}

void StreamSession::WriteNext() {
  if (writing_ || queue_.empty() || port_ == nullptr) return;
  const std::string message = std::move(queue_.front());
  queue_.pop_front();
  queued_bytes_ -= message.size();
  writing_ = true;
  port_->Write(message);
}

void StreamSession::OnWritten(bool ok) {
  sync::MutexLock lock(mutex_);
  writing_ = false;
  if (!ok) {
    queue_.clear();
    queued_bytes_ = 0;
  }
  if (state_ != State::kFinished) WriteNext();
  FinishIfFlushed();
}

}  // namespace voxeld::daemon::services
