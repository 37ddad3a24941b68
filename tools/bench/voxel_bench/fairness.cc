// Measures how throughput is divided between many clients that each send as fast as their credit
// allows.
#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/content.h"
#include "tools/bench/voxel_bench/feed.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"
#include "tools/bench/voxel_bench/session.h"

namespace voxeld::bench {
namespace {

constexpr int kVariants = 2;
constexpr sync::TimeNs kDrainLimit = 60 * sync::kSecond;

Frames LayerFrames(int layers) {
  Frames frames;
  for (int variant = 0; variant < kVariants; ++variant) {
    std::vector<Put> puts;
    puts.reserve(static_cast<size_t>(layers));
    for (int layer = 0; layer < layers; ++layer) {
      puts.push_back({absl::StrCat("layer-", layer),
                      "line",
                      {.count = 1,
                       .form = LineForm::k24Bytes,
                       .seed = static_cast<uint64_t>(variant) * layers + layer}});
    }
    frames.push_back({Message(BatchOf(puts))});
  }
  return frames;
}

struct Client {
  Client(Loop& loop, const std::string& target, const Frames& frames)
      : connection(target),
        session(loop, connection, OpenAsked()),
        sender(session, frames, FrameSender::WhenBehind::kWait) {}

  static v1::Open OpenAsked() {
    v1::Open open;
    open.set_client_name("voxel-bench fairness");
    return open;
  }

  Connection connection;
  Session session;
  FrameSender sender;
};

}  // namespace

absl::StatusOr<nlohmann::json> RunFairness(const FairnessOptions& options,
                                           const Surroundings& with) {
  nlohmann::json report = ReportOf("fairness", {{"rounds", options.rounds},
                                                {"seconds", options.seconds},
                                                {"clients", options.clients},
                                                {"layers", options.layers},
                                                {"credit_bytes", options.credit_bytes},
                                                {"display", options.display}});
  DaemonOptions wanted{.program = with.daemon,
                       .config = absl::StrCat(RoomFor(options.clients),
                                              "credit_bytes = ", options.credit_bytes, "\n")};
  if (!options.display.empty()) {
    wanted.displays = {absl::StrCat("sim=simulated,", options.display)};
  }
  absl::StatusOr<std::unique_ptr<ServerProcess>> daemon = ServerProcess::StartDaemon(wanted);
  if (!daemon.ok()) return daemon.status();
  Loop loop(with.interrupted);
  const Frames frames = LayerFrames(options.layers);
  std::vector<std::unique_ptr<Client>> clients;
  clients.reserve(static_cast<size_t>(options.clients));
  for (int i = 0; i < options.clients; ++i) {
    clients.push_back(std::make_unique<Client>(loop, (*daemon)->unix_target(), frames));
  }
  for (const auto& client : clients) {
    if (absl::Status opened = client->session.WaitOpened(); !opened.ok()) return opened;
  }
  with.progress(absl::StrFormat("fairness: %d clients are there", options.clients));
  const auto first_failure = [&clients] {
    for (const auto& client : clients) {
      if (!client->session.status().ok()) return client->session.status();
    }
    return absl::OkStatus();
  };

  // All clients continue from round to round, so each measurement is taken while all of them
  // compete.
  for (const auto& client : clients) client->sender.SetEndless(true);
  const auto duration = static_cast<sync::TimeNs>(options.seconds * sync::kSecond);
  if (absl::Status ran = loop.RunTo(Now() + duration / 4); !ran.ok()) return ran;
  std::vector<double> slowest, jain, all;
  for (int round = 0; round < options.rounds; ++round) {
    const sync::TimeNs begin = Now();
    std::vector<uint64_t> before;
    before.reserve(clients.size());
    for (const auto& client : clients) before.push_back(client->session.tally().accepted);
    if (absl::Status ran = loop.RunTo(begin + duration); !ran.ok()) return ran;
    const double seconds = static_cast<double>(Now() - begin) / sync::kSecond;
    if (absl::Status failed = first_failure(); !failed.ok()) return failed;
    std::vector<double> rates;
    uint64_t least = std::numeric_limits<uint64_t>::max(), together = 0;
    for (size_t i = 0; i < clients.size(); ++i) {
      const uint64_t accepted = clients[i]->session.tally().accepted - before[i];
      least = std::min(least, accepted);
      together += accepted;
      rates.push_back(static_cast<double>(accepted) / seconds);
    }
    const double mean = MeanOf(rates);
    const Spread spread = SpreadOf(rates);
    // Compares whole numbers, because rounding may make a mean of rates smaller than each rate.
    const uint64_t least_of_each = least * clients.size();
    slowest.push_back(
        together == 0 ? 0 : static_cast<double>(least_of_each) / static_cast<double>(together));
    jain.push_back(JainIndexOf(rates));
    all.push_back(mean * static_cast<double>(clients.size()));
    report["clients_commits_per_s"].push_back(rates);
    with.progress(absl::StrFormat("fairness: %.0f commits/s, each %.2f (%.2f to %.2f), Jain %.4f",
                                  all.back(), mean, spread.least, spread.greatest, jain.back()));
  }
  for (const auto& client : clients) client->sender.SetEndless(false);
  const absl::Status drained = loop.RunUntil(Now() + kDrainLimit, [&] {
    return std::all_of(clients.begin(), clients.end(), [](const auto& client) {
      return (client->sender.idle() && client->session.tally().Settled()) ||
             !client->session.status().ok();
    });
  });
  if (!drained.ok()) return drained;
  if (absl::Status failed = first_failure(); !failed.ok()) return failed;
  Tally sum;
  for (const auto& client : clients) sum += client->session.tally();
  AddFigure(report, "slowest_of_mean", "of the mean", SpreadOf(slowest));
  AddFigure(report, "jain_index", "", SpreadOf(jain));
  AddFigure(report, "commits", "commits/s", SpreadOf(all));
  report["commits"] = ToJson(sum);
  return report;
}

}  // namespace voxeld::bench
