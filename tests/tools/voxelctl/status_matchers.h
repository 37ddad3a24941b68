// Matchers of statuses by their messages.
#pragma once

#include <gmock/gmock.h>

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::voxelctl {

inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

MATCHER(IsOk, "") {
  *result_listener << StatusOf(arg).ToString();
  return StatusOf(arg).ok();
}

// Matches an error whose message contains every one of `words`.
MATCHER_P(Fails, words, "") {
  const absl::Status& status = StatusOf(arg);
  *result_listener << status.ToString();
  if (status.ok()) return false;
  for (const std::string& word : std::vector<std::string>(words)) {
    if (std::string(status.message()).find(word) == std::string::npos) {
      *result_listener << ", which lacks \"" << word << "\"";
      return false;
    }
  }
  return true;
}

using Words = std::vector<std::string>;

}  // namespace voxeld::voxelctl
