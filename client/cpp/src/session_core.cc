#include "client/cpp/src/session_core.h"

#include <algorithm>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"

namespace voxeld::client {
namespace {

// Approximate size of an upsert's names and fields.
constexpr size_t kFieldBytes = 256;

uint64_t KeepFrames(const Options& options) {
  switch (options.flow) {
    case Flow::kReliable:
      return 0;
    case Flow::kLatest:
      return 1;
    case Flow::kDropOldest:
      return std::max(1u, options.drop_oldest_frames);
  }
  return 0;
}

struct OperationBytes {
  size_t operator()(const UpsertOperation& upsert) const {
    return upsert.primitive.size() + upsert.layer.size() + upsert.id.size() + upsert.label.size() +
           kFieldBytes;
  }
  size_t operator()(const DefineOperation& define) const {
    return define.definition.size() + define.object.size();
  }
  size_t operator()(const FrameOperation& frame) const {
    size_t bytes = kFieldBytes;
    for (const UpsertOperation& upsert : frame.upserts) bytes += (*this)(upsert);
    return bytes;
  }
  template <typename Small>
  size_t operator()(const Small&) const {
    return kFieldBytes;
  }
};

// Approximate size of the largest message that an operation needs.
struct MessageBytes {
  size_t operator()(const FrameOperation& frame) const {
    size_t bytes = 0;
    for (const UpsertOperation& upsert : frame.upserts)
      bytes = std::max(bytes, OperationBytes()(upsert));
    return bytes;
  }
  template <typename Other>
  size_t operator()(const Other& other) const {
    return OperationBytes()(other);
  }
};

std::string Words(sync::TimeNs time) { return absl::StrCat(static_cast<double>(time) / 1e9, " s"); }

}  // namespace

SessionCore::SessionCore(Options options, std::unique_ptr<Transport> transport, sync::Clock& clock)
    : options_(std::move(options)),
      transport_(std::move(transport)),
      clock_(clock),
      outbox_(KeepFrames(options_), options_.buffer_bytes),
      receipts_(options_.outcomes),
      backoff_(options_.first_pause.count(), options_.longest_pause.count()) {}

SessionCore::~SessionCore() = default;

std::string SessionCore::Where() const { return "voxeld at " + options_.address; }

sync::TimeNs SessionCore::Step() {
  std::deque<Event> events;
  std::vector<Receipt> receipts;
  std::vector<std::unique_ptr<Link>> ended;
  sync::TimeNs next = sync::kNever;
  {
    sync::MutexLock lock(mutex_);
    next = DoDue(clock_.Now());
    events.swap(events_);
    ended.swap(ended_links_);
    if (Behind()) changed_.NotifyAll();
    for (const uint64_t frame : receipts_.TakeChanged()) {
      if (!options_.on_receipt) break;
      if (const Receipt* receipt = receipts_.Find(frame)) receipts.push_back(*receipt);
    }
  }
  for (const Event& event : events) {
    if (const auto* issue = std::get_if<Issue>(&event)) {
      if (options_.on_issue) options_.on_issue(*issue);
    } else if (options_.on_connection) {
      options_.on_connection(std::get<ConnectionChange>(event));
    }
  }
  for (const Receipt& receipt : receipts) options_.on_receipt(receipt);
  return next;
}

void SessionCore::Run() {
  for (;;) {
    Step();
    sync::MutexLock lock(mutex_);
    if (stop_ && link_ == nullptr && !HasEvents()) return;
    // Recompute: a deadline may have moved closer since.
    const sync::TimeNs next = DoDue(clock_.Now());
    if (!HasEvents() && ended_links_.empty() && next > clock_.Now())
      clock_.WaitUntil(mutex_, work_, next);
  }
}

void SessionCore::Stop() {
  sync::MutexLock lock(mutex_);
  stop_ = true;
  if (link_ != nullptr) CancelLink(absl::CancelledError("the session was closed"));
  while (link_ != nullptr) changed_.Wait(mutex_);
  if (state_ != State::kEnded) EndSession(absl::CancelledError("the session was closed"));
  work_.NotifyAll();
}

bool SessionCore::TakesEvents() const {
  return options_.on_receipt || options_.on_issue || options_.on_connection;
}

bool SessionCore::HasEvents() const {
  return !events_.empty() || (options_.on_receipt && receipts_.changed() > 0);
}

bool SessionCore::Behind() const {
  return options_.on_receipt && receipts_.changed() >= kMostUntold;
}

bool SessionCore::Room() const {
  return state_ == State::kOpen && outbox_.empty() && outbox_.has_credit() &&
         receipts_.unsettled() < options_.most_unsettled && !Behind();
}

void SessionCore::Changed() {
  if (!TakesEvents()) events_.clear();
  if (!options_.on_receipt) receipts_.TakeChanged();
  if (HasEvents() || !ended_links_.empty()) work_.NotifyAll();
  changed_.NotifyAll();
}

void SessionCore::NoteDrops() {
  for (const Drop& drop : outbox_.TakeDrops())
    receipts_.Dropped(drop.frame_id, drop.frames, drop.whole);
}

absl::Status SessionCore::Stage(Operation operation) {
  const size_t bytes = std::visit(OperationBytes(), operation);
  sync::MutexLock lock(mutex_);
  if (state_ == State::kEnded || closing_)
    return absl::FailedPreconditionError("the session is closed");
  // An estimate; Commit knows the exact size.
  const size_t most = most_message_bytes();
  const size_t largest = std::visit(MessageBytes(), operation);
  if (most > 0 && largest > most + kFieldBytes) {
    return absl::InvalidArgumentError(absl::StrCat("what is to be put up has ", largest,
                                                   " bytes, and the server's max_message_bytes is ",
                                                   most, "; put it up in pieces"));
  }
  if (!staged_.empty() && staged_bytes_ + bytes > options_.most_staged_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("it has ", bytes, " bytes, and ", staged_bytes_, " of ",
                     options_.most_staged_bytes, " (most_staged_bytes) are staged; commit first"));
  }
  staged_.push_back(std::move(operation));
  staged_bytes_ += bytes;
  return absl::OkStatus();
}

