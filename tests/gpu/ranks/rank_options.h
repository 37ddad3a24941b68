// Ranked engines of a program that needs no GPU: when CUDA is requested, it is the CPU engine under
// another name.
#pragma once

#include <vector>

#include "gpu/engine.h"
#include "tests/conformance/engine_driver.h"
#include "tests/programs.h"

namespace voxeld::gpu {

inline EngineOptions RankOptions(int ranks) {
  EngineOptions options;
  options.kind = EngineKind::kCuda;
  options.threads = 1;
  options.worker = ProgramBeside("faulty_engine");
  options.worker_deadline_ns = 20'000'000'000;
  for (int r = 0; r < ranks; ++r) options.devices.push_back(r);
  return options;
}

inline conformance::EngineDriver Drive(const EngineOptions& options) {
  return {{"ranks", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
}

}  // namespace voxeld::gpu
