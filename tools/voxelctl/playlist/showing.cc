#include "tools/voxelctl/playlist/showing.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/recording/scene_recording.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kLeastLength = 0.1;  // seconds; a shorter recording is not repeated
constexpr double kMostWait = 1e8;     // seconds

// The contents of a file.
struct Contents {
  bool changes = false;   // more than one state
  bool entities = false;  // in any of the states
};

// Reads as much as is needed to know. Errors: what is wrong with the file.
absl::StatusOr<Contents> ContentsOf(recording::McapReader& reader) {
  int sets = 0;
  Contents contents;
  absl::Status status = recording::ReadScene(reader, [&](const recording::ChangeSet& set) {
    contents.changes = ++sets > 1;
    contents.entities |= set.changes.entities_size() > 0;
    return !contents.changes || !contents.entities;
  });
  reader.Rewind();
  if (!status.ok()) return status;
  return contents;
}

// An opened file of an item, with everything that is needed to play it.
struct Opened {
  std::unique_ptr<recording::McapReader> reader;
  uint64_t start_ns = 0;
  double seconds = 0;
  bool still = false;
  bool empty = false;
};

absl::StatusOr<Opened> OpenItem(const PlaylistItem& item) {
  auto reader = recording::McapReader::Open(item.file);
  if (!reader.ok()) return reader.status();
  Opened opened{.reader = *std::move(reader)};
  const absl::StatusOr<recording::McapSummary> summary = opened.reader->Summarise();
  if (!summary.ok()) return summary.status();
  const double length =
      static_cast<double>(summary->end_ns - summary->start_ns) / sync::kSecond / item.speed;
  opened.start_ns = summary->start_ns;
  const absl::StatusOr<Contents> contents = ContentsOf(*opened.reader);
  if (!contents.ok()) return contents.status();
  opened.still = !contents->changes || length < kLeastLength;
  opened.empty = !contents->entities;
  if (opened.still && !item.seconds.has_value()) {
    return absl::InvalidArgumentError(
        absl::StrCat(item.file, " is one state of a scene; give its item seconds"));
  }
  opened.seconds = item.seconds.value_or(length);
  return opened;
}

}  // namespace

absl::Status CheckPlayable(const PlaylistItem& item) { return OpenItem(item).status(); }

Showing::Showing(const PlaylistItem& item, double opacity, Connection& connection,
                 sync::Clock& clock)
    : item_(item), connection_(connection), clock_(clock), opacity_(opacity) {}

absl::StatusOr<std::unique_ptr<Showing>> Showing::Begin(const PlaylistItem& item, double opacity,
                                                        Connection& connection,
                                                        sync::Clock& clock) {
  std::unique_ptr<Showing> showing(new Showing(item, opacity, connection, clock));
  absl::StatusOr<Opened> opened = OpenItem(item);
  if (!opened.ok()) return opened.status();
  showing->reader_ = std::move(opened->reader);
  showing->start_ns_ = opened->start_ns;
  showing->still_ = opened->still;
  showing->empty_ = opened->empty;
  showing->seconds_ = opened->seconds;
  showing->thread_ = std::thread([it = showing.get()] { it->Run(); });
  return showing;
}

Showing::~Showing() {
  {
    const sync::MutexLock lock(mutex_);
    stop_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
}

bool Showing::up() const {
  const sync::MutexLock lock(mutex_);
  return playback_ != nullptr;
}

absl::Status Showing::status() const {
  const sync::MutexLock lock(mutex_);
  return status_;
}

absl::Status Showing::SetOpacity(double opacity) {
  const sync::MutexLock lock(mutex_);
  opacity_ = opacity;
  return playback_ == nullptr ? absl::OkStatus() : playback_->SetOpacity(opacity);
}

bool Showing::AwaitOrStop(sync::TimeNs due) {
  const sync::MutexLock lock(mutex_);
  while (!stop_ && clock_.Now() < due) clock_.WaitUntil(mutex_, changed_, due);
  return !stop_;
}

void Showing::Run() {
  absl::Status status;
  do {
    status = PlayOnce();
  } while (status.ok());
  std::shared_ptr<Playback> last;
  {
    const sync::MutexLock lock(mutex_);
    status_ = status;
    last = std::exchange(playback_, nullptr);
  }
  if (last != nullptr) (void)last->End();  // it is ending anyway
}

// Plays the file once; Cancelled when it is to stop. The contents of the previous round are removed
// once the first state is shown.
absl::Status Showing::PlayOnce() {
  double opacity = 0;
  {
    const sync::MutexLock lock(mutex_);
    if (stop_) return absl::CancelledError("stopped");
    opacity = opacity_;
  }
  absl::StatusOr<std::unique_ptr<Playback>> begun =
      Playback::Begin({.client_name = "voxelctl playlist",
                       .layer_prefix = RecordingName(item_.file) + ": ",
                       .opacity = opacity},
                      connection_);
  if (!begun.ok()) return begun.status();
  const std::shared_ptr<Playback> playback = *std::move(begun);
  const sync::TimeNs began = clock_.Now();
  std::shared_ptr<Playback> before;
  bool first = true;
  absl::Status wrong;
  reader_->Rewind();
  const absl::Status read = recording::ReadScene(*reader_, [&](const recording::ChangeSet& set) {
    const auto at = static_cast<double>(set.time_ns - std::min(set.time_ns, start_ns_));
    if (!AwaitOrStop(began + static_cast<sync::TimeNs>(
                                 std::min(at / item_.speed, kMostWait * sync::kSecond)))) {
      wrong = absl::CancelledError("stopped");
      return false;
    }
    wrong = playback->Put(set.changes).status();
    if (wrong.ok() && std::exchange(first, false)) {
      const sync::MutexLock lock(mutex_);
      before = std::exchange(playback_, playback);
      // It was set while the first state was being sent.
      if (opacity_ != opacity) wrong = playback->SetOpacity(opacity_);
    }
    if (before != nullptr && wrong.ok()) wrong = std::exchange(before, nullptr)->End();
    return wrong.ok();
  });
  if (!wrong.ok()) return wrong;
  if (!read.ok()) return read;
  // A single state stays until it is stopped.
  if (still_) (void)AwaitOrStop(sync::kNever);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
