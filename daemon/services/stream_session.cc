#include "daemon/services/stream_session.h"

#include <string>
#include <type_traits>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {
namespace {

// gRPC's alarms have a resolution of one millisecond.
constexpr sync::TimeNs kAlarmSlack = 10 * sync::kMillisecond;

}  // namespace

void StreamSession::Start() {
  context_.calls.Add(shared_from_this());
  sync::MutexLock lock(mutex_);
  SetAlarm(&StreamLimits::open_limit_ns);
  Read();
}

void StreamSession::SetAlarm(sync::TimeNs StreamLimits::*limit) {
  if (port_ == nullptr) return;  // the context may have been destroyed
  const sync::TimeNs delay = context_.limits.*limit;
  alarm_ns_ = context_.clock.Now() + delay;
  port_->SetAlarm(delay);
}

void StreamSession::Read() {
  if (port_ == nullptr || reading_ || reads_done_ || FarAhead() || full_ > 0 || HalfFull()) return;
  // Nothing beyond the Open is read before the Open has been handled.
  if (state_ != State::kOpen && (state_ != State::kNew || taking_)) return;
  reading_ = true;
  port_->Read();
}

bool StreamSession::FarAhead() const {
  return arrived_.size() >= kAheadMessages || arrived_bytes_ >= kAheadBytes;
}

bool StreamSession::HalfFull() const {
  return answers_.size() > context_.limits.max_queued_answers / 2 ||
         answers_.bytes() > context_.limits.max_queued_bytes / 2;
}

bool StreamSession::Crowded() const {
  sync::MutexLock lock(mutex_);
  return Listening() && HalfFull();
}

void StreamSession::OnMessage(std::unique_ptr<const ReceivedMessage> message) {
  Arrival arrival;
  arrival.received_ns = context_.clock.Now();
  for (const std::string_view slice : message->slices()) arrival.bytes += slice.size();
  core_.budget()->ChargeAnyway(Budget::Use::kArriving, arrival.bytes);
  {
    sync::MutexLock lock(mutex_);
    reading_ = false;
    arrived_.push_back({std::move(message), arrival});
    arrived_bytes_ += arrival.bytes;
    if (taking_ || MustPause()) return Read();
    taking_ = true;
  }
  TakeArrived();
}

bool StreamSession::MustPause() const {
  return state_ == State::kOpen && (full_ > 0 || HalfFull());
}

void StreamSession::Resume() {
  if (taking_ || arrived_.empty() || MustPause() || port_ == nullptr) return;
  taking_ = true;
  port_->Post();
}

void StreamSession::OnTurn() {
  {
    sync::MutexLock lock(mutex_);
    if (port_ == nullptr || state_ == State::kFinished) return;
    ++turns_;
  }
  TakeArrived();
  sync::MutexLock lock(mutex_);
  if (--turns_ == 0 && state_ == State::kFinished && port_ != nullptr) port_->Finish(end_);
}

void StreamSession::TakeArrived() {
  for (;;) {
    Arrived next;
    bool close = false;
    {
      sync::MutexLock lock(mutex_);
      taking_ = !arrived_.empty() && !MustPause();
      if (taking_) {
        next = std::move(arrived_.front());
        arrived_.pop_front();
        arrived_bytes_ -= next.arrival.bytes;
      } else {
        close = EndOfReads();
      }
      Read();
    }
    if (next.message == nullptr) {
      if (close) CloseSession();
      return;
    }
    TakeMessage(next.message->slices(), next.arrival);
    next.message.reset();
    core_.budget()->Release(Budget::Use::kArriving, next.arrival.bytes);
  }
}

void StreamSession::TakeMessage(std::span<const std::string_view> slices, Arrival arrival) {
  uint64_t previous = 0;
  bool first = false;
  std::shared_ptr<const wire::MemorySource> memory;
  {
    sync::MutexLock lock(mutex_);
    if (state_ != State::kNew && state_ != State::kOpen) return;
    first = state_ == State::kNew;
    previous = sequence_;
    memory = local_.memory();
  }
  if (first && arrival.bytes > kOpenBytes) {
    return End(absl::ResourceExhaustedError(absl::StrCat("the first message of a stream has ",
                                                         arrival.bytes, " bytes; open has at most ",
                                                         kOpenBytes, ": send it alone")));
  }
  wire::Decoded decoded = wire::DecodeStreamRequest(
      slices, core_.limits(), previous, &core_.bulk(),
      {memory.get(), context_.assets, core_.budget().get()}, &context_.fonts);
  arrival.decoded_ns = context_.clock.Now();
  if (!decoded.status.ok()) return End(decoded.status);
  if (decoded.open.has_value()) {
    OpenOptions open = *std::exchange(decoded.open, std::nullopt);
    return TakeOpen(std::move(open), std::move(decoded), arrival);
  }
  TakeOperations(std::move(decoded), arrival);
}

