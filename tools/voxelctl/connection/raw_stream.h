// A stream of the wire's own requests: for what is put up as it was told, primitive by primitive.
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

// Every call blocks until it is through, the stream ends or an interrupt comes (Cancelled). Statuses are the
// server's, their messages made fit for a terminal. Not thread-safe.
class RawStream {
 public:
  // Outcomes are not asked for. `interrupt` outlives it.
  static absl::StatusOr<std::unique_ptr<RawStream>> Open(std::shared_ptr<grpc::Channel> channel,
                                                         const std::string& address, v1::Open open,
                                                         Interrupt& interrupt);
  ~RawStream();
  RawStream(const RawStream&) = delete;
  RawStream& operator=(const RawStream&) = delete;

  uint64_t owner() const;

  // Waits for credit.
  absl::Status Send(const v1::StreamRequest& request);
  // Of all that was sent since the last one; answers what it came to. FailedPrecondition if it was refused.
  absl::StatusOr<v1::Accepted> Commit();
  // That came since they were taken last, the first kMostIssues of them.
  static constexpr size_t kMostIssues = 100;
  std::vector<v1::Issue> TakeIssues();
  // Ends the session; what becomes of its layers is Open's.
  absl::Status Close();

 private:
  class Impl;
  explicit RawStream(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::voxelctl