absl::Status SessionCore::StageUpsert(std::string layer, std::string id, const Shape& shape,
                                      const Look& look) {
  if (layer.empty()) return absl::InvalidArgumentError("the layer has no name");
  if (id.empty()) return absl::InvalidArgumentError("the entity has no id");
  absl::StatusOr<Rope> primitive = EncodePrimitive(shape, look.color, look.color_scale);
  if (!primitive.ok()) return primitive.status();
  return Stage(UpsertOperation{.layer = std::move(layer),
                               .id = std::move(id),
                               .primitive = *std::move(primitive),
                               .transform = look.transform,
                               .priority = look.priority,
                               .erase = look.erase,
                               .lifetime_ns = look.lifetime.count(),
                               .label = look.label});
}

absl::StatusOr<uint64_t> SessionCore::Commit(FrameOperation* frame, const CommitOptions& options) {
  sync::MutexLock lock(mutex_);
  if (state_ == State::kEnded) {
    return ended_.ok() ? absl::FailedPreconditionError("the session is closed") : ended_;
  }
  if (closing_) return absl::FailedPreconditionError("the session is closed");
  if (Behind()) {
    return absl::ResourceExhaustedError(absl::StrCat(
        receipts_.changed(), " receipts wait for on_receipt; commit again when it has returned"));
  }
  std::vector<Operation> operations = std::exchange(staged_, {});
  if (frame != nullptr) operations.emplace_back(std::move(*frame));
  const size_t most = most_message_bytes();
  std::shared_ptr<Transaction> transaction = MakeTransaction(std::move(operations), options, most);
  if (most > 0 && transaction->LargestMessage() > most)
    return GiveUpOversized(std::move(transaction->operations), frame);
  transaction->frame_id = next_frame_;
  const absl::Status added = outbox_.Add(transaction);
  if (!added.ok()) {
    if (frame != nullptr) {
      *frame = std::move(std::get<FrameOperation>(transaction->operations.back()));
      transaction->operations.pop_back();
    }
    staged_ = std::move(transaction->operations);
    return added;
  }
  // Until the server has said what it can read, the operations may be needed again.
  if (!options_.restore && server_) transaction->operations.clear();
  staged_bytes_ = 0;
  receipts_.Queued(next_frame_);
  NoteDrops();
  Pump();
  Changed();
  return next_frame_++;
}

