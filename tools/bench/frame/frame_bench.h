// Whole frames through the engine's door, from a draw list to packed slices, each scene beside its ceiling.
//
// A frame is whole: its draw list is the same as before, or new, but every drawable of it is new to the engine, because
// every layer has moved by one voxel along x (there and back), or because its geometries are others. So everything
// is snapped, binned, cleared, drawn, sliced and packed anew.
//
// Two columns. "Device": assembling and slicing by the engine's own clock, the slices packed where the engine keeps
// them. "Host": SubmitFrame by the caller's clock, the bytes in the caller's buffer (pinned, for CUDA). Taking in what
// changed (Apply) is neither's: it is told by itself.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::bench::frame {

struct FrameOptions {
  std::string scene;           // of SceneNames()
  std::string engine = "cpu";  // or "cuda"
  int threads = 0;             // of the CPU engine; 0: one a core
  int rounds = 5;              // of each frame and its ceiling, in turns, the first not counted
  uint64_t seed = 1;
  double share = 1;  // of the scene's primitives
  // Over so many GPUs (0 to gpus − 1), each in a process of its own, in turns with one of them alone;
  // 0: one, in this process. Of the CPU engine: processes.
  int gpus = 0;
  std::string nccl;               // where NCCL is: gpu::EngineOptions::nccl
  bool keep_tiles = false;        // cuda::Tuning::pack_as_drawn is off
  std::vector<std::string> from;  // reports (JSON) to show again instead of measuring; empty: none
  std::string svg;                // a file for the figure (resolution_figure.h); empty: none
};

// {rows: [{scene, grid [x, y, z], engine, device, threads, gpus, voxels, voxels_are ("drawn" or "lit"), scene_voxels, lit_voxels,
// rounds, packed_as_drawn, device_ms {median, least, greatest}, host_ms {…}, apply_ms {…}, gvoxel_per_s (device), host_gvoxel_per_s,
// ceiling {name, ms}, ratio (of the host's time to it, or of slicing alone), peers: [{name, ms, ratio (of the device's
// time)}], stages {apply, assemble, slice, copy, door: share of
// all}, tiles {drawn (of the last frame), most}, slicing_only, volumes_per_s {asked, reached} or
// null, and with FrameOptions::gpus: reason (how they are linked), one_gpu {device_ms, host_ms, apply_ms, as above},
// speedup {device, host: one GPU's time by theirs, the median over rounds}, same_bytes}]}. `progress` takes a line for each row; false from `go_on` ends it with Cancelled. InvalidArgument names the
// option.
absl::StatusOr<nlohmann::json> MeasureFrames(
    const FrameOptions& options, const std::function<void(const std::string&)>& progress,
    const std::function<bool()>& go_on);

// "CPU, 2 threads", or the device.
std::string MachineText(const nlohmann::json& row);

// A row as one line, and the report as lines for people.
std::string RowText(const nlohmann::json& row);
std::string FrameText(const nlohmann::json& report);

}  // namespace voxeld::bench::frame
