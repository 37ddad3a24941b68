#include "tools/bench/frame/frame_bench.h"

#include <algorithm>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "display/sync/clock.h"
#include "tools/bench/frame/ceiling.h"
#include "tools/bench/frame/cuda_machine.h"
#include "tools/bench/frame/scene.h"
#include "tools/bench/frame/subject.h"

namespace voxeld::bench::frame {
namespace {

using nlohmann::json;

constexpr double kMs = 1e6;  // nanoseconds

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

json SpreadJson(const std::vector<double>& values) {
  const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
  return {{"median", Median(values)}, {"least", *least}, {"greatest", *greatest}};
}

// The times of all rounds of one row, in milliseconds.
struct Times {
  std::vector<double> apply, assemble, slice, copy, device, host, ceiling;
  std::vector<std::vector<double>> peers;
  gpu::FrameResult last;
  uint32_t most_tiles = 0;  // the most that a frame drew, uncounted frames included

  void Add(const FrameTimes& frame) {
    apply.push_back(static_cast<double>(frame.apply_ns) / kMs);
    assemble.push_back(static_cast<double>(frame.result.assemble_ns) / kMs);
    slice.push_back(static_cast<double>(frame.result.slice_ns) / kMs);
    copy.push_back(static_cast<double>(frame.result.copy_ns) / kMs);
    device.push_back(static_cast<double>(frame.device_ns()) / kMs);
    host.push_back(static_cast<double>(frame.host_ns) / kMs);
    last = frame.result;
  }
};

absl::StatusOr<double> TimeOf(Ceiling& ceiling) {
  const sync::SystemClock clock;
  const sync::TimeNs start = clock.Now();
  if (absl::Status status = ceiling.Run(); !status.ok()) return status;
  return static_cast<double>(clock.Now() - start) / kMs;
}

// The references that are measured beside the engine.
struct Beside {
  std::unique_ptr<Ceiling> ceiling;
  std::vector<std::unique_ptr<Ceiling>> peers;
};

absl::StatusOr<Beside> BesideOf(const Scene& scene, bool cuda, int threads) {
  Beside out;
  if (cuda) {
    auto ceiling = scene.in_device ? DeviceCopyCeiling(BytesCopied(scene))
                                   : DeviceToHostCeiling(scene.target.layout.bytes());
    if (!ceiling.ok()) return ceiling.status();
    out.ceiling = *std::move(ceiling);
  } else {
    out.ceiling = CopyCeiling(BytesCopied(scene), threads);
  }
  if (scene.plain_peer && !cuda) out.peers.push_back(PlainLinesPeer(scene, threads));
  return out;
}

// The first two frames send the scene and allocate memory, so neither is counted.
constexpr int kWarmRounds = 2;

// The same scene on one GPU, drawn alternately. `subject` is null unless the comparison was
// requested.
struct Alone {
  Subject* subject = nullptr;
  Times times;

