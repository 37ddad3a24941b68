#include "tools/bench/voxel_bench/feed.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kTakeLimit = 60 * sync::kSecond;

class DaemonFeed final : public Feed {
 public:
  DaemonFeed(Loop& loop, const Target& target, Frames frames, Flush flush)
      : loop_(loop),
        connection_(target),
        session_(loop, connection_, OpenAsked()),
        sender_(session_, std::move(frames), FrameSender::WhenBehind::kWait,
                flush == Flush::kEachFrame) {}

  absl::Status WaitOpened() { return session_.WaitOpened(); }

  absl::StatusOr<Fed> Round(sync::TimeNs duration) override {
    const Tally before = session_.tally();
    const uint64_t sent = session_.credit().sent();
    const sync::TimeNs begin = Now();
    sender_.SetEndless(true);
    const absl::Status ran = loop_.RunUntil(
        kTakeLimit + begin, [&] { return Now() - begin >= duration || !session_.status().ok(); });
    sender_.SetEndless(false);
    if (!session_.status().ok()) return session_.status();
    if (!ran.ok()) return ran;
    const absl::Status taken = loop_.RunUntil(Now() + kTakeLimit, [this] {
      const Tally& tally = session_.tally();
      return !session_.status().ok() || (sender_.idle() && tally.answered() == tally.sent);
    });
    if (!session_.status().ok()) return session_.status();
    if (!taken.ok()) return taken;
    const Fed fed{session_.tally().accepted - before.accepted, session_.credit().sent() - sent,
                  Now() - begin};
    if (!session_.tally().Sound()) {
      return absl::FailedPreconditionError("the daemon refused what it was sent");
    }
    return fed;
  }

 private:
  static v1::Open OpenAsked() {
    v1::Open open;
    open.set_client_name("voxel-bench ingest");
    open.set_no_outcomes(true);
    return open;
  }

  Loop& loop_;
  Connection connection_;
  Session session_;
  FrameSender sender_;
};

class SinkFeed final : public Feed {
 public:
  SinkFeed(Loop& loop, const std::string& target, Frames frames, Flush flush)
      : loop_(loop), connection_(target), frames_(std::move(frames)), flush_(flush) {}

  absl::StatusOr<Fed> Round(sync::TimeNs duration) override {
    Fed fed;
    size_t part = 0;
    std::optional<uint64_t> counted;
    std::optional<absl::Status> ended;
    sync::TimeNs begin = 0;
    std::unique_ptr<Call> call;
    const auto write = [&] {
      if (begin == 0) begin = Now();
      const std::vector<Message>& frame = frames_[fed.frames % frames_.size()];
      if (part == 0 && Now() - begin >= duration) return call->WritesDone();
      const bool commit = part == frame.size();
      const Message message = commit ? Session::CommitMessage(fed.frames + 1, Now()) : frame[part];
      part = commit ? 0 : part + 1;
      if (commit) ++fed.frames;
      fed.bytes += message.bytes();
      call->Write(message, !commit && flush_ == Flush::kEachFrame);
    };
    call = std::make_unique<Call>(
        loop_, connection_, "/voxeld.v1.SceneService/Stream",
        CallEvents{.writable = write,
                   .message =
                       [&](std::string_view bytes) {
                         v1::StreamResponse response;
                         response.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
                         counted = response.credit_bytes();
                         fed.took_ns = Now() - begin;
                       },
                   .ended = [&](const absl::Status& status) { ended = status; }});
    const absl::Status ran =
        loop_.RunUntil(Now() + duration + kTakeLimit, [&] { return ended.has_value(); });
    if (!ran.ok()) return ran;
    if (!ended->ok()) return *ended;
    if (counted != fed.bytes) {
      return absl::DataLossError(absl::StrCat("the sink counted ", counted.value_or(0),
                                              " bytes of ", fed.bytes, " that were sent"));
    }
    return fed;
  }

 private:
  Loop& loop_;
  Connection connection_;
  const Frames frames_;
  const Flush flush_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Feed>> FeedDaemon(Loop& loop, const Target& target, Frames frames,
                                                 Flush flush) {
  auto feed = std::make_unique<DaemonFeed>(loop, target, std::move(frames), flush);
  if (absl::Status opened = feed->WaitOpened(); !opened.ok()) return opened;
  return feed;
}

std::unique_ptr<Feed> FeedSink(Loop& loop, const std::string& target, Frames frames, Flush flush) {
  return std::make_unique<SinkFeed>(loop, target, std::move(frames), flush);
}

}  // namespace voxeld::bench
