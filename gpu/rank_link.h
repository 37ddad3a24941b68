// The link over which the ranks of one display (gpu/ranks), each an engine in a process of its own,
// send each other changes of the scene: one rank invites, and all of them join.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Thread-bound, like its engine.
class RankLink {
 public:
  using Invitation = std::array<std::byte, 128>;

  virtual ~RankLink() = default;

  // Returns the invitation with which all ranks join, once. `library` says where the library is
  // found, as EngineOptions::nccl does. Errors: FailedPrecondition if it is not found.
  virtual absl::StatusOr<Invitation> Invite(const std::string& library) = 0;

  // Waits for all the others to join. From then on every rank must be given the same calls of Apply
  // in the same order, because some wait for the others. An error is permanent.
  virtual absl::Status Join(const std::string& library, const Invitation& invitation, int rank,
                            int ranks) = 0;
};

}  // namespace voxeld::gpu