  absl::Status Draw(const Subject& other, bool counts) {
    if (subject == nullptr) return absl::OkStatus();
    const absl::StatusOr<FrameTimes> frame = subject->Draw();
    if (!frame.ok()) return frame.status();
    if (counts) times.Add(*frame);
    if (subject->pictures() == other.pictures()) return absl::OkStatus();
    return absl::DataLossError("several GPUs drew other bytes than one of them alone");
  }
};

absl::StatusOr<Times> Measure(Subject& subject, Alone& alone, Beside& beside, int rounds,
                              const std::function<bool()>& go_on) {
  Times times;
  times.peers.resize(beside.peers.size());
  for (int round = -kWarmRounds; round < rounds; ++round) {
    if (!go_on()) return absl::CancelledError("interrupted");
    const absl::StatusOr<FrameTimes> frame = subject.Draw();
    if (!frame.ok()) return frame.status();
    times.most_tiles = std::max(times.most_tiles, frame->result.tiles_drawn);
    if (absl::Status status = alone.Draw(subject, round >= 0); !status.ok()) return status;
    const absl::StatusOr<double> ceiling = TimeOf(*beside.ceiling);
    if (!ceiling.ok()) return ceiling.status();
    if (round >= 0) {
      times.Add(*frame);
      times.ceiling.push_back(*ceiling);
    }
    for (size_t i = 0; i < beside.peers.size(); ++i) {
      const absl::StatusOr<double> peer = TimeOf(*beside.peers[i]);
      if (!peer.ok()) return peer.status();
      if (round >= 0) times.peers[i].push_back(*peer);
    }
  }
  return times;
}

// Returns the median over rounds of `of` divided by `to`.
double RatioOf(const std::vector<double>& of, const std::vector<double>& to) {
  std::vector<double> ratios;
  for (size_t i = 0; i < of.size(); ++i) ratios.push_back(of[i] / to[i]);
  return Median(std::move(ratios));
}

json StagesOf(const Times& times) {
  std::vector<double> all, door;
  for (size_t i = 0; i < times.host.size(); ++i) {
    all.push_back(times.apply[i] + times.host[i]);
    door.push_back(times.host[i] - times.device[i] - times.copy[i]);
  }
  return {{"apply", RatioOf(times.apply, all)},
          {"assemble", RatioOf(times.assemble, all)},
          {"slice", RatioOf(times.slice, all)},
          {"copy", RatioOf(times.copy, all)},
          {"door", RatioOf(door, all)}};
}

json RowOf(const Scene& scene, const FrameOptions& options, int threads, const Subject& subject,
           const Beside& beside, const Times& times) {
  const bool cuda = options.engine == "cuda";
  const uint64_t voxels = scene.voxels != 0 ? scene.voxels : times.last.lit_voxels;
  const std::vector<double>& device = scene.slicing_only ? times.slice : times.device;
  const auto rate = [&](const std::vector<double>& ms) {
    return static_cast<double>(voxels) / Median(ms) / 1e6;
  };
  const display::VoxelGrid& grid = scene.target.geometry.grid;
  json row = {{"scene", scene.name},
              {"grid", {grid.nx, grid.ny, grid.nz}},
              {"engine", options.engine},
              {"device", subject.info().device},
              {"threads", threads},
              {"gpus", options.gpus > 0 ? options.gpus
                       : cuda           ? 1
                                        : 0},
              {"voxels", voxels},
              {"voxels_are", scene.voxels != 0 ? "drawn" : "lit"},
              {"scene_voxels", scene.scene_voxels != 0 ? json(scene.scene_voxels) : json(nullptr)},
              {"lit_voxels", times.last.lit_voxels},
              {"tiles", {{"drawn", times.last.tiles_drawn}, {"most", times.most_tiles}}},
              {"rounds", options.rounds},
              {"packed_as_drawn", times.last.packed_as_drawn},
              {"device_ms", SpreadJson(device)},
              {"host_ms", SpreadJson(times.host)},
              {"apply_ms", SpreadJson(times.apply)},
              {"gvoxel_per_s", rate(device)},
              {"host_gvoxel_per_s", rate(times.host)},
              {"ceiling", {{"name", beside.ceiling->name()}, {"ms", Median(times.ceiling)}}},
              {"ratio", RatioOf(scene.slicing_only ? times.slice : times.host, times.ceiling)},
              {"peers", json::array()},
              {"stages", StagesOf(times)},
              {"slicing_only", scene.slicing_only},
              {"volumes_per_s", nullptr}};
  for (size_t i = 0; i < beside.peers.size(); ++i) {
    row["peers"].push_back({{"name", beside.peers[i]->name()},
                            {"ms", Median(times.peers[i])},
                            {"ratio", RatioOf(device, times.peers[i])}});
  }
  if (scene.volumes_per_second > 0) {
    row["volumes_per_s"] = {{"asked", scene.volumes_per_second},
                            {"reached", 1e3 / (Median(times.apply) + Median(times.host))}};
  }
  return row;
}

void AddAlone(const Scene& scene, const Subject& subject, const Times& times, const Alone& alone,
              json& row) {
  const auto device = [&](const Times& of) -> const std::vector<double>& {
    return scene.slicing_only ? of.slice : of.device;
  };
  row["reason"] = subject.info().reason;
  row["one_gpu"] = {{"device_ms", SpreadJson(device(alone.times))},
                    {"host_ms", SpreadJson(alone.times.host)},
                    {"apply_ms", SpreadJson(alone.times.apply)}};
  row["speedup"] = {{"device", RatioOf(device(alone.times), device(times))},
                    {"host", RatioOf(alone.times.host, times.host)}};
  row["same_bytes"] = true;  // otherwise there would be no row
}

absl::Status CheckOptions(const FrameOptions& options) {
  const std::vector<std::string> scenes = SceneNames();
  if (std::find(scenes.begin(), scenes.end(), options.scene) == scenes.end()) {
    return absl::InvalidArgumentError(absl::StrCat("--scene is '", options.scene, "'; give one of ",
                                                   absl::StrJoin(scenes, ", ")));
  }
  if (options.engine != "cpu" && options.engine != "cuda") {
    return absl::InvalidArgumentError(
        absl::StrCat("--engine is '", options.engine, "'; give cpu or cuda"));
  }
  if (options.gpus < 0 || options.gpus > 64) {
    return absl::InvalidArgumentError(
        absl::StrCat("--gpus is ", options.gpus, "; give a number from 1 to 64, or leave it out"));
  }
  if (options.engine == "cuda" && options.threads != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--threads is ", options.threads,
                     " with --engine cuda; leave it out: they are the CPU engine's"));
  }
  if (options.keep_tiles && (options.engine != "cuda" || options.gpus > 0)) {
    return absl::InvalidArgumentError("--keep-tiles is for --engine cuda without --gpus");
  }
  if (options.threads < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--threads is ", options.threads, "; give a number from 1, or 0: one a core"));
  }
  if (options.rounds < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("--rounds is ", options.rounds, "; give a number from 1"));
  }
  if (!(options.share > 0 && options.share <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--share is ", options.share, "; give a number above 0, at most 1"));
  }
  return absl::OkStatus();
}

