// What a state file has, as a scene that a core takes.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/core/state_sink.h"
#include "daemon/state/state_file.h"
#include "daemon/wire/kept.h"

namespace voxeld::daemon::state {

struct RestoredState {
  RestoredScene scene;
  uint64_t layers = 0, entities = 0, objects = 0, expired = 0;
  // Rows that could not be had any more, each as "entity layer/id: why"; the first kMostSaid of them.
  static constexpr size_t kMostSaid = 20;
  uint64_t left_out = 0;
  std::vector<std::string> why;
};

// DataLoss if the file is damaged. A row that is wrong by itself is left out.
absl::StatusOr<RestoredState> ReadState(StateFile& file, const wire::TwoClocks& now,
                                        const Limits& limits, gpu::BulkPool* pool,
                                        text::Fonts* fonts);

}  // namespace voxeld::daemon::state
