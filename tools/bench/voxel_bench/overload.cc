// Measures latency, memory and outcomes when clients send more frames than a display can show, with
// the flow policy that only the newest is kept.
#include <algorithm>
#include <fstream>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/content.h"
#include "tools/bench/voxel_bench/feed.h"
#include "tools/bench/voxel_bench/overload_samples.h"
#include "tools/bench/voxel_bench/pace.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"
#include "tools/bench/voxel_bench/session.h"
#include "tools/bench/voxel_bench/stats_watch.h"

namespace voxeld::bench {
namespace {

constexpr sync::TimeNs kSampleEvery = 100 * sync::kMillisecond;
constexpr sync::TimeNs kSettleLimit = 30 * sync::kSecond;
constexpr int kVariants = 31;
constexpr double kLength = 0.6;  // 20 voxels of 64

// Returns immediate-mode frames; each replaces the whole layer.
Frames ImmediateFrames(int client, int lines) {
  const std::string layer = absl::StrCat("layer-", client);
  Frames frames;
  for (int variant = 0; variant < kVariants; ++variant) {
    const auto seed = uint64_t{kVariants} * client + variant + 1;
    frames.push_back({Message(FrameBeginOf(layer)),
                      Message(UpsertOf(layer, "lines",
                                       EntityOf({.count = static_cast<uint32_t>(lines),
                                                 .form = LineForm::k24Bytes,
                                                 .length = kLength,
                                                 .seed = seed}))),
                      Message(FrameEndOf(layer))});
  }
  return frames;
}

v1::Open OpenAsked() {
  v1::Open open;
  open.set_client_name("voxel-bench overload");
  open.set_flow(v1::FLOW_POLICY_LATEST);
  return open;
}

struct Client {
  Client(Loop& loop, const std::string& target, Frames frames)
      : connection(target),
        session(loop, connection, OpenAsked()),
        sender(session, std::move(frames), FrameSender::WhenBehind::kLatest) {}

  Connection connection;
  Session session;
  FrameSender sender;
};

absl::Status WriteFile(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) return absl::UnavailableError(absl::StrCat(path, " cannot be written"));
  return absl::OkStatus();
}

class Overload {
 public:
  Overload(const OverloadOptions& options, const Surroundings& with)
      : options_(options), with_(with), loop_(with.interrupted) {}

  absl::StatusOr<nlohmann::json> Run() {
    nlohmann::json report = ReportOf("overload", {{"seconds", options_.seconds},
                                                  {"factor", options_.factor},
                                                  {"volumes_per_s", options_.volumes_per_second},
                                                  {"clients", options_.clients},
                                                  {"lines", options_.lines},
                                                  {"display", options_.display}});
    absl::StatusOr<std::unique_ptr<ServerProcess>> daemon = ServerProcess::StartDaemon(
        {.program = with_.daemon,
         .displays = {absl::StrCat("sim=simulated,rate=", options_.volumes_per_second, ",",
                                   options_.display)},
         .config = RoomFor(options_.clients)});
    if (!daemon.ok()) return daemon.status();
    daemon_ = *std::move(daemon);
    for (int i = 0; i < options_.clients; ++i) {
      clients_.push_back(std::make_unique<Client>(loop_, daemon_->unix_target(),
                                                  ImmediateFrames(i, options_.lines)));
      Client& client = *clients_.back();
      client.session.OnReceipt([this, &client](const v1::Receipt& receipt) {
        if (!receipt.outcome().has_presented()) return;
        const sync::TimeNs took =
            receipt.outcome().presented().time_ns() - client.sender.SentAt(receipt.frame_id());
        latency_volumes_.push_back(static_cast<double>(took) / sync::kSecond *
                                   options_.volumes_per_second);
      });
    }
    for (const auto& client : clients_) {
      if (absl::Status opened = client->session.WaitOpened(); !opened.ok()) return opened;
    }
    if (absl::Status pressed = Press(); !pressed.ok()) return pressed;
    if (absl::Status settled = Settle(); !settled.ok()) return settled;
    if (absl::Status told = Tell(report); !told.ok()) return told;
    return report;
  }

 private:
  absl::Status Press() {
    const Connection watching(daemon_->unix_target());
    const sync::TimeNs begin = Now();
    const sync::TimeNs end = begin + static_cast<sync::TimeNs>(options_.seconds * sync::kSecond);
    const StatsWatch watch(loop_, watching, kSampleEvery, [this, begin](const v1::Stats& stats) {
      TakeSample(static_cast<double>(Now() - begin) / sync::kSecond, stats);
    });
    Pace pace(begin, options_.factor * options_.volumes_per_second);
    sync::TimeNs tell = begin + sync::kSecond;
    while (pace.due() < end) {
      if (absl::Status ran = loop_.RunTo(pace.due()); !ran.ok()) return ran;
      for (uint64_t i = pace.Take(std::min(Now(), end - 1)); i > 0; --i) {
        clients_[frames_due_++ % clients_.size()]->sender.Due();
      }
      if (absl::Status failed = Failure(); !failed.ok()) return failed;
      if (watch.ended()) return absl::UnavailableError("the daemon's statistics ended");
      if (Now() >= tell) {
        tell += 10 * sync::kSecond;
        if (!samples_.empty()) {
          with_.progress(
              absl::StrFormat("overload: %.0f s, %d presented, %.1f MB", samples_.back().time_s,
                              samples_.back().presented,
                              static_cast<double>(samples_.back().resident_bytes) / 1e6));
        }
      }
    }
    return absl::OkStatus();
  }

