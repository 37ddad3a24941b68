// The queue of commits to send, in order, subject to the flow policy and the credit. It depends on
// no clock, thread or gRPC.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "client/cpp/src/operation.h"
#include "client/cpp/src/wire.h"
#include "voxeld/client.h"

namespace voxeld::client {

// One commit and all operations that take effect with it.
struct Transaction {
  // Complete messages without sequences; with `frame` set, they are an immediate frame of `layer`,
  // which may be dropped as long as none of them was sent.
  struct Piece {
    struct Message {
      Rope bytes;
      size_t operations = 0;  // number of operations in it, counted as in Refusals
      uint64_t sequence = 0;  // sequence with which it was sent
    };
    std::vector<Message> messages;
    bool frame = false;
    std::string layer;
    size_t bytes = 0;
    bool dropped = false;
  };
  uint64_t frame_id = 0;
  int64_t present_at_ns = 0;
  bool must_show = false;
  bool durable = false;
  bool restores = false;  // restores former state, and contains nothing that the caller requested
  std::vector<Operation> operations;  // for the retained book; dropped frames are empty
  std::vector<Piece> pieces;

  // The following members belong to the outbox.
  size_t next_piece = 0, next_message = 0;  // next to send
  uint64_t first_sequence = 0, commit_sequence = 0;
  uint64_t reported_drops = 0;
  bool scheduled = false;  // the server holds it until its present_at
  // (sequence, layer, id) as the server reported them.
  std::set<std::tuple<uint64_t, std::string, std::string>> refused;

  Refusals GetRefusals() const;
  size_t LargestMessage() const;  // of messages not dropped, including the sequence
};

// Encodes `operations` in their order. Messages have at most `most_bytes`, except for single
// operations that need more; 0: no limit.
std::shared_ptr<Transaction> MakeTransaction(std::vector<Operation> operations,
                                             const CommitOptions& options, size_t most_bytes = 0);

// An operation that needs a larger message than the server reads.
struct Oversized {
  Operation operation;
  std::string what;  // "layer/id takes a message of 20000000 bytes; the server's max_…"
};
// Removes the oversized operations from `operations` and returns them.
std::vector<Oversized> TakeOversized(size_t most_bytes, std::vector<Operation>* operations);

// Dropped frames of one commit; `whole`: the commit held nothing else, and will not be sent.
struct Drop {
  uint64_t frame_id = 0;
  uint64_t frames = 0;
  bool whole = false;
};

class Outbox {
 public:
  // `keep_frames`: how many frames of each layer may wait; 0: all.
  Outbox(uint64_t keep_frames, size_t buffer_bytes)
      : keep_frames_(keep_frames), buffer_bytes_(buffer_bytes) {}

  // Appends a commit. Errors: ResourceExhausted if it does not fit even after dropping all frames
  // that may be dropped; but an empty outbox accepts any size.
  absl::Status Add(std::shared_ptr<Transaction> transaction);
  // Inserts commits before all others, in their order, whatever their size.
  void AddFirst(const std::vector<std::shared_ptr<Transaction>>& transactions);

  // Call between StreamLost and StreamOpened: encodes the waiting commits again for messages of at
  // most `most_bytes`. Commits with an operation that needs more are removed and returned, with the
  // reason.
  std::vector<std::pair<std::shared_ptr<const Transaction>, std::string>> KeepTo(size_t most_bytes);
  // Call at the same time: drops pending restores, because restoring starts again.
  void DropRestores();

  // A stream was opened with an Open of `open_bytes`. If `credit_bytes` is 0, flow control is
  // off.
  void StreamOpened(uint64_t open_bytes, uint64_t credit_bytes);
  void Credit(uint64_t credit_bytes);
  // Returns sent, unanswered commits to the front of the queue in their order. Commits scheduled
  // for a time that has passed (`server_now`) are not returned to it; the result is their frame
  // ids.
  std::vector<uint64_t> StreamLost(std::optional<int64_t> server_now);
  // Call between StreamLost and StreamOpened: the resumed session applied the commits up to this
  // sequence. They are removed from the outbox and returned.
  std::vector<std::shared_ptr<const Transaction>> Applied(uint64_t last_sequence);

  struct Outgoing {
    Rope message;
    uint64_t frame_id = 0;
    uint64_t sequence = 0;
    std::shared_ptr<const Transaction> committed;  // not null: this message is its Commit
  };
  // Returns the next message to write, which then counts as sent; nothing if none may be sent now.
  std::optional<Outgoing> Next(int64_t now_ns);
  // Reports that the message was written with so many bytes fewer.
  void Saved(uint64_t bytes) { sent_ -= bytes; }
  // The same for a ping, which goes before everything else.
  std::optional<Rope> Ping(int64_t now_ns);

  void Scheduled(uint64_t frame_id);
  // An operation of the request `sequence` has an Issue: it was refused, unless `applied`. Returns
  // its commit, or null if it is unknown or no longer known. For a commit that is still being sent,
  // only the frame id is valid.
  std::shared_ptr<const Transaction> Refused(uint64_t sequence, const std::string& layer,
                                             const std::string& id, bool applied = false);
  // The commit was accepted or refused: removes and returns it, or null if it is unknown.
  std::shared_ptr<const Transaction> Answered(uint64_t frame_id);

  // Returns the frames dropped since the last call.
  std::vector<Drop> TakeDrops();

  bool has_credit() const { return open_ && (credit_ == 0 || sent_ < credit_); }
  bool empty() const { return queue_.empty(); }  // nothing waits
  size_t waiting_bytes() const { return waiting_bytes_; }
  uint64_t sent_bytes() const { return sent_; }  // since Open, including it
  // Returns the next sequence, for a request made elsewhere. Sequences ascend over all streams.
  uint64_t TakeSequence() { return ++sequence_; }

 private:
  using Queue = std::map<int64_t, std::shared_ptr<Transaction>>;
  struct WaitingFrame {
    int64_t order;
    size_t piece;
  };

  void Wait(int64_t order, const std::shared_ptr<Transaction>& transaction);
  void NoteFrames(int64_t order, const Transaction& transaction);
  // Bytes of the waiting frames that may be dropped once `coming` is added.
  size_t DroppableBytes(const Transaction& coming) const;
  // Drops the oldest frames of `layer` until `most` wait.
  void KeepNewest(const std::string& layer, size_t most);
  void DropFrame(const WaitingFrame& frame);
  bool DropOldestOfAny();
  void Begin(int64_t order, const Transaction& transaction, size_t piece);
  void Sent(Rope* message);

  const uint64_t keep_frames_;
  const size_t buffer_bytes_;
  bool open_ = false;
  uint64_t credit_ = 0, sent_ = 0;
  uint64_t sequence_ = 0;
  int64_t next_order_ = 1;
  uint64_t unreported_drops_ = 0;
  size_t waiting_bytes_ = 0;
  Queue queue_;                                     // by their order; the first may be partly sent
  Queue unanswered_;                                // completely sent
  std::map<uint64_t, int64_t> orders_;              // of unanswered commits, by frame id
  std::map<uint64_t, int64_t> by_commit_sequence_;  // of unanswered commits → their order
  // Complete waiting frames that may be dropped, oldest first.
  std::map<std::string, std::deque<WaitingFrame>> frames_;
  std::vector<Drop> drops_;
};

}  // namespace voxeld::client
