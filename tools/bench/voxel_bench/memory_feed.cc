#include "tools/bench/voxel_bench/memory_feed.h"

#include <utility>

#include "tools/bench/voxel_bench/local_socket.h"

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kTakeLimit = 60 * sync::kSecond;
constexpr size_t kRangeAlignment = 4;

// Moves the payload to the end of `memory`.
void Move(std::string* payload, v1::MemoryRange* range, uint64_t id, std::string& memory) {
  memory.resize((memory.size() + kRangeAlignment - 1) / kRangeAlignment * kRangeAlignment);
  range->set_memory(id);
  range->set_offset(memory.size());
  range->set_size(payload->size());
  memory += *payload;
}

v1::Open OpenAsked() {
  v1::Open open;
  open.set_client_name("voxel-bench ingest");
  open.set_no_outcomes(true);
  return open;
}

class MemoryFeed final : public Feed {
 public:
  MemoryFeed(Loop& loop, const std::string& target, const std::vector<v1::StreamRequest>& batches,
             MemoryUse use)
      : loop_(loop), connection_(target), session_(loop, connection_, OpenAsked()), use_(use) {
    for (const v1::StreamRequest& batch : batches) {
      Named named = InMemory(batch, frames_.size() + 1);
      frames_.push_back({Message(named.request), std::move(named.memory)});
    }
  }

  absl::Status Begin() {
    if (absl::Status opened = session_.WaitOpened(); !opened.ok()) return opened;
    const v1::Opened& opened = session_.opened();
    if (opened.local_socket().empty()) {
      return absl::UnimplementedError("the daemon offers no local socket");
    }
    absl::StatusOr<std::unique_ptr<LocalSocket>> socket =
        LocalSocket::Connect(opened.local_socket(), opened.local_token());
    if (!socket.ok()) return socket.status();
    socket_ = *std::move(socket);
    return absl::OkStatus();
  }

  absl::StatusOr<Fed> Round(sync::TimeNs duration) override {
    Fed fed;
    const uint64_t accepted = session_.tally().accepted;
    const sync::TimeNs begin = Now();
    while (Now() - begin < duration) {
      if (absl::Status sent = SendFrame(); !sent.ok()) return sent;
      fed.bytes += frames_[(session_.tally().sent - 1) % frames_.size()].memory.size();
    }
    absl::Status taken = Await([this] { return Unanswered() == 0; });
    if (!taken.ok()) return taken;
    fed.frames = session_.tally().accepted - accepted;
    fed.took_ns = Now() - begin;
    if (session_.tally().Sound()) return fed;
    return absl::FailedPreconditionError("the daemon refused what it was sent");
  }

 private:
  struct Frame {
    Message message;
    std::string memory;
    bool held = false;
  };

  uint64_t Unanswered() const { return session_.tally().sent - session_.tally().answered(); }

  absl::Status SendFrame() {
    const size_t index = session_.tally().sent % frames_.size();
    Frame& frame = frames_[index];
    // The commit that named this memory before has been answered, so nothing reads the memory now.
    absl::Status waited =
        Await([this] { return session_.Ready() && Unanswered() < frames_.size(); });
    if (!waited.ok()) return waited;
    if (frame.held && use_ == MemoryUse::kFresh) {
      if (absl::Status released = socket_->Release(index + 1); !released.ok()) return released;
      frame.held = false;
    }
    if (!frame.held) {
      if (absl::Status held = socket_->Hold(index + 1, frame.memory); !held.ok()) return held;
      frame.held = true;
    }
    session_.Send(frame.message, true);
    waited = Await([this] { return session_.Ready(); });
    if (waited.ok()) session_.Commit(Now());
    return waited;
  }

  absl::Status Await(absl::FunctionRef<bool()> done) {
    const absl::Status ran =
        loop_.RunUntil(Now() + kTakeLimit, [&] { return done() || !session_.status().ok(); });
    return session_.status().ok() ? ran : session_.status();
  }

  Loop& loop_;
  Connection connection_;
  Session session_;
  const MemoryUse use_;
  std::vector<Frame> frames_;
  std::unique_ptr<LocalSocket> socket_;
};

}  // namespace

Named InMemory(v1::StreamRequest batch, uint64_t memory_id) {
  Named out;
  for (v1::Upsert& upsert : *batch.mutable_batch()->mutable_upserts()) {
    v1::Vertices* vertices =
        upsert.mutable_entity()->mutable_primitive()->mutable_segments()->mutable_vertices();
    Move(vertices->mutable_positions(), vertices->mutable_positions_in(), memory_id, out.memory);
    vertices->clear_positions();
    if (!vertices->indices().empty()) {
      Move(vertices->mutable_indices(), vertices->mutable_indices_in(), memory_id, out.memory);
      vertices->clear_indices();
    }
    if (!vertices->colors().empty()) {
      Move(vertices->mutable_colors(), vertices->mutable_colors_in(), memory_id, out.memory);
      vertices->clear_colors();
    }
  }
  out.request = std::move(batch);
  return out;
}

absl::StatusOr<std::unique_ptr<Feed>> FeedMemory(Loop& loop, const std::string& target,
                                                 const std::vector<v1::StreamRequest>& batches,
                                                 MemoryUse use) {
  auto feed = std::make_unique<MemoryFeed>(loop, target, batches, use);
  if (absl::Status begun = feed->Begin(); !begun.ok()) return begun;
  return feed;
}

}  // namespace voxeld::bench
