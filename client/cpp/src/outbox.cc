#include "client/cpp/src/outbox.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"

namespace voxeld::client {
namespace {

// About what a Commit has on the wire.
constexpr size_t kCommitBytes = 48;

size_t BytesOf(const Transaction& transaction) {
  size_t bytes = kCommitBytes;
  for (const Transaction::Piece& piece : transaction.pieces) {
    if (!piece.dropped) bytes += piece.bytes;
  }
  return bytes;
}

// The operation that the frame piece stands for is as if it had not been asked for.
void ForgetFrame(size_t piece, Transaction* transaction) {
  const auto nth = std::count_if(transaction->pieces.begin(),
                                 transaction->pieces.begin() + static_cast<ptrdiff_t>(piece),
                                 [](const Transaction::Piece& before) { return before.frame; });
  ptrdiff_t seen = 0;
  for (Operation& operation : transaction->operations) {
    auto* frame = std::get_if<FrameOperation>(&operation);
    if (frame != nullptr && seen++ == nth) *frame = {};
  }
}

bool Droppable(const Transaction& transaction, const Transaction::Piece& piece) {
  return piece.frame && !piece.dropped && transaction.present_at_ns == 0;
}

}  // namespace

std::shared_ptr<Transaction> MakeTransaction(std::vector<Operation> operations,
                                             const CommitOptions& options) {
  auto transaction = std::make_shared<Transaction>();
  transaction->present_at_ns = options.present_at_ns;
  transaction->must_show = options.must_show;
  Batcher batcher;
  Transaction::Piece plain;
  const auto take_batches = [&batcher](Transaction::Piece* piece) {
    for (Rope& message : batcher.Take()) {
      piece->bytes += message.size();
      piece->messages.push_back(std::move(message));
    }
  };
  const auto add = [](Rope message, Transaction::Piece* piece) {
    piece->bytes += message.size();
    piece->messages.push_back(std::move(message));
  };
  for (const Operation& operation : operations) {
    if (const auto* upsert = std::get_if<UpsertOperation>(&operation)) {
      batcher.Add(*upsert);
      continue;
    }
    take_batches(&plain);
    const auto* frame = std::get_if<FrameOperation>(&operation);
    if (frame == nullptr) {
      add(EncodeOperation(operation), &plain);
      continue;
    }
    if (!plain.messages.empty()) transaction->pieces.push_back(std::exchange(plain, {}));
    Transaction::Piece piece;
    piece.frame = true;
    piece.layer = frame->layer;
    add(EncodeFrameBegin(frame->layer), &piece);
    for (const UpsertOperation& upsert : frame->upserts) batcher.Add(upsert);
    take_batches(&piece);
    add(EncodeFrameEnd(frame->layer), &piece);
    transaction->pieces.push_back(std::move(piece));
  }
  take_batches(&plain);
  if (!plain.messages.empty()) transaction->pieces.push_back(std::move(plain));
  transaction->operations = std::move(operations);
  return transaction;
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
  for (const auto& [layer, waiting] : frames_) {
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

void Outbox::StreamOpened(uint64_t open_bytes, uint64_t credit_bytes) {
  open_ = true;
  sent_ = open_bytes;
  credit_ = credit_bytes;
  // What was sent before and was not applied is like all the rest from now on.
  frames_.clear();
  for (const auto& [order, transaction] : queue_) {
    transaction->first_sequence = transaction->commit_sequence = 0;
    NoteFrames(order, *transaction);
  }
  if (keep_frames_ == 0) return;
  std::vector<std::string> layers;
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
  frames_.clear();
  waiting_bytes_ = 0;
  for (const auto& [order, transaction] : all) {
    transaction->next_piece = transaction->next_message = 0;
    unreported_drops_ += std::exchange(transaction->reported_drops, 0);
    transaction->scheduled = false;
    queue_.emplace(order, transaction);
    waiting_bytes_ += BytesOf(*transaction);
    // What was sent whole may have been applied: nothing of it is given up before that is known.
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
    if (it->second.size() < 2) continue;  // the newest of a layer stays
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
  if (t.next_piece < t.pieces.size()) {
    const Transaction::Piece& piece = t.pieces[t.next_piece];
    if (t.next_message == 0 && piece.frame) Begin(order, t, t.next_piece);
    out.message = piece.messages[t.next_message];
    if (++t.next_message == piece.messages.size()) {
      ++t.next_piece;
      t.next_message = 0;
    }
    Sent(&out.message);
    out.sequence = sequence_;
    if (t.first_sequence == 0) t.first_sequence = sequence_;
    return out;
  }
  t.reported_drops = std::exchange(unreported_drops_, 0);
  out.message = EncodeCommit({.frame_id = t.frame_id,
                              .send_time_ns = now_ns,
                              .present_at_ns = t.present_at_ns,
                              .must_show = t.must_show,
                              .client_drops = t.reported_drops});
  Sent(&out.message);
  out.sequence = sequence_;
  if (t.first_sequence == 0) t.first_sequence = sequence_;
  t.commit_sequence = sequence_;
  waiting_bytes_ -= BytesOf(t);
  queue_.erase(queue_.begin());
  unanswered_.emplace(order, transaction);
  orders_[t.frame_id] = order;
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

std::shared_ptr<const Transaction> Outbox::Answered(uint64_t frame_id) {
  const auto it = orders_.find(frame_id);
  if (it == orders_.end()) return nullptr;
  const auto at = unanswered_.find(it->second);
  std::shared_ptr<const Transaction> transaction = at->second;
  unanswered_.erase(at);
  orders_.erase(it);
  return transaction;
}

std::vector<Drop> Outbox::TakeDrops() { return std::exchange(drops_, {}); }

}  // namespace voxeld::client
