// The stream of a session, and its successors.
#include <algorithm>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"
#include "client/cpp/src/from_wire.h"
#include "client/cpp/src/session_core.h"

namespace voxeld::client {
namespace {

// The first pings of a stream are sent quickly, so that a clock estimate is soon available.
constexpr uint64_t kQuickPings = 4;
constexpr sync::TimeNs kQuickPing = 20 * sync::kMillisecond;
constexpr uint64_t kMostUnansweredPings = 4;
// The server sends pending outcomes for 10 s after a resume.
constexpr sync::TimeNs kOwedOutcomes = 12 * sync::kSecond;
constexpr size_t kRestoreBytes = 4 << 20;
// After so many consecutive refusals, no more memory is offered on that stream.
constexpr uint64_t kMostMemoriesRefused = 3;

// Returns true if another attempt would fail in the same way.
bool IsFinal(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kUnauthenticated:
    case absl::StatusCode::kUnimplemented:
      return true;
    default:
      return false;
  }
}

v1::DisconnectPolicy ToWire(OnDisconnect policy) {
  switch (policy) {
    case OnDisconnect::kClear:
      return v1::DISCONNECT_POLICY_CLEAR;
    case OnDisconnect::kLinger:
      return v1::DISCONNECT_POLICY_LINGER;
    case OnDisconnect::kKeep:
      return v1::DISCONNECT_POLICY_KEEP;
  }
  return v1::DISCONNECT_POLICY_UNSPECIFIED;
}

v1::FlowPolicy ToWire(Flow flow) {
  switch (flow) {
    case Flow::kReliable:
      return v1::FLOW_POLICY_RELIABLE;
    case Flow::kLatest:
      return v1::FLOW_POLICY_LATEST;
    case Flow::kDropOldest:
      return v1::FLOW_POLICY_DROP_OLDEST;
  }
  return v1::FLOW_POLICY_UNSPECIFIED;
}

}  // namespace

std::string SessionCore::OpenBytes(Take take) {
  v1::StreamRequest request;
  request.set_sequence(outbox_.TakeSequence());
  v1::Open& open = *request.mutable_open();
  open.set_client_name(options_.client_name);
  open.set_on_disconnect(ToWire(options_.on_disconnect));
  if (options_.on_disconnect == OnDisconnect::kLinger) open.set_linger_ns(options_.linger.count());
  open.set_strict(options_.strict);
  open.set_flow(ToWire(options_.flow));
  if (options_.flow == Flow::kDropOldest)
    open.set_drop_oldest_frames(std::max(1u, options_.drop_oldest_frames));
  open.set_no_outcomes(!options_.outcomes);
  if (take == Take::kSession) open.set_resume_token(resume_token_);
  if (take == Take::kOwner) open.set_owner_token(own_token_);
  // An owner that was joined and no longer exists, as after a server restart, cannot be joined
  // again.
  if (take == Take::kNothing && !server_) open.set_owner_token(options_.owner_token);
  return request.SerializeAsString();
}

void SessionCore::Connect() {
  const Take take = !resume_token_.empty() ? Take::kSession
                    : !own_token_.empty()  ? Take::kOwner
                                           : Take::kNothing;
  state_ = State::kConnecting;
  open_deadline_ = clock_.Now() + options_.open_timeout.count();
  link_ = std::make_unique<Link>(this, take);
  link_->stream = transport_->Start(link_.get());
  const Rope open(OpenBytes(take));
  link_->open_bytes = open.size();
  Write(open);
}

void SessionCore::Write(const Rope& message) {
  link_->writing = true;
  ++receipts_.tally().messages_sent;
  receipts_.tally().bytes_sent += message.size();
  link_->stream->Write(message);
}

void SessionCore::CancelLink(const absl::Status& why) {
  if (link_->cancelled_for.ok()) link_->cancelled_for = why;
  link_->stream->Cancel();
}

void SessionCore::Pump() {
  if (state_ != State::kOpen || link_ == nullptr || half_closed_) return;
  if (link_->writing || link_->handing) return;
  const sync::TimeNs now = clock_.Now();
  std::optional<Rope> message;
  if (ping_due_) {
    message = outbox_.Ping(now);
    if (message) {
      ping_due_ = false;
      ++pings_;
      ++unanswered_pings_;
    }
  }
  if (!message) {
    std::optional<Outbox::Outgoing> next = outbox_.Next(now);
    if (next) {
      if (HandOver(*next)) return;
      message = std::move(next->message);
      if (next->committed != nullptr) {
        receipts_.Sent(next->committed->frame_id, next->committed->first_sequence,
                       next->committed->commit_sequence, now);
      }
    }
  }
  if (message) {
    Write(*message);
  } else if (closing_ && outbox_.empty()) {
    half_closed_ = true;
    link_->stream->WritesDone();
  }
}

