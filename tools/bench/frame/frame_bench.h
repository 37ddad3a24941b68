// Measures whole frames through the engine's interface, from a draw list to packed slices, each
// scene beside its upper bound.
//
// A frame is always drawn in full. Its draw list is the same as before or new, but every drawable
// is dirty to the engine, because every layer has moved by one voxel along x (there and back) or
// because its geometries have changed. So everything is snapped, binned, cleared, drawn, sliced and
// packed again.
//
// There are two columns. "Device" is assembling and slicing by the engine's own clock, with the
// slices packed where the engine keeps them. "Host" is SubmitFrame by the caller's clock, with the
// bytes in the caller's buffer (pinned, for CUDA). Applying the change (Apply) is part of neither
// and is reported separately.
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
  int threads = 0;             // of the CPU engine; 0: one per core
  int rounds = 5;              // of each frame and its ceiling, alternately, without the first
  uint64_t seed = 1;
  double share = 1;  // of the scene's primitives
  // Number of GPUs to draw on (0 to gpus − 1), each in a process of its own, alternating with one
  // of them alone; 0: one GPU, in this process. For the CPU engine: number of processes.
  int gpus = 0;
  std::string nccl;               // path of NCCL: gpu::EngineOptions::nccl
  bool keep_tiles = false;        // turns cuda::Tuning::pack_as_drawn off
  std::vector<std::string> from;  // JSON reports to print instead of measuring; empty: none
  std::string svg;                // output file for the figure (resolution_figure.h); empty: none
};

// Runs the measurement.
// Returns: {rows: [{scene, grid [x, y, z], engine, device, threads, gpus, voxels, voxels_are
// ("drawn" or "lit"), scene_voxels, lit_voxels, rounds, packed_as_drawn, device_ms {median, least,
// greatest}, host_ms {…}, apply_ms {…}, gvoxel_per_s (device), host_gvoxel_per_s, ceiling {name,
// ms}, ratio (of the host's time to it, or of slicing alone), peers: [{name, ms, ratio (of the
// device's time)}], stages {apply, assemble, slice, copy, door: share of the total}, tiles {drawn
// (of the last frame), most}, slicing_only, volumes_per_s {asked, reached} or null, and with
// FrameOptions::gpus: reason (how the GPUs are linked), one_gpu {device_ms, host_ms, apply_ms, as
// above}, speedup {device, host: one GPU's time divided by theirs, the median over rounds},
// same_bytes}]}. Calls `progress` with a line for each row.
// Errors: Cancelled if `go_on` returns false; InvalidArgument that names the option.
absl::StatusOr<nlohmann::json> MeasureFrames(
    const FrameOptions& options, const std::function<void(const std::string&)>& progress,
    const std::function<bool()>& go_on);

// Returns "CPU, 2 threads", or the name of the device.
std::string MachineText(const nlohmann::json& row);

// Return a row as one line, and the report as readable lines.
std::string RowText(const nlohmann::json& row);
std::string FrameText(const nlohmann::json& report);

}  // namespace voxeld::bench::frame
