// Measures a client that occasionally commits one line, alone and beside another owner that
// repeatedly uploads a large scene.
#include <algorithm>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/content.h"
#include "tools/bench/voxel_bench/feed.h"
#include "tools/bench/voxel_bench/pace.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"
#include "tools/bench/voxel_bench/session.h"

namespace voxeld::bench {
namespace {

constexpr int kEntitiesAMessage = 10'000;
constexpr int kLineVariants = 4;  // of the line
constexpr sync::TimeNs kQuietLimit = 120 * sync::kSecond;

// The large scene is dim and the line is in front of it, so the line always changes the volume.
v1::StreamRequest LayerOf(const std::string& name, int order, uint32_t opacity) {
  v1::StreamRequest request;
  v1::LayerState* state = request.mutable_layer_state();
  state->set_layer(name);
  state->set_order(order);
  state->set_opacity(opacity);
  return request;
}

// Returns one frame in which every entity is a line of its own and all are committed at once.
Frames LargeFrame(int entities) {
  std::vector<Message> messages = {Message(LayerOf("large", 0, 100))};
  for (int first = 0; first < entities; first += kEntitiesAMessage) {
    std::vector<Put> puts;
    for (int i = first; i < std::min(first + kEntitiesAMessage, entities); ++i) {
      puts.push_back({"large",
                      absl::StrCat(i),
                      {.form = LineForm::k24Bytes, .length = 0.1, .seed = uint64_t(i) + 1}});
    }
    messages.push_back(Message(BatchOf(puts)));
  }
  return {std::move(messages)};
}

Frames OneLine() {
  Frames frames;
  for (int variant = 1; variant <= kLineVariants; ++variant) {
    frames.push_back(
        {Message(LayerOf("small", 1, 255)),
         Message(UpsertOf("small", "line",
                          EntityOf({.form = LineForm::k24Bytes, .seed = uint64_t(variant)})))});
  }
  return frames;
}

v1::Open OpenBeside() {
  v1::Open open;
  open.set_client_name("voxel-bench beside");
  return open;
}

struct Party {
  Party(Loop& loop, const std::string& target, Frames frames)
      : connection(target),
        session(loop, connection, OpenBeside()),
        sender(session, std::move(frames), FrameSender::WhenBehind::kWait) {}

  Connection connection;
  Session session;
  FrameSender sender;
};

struct Latencies {
  std::vector<double> accepted_ms, lit_volumes;
};

}  // namespace

absl::StatusOr<nlohmann::json> RunBeside(const BesideOptions& options, const Surroundings& with) {
  nlohmann::json report = ReportOf("beside", {{"rounds", options.rounds},
                                              {"seconds", options.seconds},
                                              {"commits_per_s", options.rate},
                                              {"entities", options.entities},
                                              {"volumes_per_s", options.volumes_per_second},
                                              {"display", options.display}});
  absl::StatusOr<std::unique_ptr<ServerProcess>> daemon = ServerProcess::StartDaemon(
      {.program = with.daemon,
       .displays = {absl::StrCat("sim=simulated,rate=", options.volumes_per_second, ",",
                                 options.display)},
       // The limits are raised because a commit may not contain a million entities by default.
       .config = "[limits]\nmax_uncommitted_bytes = 1_073_741_824\nmax_operations_per_commit = "
                 "1_000_100\n"});
  if (!daemon.ok()) return daemon.status();
  // Built before the streams begin: the daemon closes a stream that does not open its session within some seconds.
  Frames large_frame = LargeFrame(options.entities);
  Loop loop(with.interrupted);
  Party small(loop, (*daemon)->unix_target(), OneLine());
  Party large(loop, (*daemon)->unix_target(), std::move(large_frame));
  Latencies* now = nullptr;
  uint64_t seen = 0;  // the newest frame that was shown
  small.session.OnReceipt([&](const v1::Receipt& receipt) {
    const auto took_ms = [&](uint64_t frame_id) {
      return static_cast<double>(Now() - small.sender.SentAt(frame_id)) / sync::kMillisecond;
    };
    if (now == nullptr) return;
    if (receipt.has_accepted()) now->accepted_ms.push_back(took_ms(receipt.frame_id()));
    if (receipt.has_outcome() && receipt.outcome().has_presented()) {
      // A commit that this one superseded became visible with it.
      for (; seen < receipt.frame_id(); ++seen) {
        now->lit_volumes.push_back(took_ms(seen + 1) / 1000 * options.volumes_per_second);
      }
    }
  });
  for (Party* client : {&small, &large}) {
    if (absl::Status opened = client->session.WaitOpened(); !opened.ok()) return opened;
  }

  const auto run = [&](Latencies& latencies) -> absl::Status {
    now = &latencies;
    const sync::TimeNs begin = Now();
    const auto end = begin + static_cast<sync::TimeNs>(options.seconds * sync::kSecond);
    Pace pace(begin, options.rate);
    while (pace.due() < end) {
      if (absl::Status ran = loop.RunTo(pace.due()); !ran.ok()) return ran;
      small.sender.Due(pace.Take(Now()));
      for (const Party* client : {&small, &large}) {
        if (!client->session.status().ok()) return client->session.status();
      }
    }
    const absl::Status settled = loop.RunUntil(Now() + kQuietLimit, [&] {
      return (small.sender.idle() && small.session.tally().Settled()) ||
             !small.session.status().ok();
    });
    now = nullptr;
    return settled.ok() ? small.session.status() : settled;
  };

  std::vector<double> accepted[2], lit[2];
  uint64_t uploads = 0;
  for (int round = 0; round < options.rounds; ++round) {
    for (const bool beside : {false, true}) {
      const uint64_t before = large.session.tally().accepted;
      large.sender.SetEndless(beside);
      Latencies latencies;
      if (absl::Status ran = run(latencies); !ran.ok()) return ran;
      large.sender.SetEndless(false);
      const absl::Status drained = loop.RunUntil(Now() + kQuietLimit, [&] {
        return (large.sender.idle() && large.session.tally().Settled()) ||
               !large.session.status().ok();
      });
      if (!drained.ok()) return drained;
      if (!large.session.status().ok()) return large.session.status();
      accepted[beside].push_back(QuantileOf(latencies.accepted_ms, 0.99));
      lit[beside].push_back(QuantileOf(latencies.lit_volumes, 0.99));
      uploads += large.session.tally().accepted - before;
      with.progress(absl::StrFormat(
          "beside: %s: accepted p50 %.1f ms, p99 %.1f ms; lit p50 %.1f volumes, p99 %.1f",
          beside ? "beside an upload" : "alone", QuantileOf(latencies.accepted_ms, 0.5),
          accepted[beside].back(), QuantileOf(latencies.lit_volumes, 0.5), lit[beside].back()));
    }
  }
  AddFigure(report, "alone.accepted.p99", "ms", SpreadOf(accepted[0]));
  AddFigure(report, "beside.accepted.p99", "ms", SpreadOf(accepted[1]));
  AddFigure(report, "alone.lit.p99", "volumes", SpreadOf(lit[0]));
  AddFigure(report, "beside.lit.p99", "volumes", SpreadOf(lit[1]));
  report["uploads"] = uploads;
  report["commits"] = ToJson(small.session.tally());
  return report;
}

}  // namespace voxeld::bench