bool SessionCore::HandOver(const Outbox::Outgoing& next) {
  if (link_->memory == nullptr || link_->memories_refused >= kMostMemoriesRefused) return false;
  std::optional<InMemory> moved = MoveToMemory(next.message, link_->memories + 1);
  if (!moved) return false;
  Rope content = moved->memory;
  link_->handing = Link::Handing{next.message, *std::move(moved), next.frame_id};
  link_->memory->Hold(++link_->memories, std::move(content));
  return true;
}

void SessionCore::Held(Link* link, MemoryChannel::Answer answer) {
  sync::MutexLock lock(mutex_);
  if (link != link_.get() || !link->handing) return;
  const Link::Handing handed = *std::exchange(link->handing, std::nullopt);
  if (answer == MemoryChannel::Answer::kGone) {
    link->memories_refused = kMostMemoriesRefused;
  } else if (answer == MemoryChannel::Answer::kRefused) {
    ++link->memories_refused;
  }
  if (answer == MemoryChannel::Answer::kHeld) {
    link->memories_refused = 0;
    link->in_use[handed.frame_id].push_back(link->memories);
    outbox_.Saved(handed.whole.size() - handed.moved.request.size());
    receipts_.tally().memory_bytes += handed.moved.memory.size();
    Write(handed.moved.request);
  } else {
    Write(handed.whole);
  }
}

void SessionCore::ReleaseMemory(uint64_t frame_id) {
  const auto it = link_->in_use.find(frame_id);
  if (it == link_->in_use.end()) return;
  for (const uint64_t memory : it->second) link_->memory->Release(memory);
  link_->in_use.erase(it);
}

void SessionCore::Written(Link* link) {
  sync::MutexLock lock(mutex_);
  link->writing = false;
  if (link != link_.get()) return;
  Pump();
  // There may be room now.
  if (outbox_.empty()) Changed();
}

void SessionCore::TakeIssue(const v1::Issue& issue) {
  const auto of = outbox_.Refused(issue.sequence(), issue.layer(), issue.id(), issue.applied());
  const Issue& told = receipts_.Told(issue, of == nullptr ? 0 : of->frame_id);
  if (!options_.on_issue) return;
  if (events_.size() < kMostUntold) {
    events_.push_back(told);
  } else {
    ++receipts_.tally().untold_issues;
  }
}

void SessionCore::TellNotRestored(const std::string& why) {
  v1::Issue issue;
  issue.set_message(
      absl::StrCat("what was up before the connection was lost is not put up again: ", why));
  TakeIssue(issue);
}

void SessionCore::TakeReceipt(const v1::Receipt& receipt) {
  const sync::TimeNs now = clock_.Now();
  receipts_.Told(receipt, now);
  if (receipt.has_scheduled()) outbox_.Scheduled(receipt.frame_id());
  // The server has read it, whatever its outcome.
  if (!receipt.has_outcome()) ReleaseMemory(receipt.frame_id());
  if (receipt.has_outcome()) retained_.WasApplied(receipt.frame_id());
  if (!receipt.has_accepted() && !receipt.has_refused()) return;
  backoff_.Reset();
  const std::shared_ptr<const Transaction> done = outbox_.Answered(receipt.frame_id());
  if (done == nullptr) return;
  if (done->restores) {
    // The caller did not request this commit, so nobody reads its receipt; the book has it.
    if (receipt.has_refused()) TellNotRestored(receipt.refused().message());
    return;
  }
  if (receipt.has_accepted() && options_.restore)
    retained_.Apply(done->operations, done->GetRefusals(), now);
}

void SessionCore::Read(Link* link, const v1::StreamResponse& response) {
  sync::MutexLock lock(mutex_);
  if (link != link_.get()) return;
  const sync::TimeNs now = clock_.Now();
  unanswered_pings_ = 0;
  if (response.has_opened() && !link->opened) {
    link->opened = true;
    TakeOpened(response.opened());
  }
  if (!link->opened) return;
  last_heard_ = now;
  if (response.has_pong()) {
    pong_seen_ = true;
    estimator_.Add(response.pong().client_time_ns(), response.pong().received_time_ns(),
                   response.pong().server_time_ns(), now);
  }
  for (const v1::Issue& issue : response.issues()) TakeIssue(issue);
  for (const v1::Receipt& receipt : response.receipts()) TakeReceipt(receipt);
  if (response.credit_bytes() != 0) outbox_.Credit(response.credit_bytes());
  Pump();
  Changed();
}

