#include "tools/voxelctl/playlist/play_list.h"

#include <algorithm>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/playlist/showing.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kFadeStep = sync::kSecond / 30;
// Interval at which the time of day and the current item are checked.
constexpr sync::TimeNs kLook = sync::kSecond / 5;
constexpr sync::TimeNs kRest = sync::kSecond;  // after an item that cannot be played

// Returns whether a status of an item that was opened successfully is caused by the server.
bool IsOfTheServer(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsUnauthenticated(status) ||
         absl::IsPermissionDenied(status);
}

std::string LinesForTerminal(absl::string_view lines) {
  return absl::StrJoin(
      absl::StrSplit(lines, '\n'), "\n",
      [](std::string* out, absl::string_view line) { out->append(EscapeForTerminal(line)); });
}

class Player {
 public:
  Player(const Playlist& playlist, Connection& connection, const std::function<WeekMinute()>& now,
         Interrupt& interrupt, Console& console)
      : playlist_(playlist),
        connection_(connection),
        now_(now),
        interrupt_(interrupt),
        console_(console) {}

  absl::Status Run() {
    std::optional<size_t> at;
    std::set<size_t> failed;  // consecutively
    while (!interrupt_.requested()) {
      const std::optional<size_t> next = NextItem(playlist_, at, now_());
      if (!next.has_value()) {
        const bool over = !playlist_.loop && at.has_value();
        if (absl::Status status = FadeTo(nullptr); !status.ok() || over) {
          return interrupt_.requested() ? absl::OkStatus() : status;
        }
        if (Wait(kLook)) break;
        continue;
      }
      const PlaylistItem& item = playlist_.items[*next];
      const bool stays =
          shown_ != nullptr && next == at && shown_->still() && shown_->status().ok();
      absl::Status status;
      if (!stays) status = Show(item);
      at = next;
      if (status.ok()) status = Stay(item);
      if (interrupt_.requested()) break;
      if (status.ok()) {
        failed.clear();
        told_.erase(*next);
        continue;
      }
      const bool anew = failed.insert(*next).second;
      if (opened_ && IsOfTheServer(status)) return status;
      if (playlist_.items.size() == 1) return status;
      if (told_.insert(*next).second) {
        console_.Say(absl::StrCat(EscapeForTerminal(item.file),
                                  " is passed over: ", EscapeForTerminal(status.message())));
      }
      if (anew) status = AnyOther(failed);
      if (!status.ok() && anew) return status;
      if (Wait(kRest)) break;
    }
    return absl::OkStatus();
  }

 private:
  // Checks whether an item outside `failed` can be played, now or at its hours. If none can,
  // returns what is wrong with each.
  absl::Status AnyOther(const std::set<size_t>& failed) const {
    std::string faults;
    for (size_t i = 0; i < playlist_.items.size(); ++i) {
      if (failed.contains(i)) continue;
      const absl::Status status = CheckPlayable(playlist_.items[i]);
      if (status.ok()) return status;
      absl::StrAppend(&faults, "\nitem ", i + 1, ": ",
                      EscapeForTerminal(std::string(status.message())));
    }
    return absl::FailedPreconditionError(
        absl::StrCat("nothing of the playlist can be played", faults.empty() ? "" : ":", faults));
  }