void StreamSession::TakeOpen(OpenOptions open, wire::Decoded decoded, const Arrival& arrival) {
  bool first = false;
  {
    sync::MutexLock lock(mutex_);
    first = state_ == State::kNew;
    if (first) {
      sequence_ = decoded.sequence;
      no_outcomes_ = open.no_outcomes;
      client_name_ = open.client_name;
      open.principal = caller().principal;
      open.may_erase = caller().scopes.Has(access::Scope::kControl);
      state_ = State::kOpening;
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
    return TakeOperations(std::move(decoded), arrival);
  }
  core_.OpenSession(std::move(open), arrival.bytes, shared_from_this(),
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
    incarnation_ = info->incarnation;
    abandoned = state_ != State::kOpening;  // ended in the meantime
    if (!abandoned) {
      v1::StreamResponse response;
      wire::Encode(*info, response.mutable_opened());
      v1::Opened* opened = response.mutable_opened();
      opened->set_server_version(context_.version);
      opened->set_server_time_ns(context_.clock.Now());
      wire::Encode(core_.limits(), opened->mutable_limits());
      intake_ = info->intake;
      local_ = local::LocalSession(context_.local.get(), session_);
      opened->set_local_socket(local_.path());
      opened->set_local_token(local_.token());
      state_ = State::kOpen;
      answers_.AddOpened(response.SerializeAsString());
      WriteNext();
      Read();
      if (context_.log != nullptr) {
        context_.log->Info(incarnation_ > 0 ? "session taken up again" : "session opened",
                           {{"session", std::to_string(session_)},
                            {"owner", std::to_string(info->owner)},
                            {"client", client_name_}});
      }
    }
  }
  if (abandoned) CloseSession();
}

void StreamSession::TakeOperations(wire::Decoded decoded, const Arrival& arrival) {
  std::shared_ptr<Intake> intake;
  bool early = false;
  {
    sync::MutexLock lock(mutex_);
    early = state_ == State::kNew;
    if (!early && state_ != State::kOpen) return;
    if (!early) {
      sequence_ = decoded.sequence;
      intake = intake_;
      for (const Operation& operation : decoded.operations) {
        if (std::holds_alternative<Commit>(operation.op)) ++unanswered_;
      }
      if (decoded.ping_client_time_ns.has_value()) {
        answers_.AddPong(*decoded.ping_client_time_ns, arrival.received_ns);
        WriteNext();
      }
    }
  }
  if (early) {
    return End(absl::FailedPreconditionError(
        "the first message of a stream must be open; the operation was not carried out"));
  }
  const bool filled = intake->Take({.operations = std::move(decoded.operations),
                                    .refused = std::move(decoded.refused),
                                    .bytes = arrival.bytes,
                                    .received_ns = arrival.received_ns,
                                    .decoded_ns = arrival.decoded_ns,
                                    .named_bytes = decoded.named_bytes});
  if (!filled) return;
  sync::MutexLock lock(mutex_);
  ++full_;
}

void StreamSession::OnRoom() {
  sync::MutexLock lock(mutex_);
  --full_;
  Resume();
  Read();
}

void StreamSession::OnReadsDone() {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    reading_ = false;
    reads_done_ = true;
    close = EndOfReads();
  }
  if (close) CloseSession();
}

bool StreamSession::EndOfReads() {
  if (!reads_done_ || taking_ || !arrived_.empty()) return false;
  if (state_ == State::kNew) {
    return Close(absl::FailedPreconditionError(
        "the stream ended before its first message, which must be open"));
  }
  if (state_ != State::kOpen) return false;
  state_ = State::kDraining;
  SetAlarm(&StreamLimits::drain_limit_ns);
  return Drained();
}

bool StreamSession::Drained() {
  if (state_ != State::kDraining || unanswered_ > 0 || outcomes_owed_ > 0) return false;
  return Close(absl::OkStatus());
}

void StreamSession::OnAlarm() {
  bool close = false;
  {
    sync::MutexLock lock(mutex_);
    // Without a port the context may have been destroyed. The alarm may also be a replaced one.
    if (port_ == nullptr) return;
    if (context_.clock.Now() < alarm_ns_ - kAlarmSlack) return;
    if (state_ == State::kNew) {
      close = Close(absl::DeadlineExceededError(
          absl::StrCat("no open came within ", context_.limits.open_limit_ns / sync::kMillisecond,
                       " ms; begin a stream with it")));
    } else if (state_ == State::kDraining) {
      close = Close(absl::OkStatus());
    } else if (state_ == State::kClosing || state_ == State::kFlushing) {
      Finish();
      close = true;  // again, to return outcomes that the client did not take
    }
  }
  if (close) CloseSession();
}

void StreamSession::OnCancel() {
  {
    sync::MutexLock lock(mutex_);
    cancelled_ = true;
    (void)Close(absl::CancelledError("the client is gone"));
  }
  CloseSession();  // also if called before: nothing more can be sent
  sync::MutexLock lock(mutex_);
  if (state_ == State::kClosing) state_ = State::kFlushing;  // do not wait for the core
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
  // Without a session nothing is waited for, also while one is being opened: OnOpened closes it.
  const bool session = session_ != 0;
  state_ = session ? State::kClosing : State::kFlushing;
  SetAlarm(&StreamLimits::drain_limit_ns);
  if (!session) FinishIfFlushed();
  return session;
}

