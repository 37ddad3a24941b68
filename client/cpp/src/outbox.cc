#include "client/cpp/src/outbox.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"

namespace voxeld::client {
namespace {

// Approximate wire size of a Commit.
constexpr size_t kCommitBytes = 48;
// Maximum size added by AddSequence.
constexpr size_t kSequenceBytes = 11;
// Limit of the issues kept per commit; the server's default is a thousand.
constexpr size_t kMostRefused = 65536;

size_t BytesOf(const Transaction& transaction) {
  size_t bytes = kCommitBytes;
  for (const Transaction::Piece& piece : transaction.pieces) {
    if (!piece.dropped) bytes += piece.bytes;
  }
  return bytes;
}

// Clears the operation of a dropped frame piece, as if it had not been requested.
void ForgetFrame(size_t piece, Transaction* transaction) {
  const auto nth = std::count_if(
      transaction->pieces.begin(), transaction->pieces.begin() + static_cast<ptrdiff_t>(piece),
      [](const auto& before) { return before.frame && !before.dropped; });
  ptrdiff_t seen = 0;
  for (Operation& operation : transaction->operations) {
    auto* frame = std::get_if<FrameOperation>(&operation);
    if (frame != nullptr && !frame->layer.empty() && seen++ == nth) {
      *frame = {};
      return;
    }
  }
}

// Returns the bytes of upserts that fit into one batch whose message may have `most_bytes`.
size_t BatchBytes(size_t most_bytes) {
  constexpr size_t kWrapping = kSequenceBytes + 6;
  return most_bytes > kWrapping ? most_bytes - kWrapping : 1;
}

struct NameParts {
  std::string operator()(const UpsertOperation& upsert) const {
    return absl::StrCat(upsert.layer, "/", upsert.id);
  }
  std::string operator()(const DefineOperation& define) const {
    return absl::StrCat("the object \"", define.object, "\"");
  }
  template <typename Small>
  std::string operator()(const Small&) const {
    return "an operation";
  }
};

// Upper bound of the message that an operation needs alone; SIZE_MAX: encode it to find out.
struct AtMostBytes {
  static constexpr size_t kFields = 512;
  size_t operator()(const UpsertOperation& upsert) const {
    return upsert.primitive.size() + upsert.layer.size() + upsert.id.size() + upsert.label.size() +
           kFields;
  }
  size_t operator()(const DefineOperation& define) const {
    return define.definition.size() + define.object.size() + kFields;
  }
  template <typename Other>
  size_t operator()(const Other&) const {
    return SIZE_MAX;
  }
};

std::string NameOf(const Operation& operation) { return std::visit(NameParts(), operation); }

bool Droppable(const Transaction& transaction, const Transaction::Piece& piece) {
  return piece.frame && !piece.dropped && transaction.present_at_ns == 0;
}

}  // namespace

std::shared_ptr<Transaction> MakeTransaction(std::vector<Operation> operations,
                                             const CommitOptions& options, size_t most_bytes) {
  auto transaction = std::make_shared<Transaction>();
  transaction->present_at_ns = options.present_at_ns;
  transaction->must_show = options.must_show;
  transaction->durable = options.durable;
  Batcher batcher(most_bytes == 0 ? kBatchBytes : std::min(kBatchBytes, BatchBytes(most_bytes)));
  Transaction::Piece plain;
  const auto add = [](Rope message, size_t count, Transaction::Piece* piece) {
    piece->bytes += message.size();
    piece->messages.push_back({std::move(message), count});
  };
  const auto take_batches = [&batcher, &add](Transaction::Piece* piece) {
    for (Batcher::Message& message : batcher.Take())
      add(std::move(message.bytes), message.upserts, piece);
  };
  for (const Operation& operation : operations) {
    if (const auto* upsert = std::get_if<UpsertOperation>(&operation)) {
      batcher.Add(*upsert);
      continue;
    }
    take_batches(&plain);
    const auto* frame = std::get_if<FrameOperation>(&operation);
    if (frame == nullptr) {
      add(EncodeOperation(operation), 1, &plain);
      continue;
    }
    if (frame->layer.empty()) continue;  // dropped
    if (!plain.messages.empty()) transaction->pieces.push_back(std::exchange(plain, {}));
    Transaction::Piece piece;
    piece.frame = true;
    piece.layer = frame->layer;
    add(EncodeFrameBegin(frame->layer), 1, &piece);
    for (const UpsertOperation& upsert : frame->upserts) batcher.Add(upsert);
    take_batches(&piece);
    add(EncodeFrameEnd(frame->layer), 1, &piece);
    transaction->pieces.push_back(std::move(piece));
  }
  take_batches(&plain);
  if (!plain.messages.empty()) transaction->pieces.push_back(std::move(plain));
  transaction->operations = std::move(operations);
  return transaction;
}

std::vector<Oversized> TakeOversized(size_t most_bytes, std::vector<Operation>* operations) {
  std::vector<Oversized> oversized;
  std::erase_if(*operations, [&](Operation& operation) {
    // Check a frame's upserts one by one, and its begin.
    const auto* frame = std::get_if<FrameOperation>(&operation);
    const auto too_large = [&](const Operation& one) {
      if (std::visit(AtMostBytes(), one) <= most_bytes) return false;
      const size_t bytes = MakeTransaction({one}, {}, most_bytes)->LargestMessage();
      if (bytes <= most_bytes) return false;
      oversized.push_back({{},
                           absl::StrCat(NameOf(one), " takes a message of ", bytes,
                                        " bytes, and the server's max_message_bytes is ",
                                        most_bytes, "; put it up in pieces")});
      return true;
    };
    const bool takes_more =
        frame == nullptr
            ? too_large(operation)
            : too_large(FrameOperation{frame->layer, {}}) ||
                  std::any_of(frame->upserts.begin(), frame->upserts.end(),
                              [&](const UpsertOperation& upsert) { return too_large(upsert); });
    if (takes_more) oversized.back().operation = std::move(operation);
    return takes_more;
  });
  return oversized;
}

Refusals Transaction::GetRefusals() const {
  Refusals refusals;
  if (refused.empty()) return refusals;
  refusals.refused = refused;
  for (const Piece& piece : pieces) {
    for (const Piece::Message& message : piece.messages)
      refusals.requests.push_back({message.sequence, message.operations});
  }
  return refusals;
}

size_t Transaction::LargestMessage() const {
  size_t largest = 0;
  for (const Piece& piece : pieces) {
    for (const Piece::Message& message : piece.messages)
      largest = std::max(largest, message.bytes.size() + kSequenceBytes);
  }
  return largest;
}

void Outbox::Wait(int64_t order, const std::shared_ptr<Transaction>& transaction) {
  queue_.emplace(order, transaction);
  waiting_bytes_ += BytesOf(*transaction);
  NoteFrames(order, *transaction);
}

void Outbox::NoteFrames(int64_t order, const Transaction& transaction) {
  for (size_t i = 0; i < transaction.pieces.size(); ++i) {
    const Transaction::Piece& piece = transaction.pieces[i];
    if (Droppable(transaction, piece)) frames_[piece.layer].push_back({order, i});
  }
}

size_t Outbox::DroppableBytes(const Transaction& coming) const {
  size_t bytes = 0;
  for (const auto& entry : frames_) {
    const std::string& layer = entry.first;
    const std::deque<WaitingFrame>& waiting = entry.second;
    const bool has_newer = std::any_of(
        coming.pieces.begin(), coming.pieces.end(),
        [&](const auto& piece) { return Droppable(coming, piece) && piece.layer == layer; });
    const size_t count = has_newer ? waiting.size() : waiting.size() - 1;
    for (size_t i = 0; i < count; ++i)
      bytes += queue_.at(waiting[i].order)->pieces[waiting[i].piece].bytes;
  }
  return bytes;
}

absl::Status Outbox::Add(std::shared_ptr<Transaction> transaction) {
  const size_t bytes = BytesOf(*transaction);
  if (!queue_.empty() && waiting_bytes_ + bytes > buffer_bytes_) {
    const bool may_drop = keep_frames_ > 0 || !open_;
    if (!may_drop || waiting_bytes_ + bytes - DroppableBytes(*transaction) > buffer_bytes_) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the commit has ", bytes, " bytes, and ", waiting_bytes_, " of ",
                       buffer_bytes_, " (buffer_bytes) wait to be sent; wait for room"));
    }
  }
  Wait(next_order_++, transaction);
  if (keep_frames_ > 0 && transaction->present_at_ns == 0) {
    for (size_t i = 0; i < transaction->pieces.size(); ++i) {
      if (transaction->pieces[i].frame) KeepNewest(transaction->pieces[i].layer, keep_frames_);
    }
  }
  while (waiting_bytes_ > buffer_bytes_ && DropOldestOfAny()) {
  }
  return absl::OkStatus();
}