void SessionCore::TakeOpened(const v1::Opened& opened) {
  const sync::TimeNs now = clock_.Now();
  const bool first = !server_.has_value();
  const bool resumed = !first && link_->take() == Take::kSession;
  server_ = FromWire(opened);
  resume_token_ = opened.resume_token();
  own_token_ = opened.owner_token();
  state_ = State::kOpen;
  open_deadline_ = sync::kNever;
  opened_at_ = now;
  ++receipts_.tally().connections;
  // The server may keep a session, for its outcomes, longer than its layers.
  const bool layers_kept = resumed && (options_.on_disconnect == OnDisconnect::kKeep ||
                                       (options_.on_disconnect == OnDisconnect::kLinger &&
                                        now - last_heard_ < options_.linger.count()));
  ConnectionChange change;
  if (resumed) {
    change.kind = ConnectionChange::Kind::kResumed;
    ++receipts_.tally().resumed;
    if (layers_kept && opened.has_last_sequence()) TakeUnheard(opened.last_sequence());
    resumed_at_ = now;
    outcomes_until_ = now + kOwedOutcomes;
  } else if (!first) {
    estimator_.Reset();
    change.lost_outcomes = receipts_.OutcomesLost(
        sync::kNever, "the connection was lost, and the server did not keep the session");
  }
  if (!first && !layers_kept) {
    // Commits applied without an answer were lost with the layers: send them again, after the
    // restore.
    retained_.EndDoubts();
    outbox_.DropRestores();
    change.kind =
        options_.restore ? ConnectionChange::Kind::kRestored : ConnectionChange::Kind::kReopened;
    if (options_.restore) {
      ++receipts_.tally().restored;
      SendRetained();
    }
  }
  if (const size_t most = most_message_bytes(); most > 0) {
    for (const auto& [transaction, why] : outbox_.KeepTo(most))
      receipts_.RefusedHere(transaction->frame_id, "it was not sent: " + why);
  }
  last_heard_ = now;
  if (options_.local_memory && !opened.local_socket().empty()) {
    link_->memory =
        transport_->OpenMemory(opened.local_socket(), opened.local_token(), link_.get());
  }
  outbox_.StreamOpened(link_->open_bytes, opened.credit_bytes());
  NoteDrops();
  events_.push_back(std::move(change));
  ping_due_ = options_.ping_interval.count() > 0;
  ping_at_ = ping_due_ ? now : sync::kNever;
  pings_ = unanswered_pings_ = 0;
  pong_seen_ = false;
  work_.NotifyAll();  // for the pings
}

void SessionCore::TakeUnheard(uint64_t last_sequence) {
  const sync::TimeNs now = clock_.Now();
  for (const auto& unheard : outbox_.Applied(last_sequence)) {
    // The last commit was applied. Earlier ones may have been refused, but whole only in a strict
    // session.
    if (options_.strict && unheard->commit_sequence != last_sequence) {
      receipts_.Unheard(unheard->frame_id, server_->displays);
      if (options_.restore) retained_.Doubt(unheard->frame_id, unheard->operations, now);
    } else {
      receipts_.Applied(unheard->frame_id, server_->displays);
      if (options_.restore) retained_.Apply(unheard->operations, unheard->GetRefusals(), now);
    }
  }
  // Without outcomes nothing will resolve the doubt.
  if (!options_.outcomes || server_->displays.empty()) retained_.EndDoubts();
}

void SessionCore::SendRetained() {
  const Limits& limits = server_->limits;
  const size_t most_bytes = limits.max_uncommitted_bytes == 0
                                ? kRestoreBytes
                                : std::min<size_t>(kRestoreBytes, limits.max_uncommitted_bytes / 2);
  const size_t most_operations =
      limits.max_operations_per_commit == 0 ? SIZE_MAX : limits.max_operations_per_commit;
  std::vector<std::shared_ptr<Transaction>> transactions;
  std::vector<Operation> operations;
  size_t bytes = 0;
  const auto flush = [&]() VOXELD_REQUIRES(mutex_) {
    if (operations.empty()) return;
    transactions.push_back(
        MakeTransaction(std::exchange(operations, {}), {}, most_message_bytes()));
    transactions.back()->restores = true;
    transactions.back()->frame_id = next_frame_++;
    bytes = 0;
  };
  std::vector<Operation> retained = retained_.Restore(clock_.Now());
  if (most_message_bytes() > 0) {
    for (const Oversized& oversized : TakeOversized(most_message_bytes(), &retained))
      TellNotRestored(oversized.what);
  }
  for (Operation& operation : retained) {
    const auto* upsert = std::get_if<UpsertOperation>(&operation);
    const auto* define = std::get_if<DefineOperation>(&operation);
    const size_t size = upsert != nullptr   ? upsert->primitive.size()
                        : define != nullptr ? define->definition.size()
                                            : 0;
    if (bytes + size > most_bytes || operations.size() >= most_operations) flush();
    bytes += size;
    operations.push_back(std::move(operation));
  }
  flush();
  outbox_.AddFirst(transactions);
}

