#include "tools/bench/voxel_bench/stats_watch.h"

#include <string_view>
#include <utility>

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kAnswerLimit = 30 * sync::kSecond;

Message RequestOf(sync::TimeNs interval) {
  v1::WatchStatsRequest request;
  request.set_interval_ns(interval);
  return Message(request);
}

}  // namespace

StatsWatch::StatsWatch(Loop& loop, const Connection& connection, sync::TimeNs interval,
                       std::function<void(const v1::Stats&)> stats, bool read_on)
    : stats_(std::move(stats)),
      request_(RequestOf(interval)),
      call_(loop, connection, "/voxeld.v1.DisplayService/WatchStats",
            {.writable =
                 [this] {
                   if (std::exchange(asked_, true)) return call_.WritesDone();
                   call_.Write(request_, true);
                 },
             .message =
                 [this](std::string_view bytes) {
                   v1::Stats stats;
                   stats.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
                   stats_(stats);
                 },
             .ended = {}},
            read_on) {}

absl::StatusOr<v1::Stats> StatsOf(Loop& loop, const Connection& connection) {
  std::optional<v1::Stats> out;
  const StatsWatch watch(
      loop, connection, sync::kSecond, [&out](const v1::Stats& stats) { out = stats; }, false);
  const absl::Status ran =
      loop.RunUntil(Now() + kAnswerLimit, [&] { return out.has_value() || watch.ended(); });
  if (!ran.ok()) return ran;
  if (!out.has_value()) return absl::UnavailableError("the daemon gave no statistics");
  return *std::move(out);
}

}  // namespace voxeld::bench