  void TakeSample(double time_s, const v1::Stats& stats) {
    OverloadSample sample;
    sample.time_s = time_s;
    sample.frames_due = frames_due_;
    for (const auto& client : clients_) {
      sample.commits_sent += client->session.tally().sent;
      sample.frames_dropped += client->sender.dropped();
    }
    TakeStats(stats, sample);
    sample.latency_volumes = std::exchange(latency_volumes_, {});
    sample.resident_bytes = daemon_->ResidentBytes().value_or(0);
    samples_.push_back(std::move(sample));
  }

  absl::Status Failure() const {
    for (const auto& client : clients_) {
      if (!client->session.status().ok()) return client->session.status();
    }
    return absl::OkStatus();
  }

  absl::Status Settle() {
    const absl::Status settled = loop_.RunUntil(Now() + kSettleLimit, [this] {
      return !Failure().ok() ||
             std::all_of(clients_.begin(), clients_.end(), [](const auto& client) {
               return client->sender.idle() && client->session.tally().Settled();
             });
    });
    if (absl::Status failed = Failure(); !failed.ok()) return failed;
    return settled;
  }

  absl::Status Tell(nlohmann::json& report) {
    Tally sum;
    uint64_t dropped = 0;
    for (const auto& client : clients_) {
      sum += client->session.tally();
      dropped += client->sender.dropped();
    }
    // Compares what the clients received with the daemon's own counts.
    const absl::StatusOr<v1::Stats> stats = StatsOf(loop_, Connection(daemon_->unix_target()));
    if (!stats.ok()) return stats.status();
    OverloadSample last;
    TakeStats(*stats, last);
    report["commits"] = ToJson(sum);
    report["frames_due"] = frames_due_;
    report["frames_dropped"] = dropped;
    report["daemon_agrees"] = last.owed == sum.owed && last.presented == sum.presented &&
                              last.unchanged == sum.unchanged &&
                              last.superseded == sum.superseded && last.lost == sum.lost &&
                              last.not_shown == sum.not_shown && last.pending == 0;
    report["samples"] = samples_.size();
    report["samples_exact"] =
        std::count_if(samples_.begin(), samples_.end(),
                      [](const OverloadSample& sample) { return sample.Exact(); });

    const size_t count = samples_.size(), third = count / 3;
    const std::vector<double> all = LatenciesOf(samples_, 0, count);
    AddFigure(report, "latency.p50", "volumes", QuantileOf(all, 0.5));
    AddFigure(report, "latency.p99", "volumes", QuantileOf(all, 0.99));
    AddFigure(report, "latency.max", "volumes", QuantileOf(all, 1));
    AddFigure(report, "latency.p50.first_third", "volumes",
              QuantileOf(LatenciesOf(samples_, 0, third), 0.5));
    AddFigure(report, "latency.p50.last_third", "volumes",
              QuantileOf(LatenciesOf(samples_, count - third, count), 0.5));
    AddFigure(report, "resident.first_third", "MB", ResidentMb(0, third));
    AddFigure(report, "resident.last_third", "MB", ResidentMb(count - third, count));
    AddFigure(report, "frames", "times what the display takes",
              static_cast<double>(frames_due_) / options_.seconds / options_.volumes_per_second);
    AddFigure(
        report, "sent", "of the frames",
        static_cast<double>(sum.sent) / static_cast<double>(std::max<uint64_t>(1, frames_due_)));
    AddFigure(report, "presented", "volumes/s",
              static_cast<double>(sum.presented) / options_.seconds);
    if (!options_.csv.empty()) {
      if (absl::Status wrote = WriteFile(options_.csv, CsvOf(samples_)); !wrote.ok()) return wrote;
    }
    if (options_.svg.empty()) return absl::OkStatus();
    const std::string title = absl::StrFormat(
        "%g times what the display takes, %d LATEST client(s)", options_.factor, options_.clients);
    return WriteFile(options_.svg, PlotOf(title, samples_));
  }

  Spread ResidentMb(size_t begin, size_t end) const {
    std::vector<double> values;
    for (size_t i = begin; i < end; ++i) {
      values.push_back(static_cast<double>(samples_[i].resident_bytes) / 1e6);
    }
    return SpreadOf(std::move(values));
  }

  const OverloadOptions& options_;
  const Surroundings& with_;
  Loop loop_;
  std::unique_ptr<ServerProcess> daemon_;
  std::vector<std::unique_ptr<Client>> clients_;
  uint64_t frames_due_ = 0;
  std::vector<double> latency_volumes_;  // since the last sample
  std::vector<OverloadSample> samples_;
};

}  // namespace

absl::StatusOr<nlohmann::json> RunOverload(const OverloadOptions& options,
                                           const Surroundings& with) {
  return Overload(options, with).Run();
}

}  // namespace voxeld::bench
