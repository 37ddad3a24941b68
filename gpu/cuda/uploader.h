// Brings the arrays of deltas to the device: from the host's memory or, once it has joined the
// other ranks of its display, large ones from the first rank's device, the only one that then
// copies from the host.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/nccl.h"
#include "gpu/cuda/upload_plan.h"
#include "gpu/rank_link.h"

namespace voxeld::gpu::cuda {

// Thread-bound.
class Uploader final : public RankLink {
 public:
  explicit Uploader(Device& device) : device_(device) {}
  ~Uploader() override;
  Uploader(const Uploader&) = delete;
  Uploader& operator=(const Uploader&) = delete;

  // Returns memory of the plan's size (not 0), with the copies into it queued in the device's
  // stream. The sources of the copies must stay valid until Wait. Errors: ResourceExhausted if a
  // rank that takes part has no memory: then all ranks return it, and nothing has changed.
  absl::StatusOr<Block> Upload(const UploadPlan& plan);
  // Waits for the queued work.
  absl::Status Wait();

  absl::StatusOr<Invitation> Invite(const std::string& library) override;
  absl::Status Join(const std::string& library, const Invitation& invitation, int rank,
                    int ranks) override;

 private:
  absl::Status OpenLibrary(const std::string& library);
  absl::Status CopyAll(const UploadPlan& plan, const Block& block);
  absl::Status Broadcast(const UploadPlan& plan, const Block& block);
  // Lets copies that were queued before an error finish before their memory is freed.
  absl::Status GivenUp(const absl::Status& why);
  absl::StatusOr<bool> AllHave(bool mine);

  Device& device_;
  std::shared_ptr<const Nccl> nccl_;
  std::unique_ptr<NcclComm> comm_;  // null: not joined
  Block agreed_;                    // a number
  cudaEvent_t event_ = nullptr;
};

}  // namespace voxeld::gpu::cuda
