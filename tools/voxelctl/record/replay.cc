#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/recording/mcap.h"
#include "tools/recording/scene_recording.h"
#include "tools/voxelctl/connection/owned_layers.h"
#include "tools/voxelctl/record/playback.h"
#include "tools/voxelctl/record/record.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

absl::Status Escaped(const absl::Status& status) {
  return {status.code(), EscapeForTerminal(status.message())};
}

std::string Announcement(const ReplayOptions& options, double seconds) {
  const double left = seconds - options.from_s;
  std::string text = absl::StrCat("replays ", EscapeForTerminal(options.file), ", ");
  if (seconds <= 0) {
    absl::StrAppend(&text, "one state of a scene");
  } else if (options.step) {
    absl::StrAppendFormat(&text, "%.1f s, a change for each line of standard input", left);
  } else {
    absl::StrAppendFormat(&text, "%.1f s", left / options.speed);
  }
  if (options.speed != 1 && !options.step && seconds > 0) {
    absl::StrAppendFormat(&text, " at %g times its speed", options.speed);
  }
  if (options.loop) absl::StrAppend(&text, ", again and again until Ctrl-C");
  return text;
}

// One run through the file, and what it shows.
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
    const std::string name = RecordingName(options_.file);
    const std::string client_name = absl::StrCat("voxelctl replay ", name);
    absl::StatusOr<std::vector<OwnedLayer>> before = LayersLeftBy(client_name, connection_);
    if (!before.ok()) return before.status();
    absl::StatusOr<std::unique_ptr<Playback>> playback =
        Playback::Begin({.client_name = client_name,
                         .layer_prefix = absl::StrCat(name, ": "),
                         .keep = options_.keep},
                        connection_);
    if (!playback.ok()) return playback.status();
    playback_ = *std::move(playback);
    // With a token there is only one owner, in whose layers the same names reappear.
    const auto others = std::stable_partition(
        before->begin(), before->end(),
        [&](const OwnedLayer& layer) { return layer.owner == playback_->owner(); });
    before_.assign(others, before->end());
    before->erase(others, before->end());
    if (absl::Status status = TakeDown(*before, connection_).status(); !status.ok()) return status;
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
    ++changes_;
    if (absl::Status status = TakeBeforeDown(); !status.ok()) return status;
    for (const v1::Issue& issue : playback_->TakeIssues()) {
      if (++issues_ > kMostSaid || issue.applied()) continue;
      console_.Say(absl::StrCat("not as recorded: ", EscapeForTerminal(issue.layer()), " ",
                                EscapeForTerminal(issue.id()), ": ",
                                EscapeForTerminal(issue.message())));
    }
    return Tell(at, set.snapshot, *snapshot);
  }

  uint64_t changes() const { return changes_; }

  // With --step it waits for one more line before the contents are removed.
  absl::Status End() {
    if (options_.step) {
      if (absl::Status status = Await(0); !status.ok()) return status;
    }
    return playback_->End();
  }

 private:
  static constexpr size_t kMostSaid = 20;

  // Removes what a previous replay of the file has left, once its replacement is shown.
  absl::Status TakeBeforeDown() {
    if (before_.empty()) return absl::OkStatus();
    const absl::StatusOr<TakenDown> taken = TakeDown(std::exchange(before_, {}), connection_);
    if (!taken.ok()) return taken.status();
    if (!taken->stay.empty()) console_.Say(OthersStay(taken->stay));
    return absl::OkStatus();
  }

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
  std::vector<OwnedLayer> before_;
  size_t issues_ = 0;
  uint64_t changes_ = 0;
};

}  // namespace

absl::Status Replay(const ReplayOptions& options, const Connector& connect, Interrupt& interrupt,
                    std::istream& in, Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
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
  if (!console.json()) console.Say(Announcement(options, seconds));
  uint64_t changes = 0;
  sync::SystemClock clock;
  const sync::TimeNs began = clock.Now();
  const auto sum_up = [&] {
    if (console.json()) return;
    const std::string time =
        seconds <= 0 && !options.loop && !options.step
            ? ""
            : absl::StrFormat(" in %.1f s",
                              static_cast<double>(clock.Now() - began) / sync::kSecond);
    console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", Counted(changes, "change"),
                             time,
                             options.keep ? "; what is up stays until `voxelctl clear`"
                                          : "; it is down again, --keep would leave it up"));
  };
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
    changes += run.changes();
    if (absl::IsCancelled(wrong)) sum_up();
    if (!wrong.ok()) return wrong;
    if (!read.ok()) return Escaped(read);
    if (absl::Status status = run.End(); !status.ok()) return status;
  } while (options.loop);
  sum_up();
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
