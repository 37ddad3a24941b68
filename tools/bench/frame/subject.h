// An engine that is measured on one scene.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "gpu/engine.h"
#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// The times of one frame. The change is applied first and then the frame is drawn; each step is
// waited for.
struct FrameTimes {
  int64_t apply_ns = 0;  // from Apply until it is done; the change is already in staging
  int64_t host_ns = 0;   // from SubmitFrame until the bytes are in the caller's buffer
  gpu::FrameResult result;

  // Returns the time until the slice images were packed in the engine's memory.
  int64_t device_ns() const { return result.assemble_ns + result.slice_ns; }
};

class Subject {
 public:
  struct Machine {
    std::string engine = "cpu";  // or "cuda"
    int threads = 0;             // of the CPU engine; 0: one per core
    // 0: draws in this process. Otherwise draws as for a display on that many GPUs, from 0 on, each
    // in a process of its own (for the CPU engine: that many processes).
    int gpus = 0;
    std::string nccl;         // gpu::EngineOptions::nccl
    bool keep_tiles = false;  // for the CUDA engine in this process
  };
  // The scene must outlive the subject.
  static absl::StatusOr<std::unique_ptr<Subject>> Create(const Machine& machine,
                                                         const Scene& scene);
  ~Subject();
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;

  const gpu::EngineInfo& info() const { return engine_->info(); }
  const std::vector<std::byte>& pictures() const { return bytes_; }

  // Applies the scene's change and draws a frame. The first call also sends the contents that stay.
  absl::StatusOr<FrameTimes> Draw();

 private:
  Subject(bool pinned, std::unique_ptr<gpu::Engine> engine, const Scene& scene);
  absl::Status SetTarget();
  absl::StatusOr<gpu::StagingBlock> Change(size_t* size);

  const bool pinned_;
  const std::unique_ptr<gpu::Engine> engine_;
  const Scene& scene_;
  std::vector<std::byte> bytes_;
  std::vector<uint64_t> changed_in_;
  uint64_t drawn_ = 0;
  const sync::SystemClock clock_;
};

}  // namespace voxeld::bench::frame
