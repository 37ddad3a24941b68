#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "display/sync/clock.h"
#include "tools/recording/mcap.h"
#include "tools/recording/scene_recording.h"
#include "tools/voxelctl/record/playback.h"
#include "tools/voxelctl/record/record.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

absl::Status Escaped(const absl::Status& status) {
  return {status.code(), EscapeForTerminal(status.message())};
}

// One run through the file, and what it has put up.
class Run {
 public:
  Run(const ReplayOptions& options, const recording::McapSummary& summary, Connection& connection,
      Interrupt& interrupt, std::istream& in, Console& console)
      : options_(options),
        summary_(summary),
        connection_(connection),
        interrupt_(interrupt),
        in_(in),
        console_(console),
        from_ns_(static_cast<uint64_t>(options.from_s * sync::kSecond)) {}

  absl::Status Begin() {
    absl::StatusOr<std::unique_ptr<Playback>> playback =
        Playback::Begin({.client_name = "voxelctl replay", .keep = options_.keep}, connection_);
    if (!playback.ok()) return playback.status();
    playback_ = *std::move(playback);
    began_ = clock_.Now();
    return absl::OkStatus();
  }

  absl::Status Take(const recording::ChangeSet& set) {
    const uint64_t at = set.time_ns - std::min(set.time_ns, summary_.start_ns);
    if (at < from_ns_) {
      playback_->Skip(set.changes);
      return absl::OkStatus();
    }
    if (absl::Status status = Await(at); !status.ok()) return status;
    const absl::StatusOr<uint64_t> snapshot = playback_->Put(set.changes);
    if (!snapshot.ok()) return snapshot.status();
    for (const v1::Issue& issue : playback_->TakeIssues()) {
      if (++issues_ > kMostSaid || issue.applied()) continue;
      console_.Say(absl::StrCat("not as recorded: ", EscapeForTerminal(issue.layer()), " ",
                                EscapeForTerminal(issue.id()), ": ",
                                EscapeForTerminal(issue.message())));
    }
    return Tell(at, set.snapshot, *snapshot);
  }

  // With --step, after one more line: what is up goes then.
  absl::Status End() {
    if (options_.step) {
      if (absl::Status status = Await(0); !status.ok()) return status;
    }
    return playback_->End();
  }

 private:
  static constexpr size_t kMostSaid = 20;

  absl::Status Await(uint64_t at) {
    if (options_.step) {
      std::string line;
      if (!std::getline(in_, line)) return absl::CancelledError("standard input has ended");
      return interrupt_.requested() ? absl::CancelledError("interrupted") : absl::OkStatus();
    }
    const auto due =
        began_ + static_cast<sync::TimeNs>(static_cast<double>(at - from_ns_) / options_.speed);
    if (!interrupt_.WaitUntil(clock_, due)) return absl::OkStatus();
    return absl::CancelledError("interrupted");
  }

  absl::Status Tell(uint64_t at, uint64_t recorded, uint64_t now) {
    if (console_.json()) {
      const nlohmann::ordered_json line = {
          {"time_ns", at}, {"recorded", recorded}, {"snapshot", now}};
      if (!console_.Data(line.dump() + "\n")) return absl::CancelledError("nobody reads any more");
      return absl::OkStatus();
    }
    const double length = static_cast<double>(summary_.end_ns - summary_.start_ns);
    console_.ProgressBar("replaying", length == 0 ? 1 : static_cast<double>(at) / length,
                         absl::StrFormat("%.1f s", static_cast<double>(at) / sync::kSecond));
    return absl::OkStatus();
  }

  const ReplayOptions& options_;
  const recording::McapSummary& summary_;
  Connection& connection_;
  Interrupt& interrupt_;
  std::istream& in_;
  Console& console_;
  const uint64_t from_ns_;
  sync::SystemClock clock_;
  sync::TimeNs began_ = 0;
  std::unique_ptr<Playback> playback_;
  size_t issues_ = 0;
};

}  // namespace

absl::Status Replay(const ReplayOptions& options, Connection& connection, Interrupt& interrupt,
                    std::istream& in, Console& console) {
  auto opened = recording::McapReader::Open(options.file);
  if (!opened.ok()) return Escaped(opened.status());
  recording::McapReader& reader = **opened;
  console.Progress(absl::StrCat("reading  ", EscapeForTerminal(options.file)));
  const absl::StatusOr<recording::McapSummary> summary = reader.Summarise();
  console.EndProgress();
  if (!summary.ok()) return Escaped(summary.status());
  if (!summary->whole) {
    console.Say(absl::StrCat(EscapeForTerminal(options.file),
                             " was cut off; it is replayed up to its last whole part"));
  }
  const double seconds = static_cast<double>(summary->end_ns - summary->start_ns) / 1e9;
  if (options.from_s > seconds) {
    return absl::InvalidArgumentError(
        absl::StrFormat("--from is %g s, and the recording has %g s", options.from_s, seconds));
  }
  do {
    reader.Rewind();
    Run run(options, *summary, connection, interrupt, in, console);
    if (absl::Status status = run.Begin(); !status.ok()) return status;
    absl::Status wrong;
    absl::Status read = recording::ReadScene(reader, [&](recording::ChangeSet set) {
      wrong = run.Take(set);
      return wrong.ok();
    });
    console.EndProgress();
    if (!wrong.ok()) return wrong;
    if (!read.ok()) return Escaped(read);
    if (absl::Status status = run.End(); !status.ok()) return status;
  } while (options.loop);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