  // Waits as long as the current item is to be shown.
  absl::Status Stay(const PlaylistItem& item) {
    // An item that is shown for its own length also plays while it fades in and out.
    const double fades = shown_->of_its_own_length() ? 2 * playlist_.cross_fade_s : 0;
    const double seconds = std::max(shown_->seconds() - fades, 0.0);
    const sync::TimeNs end = clock_.Now() + static_cast<sync::TimeNs>(seconds * sync::kSecond);
    while (clock_.Now() < end && IsWithin(item.hours, now_())) {
      if (Wait(std::min(kLook, end - clock_.Now()))) break;
      if (absl::Status status = shown_->status(); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  bool Wait(sync::TimeNs time) { return interrupt_.WaitUntil(clock_, clock_.Now() + time); }

  absl::Status Show(const PlaylistItem& item) {
    opened_ = false;
    const bool fades = playlist_.cross_fade_s > 0;
    absl::StatusOr<std::unique_ptr<Showing>> showing =
        Showing::Begin(item, fades ? 0 : 1, connection_, clock_);
    if (!showing.ok()) return showing.status();
    opened_ = true;
    if (console_.json()) {
      const nlohmann::ordered_json line = {{"file", item.file}, {"seconds", (*showing)->seconds()}};
      if (!console_.Data(line.dump() + "\n")) return absl::CancelledError("nobody reads any more");
    } else {
      console_.Say(
          absl::StrFormat("%s, %.1f s", EscapeForTerminal(item.file), (*showing)->seconds()));
    }
    if ((*showing)->empty()) {
      console_.Say(absl::StrCat("warning: ", EscapeForTerminal(item.file),
                                " shows nothing: its scene is empty"));
    }
    return FadeTo(*std::move(showing));
  }

  // Fades from the current item to `next`, which may be null.
  absl::Status FadeTo(std::unique_ptr<Showing> next) {
    const auto length = static_cast<sync::TimeNs>(playlist_.cross_fade_s * sync::kSecond);
    absl::Status status;
    while (next != nullptr && !next->up() && status.ok() && !Wait(sync::kMillisecond)) {
      status = next->status();
    }
    const sync::TimeNs begin = clock_.Now();
    double part = length > 0 ? 0 : 1;
    while (length > 0 && part < 1 && status.ok() && (shown_ != nullptr || next != nullptr)) {
      if (Wait(kFadeStep)) break;
      part = std::min(1.0, static_cast<double>(clock_.Now() - begin) / static_cast<double>(length));
      if (next != nullptr) status = next->SetOpacity(part);
      if (shown_ != nullptr) (void)shown_->SetOpacity(1 - part);  // it is removed in any case
      if (next != nullptr && status.ok()) status = next->status();
    }
    shown_ = std::move(next);
    return status;
  }

  const Playlist& playlist_;
  Connection& connection_;
  const std::function<WeekMinute()>& now_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  std::unique_ptr<Showing> shown_;
  std::set<size_t> told_;  // items that were reported as skipped since they last played
  bool opened_ = false;    // whether the latest item's file was opened
};

absl::Status Check(const Playlist& playlist, const std::string& path, WeekMinute now,
                   Console& console) {
  std::set<size_t> passed_over;
  std::vector<std::string> faults;
  for (size_t i = 0; i < playlist.items.size(); ++i) {
    const absl::Status status = CheckPlayable(playlist.items[i]);
    if (status.ok()) continue;
    passed_over.insert(i);
    faults.push_back(
        absl::StrCat("item ", i + 1, ": ", EscapeForTerminal(std::string(status.message()))));
  }
  std::optional<size_t> first = NextItem(playlist, std::nullopt, now);
  for (size_t n = 1; first.has_value() && passed_over.contains(*first); ++n) {
    first = n < playlist.items.size() ? NextItem(playlist, first, now) : std::nullopt;
  }
  const std::string on = first.has_value() ? playlist.items[*first].file : "";
  if (console.json()) {
    const nlohmann::ordered_json line = {
        {"items", playlist.items.size()}, {"first_now", on}, {"faults", faults}};
    console.Data(line.dump() + "\n");
  } else {
    console.Data(absl::StrCat(
        Counted(playlist.items.size(), "item"), "; now ",
        on.empty() ? "nothing is on" : absl::StrCat("it begins with ", EscapeForTerminal(on)),
        "\n"));
  }
  if (faults.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(EscapeForTerminal(path), ": ", faults.size() == 1 ? "one item" : "several items",
                   " cannot be played and would be passed over:\n", absl::StrJoin(faults, "\n")));
}

}  // namespace

WeekMinute LocalWeekMinute() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  const int day = (local.tm_wday + 6) % 7;  // from Monday
  return day * kDayMinutes + local.tm_hour * 60 + local.tm_min;
}

absl::Status PlayList(const PlaylistOptions& options, const Connector& connect,
                      const std::function<WeekMinute()>& now, Interrupt& interrupt,
                      Console& console) {
  const absl::StatusOr<Playlist> playlist = ReadPlaylist(options.file);
  if (!playlist.ok()) {
    return {playlist.status().code(), LinesForTerminal(playlist.status().message())};
  }
  if (options.check) return Check(*playlist, options.file, now(), console);
  const absl::StatusOr<std::unique_ptr<Connection>> connection = connect();
  if (!connection.ok()) return connection.status();
  return Player(*playlist, **connection, now, interrupt, console).Run();
}

}  // namespace voxeld::voxelctl
