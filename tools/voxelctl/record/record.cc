#include "tools/voxelctl/record/record.h"

#include <chrono>
#include <condition_variable>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "tools/recording/scene_recording.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kTick = 200 * sync::kMillisecond;

uint64_t UnixNs() {
  return static_cast<uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                   std::chrono::system_clock::now().time_since_epoch())
                                   .count());
}

// The file, and a thread that syncs waiting messages to the disk even if no more arrive.
class Taping {
 public:
  Taping(std::unique_ptr<recording::SceneRecorder> recorder, double duration_s,
         Interrupt& interrupt)
      : recorder_(std::move(recorder)), interrupt_(interrupt) {
    if (duration_s > 0) {
      end_ = clock_.Now() + static_cast<sync::TimeNs>(duration_s * sync::kSecond);
    }
    thread_ = std::thread([this] { Run(); });
  }

  ~Taping() {
    {
      sync::MutexLock lock(mutex_);
      stop_ = true;
      changed_.NotifyAll();
    }
    thread_.join();
  }

  absl::Status Add(const v1::WatchSceneResponse& message) {
    sync::MutexLock lock(mutex_);
    if (status_.ok()) status_ = recorder_->Add(message, UnixNs());
    return status_;
  }
  absl::Status Close() {
    sync::MutexLock lock(mutex_);
    if (status_.ok()) status_ = recorder_->Close();
    return status_;
  }
  bool over() const { return end_.has_value() && clock_.Now() >= *end_; }
  std::string Figures() const {
    sync::MutexLock lock(mutex_);
    return absl::StrCat(Counted(recorder_->change_sets(), "change"), ", ",
                        Bytes(recorder_->bytes()));
  }
  const recording::SceneRecorder& recorder() const { return *recorder_; }

 private:
  void Run() {
    sync::MutexLock lock(mutex_);
    while (!stop_) {
      if (status_.ok()) status_ = recorder_->Tick(UnixNs());
      // The watch may be silent for a long time.
      if (over() || !status_.ok()) interrupt_.Request();
      clock_.WaitUntil(mutex_, changed_,
                       std::min(clock_.Now() + kTick, end_.value_or(sync::kNever)));
    }
  }

  const std::unique_ptr<recording::SceneRecorder> recorder_;
  Interrupt& interrupt_;
  mutable sync::SystemClock clock_;
  std::optional<sync::TimeNs> end_;
  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace

absl::Status Record(const RecordOptions& options, const Connector& connect, Interrupt& interrupt,
                    Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  auto recorder = recording::SceneRecorder::Create(options.file, VOXELD_VERSION);
  if (!recorder.ok()) {
    return {recorder.status().code(), EscapeForTerminal(recorder.status().message())};
  }
  Taping taping(*std::move(recorder), options.duration_s, interrupt);
  v1::WatchSceneRequest request;
  request.set_contents(true);
  absl::Status wrong;
  uint64_t entities = 0;  // added or changed
  absl::Status status = connection.WatchScene(request, [&](const v1::WatchSceneResponse& message) {
    wrong = taping.Add(message);
    entities += static_cast<uint64_t>(message.entities_size());
    if (message.in_sync() == 0) return wrong.ok();
    console.Progress(absl::StrCat("recording  ", taping.Figures()));
    return wrong.ok() && !options.still;  // the first change set is the whole scene
  });
  console.EndProgress();
  if (wrong.ok()) wrong = taping.Close();
  if (!wrong.ok()) return {wrong.code(), EscapeForTerminal(wrong.message())};
  // This is the intended end.
  if (absl::IsCancelled(status) && interrupt.requested()) status = absl::OkStatus();
  if (console.json()) {
    console.Data(nlohmann::ordered_json{{"file", options.file},
                                        {"change_sets", taping.recorder().change_sets()},
                                        {"bytes", taping.recorder().bytes()}}
                     .dump() +
                 "\n");
  } else {
    console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", taping.Figures()));
  }
  if (entities == 0 && status.ok())
    console.Say("warning: the scene was empty; the recording shows nothing");
  return status;
}

}  // namespace voxeld::voxelctl