void Outbox::AddFirst(const std::vector<std::shared_ptr<Transaction>>& transactions) {
  int64_t order = queue_.empty() ? next_order_ : queue_.begin()->first;
  if (queue_.empty()) next_order_ += static_cast<int64_t>(transactions.size());
  if (!queue_.empty()) order -= static_cast<int64_t>(transactions.size());
  for (const auto& transaction : transactions) Wait(order++, transaction);
}

std::vector<std::pair<std::shared_ptr<const Transaction>, std::string>> Outbox::KeepTo(
    size_t most_bytes) {
  std::vector<std::pair<std::shared_ptr<const Transaction>, std::string>> refused;
  for (auto it = queue_.begin(); it != queue_.end();) {
    const std::shared_ptr<Transaction> transaction = it->second;
    if (transaction->LargestMessage() <= most_bytes) {
      ++it;
      continue;
    }
    waiting_bytes_ -= BytesOf(*transaction);
    std::vector<Operation> operations = transaction->operations;
    const std::vector<Oversized> oversized = TakeOversized(most_bytes, &operations);
    if (oversized.empty() && !operations.empty()) {
      const std::shared_ptr<Transaction> fresh =
          MakeTransaction(std::move(operations), {}, most_bytes);
      transaction->pieces = std::move(fresh->pieces);
      waiting_bytes_ += BytesOf(*transaction);
      ++it;
      continue;
    }
    refused.emplace_back(
        transaction,
        !oversized.empty()
            ? oversized.front().what
            : absl::StrCat("it takes a message of ", transaction->LargestMessage(),
                           " bytes, and the server's max_message_bytes is ", most_bytes));
    it = queue_.erase(it);
  }
  return refused;
}

