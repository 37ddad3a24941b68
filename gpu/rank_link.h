// What lets the ranks of one display (gpu/ranks), each an engine in a process of its own, hand each
// other what comes: one of them invites, all of them join.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Thread-bound, with its engine.
class RankLink {
 public:
  using Invitation = std::array<std::byte, 128>;

  virtual ~RankLink() = default;

  // By which all ranks join, once. `library`: where it is to be found, as EngineOptions::nccl says.
  // FailedPrecondition if it is not.
  virtual absl::StatusOr<Invitation> Invite(const std::string& library) = 0;

  // Waits for all the others to join. From then on every rank must be given the same calls of Apply
  // in the same order: some wait for the others. An error is for good.
  virtual absl::Status Join(const std::string& library, const Invitation& invitation, int rank,
                            int ranks) = 0;
};

}  // namespace voxeld::gpu
