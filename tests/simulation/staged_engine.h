// The CPU engine, whose calls end when the simulation lets them, or fail on request. Its answers
// are posted, as those of an engine with threads are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/status.h"
#include "display/sync/clock.h"
#include "gpu/engine.h"
#include "tests/daemon/fakes/recording_engine.h"

namespace voxeld::simulation {

// The stage of one display's engines; outlives them. Single-threaded.
struct EngineStage {
  struct Call {
    sync::TimeNs due = 0;
    const void* engine = nullptr;
    std::function<void(bool cancelled)> run;
  };

  sync::Clock* clock = nullptr;
  std::function<sync::TimeNs()> takes;             // how long the next call takes
  std::optional<absl::Status> fail;                // the next frame ends with this error, once
  bool fail_staging = false;                       // the next AcquireStaging is refused, once
  std::function<void(uint64_t volume)> on_submit;  // called when a volume is requested
  std::function<void(uint64_t volume, const absl::Status&)> on_failed;
  // Called when a volume is drawn, with its scene and bytes.
  std::function<void(uint64_t volume, const daemon::testing::SceneModel& scene,
                     std::span<const std::byte> bytes)>
      on_frame;
  std::deque<Call> calls;  // in order

  sync::TimeNs Next() const { return calls.empty() ? sync::kNever : calls.front().due; }
  // Carries out the next call.
  void Run();
  // Returns whether a call of any stage is being carried out in this thread.
  static bool IsRunning();
};

std::unique_ptr<gpu::Engine> MakeStagedEngine(std::shared_ptr<EngineStage> stage);

}  // namespace voxeld::simulation
