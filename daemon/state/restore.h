// Converts a state file to a scene that a core can restore.
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
  // Rows that could not be restored, each as "entity layer/id: why"; only the first kMostSaid.
  static constexpr size_t kMostSaid = 20;
  uint64_t left_out = 0;
  std::vector<std::string> why;
};

// Reads the file. Invalid rows are skipped. Errors: DataLoss if the file is damaged.
absl::StatusOr<RestoredState> ReadState(StateFile& file, const wire::TwoClocks& now,
                                        const Limits& limits, gpu::BulkPool* pool,
                                        text::Fonts* fonts);

}  // namespace voxeld::daemon::state
