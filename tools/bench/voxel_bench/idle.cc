// Measures what idle streams cost, and how streams that do not read affect a normal client.
#include <algorithm>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/paced_client.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"
#include "tools/bench/voxel_bench/stats_watch.h"

namespace voxeld::bench {
namespace {

constexpr int kLines = 100, kEntities = 10, kVariants = 16;
constexpr double kVoxels = 20, kDisplayVoxels = 64;
constexpr int kShared = 50;  // streams per connection if they share connections
constexpr sync::TimeNs kFastStats = 10 * sync::kMillisecond;
constexpr sync::TimeNs kSlowRead = sync::kSecond;
constexpr sync::TimeNs kOpenLimit = 30 * sync::kSecond;

v1::Open OpenAsked(const char* name) {
  v1::Open open;
  open.set_client_name(name);
  return open;
}

// Sends commits without respecting its credit, and reads nothing after Opened. If the daemon ends
// its call, it starts another.
class DeafClient {
 public:
  DeafClient(Loop& loop, const std::string& target) : loop_(loop), connection_(target) {}

  absl::Status Begin() {
    asked_ = opened_ = false;
    call_ = std::make_unique<Call>(loop_, connection_, "/voxeld.v1.SceneService/Stream",
                                   CallEvents{.writable = [this] { Send(); },
                                              .message =
                                                  [this](std::string_view) {
                                                    if (std::exchange(opened_, true)) return;
                                                    if (call_->writable()) Send();
                                                  },
                                              .ended = {}},
                                   false);
    const absl::Status ran =
        loop_.RunUntil(Now() + kOpenLimit, [this] { return opened_ || call_->ended(); });
    if (!ran.ok()) return ran;
    return opened_ ? absl::OkStatus() : absl::UnavailableError("the deaf client was not let in");
  }
  void End() { call_.reset(); }

  // Restarts the call if it has ended. Call it periodically.
  absl::Status Renew() {
    if (call_ == nullptr || !call_->ended()) return absl::OkStatus();
    ++ends_;
    return Begin();
  }
  uint64_t ends() const { return ends_; }

 private:
  void Send() {
    if (!std::exchange(asked_, true)) {
      v1::StreamRequest request;
      *request.mutable_open() = OpenAsked("voxel-bench deaf");
      call_->Write(Message(request));
    } else if (opened_) {
      call_->Write(commit_);
    }
  }

  Loop& loop_;
  Connection connection_;
  const Message commit_ = Session::CommitMessage(1, 0);
  std::unique_ptr<Call> call_;
  bool asked_ = false, opened_ = false;
  uint64_t ends_ = 0;
};

class Idle {
 public:
  Idle(const IdleOptions& options, const Surroundings& with)
      : options_(options), with_(with), loop_(with.interrupted) {}

  absl::StatusOr<nlohmann::json> Run() {
    nlohmann::json report = ReportOf("idle", {{"streams", options_.streams},
                                              {"rounds", options_.rounds},
                                              {"seconds", options_.seconds},
                                              {"commits_per_s", options_.rate},
                                              {"lines", kLines},
                                              {"display", options_.display}});
    // With shared connections, only the memory is measured.
    absl::Status ran = WithDaemon([&](ServerProcess& daemon) {
      return MeasureMemory(daemon, kShared, "resident_per_stream.shared_connections", report,
                           [] { return absl::OkStatus(); });
    });
    if (!ran.ok()) return ran;
    ran = WithDaemon([&](ServerProcess& daemon) { return BesideOthers(daemon, report); });
    if (!ran.ok()) return ran;
    return report;
  }

 private:
  absl::Status WithDaemon(const std::function<absl::Status(ServerProcess&)>& measure) {
    absl::StatusOr<std::unique_ptr<ServerProcess>> daemon =
        ServerProcess::StartDaemon({.program = with_.daemon,
                                    .displays = {absl::StrCat("sim=simulated,", options_.display)},
                                    .config = RoomFor(options_.streams)});
    if (!daemon.ok()) return daemon.status();
    return measure(**daemon);
  }

  // Opens the streams, measures the memory per stream, and runs `then` while they are open.
  absl::Status MeasureMemory(ServerProcess& daemon, int streams_a_connection,
                             const std::string& name, nlohmann::json& report,
                             const std::function<absl::Status()>& then) {
    const absl::StatusOr<uint64_t> before = daemon.ResidentBytes();
    if (!before.ok()) return before.status();
    std::vector<std::unique_ptr<Connection>> connections;
    std::vector<std::unique_ptr<Session>> sessions;
    for (int i = 0; i < options_.streams; ++i) {
      if (i % streams_a_connection == 0) {
        connections.push_back(std::make_unique<Connection>(daemon.unix_target()));
      }
      sessions.push_back(
          std::make_unique<Session>(loop_, *connections.back(), OpenAsked("voxel-bench idle")));
      // Opens a few at a time, because a listener's queue is short.
      if (i % kAtATime == kAtATime - 1) {
        if (absl::Status opened = WaitOpened(sessions); !opened.ok()) return opened;
      }
    }
    if (absl::Status opened = WaitOpened(sessions); !opened.ok()) return opened;
    if (absl::Status ran = loop_.RunTo(Now() + sync::kSecond / 2); !ran.ok()) return ran;
    const absl::StatusOr<uint64_t> after = daemon.ResidentBytes();
    if (!after.ok()) return after.status();
    const double each = (static_cast<double>(*after) - static_cast<double>(*before)) /
                        static_cast<double>(options_.streams);
    AddFigure(report, name, "kB", each / 1e3);
    with_.progress(absl::StrFormat("idle: %d streams, %d a connection: %.1f kB each",
                                   options_.streams, streams_a_connection, each / 1e3));
    const absl::StatusOr<v1::Stats> stats = StatsOf(loop_, *connections.front());
    if (!stats.ok()) return stats.status();
    report["sessions"].push_back(stats->sessions());
    absl::Status rest = then();
    for (const auto& session : sessions) {
      if (rest.ok()) rest = session->status();
    }
    return rest;
  }