void SessionCore::Lose(const absl::Status& why) {
  std::optional<int64_t> server_now;
  if (const std::optional<ClockEstimate> estimate = estimator_.Get())
    server_now = clock_.Now() + estimate->offset_ns;
  for (const uint64_t frame : outbox_.StreamLost(server_now)) {
    receipts_.Lost(frame, absl::StrCat("the connection was lost before its time: ", why.message()));
  }
  receipts_.StreamLost();
  // A stream that soon ended without answering may have failed because of what was sent on it.
  if (clock_.Now() - opened_at_ >= options_.longest_pause.count()) backoff_.Reset();
  half_closed_ = false;
  ping_at_ = outcomes_until_ = sync::kNever;
  ping_due_ = false;
}

void SessionCore::EndSession(const absl::Status& status) {
  state_ = State::kEnded;
  ended_ = status;
  receipts_.Ended(status.ok() ? "the session was closed" : std::string(status.message()));
  ConnectionChange change;
  change.kind = ConnectionChange::Kind::kEnded;
  change.status = status;
  events_.push_back(std::move(change));
  ping_at_ = open_deadline_ = outcomes_until_ = sync::kNever;
  Changed();
}

void SessionCore::End(Link* link, const absl::Status& told) {
  sync::MutexLock lock(mutex_);
  const bool was_opened = link->opened;
  const bool half_closed = half_closed_;
  const Take take = link->take();
  absl::Status status = link->cancelled_for.ok() ? told : link->cancelled_for;
  ended_links_.push_back(std::move(link_));
  work_.NotifyAll();
  const auto notify = absl::MakeCleanup([this]() VOXELD_NO_THREAD_SAFETY_ANALYSIS { Changed(); });
  if (absl::IsUnavailable(status) && link->cancelled_for.ok()) {
    status = absl::UnavailableError(absl::StrCat(Where(), " is not available: ", status.message()));
  }
  if (was_opened) Lose(status);
  if (stop_ || (closing_ && half_closed && was_opened)) {
    EndSession(stop_ ? absl::CancelledError("the session was closed") : status);
    return;
  }
  // The session or owner to resume no longer exists: at once try the next best.
  if (!was_opened && absl::IsNotFound(status) && take != Take::kNothing) {
    (take == Take::kSession ? resume_token_ : own_token_).clear();
    state_ = State::kPausing;
    retry_at_ = clock_.Now();
    return;
  }
  if (IsFinal(status) || !options_.reconnect) {
    EndSession(status.ok() ? absl::UnavailableError(Where() + " ended the stream") : status);
    return;
  }
  if (status.ok()) status = absl::UnavailableError(Where() + " ended the stream");
  last_loss_ = status;
  if (was_opened) {
    ConnectionChange change;
    change.kind = ConnectionChange::Kind::kLost;
    change.status = status;
    events_.push_back(std::move(change));
  }
  state_ = State::kPausing;
  retry_at_ = clock_.Now() + backoff_.Next();
}

sync::TimeNs SessionCore::DoDue(sync::TimeNs now) {
  if (stop_ || state_ == State::kEnded) return sync::kNever;
  if (state_ == State::kPausing) {
    if (now < retry_at_) return retry_at_;
    Connect();
  }
  if (now >= open_deadline_) {
    open_deadline_ = sync::kNever;
    CancelLink(absl::DeadlineExceededError(
        absl::StrCat(Where(), " did not answer Open in ",
                     static_cast<double>(options_.open_timeout.count()) / 1e9, " s")));
  }
  if (now >= outcomes_until_) {
    outcomes_until_ = sync::kNever;
    receipts_.OutcomesLost(resumed_at_, "the server did not say after the session was resumed");
    retained_.EndDoubts();
    Changed();
  }
  if (now >= ping_at_) {
    const sync::TimeNs interval = options_.ping_interval.count();
    ping_at_ = now + (pings_ < kQuickPings ? std::min(interval, kQuickPing) : interval);
    if (pong_seen_ && unanswered_pings_ >= kMostUnansweredPings) {
      ping_at_ = sync::kNever;
      CancelLink(absl::UnavailableError(
          absl::StrCat(Where(), " did not answer ", unanswered_pings_, " pings")));
    } else {
      ping_due_ = true;
      Pump();
    }
  }
  return std::min({open_deadline_, outcomes_until_, ping_at_});
}

}  // namespace voxeld::client
