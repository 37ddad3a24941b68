// A stream to the scene: it opens the stream, respects its credit and counts its commits and
// outcomes; and a sender that feeds it with frames.
//
// Bound to its loop's thread.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "tools/bench/voxel_bench/credit.h"
#include "tools/bench/voxel_bench/tally.h"
#include "tools/bench/voxel_bench/wire.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

class Session {
 public:
  Session(Loop& loop, const Connection& connection, const v1::Open& open);

  // Sets the callbacks that run whenever something may be sent, and for each receipt. Requires: set
  // before WaitOpened.
  void OnReady(std::function<void()> ready) { ready_ = std::move(ready); }
  void OnReceipt(std::function<void(const v1::Receipt&)> receipt) { receipt_ = std::move(receipt); }

  // Errors: FailedPrecondition if the daemon's clock is not this process's clock, because then the
  // daemon's times could not be compared.
  absl::Status WaitOpened();
  // Waits until every commit has its answer and its outcomes.
  absl::Status WaitSettled(sync::TimeNs limit);

  bool Ready() const { return opened_ && call_.writable() && credit_.MaySend(); }
  // Requires: the session is ready. With `more`, another Send follows as soon as this one is
  // written.
  void Send(const Message& message, bool more = false);
  // Sends a commit. Returns: its number, from 1. Requires: the session is ready.
  uint64_t Commit(sync::TimeNs sent_ns, uint64_t client_drops = 0);
  // Returns the bytes of a commit; they depend only on the arguments.
  static Message CommitMessage(uint64_t frame_id, sync::TimeNs sent_ns, uint64_t client_drops = 0);

  const v1::Opened& opened() const { return *opened_; }
  const Tally& tally() const { return tally_; }
  const Credit& credit() const { return credit_; }
  // Returns why the session ended, or the first refusal; Ok as long as there is neither.
  const absl::Status& status() const { return status_; }
  Call& call() { return call_; }

 private:
  void OnMessage(std::string_view bytes);
  void OnWritable();

  Loop& loop_;
  const v1::Open open_;
  std::function<void()> ready_;
  std::function<void(const v1::Receipt&)> receipt_;
  std::optional<v1::Opened> opened_;
  sync::TimeNs asked_ns_ = 0, opened_ns_ = 0;
  bool asked_ = false;
  Credit credit_;
  Tally tally_;
  absl::Status status_;
  Call call_;
};

// Sends frames; each consists of some messages and a commit.
class FrameSender {
 public:
  enum class WhenBehind : uint8_t {
    kWait,    // every frame is sent, in order
    kLatest,  // only the newest that has not begun is sent; the others are dropped and reported
  };

  // `frames` are sent cyclically and must not be empty. Feeds `session` whenever it is ready. Both
  // must live as long as events may come. With `gather`, a frame's messages may be flushed together
  // with its commit.
  FrameSender(Session& session, std::vector<std::vector<Message>> frames, WhenBehind when_behind,
              bool gather = true);

  // Declares that `count` frames are due.
  void Due(uint64_t count = 1);
  // If `endless`, a frame is due from now on whenever the previous one has been sent.
  void SetEndless(bool endless);

  bool idle() const { return waiting_ == 0 && part_ == 0; }
  uint64_t dropped() const { return dropped_; }
  uint64_t begun() const { return begun_; }
  // Returns when the first byte of a frame was passed on.
  sync::TimeNs SentAt(uint64_t frame_id) const { return sent_ns_[frame_id - 1]; }

 private:
  void Pump();

  Session& session_;
  const std::vector<std::vector<Message>> frames_;
  const WhenBehind when_behind_;
  const bool gather_;
  bool endless_ = false;
  uint64_t waiting_ = 0;  // due, not begun
  size_t part_ = 0;       // of the frame that has begun; 0: none
  uint64_t begun_ = 0, dropped_ = 0, untold_ = 0;
  std::vector<sync::TimeNs> sent_ns_;  // by frame id - 1
};

}  // namespace voxeld::bench
