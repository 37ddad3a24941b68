#include "tools/voxelctl/top/top.h"

#include <unistd.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <string>
#include <thread>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/top/terminal.h"
#include "tools/voxelctl/top/top_view.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kLook = 100;  // milliseconds: interval to check for keys, news and the end

v1::WatchStatsRequest RequestOf(const TopOptions& options) {
  v1::WatchStatsRequest request;
  request.set_once(options.once);
  if (!options.once) request.set_interval_ns(std::llround(options.interval_s * 1e9));
  return request;
}

absl::Status Plain(const TopOptions& options, Connection& connection, Interrupt& interrupt,
                   Console& console) {
  bool any = false;
  const absl::Status status =
      connection.WatchStats(RequestOf(options), [&](const v1::Stats& stats) {
        const absl::StatusOr<v1::ListOwnersResponse> owners = connection.ListOwners();
        const v1::ListOwnersResponse told = owners.ok() ? *owners : v1::ListOwnersResponse();
        const std::string gap = any && !console.json() ? "\n" : "";
        any = true;
        const bool read = console.Data(
            console.json()
                ? JsonText({{"stats", ToJson(stats)}, {"owners", ToJson(told)["owners"]}},
                           !options.once)
                : absl::StrCat(gap, TopText(stats, told)));
        return read && !options.once;
      });
  if (any && interrupt.requested()) return absl::OkStatus();
  return status;
}

// The view, which one thread fills and another shows.
class Dashboard {
 public:
  Dashboard(const TopOptions& options, Connection& connection, Interrupt& interrupt)
      : options_(options), connection_(connection), interrupt_(interrupt) {
    sync::MutexLock lock(mutex_);
    view_.Choose(options.display);
  }

  void Run(Terminal& terminal) {
    std::thread feeder([this] { Feed(); });
    const absl::Cleanup end = [&] {
      interrupt_.Request();  // ends the current call and the wait for the next
      feeder.join();
    };
    bool draw = true;
    while (!interrupt_.requested()) {
      if (draw || news_.exchange(false)) terminal.Show(Lines(terminal));
      const TopKey key = terminal.Wait(kLook);
      draw = key != TopKey::kNone;
      if (key == TopKey::kQuit) return;
      sync::MutexLock lock(mutex_);
      if (key == TopKey::kPause) view_.TogglePause();
      if (key == TopKey::kNext) view_.Choose(1);
      if (key == TopKey::kPrevious) view_.Choose(-1);
    }
  }

 private:
  std::vector<TopLine> Lines(const Terminal& terminal) {
    sync::MutexLock lock(mutex_);
    return view_.Lines(terminal.width(), terminal.height());
  }

  void Feed() {
    sync::SystemClock clock;
    while (!interrupt_.requested()) {
      const absl::Status status =
          connection_.WatchStats(RequestOf(options_), [&](const v1::Stats& stats) {
            const absl::StatusOr<v1::ListOwnersResponse> owners = connection_.ListOwners();
            sync::MutexLock lock(mutex_);
            view_.Take(stats, owners.ok() ? *owners : v1::ListOwnersResponse(),
                       std::string(owners.status().message()));
            news_ = true;
            return true;
          });
      if (interrupt_.requested()) return;
      {
        sync::MutexLock lock(mutex_);
        view_.Lose(status.ok() ? "the server ended" : std::string(status.message()));
      }
      news_ = true;
      interrupt_.WaitUntil(clock, clock.Now() + sync::kSecond);
    }
  }

  const TopOptions& options_;
  Connection& connection_;
  Interrupt& interrupt_;
  std::atomic<bool> news_ = false;
  sync::Mutex mutex_;
  TopView view_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace

absl::Status Top(const TopOptions& options, bool colors, Connection& connection,
                 Interrupt& interrupt, Console& console) {
  const bool interactive = !options.once && !console.json() && ::isatty(STDIN_FILENO) == 1 &&
                           ::isatty(STDOUT_FILENO) == 1;
  const std::unique_ptr<Terminal> terminal = interactive ? Terminal::Open(colors) : nullptr;
  if (terminal == nullptr) return Plain(options, connection, interrupt, console);
  Dashboard(options, connection, interrupt).Run(*terminal);
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
