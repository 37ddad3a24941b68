// What waits to be sent, in order: commits with what they hold, under the flow policy and the credit.
// Knows no time, no thread and no gRPC.
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

// One commit and all that takes effect with it.
struct Transaction {
  // Whole messages without sequences; `frame`: they are an immediate frame of `layer`, which may be
  // given up as long as none of them was sent.
  struct Piece {
    struct Message {
      Rope bytes;
      size_t operations = 0;  // that it carries, as Refusals counts them
      uint64_t sequence = 0;  // that it was sent with
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
  bool restores = false;  // puts up what was there before, and nothing that anybody asked for
  std::vector<Operation> operations;  // for the book of what is retained; given up frames are empty
  std::vector<Piece> pieces;

  // The outbox's own.
  size_t next_piece = 0, next_message = 0;  // to be sent
  uint64_t first_sequence = 0, commit_sequence = 0;
  uint64_t reported_drops = 0;
  bool scheduled = false;  // the server keeps it for its time
  // (sequence, layer, id) as the server told them.
  std::set<std::tuple<uint64_t, std::string, std::string>> refused;

  Refusals GetRefusals() const;
  size_t LargestMessage() const;  // of what is not given up, with its sequence
};

// Encodes `operations` in their order. Messages have at most `most_bytes`, but for operations that take
// more alone; 0: any number.
std::shared_ptr<Transaction> MakeTransaction(std::vector<Operation> operations,
                                             const CommitOptions& options, size_t most_bytes = 0);

// An operation that takes a message of more than the server reads.
struct Oversized {
  Operation operation;
  std::string what;  // "layer/id takes a message of 20000000 bytes; the server's max_…"
};
// Takes them out of `operations`.
std::vector<Oversized> TakeOversized(size_t most_bytes, std::vector<Operation>* operations);

// Frames given up of one commit; `whole`: nothing else was in it, and it will not be sent.
struct Drop {
  uint64_t frame_id = 0;
  uint64_t frames = 0;
  bool whole = false;
};

class Outbox {
 public:
  // `keep_frames`: how many of each layer may wait; 0: all.
  Outbox(uint64_t keep_frames, size_t buffer_bytes)
      : keep_frames_(keep_frames), buffer_bytes_(buffer_bytes) {}

  // Puts it at the end. ResourceExhausted if there is no room for it, whatever may be dropped; but an
  // empty outbox takes anything.
  absl::Status Add(std::shared_ptr<Transaction> transaction);
  // Puts them before everything else, in their order, whatever their size.
  void AddFirst(const std::vector<std::shared_ptr<Transaction>>& transactions);

  // Between StreamLost and StreamOpened: what waits is encoded anew for messages of at most `most_bytes`.
  // What holds an operation that takes more alone is taken out and returned, with the reason.
  std::vector<std::pair<std::shared_ptr<const Transaction>, std::string>> KeepTo(size_t most_bytes);
  // The same time: restoring begins anew.
  void DropRestores();

  // A stream was opened with an Open of `open_bytes`; `credit_bytes`: 0 means that there is no pacing.
  void StreamOpened(uint64_t open_bytes, uint64_t credit_bytes);
  void Credit(uint64_t credit_bytes);
  // What was sent and not answered comes back to its place, in front. What was scheduled for a time that has
  // passed (`server_now`) does not: its frame ids are returned.
  std::vector<uint64_t> StreamLost(std::optional<int64_t> server_now);
  // Between StreamLost and StreamOpened: commits up to this sequence were applied by the session that
  // was taken up. They are forgotten, and returned.
  std::vector<std::shared_ptr<const Transaction>> Applied(uint64_t last_sequence);

  struct Outgoing {
    Rope message;
    uint64_t frame_id = 0;
    uint64_t sequence = 0;
    std::shared_ptr<const Transaction> committed;  // not null: this is its Commit
  };
  // What is to be written now, which counts as sent; nothing if nothing may be.
  std::optional<Outgoing> Next(int64_t now_ns);
  // What was to be written had so many bytes less.
  void Saved(uint64_t bytes) { sent_ -= bytes; }
  // The same for a ping, which goes before everything.
  std::optional<Rope> Ping(int64_t now_ns);

  void Scheduled(uint64_t frame_id);
  // An operation of the request `sequence` has an Issue: it was refused, unless `applied`. Of which commit: null if it is not
  // known (any more). Its frame id is all that is known of one that is being sent.
  std::shared_ptr<const Transaction> Refused(uint64_t sequence, const std::string& layer,
                                             const std::string& id, bool applied = false);
  // Accepted or refused: it is forgotten. Null if it is not known.
  std::shared_ptr<const Transaction> Answered(uint64_t frame_id);

  // What was given up since the last call.
  std::vector<Drop> TakeDrops();

  bool has_credit() const { return open_ && (credit_ == 0 || sent_ < credit_); }
  bool empty() const { return queue_.empty(); }  // nothing waits
  size_t waiting_bytes() const { return waiting_bytes_; }
  uint64_t sent_bytes() const { return sent_; }  // since Open, with it
  // The next number, for a request that does not come from here. They ascend over all streams.
  uint64_t TakeSequence() { return ++sequence_; }

 private:
  using Queue = std::map<int64_t, std::shared_ptr<Transaction>>;
  struct WaitingFrame {
    int64_t order;
    size_t piece;
  };

  void Wait(int64_t order, const std::shared_ptr<Transaction>& transaction);
  void NoteFrames(int64_t order, const Transaction& transaction);
  // Of the waiting frames that may go when `coming` has come.
  size_t DroppableBytes(const Transaction& coming) const;
  // Gives up the oldest frames of `layer` until `most` wait.
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
  Queue queue_;                                     // by their order; the first may be sent in part
  Queue unanswered_;                                // sent whole
  std::map<uint64_t, int64_t> orders_;              // of the unanswered, by frame id
  std::map<uint64_t, int64_t> by_commit_sequence_;  // of the unanswered → their order
  // Whole frames that wait and may be dropped, oldest first.
  std::map<std::string, std::deque<WaitingFrame>> frames_;
  std::vector<Drop> drops_;
};

}  // namespace voxeld::client