void Outbox::DropRestores() {
  for (auto it = queue_.begin(); it != queue_.end();) {
    if (!it->second->restores) {
      ++it;
      continue;
    }
    waiting_bytes_ -= BytesOf(*it->second);
    it = queue_.erase(it);
  }
}

void Outbox::StreamOpened(uint64_t open_bytes, uint64_t credit_bytes) {
  open_ = true;
  sent_ = open_bytes;
  credit_ = credit_bytes;
  // Commits that were sent before but not applied are treated like all others from now on.
  frames_.clear();
  for (const auto& [order, transaction] : queue_) {
    transaction->first_sequence = transaction->commit_sequence = 0;
    transaction->refused.clear();
    NoteFrames(order, *transaction);
  }
  if (keep_frames_ == 0) return;
  std::vector<std::string> layers;
  layers.reserve(frames_.size());
  for (const auto& [layer, waiting] : frames_) layers.push_back(layer);
  for (const std::string& layer : layers) KeepNewest(layer, keep_frames_);
}

void Outbox::Credit(uint64_t credit_bytes) { credit_ = std::max(credit_, credit_bytes); }

std::vector<uint64_t> Outbox::StreamLost(std::optional<int64_t> server_now) {
  open_ = false;
  std::vector<uint64_t> missed;
  Queue all = std::exchange(queue_, {});
  for (const auto& [order, transaction] : unanswered_) {
    const bool passed = transaction->scheduled &&
                        (!server_now.has_value() || transaction->present_at_ns <= *server_now);
    if (passed) {
      missed.push_back(transaction->frame_id);
    } else {
      all.emplace(order, transaction);
    }
  }
  unanswered_.clear();
  orders_.clear();
  by_commit_sequence_.clear();
  frames_.clear();
  waiting_bytes_ = 0;
  for (const auto& [order, transaction] : all) {
    transaction->next_piece = transaction->next_message = 0;
    unreported_drops_ += std::exchange(transaction->reported_drops, 0);
    transaction->scheduled = false;
    queue_.emplace(order, transaction);
    waiting_bytes_ += BytesOf(*transaction);
    // A completely sent commit may have been applied: keep its frames until that is known.
    if (transaction->commit_sequence != 0) continue;
    NoteFrames(order, *transaction);
  }
  return missed;
}

