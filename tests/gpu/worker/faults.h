// Workers that fail as their environment says:
//
//   VOXELD_FAULT_FRAME=n       at the n-th frame of each of its engines, from 1; 0 or not set: never
//   VOXELD_FAULT_COLOR=RRGGBB  at every frame while a geometry of that uniform colour is in the
//                              scene, unless the CPU is to draw it (DrawnBy); not set: never
//   VOXELD_FAULT_FILE=path     at the next frame once that file exists; it is removed first, and
//                              says how
//   VOXELD_FAULT_KIND=…        how, if a program supports several ways and no file says it
//
// Until then, such a worker is like any other.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "gpu/engine.h"
#include "gpu/rank_link.h"

namespace voxeld::gpu {

struct FaultTrigger {
  uint64_t frame = 0;             // 0: not set
  std::optional<uint32_t> color;  // 0x00RRGGBB
  std::string file;               // empty: not set
  std::string kind;

  static FaultTrigger FromEnvironment();
};

// Fails in the given way: "crash" (as for any other word), "exit", "hang", "dataloss", "exhausted"
// (an ordinary error).
absl::Status Fail(const std::string& kind);

// Wraps `engine`, which must carry out calls inline, under the name `info`. Before a frame that the
// trigger names, `fault` is called with the kind: an error is the frame's answer; after OK, the
// engine gets the frame. `link` (may be null) replaces the engine's own.
std::unique_ptr<Engine> MakeFaulty(std::unique_ptr<Engine> engine, EngineInfo info,
                                   const FaultTrigger& trigger,
                                   std::function<absl::Status(const std::string& kind)> fault,
                                   std::unique_ptr<RankLink> link = nullptr);

// Returns a link that links nothing. VOXELD_FAULT_LINK: "invite" or "join" fails, the latter for
// rank 1.
std::unique_ptr<RankLink> MakeFaultyLink();

}  // namespace voxeld::gpu