// Returns the thread counts that get a row each. If there is a reference or a memcpy to compare
// with, one thread is measured too.
std::vector<int> ThreadsOf(const FrameOptions& options, const Scene& scene) {
  if (options.engine == "cuda") return {0};
  if (options.threads > 0) return {options.threads};
  const int all = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  if (options.gpus > 0) return {all};
  if (scene.plain_peer) return {1, 2};
  if (scene.slicing_only && all > 1) return {1, all};
  return {all};
}

}  // namespace

absl::StatusOr<json> MeasureFrames(const FrameOptions& options,
                                   const std::function<void(const std::string&)>& progress,
                                   const std::function<bool()>& go_on) {
  if (absl::Status status = CheckOptions(options); !status.ok()) return status;
  json report = {{"rows", json::array()}};
  for (const MakeScene& make : ScenesOf(options.scene, options.seed, options.share)) {
    const absl::StatusOr<Scene> made_scene = make();
    if (!made_scene.ok()) return made_scene.status();
    const Scene& scene = *made_scene;
    for (const int threads : ThreadsOf(options, scene)) {
      Subject::Machine machine{options.engine, threads, options.gpus, options.nccl,
                               options.keep_tiles};
      auto subject = Subject::Create(machine, scene);
      if (!subject.ok()) return subject.status();
      std::unique_ptr<Subject> one;
      if (options.gpus > 0) {
        machine.gpus = 1;
        auto made = Subject::Create(machine, scene);
        if (!made.ok()) return made.status();
        one = *std::move(made);
      }
      Alone alone{one.get(), {}};
      auto beside = BesideOf(scene, options.engine == "cuda", threads);
      if (!beside.ok()) return beside.status();
      const absl::StatusOr<Times> times = Measure(**subject, alone, *beside, options.rounds, go_on);
      if (!times.ok()) return times.status();
      report["rows"].push_back(RowOf(scene, options, threads, **subject, *beside, *times));
      if (one != nullptr) AddAlone(scene, **subject, *times, alone, report["rows"].back());
      progress(RowText(report["rows"].back()));
    }
  }
  return report;
}

}  // namespace voxeld::bench::frame