absl::Status SessionCore::GiveUpOversized(std::vector<Operation> operations,
                                          FrameOperation* frame) {
  const size_t most = most_message_bytes();
  std::vector<Operation> last;  // the caller's frame
  if (frame != nullptr) {
    last.push_back(std::move(operations.back()));
    operations.pop_back();
  }
  std::vector<Oversized> oversized = TakeOversized(most, &operations);
  for (Oversized& of_frame : TakeOversized(most, &last)) oversized.push_back(std::move(of_frame));
  if (!last.empty()) *frame = std::move(std::get<FrameOperation>(last.back()));
  staged_ = std::move(operations);
  staged_bytes_ = 0;
  for (const Operation& operation : staged_)
    staged_bytes_ += std::visit(OperationBytes(), operation);
  return absl::InvalidArgumentError(
      absl::StrCat(oversized.empty() ? "" : oversized.front().what,
                   "; nothing was committed; it is given up, and all else stays staged"));
}

size_t SessionCore::most_message_bytes() const {
  return server_ ? server_->limits.max_message_bytes : 0;
}

size_t SessionCore::staged_bytes() const {
  sync::MutexLock lock(mutex_);
  return staged_bytes_;
}

bool SessionCore::HasRoom() const {
  sync::MutexLock lock(mutex_);
  return Room();
}

template <typename Done>
absl::Status SessionCore::Wait(Duration timeout, bool interruptible, const char* what, Done done) {
  const sync::TimeNs now = clock_.Now();
  const sync::TimeNs deadline =
      timeout.count() > sync::kNever - now ? sync::kNever : now + timeout.count();
  sync::MutexLock lock(mutex_);
  while (!done()) {
    if (state_ == State::kEnded) {
      return ended_.ok() ? absl::UnavailableError(Where() + " ended the stream") : ended_;
    }
    if (interruptible && interrupted_) return absl::CancelledError("interrupted");
    if (clock_.Now() >= deadline) {
      std::string why = absl::StrCat("waited in vain for ", what, " from ", Where());
      if (state_ != State::kOpen && !last_loss_.ok())
        absl::StrAppend(&why, ": ", last_loss_.message());
      return absl::DeadlineExceededError(why);
    }
    clock_.WaitUntil(mutex_, changed_, deadline);
  }
  return absl::OkStatus();
}

absl::Status SessionCore::WaitOpened(Duration timeout) {
  return Wait(timeout, true, "Opened",
              [this]() VOXELD_REQUIRES(mutex_) { return state_ == State::kOpen; });
}

absl::Status SessionCore::WaitForRoom(Duration timeout) {
  return Wait(timeout, true, "room", [this]() VOXELD_REQUIRES(mutex_) { return Room(); });
}

absl::StatusOr<Receipt> SessionCore::AnswerOf(uint64_t frame) const {
  const Receipt* receipt = receipts_.Find(frame);
  if (receipt == nullptr) {
    return absl::NotFoundError(absl::StrCat(
        "the commit ", frame, " is not known (any more); the newest is ", next_frame_ - 1));
  }
  switch (receipt->state) {
    case Receipt::State::kRefused: {
      std::string text = absl::StrCat("the server refused commit ", frame, ": ", receipt->message);
      const std::vector<Issue>& issues = receipt->issues;
      constexpr size_t kMost = 20;
      for (size_t i = 0; i < issues.size() && i < kMost; ++i) {
        const std::string described = DescribeIssue(issues[i]);
        // the first issue, which the message already contains
        if (absl::StrContains(receipt->message, described)) continue;
        absl::StrAppend(&text, "\n  ", described);
      }
      if (issues.size() > kMost) absl::StrAppend(&text, "\n  and ", issues.size() - kMost, " more");
      return absl::FailedPreconditionError(text);
    }
    case Receipt::State::kDropped:
      return absl::AbortedError(
          absl::StrCat("the commit ", frame, " was not sent: newer frames replaced its own"));
    case Receipt::State::kLost:
      return absl::AbortedError(absl::StrCat("the commit ", frame, " is lost: ", receipt->message));
    default:
      return *receipt;
  }
}

absl::StatusOr<Receipt> SessionCore::WaitAccepted(uint64_t frame, Duration timeout) {
  const absl::Status waited =
      Wait(timeout, true, "Accepted", [this, frame]() VOXELD_REQUIRES(mutex_) {
        const Receipt* receipt = receipts_.Find(frame);
        return receipt == nullptr || receipt->settled ||
               receipt->state == Receipt::State::kAccepted;
      });
  if (!waited.ok()) return waited;
  sync::MutexLock lock(mutex_);
  return AnswerOf(frame);
}

