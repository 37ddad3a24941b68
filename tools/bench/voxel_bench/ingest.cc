// Measures which share of the throughput of bare gRPC the daemon reaches, and which share of its
// own normal throughput it reaches over TLS and while it is being recorded. Both sides receive the
// same bytes, alternately.
#include <algorithm>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "tools/bench/voxel_bench/content.h"
#include "tools/bench/voxel_bench/feed.h"
#include "tools/bench/voxel_bench/memory_feed.h"
#include "tools/bench/voxel_bench/recorder.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"

namespace voxeld::bench {
namespace {

constexpr int kEntities = 64;  // replaced in each frame
constexpr uint32_t kLinesAnEntity = 4096;
constexpr int kVariants = 2;  // of each frame, so that every commit changes something

enum class Shape : uint8_t { kBatch, kUpsert, kUpsertGathered, kMemory, kMemoryAgain };

enum class With : uint8_t { kNothing, kDisplay, kTls, kRecorder };

struct Case {
  const char* name;
  Shape shape;
  bool tcp;
  With with = With::kNothing;
};
constexpr Case kCases[] = {{"batch_unix", Shape::kBatch, false},
                           {"batch_tcp", Shape::kBatch, true},
                           {"batch_unix_display", Shape::kBatch, false, With::kDisplay},
                           {"upsert_unix", Shape::kUpsert, false},
                           {"upsert_unix_gathered", Shape::kUpsertGathered, false},
                           {"memfd", Shape::kMemory, false},
                           {"memfd_again", Shape::kMemoryAgain, false},
                           {"batch_tls", Shape::kBatch, true, With::kTls},
                           {"batch_unix_recorded", Shape::kBatch, false, With::kRecorder}};

// Returns whether the case is compared with a second daemon without TLS or recorder; all others are
// compared with the bare sink.
bool BesideAnotherDaemon(const Case& item) {
  return item.with == With::kTls || item.with == With::kRecorder;
}

const char* UnitOfRatio(const Case& item) {
  if (item.with == With::kTls) return "of plain TCP";
  return item.with == With::kRecorder ? "of the same, not recorded" : "of the bare sink";
}

bool IsUpsert(Shape shape) { return shape == Shape::kUpsert || shape == Shape::kUpsertGathered; }

// Returns a message with all of a frame's entities, or some of them.
v1::StreamRequest Batch(int variant, int first, int count, LineForm form) {
  std::vector<Put> puts;
  for (int i = first; i < std::min(first + count, kEntities); ++i) {
    const auto seed = uint64_t{kEntities} * variant + i;
    puts.push_back({"bench",
                    absl::StrCat("entity-", i),
                    {.count = kLinesAnEntity, .form = form, .seed = seed}});
  }
  return BatchOf(puts);
}

Frames BatchFrames(int batch, LineForm form) {
  Frames frames;
  for (int variant = 0; variant < kVariants; ++variant) {
    std::vector<Message> frame;
    for (int first = 0; first < kEntities; first += batch) {
      frame.emplace_back(Batch(variant, first, batch, form));
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

// Returns frames whose entities have one line each.
Frames UpsertFrames(LineForm form) {
  Frames frames;
  for (int variant = 0; variant < kVariants; ++variant) {
    std::vector<Message> frame;
    for (int i = 0; i < kEntities; ++i) {
      const auto seed = uint64_t{kEntities} * variant + i;
      frame.emplace_back(UpsertOf("bench", absl::StrCat("entity-", i),
                                  EntityOf({.count = 1, .form = form, .seed = seed})));
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

// The rates per second of both sides in one case.
struct Rates {
  std::vector<double> daemon, beside, daemon_cores;
  double bytes_an_item = 0;
};

class Ingest {
 public:
  Ingest(const IngestOptions& options, const Surroundings& with)
      : options_(options), with_(with), loop_(with.interrupted) {}

  absl::StatusOr<nlohmann::json> Run() {
    absl::StatusOr<std::unique_ptr<ServerProcess>> sink = ServerProcess::StartSink();
    if (!sink.ok()) return sink.status();
    sink_ = *std::move(sink);
    nlohmann::json report = ReportOf("ingest", {{"rounds", options_.rounds},
                                                {"seconds", options_.seconds},
                                                {"line_bytes", options_.line_bytes},
                                                {"lines_an_entity", kLinesAnEntity},
                                                {"entities_a_commit", kEntities},
                                                {"entities_a_message", options_.batch},
                                                {"display", options_.display}});
    for (const Case& item : kCases) {
      const std::vector<std::string>& wanted = options_.cases;
      if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), item.name) == wanted.end()) {
        continue;
      }
      if (absl::Status ran = RunCase(item, report); !ran.ok()) return ran;
    }
    return report;
  }

 private:
  LineForm form() const { return static_cast<LineForm>(options_.line_bytes); }

  absl::Status RunCase(const Case& item, nlohmann::json& report) {
    DaemonOptions wanted{.program = with_.daemon, .tls = item.with == With::kTls};
    if (item.with == With::kDisplay) {
      wanted.displays = {absl::StrCat("sim=simulated,", options_.display)};
    }
    absl::StatusOr<std::unique_ptr<ServerProcess>> daemon = ServerProcess::StartDaemon(wanted);
    if (!daemon.ok()) return daemon.status();
    absl::StatusOr<std::unique_ptr<ServerProcess>> other;
    if (BesideAnotherDaemon(item)) {
      other = ServerProcess::StartDaemon({.program = with_.daemon});
      if (!other.ok()) return other.status();
    }
    std::unique_ptr<Recorder> recorder;
    if (item.with == With::kRecorder) {
      absl::StatusOr<std::unique_ptr<Recorder>> started = Recorder::Start((*daemon)->unix_target());
      if (!started.ok()) return started.status();
      recorder = *std::move(started);
    }
    const bool upserts = IsUpsert(item.shape);
    // In the cases with memory, the sink receives what the daemon would receive without it.
    const Frames frames = upserts ? UpsertFrames(form()) : BatchFrames(options_.batch, form());
    const size_t message = frames[0][0].bytes();
    with_.progress(absl::StrFormat("ingest %s: messages of %d bytes", item.name, message));
    const absl::StatusOr<Rates> rates =
        Alternate(item, **daemon, other.ok() ? other->get() : nullptr, frames);
    if (absl::IsUnimplemented(rates.status())) {
      with_.progress(absl::StrCat("ingest ", item.name, ": ", rates.status().message()));
      report["left_out"][item.name] = std::string(rates.status().message());
      return absl::OkStatus();
    }
    if (!rates.ok()) return rates.status();
    const std::string unit = upserts ? "upserts/s" : "lines/s", name = item.name;
    const Spread daemon_rate = SpreadOf(rates->daemon);
    AddFigure(report, name + ".ratio", UnitOfRatio(item), RatiosOf(rates->daemon, rates->beside));
    AddFigure(report, name + ".daemon", unit, daemon_rate);
    AddFigure(report, name + (BesideAnotherDaemon(item) ? ".without" : ".sink"), unit,
              SpreadOf(rates->beside));
    AddFigure(report, name + ".daemon_bytes", "MB/s",
              daemon_rate.median * rates->bytes_an_item / 1e6);
    AddFigure(report, name + ".daemon_cores", "cores", SpreadOf(rates->daemon_cores));
    report["message_bytes"][name] = message;
    if (recorder == nullptr) return absl::OkStatus();
    const absl::StatusOr<nlohmann::json> recorded = recorder->Stop();
    if (!recorded.ok()) return recorded.status();
    report["recorded"][name] = *recorded;
    return absl::OkStatus();
  }

  static Flush FlushOf(const Case& item) {
    return item.shape == Shape::kUpsert ? Flush::kEachMessage : Flush::kEachFrame;
  }

  absl::StatusOr<std::unique_ptr<Feed>> ToDaemon(const Case& item, const ServerProcess& daemon,
                                                 const Frames& frames) {
    const Target target =
        daemon.tls_target().certificate.empty()
            ? Target{item.tcp ? daemon.tcp_target() : daemon.unix_target(), {}, {}}
            : daemon.tls_target();
    if (item.shape == Shape::kBatch || IsUpsert(item.shape)) {
      return FeedDaemon(loop_, target, frames, FlushOf(item));
    }
    std::vector<v1::StreamRequest> whole;
    whole.reserve(kVariants);
    for (int variant = 0; variant < kVariants; ++variant) {
      whole.push_back(Batch(variant, 0, kEntities, form()));
    }
    const MemoryUse use = item.shape == Shape::kMemory ? MemoryUse::kFresh : MemoryUse::kAgain;
    return FeedMemory(loop_, target.address, whole, use);
  }

  // `other` is the daemon to compare with; null means the bare sink.
  absl::StatusOr<Rates> Alternate(const Case& item, ServerProcess& daemon,
                                  const ServerProcess* other, const Frames& frames) {
    const auto duration = static_cast<sync::TimeNs>(options_.seconds * sync::kSecond);
    const double items =
        IsUpsert(item.shape) ? double{kEntities} : double{kEntities} * kLinesAnEntity;
    const absl::StatusOr<std::unique_ptr<Feed>> to_daemon = ToDaemon(item, daemon, frames);
    if (!to_daemon.ok()) return to_daemon.status();
    absl::StatusOr<std::unique_ptr<Feed>> to_other =
        other != nullptr ? ToDaemon(item, *other, frames)
                         : FeedSink(loop_, item.tcp ? sink_->tcp_target() : sink_->unix_target(),
                                    frames, FlushOf(item));
    if (!to_other.ok()) return to_other.status();
    Rates rates;
    const auto round = [&](Feed& feed, std::vector<double>& out) -> absl::StatusOr<Fed> {
      const absl::StatusOr<Fed> fed = feed.Round(duration);
      if (!fed.ok()) return fed.status();
      out.push_back(static_cast<double>(fed->frames) * items * sync::kSecond /
                    static_cast<double>(fed->took_ns));
      rates.bytes_an_item =
          static_cast<double>(fed->bytes) / (static_cast<double>(fed->frames) * items);
      return fed;
    };
    std::vector<double> warm;
    if (auto fed = round(**to_daemon, warm); !fed.ok()) return fed.status();
    if (other != nullptr) {
      if (auto fed = round(**to_other, warm); !fed.ok()) return fed.status();
    }
    for (int i = 0; i < options_.rounds; ++i) {
      if (auto fed = round(**to_other, rates.beside); !fed.ok()) return fed.status();
      const absl::StatusOr<int64_t> before = daemon.ProcessorNs();
      const absl::StatusOr<Fed> fed = round(**to_daemon, rates.daemon);
      if (!fed.ok()) return fed.status();
      const absl::StatusOr<int64_t> after = daemon.ProcessorNs();
      if (!before.ok() || !after.ok()) return after.status();
      rates.daemon_cores.push_back(static_cast<double>(*after - *before) /
                                   static_cast<double>(fed->took_ns));
    }
    return rates;
  }

  const IngestOptions& options_;
  const Surroundings& with_;
  Loop loop_;
  std::unique_ptr<ServerProcess> sink_;
};

}  // namespace

std::vector<std::string> IngestCases() {
  std::vector<std::string> names;
  for (const Case& item : kCases) names.emplace_back(item.name);
  return names;
}

absl::StatusOr<nlohmann::json> RunIngest(const IngestOptions& options, const Surroundings& with) {
  return Ingest(options, with).Run();
}

}  // namespace voxeld::bench
