// A stream of raw requests, for scenes that are restored primitive by primitive as they were
// received.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/process/interrupt.h"
#include "voxeld/v1/scene.pb.h"

namespace grpc {
class Channel;
}

namespace voxeld::voxelctl {

// Every call blocks until it is done, the stream ends or an interrupt comes (Cancelled). Statuses
// are the server's, with messages escaped for a terminal. Not thread-safe.
class RawStream {
 public:
  // Outcomes are not requested. `interrupt` must outlive the stream.
  static absl::StatusOr<std::unique_ptr<RawStream>> Open(std::shared_ptr<grpc::Channel> channel,
                                                         const std::string& address, v1::Open open,
                                                         Interrupt& interrupt);
  ~RawStream();
  RawStream(const RawStream&) = delete;
  RawStream& operator=(const RawStream&) = delete;

  uint64_t owner() const;

  // Waits for credit, then sends.
  absl::Status Send(const v1::StreamRequest& request);
  // Commits everything since the last commit. Returns: the acceptance. Errors: FailedPrecondition
  // if it was refused.
  absl::StatusOr<v1::Accepted> Commit();
  // Returns the issues since the previous call, at most the first kMostIssues.
  static constexpr size_t kMostIssues = 100;
  std::vector<v1::Issue> TakeIssues();
  // Ends the session. Its Open message determines what happens to its layers.
  absl::Status Close();

 private:
  class Impl;
  explicit RawStream(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::voxelctl