absl::StatusOr<Receipt> SessionCore::WaitShown(uint64_t frame, Duration timeout) {
  const absl::Status waited =
      Wait(timeout, true, "outcomes", [this, frame]() VOXELD_REQUIRES(mutex_) {
        const Receipt* receipt = receipts_.Find(frame);
        return receipt == nullptr || receipt->settled;
      });
  if (!waited.ok()) return waited;
  sync::MutexLock lock(mutex_);
  return AnswerOf(frame);
}

absl::StatusOr<Receipt> SessionCore::WaitDurable(uint64_t frame, Duration timeout) {
  const absl::Status waited =
      Wait(timeout, true, "word that it is durable", [this, frame]() VOXELD_REQUIRES(mutex_) {
        const Receipt* receipt = receipts_.Find(frame);
        if (receipt == nullptr || receipt->settled || receipt->durable) return true;
        return receipt->state == Receipt::State::kAccepted && !receipt->durable_owed;
      });
  if (!waited.ok()) return waited;
  sync::MutexLock lock(mutex_);
  absl::StatusOr<Receipt> receipt = AnswerOf(frame);
  if (!receipt.ok() || receipt->durable) return receipt;
  for (const Issue& issue : receipt->issues) {
    if (issue.field == "commit.durable") return absl::FailedPreconditionError(issue.message);
  }
  return absl::FailedPreconditionError(
      "the commit is applied and not durable: it was made without CommitOptions::durable");
}

absl::Status SessionCore::WaitSettled(Duration timeout) {
  const absl::Status waited = Wait(timeout, false, "outcomes", [this]() VOXELD_REQUIRES(mutex_) {
    return receipts_.unsettled() == 0;
  });
  if (!absl::IsDeadlineExceeded(waited)) return waited;
  sync::MutexLock lock(mutex_);
  const uint64_t left = receipts_.unsettled();
  if (left == 0) return absl::OkStatus();
  return absl::DeadlineExceededError(
      absl::StrCat(left, left == 1 ? " commit has" : " commits have", " no outcome yet"));
}

absl::Status SessionCore::Close(Duration timeout) {
  {
    sync::MutexLock lock(mutex_);
    closing_ = true;
    staged_.clear();
    staged_bytes_ = 0;
    Pump();
  }
  const sync::TimeNs deadline = clock_.Now() + timeout.count();
  sync::MutexLock lock(mutex_);
  while (state_ != State::kEnded && clock_.Now() < deadline)
    clock_.WaitUntil(mutex_, changed_, deadline);
  if (state_ == State::kEnded) return ended_;
  std::string why = absl::StrCat(Where(), " did not end the stream in ", Words(timeout.count()));
  if (!outbox_.empty())
    absl::StrAppend(&why, "; ", outbox_.waiting_bytes(), " bytes were not sent");
  if (state_ != State::kOpen && !last_loss_.ok()) absl::StrAppend(&why, ": ", last_loss_.message());
  return absl::DeadlineExceededError(why);
}

void SessionCore::Interrupt() {
  sync::MutexLock lock(mutex_);
  interrupted_ = true;
  changed_.NotifyAll();
}

std::optional<Receipt> SessionCore::FindReceipt(uint64_t frame) const {
  sync::MutexLock lock(mutex_);
  const Receipt* receipt = receipts_.Find(frame);
  if (receipt == nullptr) return std::nullopt;
  return *receipt;
}

Tally SessionCore::GetTally() const {
  sync::MutexLock lock(mutex_);
  return receipts_.GetTally();
}

std::vector<int64_t> SessionCore::latencies_ns() const {
  sync::MutexLock lock(mutex_);
  return receipts_.latencies_ns();
}

std::optional<ServerInfo> SessionCore::server() const {
  sync::MutexLock lock(mutex_);
  return server_;
}

std::optional<ClockEstimate> SessionCore::clock_estimate() const {
  sync::MutexLock lock(mutex_);
  return estimator_.Get();
}

std::optional<int64_t> SessionCore::ServerNow() const {
  sync::MutexLock lock(mutex_);
  const std::optional<ClockEstimate> estimate = estimator_.Get();
  if (!estimate) return std::nullopt;
  return clock_.Now() + estimate->offset_ns;
}

}  // namespace voxeld::client
