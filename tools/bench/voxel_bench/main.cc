// voxel-bench: measures the daemon's performance from its clients' side.
#include <csignal>
#include <cstdio>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>
#include <variant>

#include "daemon/process/process.h"
#include "tools/bench/voxel_bench/command_line.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"
#include "tools/bench/voxel_bench/sink.h"
#include "tools/bench/voxel_bench/wire.h"

namespace voxeld::bench {
namespace {

constexpr int kUsageError = 2;

// By a signal; a benchmark's children and folders are cleaned up too.
std::atomic<bool> interrupted = false;

int Fail(int code, const absl::Status& status) {
  std::fprintf(stderr, "voxel-bench: %s\n", std::string(status.message()).c_str());
  return code;
}

absl::StatusOr<nlohmann::json> Run(const CommandLine& line) {
  const Surroundings with{
      .interrupted = &interrupted,
      .progress = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); },
      .daemon = line.daemon};
  return std::visit(
      [&with](const auto& options) -> absl::StatusOr<nlohmann::json> {
        using Options = std::decay_t<decltype(options)>;
        if constexpr (std::is_same_v<Options, IngestOptions>) return RunIngest(options, with);
        if constexpr (std::is_same_v<Options, LatencyOptions>) return RunLatency(options, with);
        if constexpr (std::is_same_v<Options, FairnessOptions>) return RunFairness(options, with);
        if constexpr (std::is_same_v<Options, BesideOptions>) return RunBeside(options, with);
        if constexpr (std::is_same_v<Options, OverloadOptions>) return RunOverload(options, with);
        if constexpr (std::is_same_v<Options, IdleOptions>) return RunIdle(options, with);
        if constexpr (std::is_same_v<Options, PaperOptions>) return RunPaper(options, with);
        if constexpr (std::is_same_v<Options, FrameOptions>) return RunFrame(options, with);
        return absl::UnimplementedError("the sink measures nothing");
      },
      line.command);
}

int Main(int argc, char** argv) {
  absl::StatusOr<CommandLine> line =
      ParseCommandLine(std::vector<std::string>(argv + 1, argv + argc));
  if (!line.ok()) return Fail(kUsageError, line.status());
  if (!line->print_and_exit.empty()) {
    std::fputs(line->print_and_exit.c_str(), stdout);
    return 0;
  }
  std::signal(SIGPIPE, SIG_IGN);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    std::signal(number, [](int) { interrupted.store(true); });
  }
  daemon::TuneProcess();  // also in the sink's process, so that a ratio compares equal settings
  daemon::RaiseDescriptorLimit();
  const GrpcCore core;
  if (const auto* sink = std::get_if<SinkOptions>(&line->command)) {
    const absl::Status status = RunSink(sink->listen);
    return status.ok() ? 0 : Fail(1, status);
  }
  const absl::StatusOr<nlohmann::json> report = Run(*line);
  if (!report.ok()) return Fail(1, report.status());
  std::fputs(line->json ? (report->dump(1) + "\n").c_str() : TextOf(*report).c_str(), stdout);
  return 0;
}

}  // namespace
}  // namespace voxeld::bench

int main(int argc, char** argv) { return voxeld::bench::Main(argc, argv); }
