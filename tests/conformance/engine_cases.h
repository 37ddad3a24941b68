// Every engine that must pass the conformance suite: one line each.
#pragma once

#include <vector>

#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

inline std::vector<EngineCase> EngineCases() {
  const auto of_kind = [](EngineKind kind) {
    return [kind](EngineOptions options) {
      options.kind = kind;
      return CreateEngine(options);
    };
  };
  return {
      {"cpu", of_kind(EngineKind::kCpu)},
  };
}

}  // namespace voxeld::gpu::conformance