std::vector<std::shared_ptr<const Transaction>> Outbox::Applied(uint64_t last_sequence) {
  std::vector<std::shared_ptr<const Transaction>> applied;
  for (auto it = queue_.begin(); it != queue_.end();) {
    const Transaction& transaction = *it->second;
    if (transaction.commit_sequence == 0 || transaction.commit_sequence > last_sequence ||
        transaction.present_at_ns != 0) {
      ++it;
      continue;
    }
    applied.push_back(it->second);
    waiting_bytes_ -= BytesOf(transaction);
    it = queue_.erase(it);
  }
  return applied;
}

void Outbox::KeepNewest(const std::string& layer, size_t most) {
  const auto it = frames_.find(layer);
  if (it == frames_.end()) return;
  while (it->second.size() > most) {
    const WaitingFrame frame = it->second.front();
    it->second.pop_front();
    DropFrame(frame);
  }
  if (it->second.empty()) frames_.erase(it);
}

void Outbox::DropFrame(const WaitingFrame& frame) {
  const auto it = queue_.find(frame.order);
  Transaction& transaction = *it->second;
  Transaction::Piece& piece = transaction.pieces[frame.piece];
  piece.dropped = true;
  piece.messages.clear();
  waiting_bytes_ -= piece.bytes;
  ForgetFrame(frame.piece, &transaction);
  ++unreported_drops_;
  const bool nothing_left =
      transaction.next_piece == 0 && transaction.next_message == 0 && !transaction.must_show &&
      !transaction.durable &&
      std::all_of(transaction.pieces.begin(), transaction.pieces.end(),
                  [](const Transaction::Piece& other) { return other.dropped; });
  drops_.push_back({transaction.frame_id, 1, nothing_left});
  if (!nothing_left) return;
  waiting_bytes_ -= kCommitBytes;
  queue_.erase(it);
}

bool Outbox::DropOldestOfAny() {
  auto oldest = frames_.end();
  for (auto it = frames_.begin(); it != frames_.end(); ++it) {
    if (it->second.size() < 2) continue;  // the newest frame of a layer stays
    if (oldest == frames_.end() || it->second.front().order < oldest->second.front().order)
      oldest = it;
  }
  if (oldest == frames_.end()) return false;
  KeepNewest(oldest->first, oldest->second.size() - 1);
  return true;
}

void Outbox::Begin(int64_t order, const Transaction& transaction, size_t piece) {
  const auto it = frames_.find(transaction.pieces[piece].layer);
  if (it == frames_.end()) return;
  std::erase_if(it->second, [&](const WaitingFrame& frame) {
    return frame.order == order && frame.piece == piece;
  });
  if (it->second.empty()) frames_.erase(it);
}

