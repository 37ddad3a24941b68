// The benchmarks, their options, and where their figures go.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/frame/frame_bench.h"
#include "tools/bench/paper/paper_bench.h"

namespace voxeld::bench {

struct Surroundings {
  const std::atomic<bool>* interrupted = nullptr;
  // Path of the program; empty: voxeld beside this one.
  std::function<void(const std::string&)> progress;  // receives a line for people
  std::string daemon;
};

struct IngestOptions {
  std::vector<std::string> cases;  // of IngestCases(); empty: all
  int rounds = 5;                  // daemon and sink alternately
  double seconds = 1;              // of each
  int line_bytes = 28;             // 24, 28, 30
  int batch = 1;                   // entities per message
  std::string display = "size=64x64x64,format=rgb888,rate=60";
};
std::vector<std::string> IngestCases();
absl::StatusOr<nlohmann::json> RunIngest(const IngestOptions& options, const Surroundings& with);

struct LatencyOptions {
  int rounds = 5;
  double seconds = 10;
  double rate = 200;  // commits per second
  int lines = 1000, entities = 10;
  double voxels = 20;  // a line's length
  std::string display = "size=64x64x64,format=rgb888,rate=400";
};
absl::StatusOr<nlohmann::json> RunLatency(const LatencyOptions& options, const Surroundings& with);

struct FairnessOptions {
  int rounds = 3;
  double seconds = 10;
  int clients = 200, layers = 50;
  // The daemon's limits.credit_bytes: how many bytes each client may have in flight. The default
  // for one client is far more than many clients can have applied in a short run.
  int credit_bytes = 65'536;
  std::string display;  // empty: none
};
absl::StatusOr<nlohmann::json> RunFairness(const FairnessOptions& options,
                                           const Surroundings& with);

struct BesideOptions {
  int rounds = 3;
  double seconds = 15;
  double rate = 20;  // commits of one line per second
  int entities = 1'000'000;
  double volumes_per_second = 60;
  std::string display = "size=64x64x64,format=rgb888";
};
absl::StatusOr<nlohmann::json> RunBeside(const BesideOptions& options, const Surroundings& with);

struct OverloadOptions {
  double seconds = 60;
  double factor = 10;  // all clients together, as a multiple of the display's rate
  double volumes_per_second = 60;
  int clients = 1, lines = 1000;
  std::string display = "size=64x64x64,format=rgb888";
  std::string csv, svg;  // output files; empty: none
};
absl::StatusOr<nlohmann::json> RunOverload(const OverloadOptions& options,
                                           const Surroundings& with);

struct IdleOptions {
  int streams = 2000;
  int rounds = 3;
  double seconds = 4;  // duration of each measurement of the normal client
  double rate = 200;   // its commits per second
  std::string display = "size=64x64x64,format=rgb888,rate=400";
};
absl::StatusOr<nlohmann::json> RunIdle(const IdleOptions& options, const Surroundings& with);

using PaperOptions = paper::PaperOptions;
absl::StatusOr<nlohmann::json> RunPaper(const PaperOptions& options, const Surroundings& with);

using FrameOptions = frame::FrameOptions;
absl::StatusOr<nlohmann::json> RunFrame(const FrameOptions& options, const Surroundings& with);

}  // namespace voxeld::bench
