// "GPU" engines that fault when a test says so: the CPU's engine, in the caller's thread, under
// another name.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cpu/cpu_engine.h"
#include "gpu/engine.h"
#include "gpu/ranks/ranked_engine.h"
#include "gpu/worker/call_channel.h"
#include "tests/daemon/fakes/recording_engine.h"

namespace voxeld::daemon::testing {

// The state of the GPU and of its engines that a test sets and reads; outlives them.
struct GpuScript {
  std::set<uint32_t> bad_colors;  // colours of geometries that fault, unless the CPU draws them
  int faults = 0;                 // the next frames fault, whatever they draw
  bool broken = false;            // every frame faults
  int late = 0;                   // the answers to the next frames are late
  int unequal = 0;  // number of frames for which one of several GPUs is out of memory: all are lost
  bool full = false;         // frames are refused as out of memory
  absl::Status absent;       // if not OK: engines are created, and are then unavailable
  bool wrong = false;        // frames have wrong bytes
  bool slow_cpu = false;     // the CPU's frames wait for RunCpu
  std::vector<bool> shared;  // whether each GPU engine is in the shared process
  int cpu_engines = 0;       // number made
  std::vector<std::function<void()>> cpu_frames;

  void RunCpu() {
    for (auto& frame : std::exchange(cpu_frames, {})) frame();
  }
};

class FaultyGpu final : public gpu::Engine {
 public:
  FaultyGpu(const gpu::EngineOptions& options, std::shared_ptr<GpuScript> script)
      : script_(std::move(script)),
        gpu_(options.kind == gpu::EngineKind::kCuda),
        lost_(options.lost) {
    gpu::EngineOptions cpu;
    cpu.threads = 1;
    cpu.inline_execution = true;
    engine_ = gpu::CreateCpuEngine(cpu, "a test");
    info_ = engine_->info();
    if (gpu_) {
      info_.kind = gpu::EngineKind::kCuda;
      info_.device = "a GPU that faults";
      script_->shared.push_back(options.workers != nullptr);
    } else {
      ++script_->cpu_engines;
    }
  }

  const gpu::EngineInfo& info() const override { return info_; }

  void SetTarget(gpu::Target target, Done done) override {
    if (gpu_ && !script_->absent.ok()) {
      gone_ = true;
      return done(absl::DataLossError(script_->absent.message()));
    }
    if (gone_) return done(absl::DataLossError("gone"));
    engine_->SetTarget(std::move(target), std::move(done));
  }
  absl::StatusOr<gpu::StagingBlock> AcquireStaging(size_t size) override {
    return engine_->AcquireStaging(size);
  }
  void Apply(gpu::StagingBlock block, size_t size, Done done) override {
    if (gone_) return done(absl::DataLossError("gone"));
    const absl::Status status = model_.Apply(block.bytes().first(size), block.referred());
    if (!status.ok()) return done(status);
    engine_->Apply(std::move(block), size, std::move(done));
  }
  void SubmitFrame(const gpu::FrameRequest& request, gpu::FrameBuffer buffer,
                   FrameDone done) override {
    if (!gpu_ && script_->slow_cpu) {
      script_->cpu_frames.push_back([this, request, buffer, done = std::move(done)] {
        engine_->SubmitFrame(request, buffer, done);
      });
      return;
    }
    if (!gpu_) return engine_->SubmitFrame(request, buffer, std::move(done));
    if (script_->full) return done(absl::ResourceExhaustedError("the device is out of memory"));
    if (script_->unequal > 0) {
      --script_->unequal;
      gone_ = true;
      absl::Status status = absl::DataLossError("the ranks of the display do not agree any more");
      status.SetPayload(gpu::kOutOfMemoryPayload, absl::Cord());
      return done(status);
    }
    if (script_->late > 0) {
      --script_->late;
      gone_ = true;
      absl::Status status = absl::DataLossError("the worker did not answer in time");
      status.SetPayload(gpu::kLatePayload, absl::Cord());
      return done(status);
    }
    if (Faults()) gone_ = true;
    if (gone_) return done(absl::DataLossError("cudaErrorIllegalAddress"));
    engine_->SubmitFrame(request, buffer, std::move(done));
    if (script_->wrong) buffer.bytes[0] ^= std::byte{1};
  }
  void ReadVoxels(gpu::VoxelBox box, std::span<uint32_t> out, Done done) override {
    engine_->ReadVoxels(box, out, std::move(done));
  }

  // The process exits between calls.
  void Die() {
    gone_ = true;
    lost_(absl::DataLossError("the worker was lost"));
  }

 private:
  bool Faults() {
    if (script_->broken) return true;
    if (script_->faults > 0) return script_->faults-- > 0;
    for (const auto& [id, drawable] : model_.drawables()) {
      const gpu::GeometryRecord& record = model_.geometries().at(drawable.geometry).record;
      if (record.drawn_by == gpu::DrawnBy::kEngine && script_->bad_colors.contains(record.color)) {
        return true;
      }
    }
    return false;
  }

  const std::shared_ptr<GpuScript> script_;
  const bool gpu_;
  const std::function<void(const absl::Status&)> lost_;
  std::unique_ptr<gpu::Engine> engine_;
  gpu::EngineInfo info_;
  SceneModel model_;
  bool gone_ = false;
};

}  // namespace voxeld::daemon::testing
