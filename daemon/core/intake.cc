#include "daemon/core/intake.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "daemon/scene/commit_applier.h"
#include "daemon/scene/draft.h"

namespace voxeld::daemon {
namespace {

// What an operation holds while it waits.
uint64_t StagedBytes(const Operation& operation) {
  uint64_t bytes = sizeof(Operation) + sizeof(WaitingCommit::Cost);
  if (const auto* upsert = std::get_if<Upsert>(&operation.op)) {
    bytes += upsert->layer.size() + upsert->id.size() + upsert->entity.label.size() +
             BytesOf(upsert->entity.content);
  } else if (const auto* define = std::get_if<DefineObject>(&operation.op)) {
    bytes += Draft::ObjectBytes(define->object, *define->data);
  } else if (const auto* del = std::get_if<Delete>(&operation.op)) {
    bytes += del->layer.size() + del->id_or_prefix.size();
  } else if (const auto* set = std::get_if<SetTransform>(&operation.op)) {
    bytes += set->layer.size() + set->id.size();
  } else if (const auto* state = std::get_if<LayerState>(&operation.op)) {
    bytes += state->layer.size() + (state->clip != nullptr ? sizeof(Clip) : 0) +
             (state->mask.has_value() ? state->mask->size() : 0);
  } else if (const auto* begin = std::get_if<FrameBegin>(&operation.op)) {
    bytes += begin->layer.size();
  } else if (const auto* end = std::get_if<FrameEnd>(&operation.op)) {
    bytes += end->layer.size();
  } else if (const auto* remove = std::get_if<DeleteObject>(&operation.op)) {
    bytes += remove->object.size();
  }
  return bytes;
}

std::pair<std::string, std::string> NamesIn(const Operation& operation) {
  if (const auto* o = std::get_if<Upsert>(&operation.op)) return {o->layer, o->id};
  if (const auto* o = std::get_if<SetTransform>(&operation.op)) return {o->layer, o->id};
  if (const auto* o = std::get_if<Delete>(&operation.op)) return {o->layer, o->id_or_prefix};
  if (const auto* o = std::get_if<LayerState>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<FrameBegin>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<FrameEnd>(&operation.op)) return {o->layer, ""};
  if (const auto* o = std::get_if<DefineObject>(&operation.op)) return {"", o->object};
  if (const auto* o = std::get_if<DeleteObject>(&operation.op)) return {"", o->object};
  return {};
}

struct FieldName {
  const char* operator()(const Upsert&) const { return "upsert"; }
  const char* operator()(const Delete&) const { return "delete"; }
  const char* operator()(const SetTransform&) const { return "set_transform"; }
  const char* operator()(const LayerState&) const { return "layer_state"; }
  const char* operator()(const FrameBegin&) const { return "frame_begin"; }
  const char* operator()(const FrameEnd&) const { return "frame_end"; }
  const char* operator()(const DefineObject&) const { return "define_object"; }
  const char* operator()(const DeleteObject&) const { return "delete_object"; }
  const char* operator()(const Commit&) const { return "commit"; }
};

// What a commit weighs by itself.
constexpr uint64_t kCommitBytes = sizeof(WaitingCommit);

}  // namespace

void RefusalTally::Count(const Issue& issue) {
  if (issue.applied) return;
  ++refused_;
  if (first_.empty()) first_ = Describe(issue);
}

void RefusalTally::CountMore(uint64_t more, const std::optional<Issue>& first) {
  if (more == 0) return;
  refused_ += more;
  if (first_.empty() && first.has_value()) first_ = Describe(*first);
}

std::string RefusalTally::Describe(const Issue& issue) {
  std::string text = EscapeQuoted(issue.layer);
  if (!issue.id.empty()) absl::StrAppend(&text, "/", EscapeQuoted(issue.id));
  if (!issue.field.empty()) absl::StrAppend(&text, text.empty() ? "" : ", ", issue.field);
  if (!text.empty()) text += ": ";
  return text + issue.message;
}

void RefusalTally::Tell(const Issue& issue, SessionSink* sink, uint64_t most) {
  if (told_ >= most) {
    ++left_out_;
    return;
  }
  ++told_;
  if (sink != nullptr) sink->OnIssue(issue);
}

void RefusalTally::TellOfThoseLeftOut(uint64_t sequence, SessionSink* sink, uint64_t most) {
  if (left_out_ == 0 || sink == nullptr) return;
  sink->OnIssue({sequence,
                 {},
                 {},
                 "commit",
                 Reason::kQuotaExceeded,
                 absl::StrFormat("%d more issues are left out, beyond the %d of "
                                 "max_issues_per_commit; the receipt counts all "
                                 "refusals; commit fewer operations at a time to be told of each",
                                 left_out_, most)});
}

Intake::Intake(const Limits& limits, std::shared_ptr<Budget> budget,
               std::shared_ptr<std::atomic<uint64_t>> bytes_in, const OpenOptions& options,
               uint64_t open_bytes, std::shared_ptr<SessionSink> sink,
               std::function<void()> schedule)
    : limits_(limits),
      budget_(std::move(budget)),
      bytes_in_(std::move(bytes_in)),
      frames_kept_(options.flow == FlowPolicy::kReliable ? 0
                   : options.flow == FlowPolicy::kLatest ? 1
                                                         : options.drop_oldest_frames),
      sink_(std::move(sink)),
      schedule_(std::move(schedule)),
      received_(open_bytes),
      returned_(open_bytes),
      told_credit_(open_bytes + limits.credit_bytes) {
  bytes_in_->fetch_add(open_bytes, std::memory_order_relaxed);
}

Intake::~Intake() {
  Close();
  sync::MutexLock lock(mutex_);
  for (const WaitingCommit& commit : queue_) {
    budget_->Release(Budget::Use::kWaiting, commit.bytes);
  }
}

uint64_t Intake::first_credit() const {
  sync::MutexLock lock(mutex_);
  return told_credit_;
}

bool Intake::Take(IncomingMessage message) {
  sync::MutexLock lock(mutex_);
  if (sink_ == nullptr) return false;
  received_ += message.bytes;
  bytes_in_->fetch_add(message.bytes, std::memory_order_relaxed);
  staged_.credit += message.bytes;
  staged_.named_bytes += message.named_bytes;
  named_bytes_ += message.named_bytes;

  for (const Issue& issue : message.refused.issues) {
    staged_.refusals.Tell(issue, sink_.get(), limits_.max_issues_per_commit);
  }
  staged_.refusals.LeaveOut(message.refused.more + message.refused.more_applied);
  staged_.refusals.CountMore(message.refused.more, message.refused.first);
  // What decoding refused counts for the commit that it came before.
  size_t counted = 0;
  const auto count_up_to = [&](uint64_t sequence) VOXELD_REQUIRES(mutex_) {
    const std::vector<Issue>& issues = message.refused.issues;
    for (; counted < issues.size() && issues[counted].sequence <= sequence; ++counted) {
      staged_.refusals.Count(issues[counted]);
    }
  };
  uint64_t credit = message.bytes;  // all of it goes with the first operation that is staged
  for (Operation& operation : message.operations) {
    if (std::holds_alternative<Commit>(operation.op)) {
      count_up_to(operation.sequence);
      Seal(operation, message);
    } else {
      Stage(std::move(operation), std::exchange(credit, 0));
    }
  }
  count_up_to(UINT64_MAX);
  ReturnStaged();
  if (!queue_.empty() && !std::exchange(scheduled_, true)) schedule_();
  return !Room() && !std::exchange(asked_for_room_, true);
}

void Intake::Stage(Operation operation, uint64_t credit) {
  std::optional<Issue> issue;
  const uint64_t bytes = StagedBytes(operation);
  const auto over = [&](std::string message) {
    auto [layer, id] = NamesIn(operation);
    issue = Issue{operation.sequence,     std::move(layer),
                  std::move(id),          std::visit(FieldName(), operation.op),
                  Reason::kQuotaExceeded, std::move(message)};
  };
  const uint64_t mine = staged_.bytes + detached_bytes_ + bytes;
  const uint64_t all = budget_->used_bytes(Budget::Use::kStaged) + bytes;
  if (staged_.operations.size() >= limits_.max_operations_per_commit) {
    over(absl::StrFormat("%d %s for a commit, which is max_operations_per_commit; commit first",
                         staged_.operations.size(),
                         staged_.operations.size() == 1 ? "operation waits" : "operations wait"));
  } else if (mine > limits_.max_uncommitted_bytes) {
    over(absl::StrFormat(
        "%d bytes would wait for a commit, or for a commit's present_at; max_uncommitted_bytes is "
        "%d; commit first, or less far ahead",
        mine, limits_.max_uncommitted_bytes));
  } else if (all > limits_.max_uncommitted_bytes_total) {
    over(absl::StrFormat(
        "%d bytes of all sessions would wait for their commits; max_uncommitted_bytes_total is %d; "
        "commit first, or try again when others have committed",
        all, limits_.max_uncommitted_bytes_total));
  } else if (issue = CheckAlone(operation, limits_);
             !issue.has_value() && !budget_->Charge(Budget::Use::kStaged, bytes)) {
    over(absl::StrFormat(
        "%d bytes more would be held for all clients, beyond the %d of %d there are; "
        "max_memory_bytes is the limit; try again when others have taken something away",
        bytes, budget_->used_bytes(), budget_->limit_bytes()));
  }
  if (issue.has_value()) {
    staged_.refusals.Count(*issue);
    return staged_.refusals.Tell(*issue, sink_.get(), limits_.max_issues_per_commit);
  }
  staged_.bytes += bytes;
  staged_.costs.push_back({bytes, credit});
  staged_.operations.push_back(std::move(operation));
}

void Intake::Seal(const Operation& operation, const IncomingMessage& message) {
  for (size_t i = 0; i < staged_returned_; ++i) staged_.costs[i].credit = 0;
  staged_returned_ = 0;
  WaitingCommit commit = std::exchange(staged_, {});
  commit.sequence = operation.sequence;
  commit.commit = std::get<Commit>(operation.op);
  commit.received_ns = message.received_ns;
  commit.decoded_ns = message.decoded_ns;
  budget_->Move(Budget::Use::kStaged, Budget::Use::kWaiting, commit.bytes);
  budget_->ChargeAnyway(Budget::Use::kWaiting, kCommitBytes);
  commit.bytes += kCommitBytes;
  queue_.push_back(std::move(commit));
  if (frames_kept_ > 0) GiveUpFrames(popped_ + queue_.size() - 1);
}

void Intake::GiveUpFrames(uint64_t number) {
  const WaitingCommit& commit = queue_.back();
  // What is to be shown at its time, or in any case, is not given up.
  if (commit.commit.must_show || commit.commit.present_at_ns != 0) return;
  std::map<std::string, uint64_t> begun;
  std::vector<std::pair<std::string, FrameRef>> ended;
  for (const Operation& operation : commit.operations) {
    if (const auto* begin = std::get_if<FrameBegin>(&operation.op)) {
      begun.try_emplace(begin->layer, operation.sequence);  // the applier keeps the first, too
    } else if (const auto* end = std::get_if<FrameEnd>(&operation.op)) {
      const auto it = begun.find(end->layer);
      if (it == begun.end()) continue;
      ended.push_back({end->layer, {number, it->second}});
      begun.erase(it);
    }
  }
  for (const auto& [layer, frame] : ended) {
    std::deque<FrameRef>& waiting = frames_[layer];
    waiting.push_back(frame);
    while (waiting.size() > frames_kept_) {
      const FrameRef oldest = waiting.front();
      waiting.pop_front();
      DropFrame(layer, oldest);
    }
  }
}

void Intake::DropFrame(const std::string& layer, const FrameRef& frame) {
  WaitingCommit& commit = queue_[frame.commit - popped_];
  std::vector<Operation> kept;
  std::vector<WaitingCommit::Cost> costs;
  kept.reserve(commit.operations.size());
  costs.reserve(commit.operations.size());
  bool inside = false, over = false;
  uint64_t bytes = 0, credit = 0;
  for (size_t i = 0; i < commit.operations.size(); ++i) {
    Operation& operation = commit.operations[i];
    // What a layer is like stays, wherever it is said.
    const bool of_layer =
        !std::holds_alternative<LayerState>(operation.op) && NamesIn(operation).first == layer;
    if (!over && operation.sequence == frame.begin_sequence &&
        std::holds_alternative<FrameBegin>(operation.op)) {
      inside = true;
    }
    const bool drops = inside && of_layer;
    if (drops && std::holds_alternative<FrameEnd>(operation.op)) {
      inside = false;
      over = true;
    }
    if (drops) {
      bytes += commit.costs[i].bytes;
      credit += commit.costs[i].credit;
    } else {
      kept.push_back(std::move(operation));
      costs.push_back(commit.costs[i]);
    }
  }
  commit.operations = std::move(kept);
  commit.costs = std::move(costs);
  commit.bytes -= bytes;
  commit.credit -= credit;
  ++commit.dropped_frames;
  budget_->Release(Budget::Use::kWaiting, bytes);
  Return(credit, 0);
}

bool Intake::Room() const {
  return received_ - returned_ < limits_.credit_bytes &&
         named_bytes_ / kNamedMessages < limits_.max_message_bytes &&
         queue_.size() < limits_.max_riding_commits;
}

bool Intake::HasRoom() const {
  sync::MutexLock lock(mutex_);
  return sink_ != nullptr && Room();
}

void Intake::Wake() {
  sync::MutexLock lock(mutex_);
  if (sink_ != nullptr) schedule_();
}

void Intake::ReturnStaged() {
  if (!queue_.empty() || under_way_ > 0) return;
  staged_returned_ = staged_.operations.size();
  Return(std::exchange(staged_.credit, 0), std::exchange(staged_.named_bytes, 0));
}

void Intake::Return(uint64_t credit, uint64_t named_bytes) {
  returned_ += credit;
  named_bytes_ -= named_bytes;
  if (sink_ == nullptr) return;
  const uint64_t total = returned_ + limits_.credit_bytes;
  if (total - told_credit_ >= limits_.credit_bytes / 4 && total > told_credit_) {
    told_credit_ = total;
    sink_->OnCredit(total);
  }
  if (asked_for_room_ && Room()) {
    asked_for_room_ = false;
    sink_->OnRoom();
  }
}

std::optional<WaitingCommit> Intake::Pop(bool* more) {
  sync::MutexLock lock(mutex_);
  *more = queue_.size() > 1;
  scheduled_ = *more;
  if (queue_.empty()) return std::nullopt;
  WaitingCommit commit = std::move(queue_.front());
  queue_.pop_front();
  const uint64_t number = popped_++;
  ++under_way_;
  if (frames_kept_ > 0) {
    for (auto it = frames_.begin(); it != frames_.end();) {
      std::deque<FrameRef>& frames = it->second;
      while (!frames.empty() && frames.front().commit <= number) frames.pop_front();
      it = frames.empty() ? frames_.erase(it) : std::next(it);
    }
  }
  return commit;
}

bool Intake::empty() const {
  sync::MutexLock lock(mutex_);
  return queue_.empty();
}

void Intake::Detach(WaitingCommit& commit) {
  sync::MutexLock lock(mutex_);
  --under_way_;
  detached_bytes_ += commit.bytes;
  commit.costs.clear();
  commit.detached = true;
  Return(std::exchange(commit.credit, 0), std::exchange(commit.named_bytes, 0));
  ReturnStaged();
}

void Intake::Done(WaitingCommit commit) {
  commit.operations.clear();  // outside the lock
  sync::MutexLock lock(mutex_);
  budget_->Release(Budget::Use::kWaiting, commit.bytes);
  if (commit.detached) {
    detached_bytes_ -= commit.bytes;
  } else {
    --under_way_;
  }
  Return(commit.credit, commit.named_bytes);
  ReturnStaged();
}

void Intake::Close() {
  WaitingCommit staged;  // freed outside the lock
  std::function<void()> schedule;
  sync::MutexLock lock(mutex_);
  if (sink_ == nullptr) return;
  sink_ = nullptr;
  schedule_.swap(schedule);
  std::swap(staged, staged_);
  budget_->Release(Budget::Use::kStaged, staged.bytes);
}

}  // namespace voxeld::daemon
