// The CPU's engine, whose calls end when a simulation lets them, or fail as it says. Its answers are posted, as
// those of an engine with threads are.
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

// Of one display; outlives its engines. Single-threaded.
struct EngineStage {
  struct Call {
    sync::TimeNs due = 0;
    const void* engine = nullptr;
    std::function<void(bool cancelled)> run;
  };

  sync::Clock* clock = nullptr;
  std::function<sync::TimeNs()> takes;             // how long the next call does
  std::optional<absl::Status> fail;                // the next frame ends in this, once
  bool fail_staging = false;                       // AcquireStaging is refused, once
  std::function<void(uint64_t volume)> on_submit;  // as it is asked for
  std::function<void(uint64_t volume, const absl::Status&)> on_failed;
  // As it is drawn: from that scene, these bytes.
  std::function<void(uint64_t volume, const daemon::testing::SceneModel& scene,
                     std::span<const std::byte> bytes)>
      on_frame;
  std::deque<Call> calls;  // in order

  sync::TimeNs Next() const { return calls.empty() ? sync::kNever : calls.front().due; }
  // Carries out the next call.
  void Run();
  // Whether a call of any is being carried out, in this thread.
  static bool IsRunning();
};

std::unique_ptr<gpu::Engine> MakeStagedEngine(std::shared_ptr<EngineStage> stage);

}  // namespace voxeld::simulation
