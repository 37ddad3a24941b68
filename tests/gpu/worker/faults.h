// Workers that fail when they are told to, by their environment:
//
//   VOXELD_FAULT_FRAME=n       at the n-th frame of each of its engines, from 1; 0 or none: never
//   VOXELD_FAULT_COLOR=RRGGBB  at every frame while a geometry of that uniform colour is in the
//                              scene, unless the CPU is to draw it (DrawnBy); none: never
//   VOXELD_FAULT_KIND=…        how, where a program knows several ways
//
// Until then such a worker is like any other.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

struct FaultTrigger {
  uint64_t frame = 0;             // 0: none
  std::optional<uint32_t> color;  // 0x00RRGGBB

  static FaultTrigger FromEnvironment();
};

// `engine`, which must carry out calls inline, under the name `info`. Before a frame that the
// trigger names `fault` is called: an error is the frame's answer, after OK the engine gets it.
std::unique_ptr<Engine> MakeFaulty(std::unique_ptr<Engine> engine, EngineInfo info,
                                   const FaultTrigger& trigger,
                                   std::function<absl::Status()> fault);

}  // namespace voxeld::gpu