void StreamSession::CloseSession() {
  SessionId session = 0;
  uint64_t incarnation = 0;
  bool gone = false;
  std::vector<Receipt> undelivered;
  local::LocalSession local;  // destroyed without the lock
  {
    sync::MutexLock lock(mutex_);
    std::swap(local, local_);
    session = session_;
    incarnation = incarnation_;
    gone = cancelled_ || state_ == State::kFinished;
    if (gone) undelivered = answers_.TakeOutcomes();
    // Without a port the context may have been destroyed.
    if (!std::exchange(logged_end_, true) && session != 0 && port_ != nullptr &&
        context_.log != nullptr) {
      context_.log->Info("session closed", {{"session", std::to_string(session)},
                                            {"client", client_name_},
                                            {"why", end_.ToString()}});
    }
  }
  if (session == 0) return;
  core_.CloseSession(session, incarnation, gone, [self = shared_from_this()] { self->OnClosed(); });
  if (!undelivered.empty()) core_.GiveBack(session, std::move(undelivered));
}

void StreamSession::OnClosed() {
  sync::MutexLock lock(mutex_);
  if (state_ == State::kClosing) state_ = State::kFlushing;
  FinishIfFlushed();
}

void StreamSession::FinishIfFlushed() {
  if (state_ == State::kFlushing && (cancelled_ || (answers_.empty() && !writing_))) Finish();
}

void StreamSession::Finish() {
  if (state_ == State::kFinished) return;
  state_ = State::kFinished;
  if (port_ != nullptr && turns_ == 0) port_->Finish(end_);
}

void StreamSession::OnPortDone() {
  {
    sync::MutexLock lock(mutex_);
    port_ = nullptr;
    core_.budget()->Release(Budget::Use::kArriving, std::exchange(arrived_bytes_, 0));
    arrived_.clear();
  }
  context_.calls.Remove(this);
}

bool StreamSession::Listening() const {
  return port_ != nullptr && !cancelled_ && state_ != State::kFinished;
}

template <typename Answer>
void StreamSession::Tell(const Answer& answer) {
  bool close = false, lost = false, inherited = false;
  SessionId session = 0;
  {
    sync::MutexLock lock(mutex_);
    session = session_;
    if constexpr (std::is_same_v<Answer, Receipt>) {
      if (IsOwed(answer)) {
        // Outcomes of an earlier stream were never counted here.
        inherited = answer.incarnation != incarnation_;
        if (!inherited && outcomes_owed_ > 0) --outcomes_owed_;
      } else if (!std::holds_alternative<Scheduled>(answer.what)) {
        if (unanswered_ > 0) --unanswered_;
        const auto* accepted = std::get_if<Accepted>(&answer.what);
        if (accepted != nullptr) {
          outcomes_owed_ += accepted->displays.size() + (accepted->durable ? 1 : 0);
        }
      }
    }
    const bool listening = Listening();
    const size_t bytes_before = answers_.bytes();
    const bool added = !listening || answers_.Add(answer);
    if (inherited && listening && added) {
      ++inherited_;
      inherited_bytes_ += answers_.bytes() - bytes_before;
    }
    lost = !listening || !added;
    WriteNext();
    close = Overrun(added) || Drained();
  }
  if (close) CloseSession();
  if constexpr (std::is_same_v<Answer, Receipt>) {
    if (lost && session != 0) core_.GiveBack(session, {answer});
  }
}

void StreamSession::OnIssue(const Issue& issue) { Tell(issue); }
void StreamSession::OnReceipt(const Receipt& receipt) { Tell(receipt); }

void StreamSession::OnCredit(uint64_t total_bytes) {
  sync::MutexLock lock(mutex_);
  if (!Listening()) return;
  answers_.SetCredit(total_bytes);
  WriteNext();
}

bool StreamSession::Overrun(bool added) {
  if (!Listening()) return false;
  if (added && answers_.size() <= context_.limits.max_queued_answers + inherited_ &&
      answers_.bytes() <= context_.limits.max_queued_bytes + inherited_bytes_) {
    return false;
  }
  core_.CountOverrun();
  if (!ending_) {
    ending_ = true;
    end_ = absl::ResourceExhaustedError(absl::StrCat(
        "the client left ", answers_.size(), " answers (", answers_.bytes(), " bytes) unread",
        added ? "" : ", and max_memory_bytes is used up", "; read the stream while writing to it"));
  }
  Finish();
  return true;
}

void StreamSession::WriteNext() {
  if (writing_ || !Listening() || answers_.empty()) return;
  writing_ = true;
  port_->Write(answers_.Pop(context_.clock.Now()));
}

void StreamSession::OnWritten(bool ok) {
  std::shared_ptr<Intake> wake;
  {
    sync::MutexLock lock(mutex_);
    writing_ = false;
    const bool crowded = HalfFull();
    if (ok) {
      answers_.Written();
      WriteNext();
    }
    if (crowded && !HalfFull()) wake = intake_;
    Resume();
    Read();
    FinishIfFlushed();
  }
  if (wake != nullptr) wake->Wake();
}

}  // namespace voxeld::daemon::services