void Outbox::Sent(Rope* message) {
  AddSequence(++sequence_, message);
  sent_ += message->size();
}

std::optional<Outbox::Outgoing> Outbox::Next(int64_t now_ns) {
  if (queue_.empty() || !has_credit()) return std::nullopt;
  const int64_t order = queue_.begin()->first;
  const std::shared_ptr<Transaction> transaction = queue_.begin()->second;
  Transaction& t = *transaction;
  while (t.next_piece < t.pieces.size() && t.pieces[t.next_piece].dropped) ++t.next_piece;
  Outgoing out;
  out.frame_id = t.frame_id;
  if (t.next_piece < t.pieces.size()) {
    Transaction::Piece& piece = t.pieces[t.next_piece];
    if (t.next_message == 0 && piece.frame) Begin(order, t, t.next_piece);
    Transaction::Piece::Message& message = piece.messages[t.next_message];
    out.message = message.bytes;
    if (++t.next_message == piece.messages.size()) {
      ++t.next_piece;
      t.next_message = 0;
    }
    Sent(&out.message);
    out.sequence = message.sequence = sequence_;
    if (t.first_sequence == 0) t.first_sequence = sequence_;
    return out;
  }
  t.reported_drops = std::exchange(unreported_drops_, 0);
  out.message = EncodeCommit({.frame_id = t.frame_id,
                              .send_time_ns = now_ns,
                              .present_at_ns = t.present_at_ns,
                              .must_show = t.must_show,
                              .durable = t.durable,
                              .client_drops = t.reported_drops});
  Sent(&out.message);
  out.sequence = sequence_;
  if (t.first_sequence == 0) t.first_sequence = sequence_;
  t.commit_sequence = sequence_;
  waiting_bytes_ -= BytesOf(t);
  queue_.erase(queue_.begin());
  unanswered_.emplace(order, transaction);
  orders_[t.frame_id] = order;
  by_commit_sequence_[t.commit_sequence] = order;
  out.committed = transaction;
  return out;
}

std::optional<Rope> Outbox::Ping(int64_t now_ns) {
  if (!has_credit()) return std::nullopt;
  Rope ping = EncodePing(now_ns);
  Sent(&ping);
  return ping;
}

void Outbox::Scheduled(uint64_t frame_id) {
  const auto it = orders_.find(frame_id);
  if (it != orders_.end()) unanswered_.at(it->second)->scheduled = true;
}

std::shared_ptr<const Transaction> Outbox::Refused(uint64_t sequence, const std::string& layer,
                                                   const std::string& id, bool applied) {
  std::shared_ptr<Transaction> transaction;
  if (const auto it = by_commit_sequence_.lower_bound(sequence); it != by_commit_sequence_.end()) {
    transaction = unanswered_.at(it->second);
  } else if (!queue_.empty()) {
    transaction = queue_.begin()->second;
  }
  if (transaction == nullptr || transaction->first_sequence == 0 ||
      sequence < transaction->first_sequence) {
    return nullptr;
  }
  if (!applied && transaction->refused.size() < kMostRefused)
    transaction->refused.insert({sequence, layer, id});
  return transaction;
}

std::shared_ptr<const Transaction> Outbox::Answered(uint64_t frame_id) {
  const auto it = orders_.find(frame_id);
  if (it == orders_.end()) return nullptr;
  const auto at = unanswered_.find(it->second);
  std::shared_ptr<const Transaction> transaction = at->second;
  by_commit_sequence_.erase(transaction->commit_sequence);
  unanswered_.erase(at);
  orders_.erase(it);
  return transaction;
}

std::vector<Drop> Outbox::TakeDrops() { return std::exchange(drops_, {}); }

}  // namespace voxeld::client