  absl::Status WaitOpened(const std::vector<std::unique_ptr<Session>>& sessions) {
    for (size_t i = opened_ < sessions.size() ? opened_ : 0; i < sessions.size(); ++i) {
      if (absl::Status opened = sessions[i]->WaitOpened(); !opened.ok()) return opened;
    }
    opened_ = sessions.size();
    return absl::OkStatus();
  }

  absl::Status BesideOthers(ServerProcess& daemon, nlohmann::json& report) {
    const std::string target = daemon.unix_target();
    absl::StatusOr<std::unique_ptr<PacedClient>> normal = PacedClient::Open(
        loop_, target, LineFrames("normal", kLines, kEntities, kVoxels, kDisplayVoxels, kVariants));
    if (!normal.ok()) return normal.status();
    std::vector<double> alone, slow, idle;
    const absl::Status warm = Measure(**normal, alone, [] { return absl::OkStatus(); });
    if (!warm.ok()) return warm;
    alone.clear();

    DeafClient deaf(loop_, target);
    const Connection watching(target);
    std::unique_ptr<StatsWatch> watch;
    uint64_t stats_read = 0;
    for (int i = 0; i < options_.rounds; ++i) {
      absl::Status ran = Measure(**normal, alone, [] { return absl::OkStatus(); });
      if (!ran.ok()) return ran;
      if (ran = deaf.Begin(); !ran.ok()) return ran;
      watch = std::make_unique<StatsWatch>(
          loop_, watching, kFastStats, [&](const v1::Stats&) { ++stats_read; }, false);
      sync::TimeNs read_at = Now() + kSlowRead;
      ran = Measure(**normal, slow, [&] {
        if (Now() >= read_at) {
          watch->Read();
          read_at += kSlowRead;
        }
        return deaf.Renew();
      });
      deaf.End();
      watch.reset();
      if (!ran.ok()) return ran;
      with_.progress(absl::StrFormat("idle: p99 %.3f ms alone, %.3f ms beside slow readers",
                                     alone.back(), slow.back()));
    }
    const absl::Status ran = MeasureMemory(
        daemon, 1, "resident_per_stream.own_connections", report, [&]() -> absl::Status {
          for (int i = 0; i < options_.rounds; ++i) {
            const absl::Status measured = Measure(**normal, idle, [] { return absl::OkStatus(); });
            if (!measured.ok()) return measured;
          }
          return absl::OkStatus();
        });
    if (!ran.ok()) return ran;
    AddFigure(report, "normal.p99.alone", "ms", SpreadOf(alone));
    AddFigure(report, "normal.p99.beside_slow_readers", "ms", SpreadOf(slow));
    AddFigure(report, "normal.p99.slow_readers_ratio", "of alone", RatiosOf(slow, alone));
    AddFigure(report, "normal.p99.beside_idle_streams", "ms", SpreadOf(idle));
    report["deaf_streams_ended"] = deaf.ends();
    report["slow_stats_read"] = stats_read;
    report["commits"] = ToJson(sum_);
    return absl::OkStatus();
  }

  // Measures the normal client's p99, in segments between which `meanwhile` may act.
  absl::Status Measure(PacedClient& normal, std::vector<double>& p99,
                       const std::function<absl::Status()>& meanwhile) {
    std::vector<double> latency;
    const auto piece = static_cast<sync::TimeNs>(std::min(options_.seconds, 0.5) * sync::kSecond);
    const sync::TimeNs end =
        Now() + static_cast<sync::TimeNs>(options_.seconds * sync::kSecond) - piece / 2;
    do {
      const absl::StatusOr<PacedRun> run = normal.Run(piece, options_.rate);
      if (!run.ok()) return run.status();
      latency.insert(latency.end(), run->latency_ms.begin(), run->latency_ms.end());
      sum_ += run->tally;
      if (absl::Status did = meanwhile(); !did.ok()) return did;
    } while (Now() < end);
    p99.push_back(QuantileOf(std::move(latency), 0.99));
    return absl::OkStatus();
  }

  static constexpr int kAtATime = 100;

  const IdleOptions& options_;
  const Surroundings& with_;
  Loop loop_;
  size_t opened_ = 0;
  Tally sum_;  // of the normal client
};

}  // namespace

absl::StatusOr<nlohmann::json> RunIdle(const IdleOptions& options, const Surroundings& with) {
  return Idle(options, with).Run();
}

}  // namespace voxeld::bench
