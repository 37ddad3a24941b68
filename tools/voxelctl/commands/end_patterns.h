// Ends test patterns, so that displays show the scene.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

struct EndedPatterns {
  std::vector<std::string> ended;        // displays
  std::vector<std::string> stay;         // displays whose pattern the caller lacks the scope to end
  std::vector<std::string> not_showing;  // sentences, as NotShowing returns them
};

// Ends the test pattern of every display that shows one.
absl::StatusOr<EndedPatterns> EndPatterns(Connection& connection);

// Returns a sentence about patterns that stay; empty if none does. Escaped for a terminal.
std::string PatternsStay(const EndedPatterns& patterns);

}  // namespace voxeld::voxelctl
