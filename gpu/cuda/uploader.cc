#include "gpu/cuda/uploader.h"

#include <algorithm>
#include <array>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cuda/broadcast_plan.h"

namespace voxeld::gpu::cuda {
namespace {

// The size from which a broadcast, and the agreement before it (0.2 ms), pay off: copying 10 MB to
// a single device takes that long, or 4 MB if the others share its bus.
constexpr size_t kBroadcastFrom = size_t{4} << 20;
constexpr size_t kPiece = size_t{4} << 20;

}  // namespace

Uploader::~Uploader() {
  comm_ = nullptr;
  if (event_ != nullptr) cudaEventDestroy(event_);
}

absl::StatusOr<Block> Uploader::Upload(const UploadPlan& plan) {
  absl::StatusOr<Block> block = device_.pool().Acquire(plan.size());
  if (comm_ == nullptr || plan.size() < kBroadcastFrom) {
    if (!block.ok()) return block;
    if (absl::Status status = CopyAll(plan, *block); !status.ok()) return GivenUp(status);
    return block;
  }
  if (!block.ok() && !absl::IsResourceExhausted(block.status())) return block;
  const absl::StatusOr<bool> all = AllHave(block.ok());
  if (!all.ok()) return all.status();
  if (!block.ok()) return block;
  if (!*all) {
    return absl::ResourceExhaustedError(
        absl::StrCat("another GPU of this display is out of memory for the ", plan.size(),
                     " bytes of a delta; show less, or on larger devices"));
  }
  if (absl::Status status = Broadcast(plan, *block); !status.ok()) return GivenUp(status);
  return block;
}

absl::Status Uploader::GivenUp(const absl::Status& why) {
  for (cudaStream_t stream : {device_.copies(), device_.stream()}) cudaStreamSynchronize(stream);
  return why;
}

absl::Status Uploader::Wait() {
  if (absl::Status status = device_.Wait(); !status.ok()) return status;
  return comm_ != nullptr ? comm_->Check() : absl::OkStatus();
}

absl::Status Uploader::CopyAll(const UploadPlan& plan, const Block& block) {
  for (const UploadPlan::Copy& copy : plan.copies()) {
    absl::Status status = device_.ToDevice(block.as<std::byte>() + copy.to, copy.from, copy.size);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

// Broadcasts a piece while the next is copied in, on the stream of copies.
absl::Status Uploader::Broadcast(const UploadPlan& plan, const Block& block) {
  const bool first = comm_->rank() == 0;
  const auto after = [&](cudaStream_t before, cudaStream_t then) {
    absl::Status status =
        device_.Run("cudaEventRecord", [&] { return cudaEventRecord(event_, before); });
    if (!status.ok()) return status;
    return device_.Run("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(then, event_, 0); });
  };
  // Earlier work in the stream may still use the memory.
  absl::Status status;
  if (first) status = after(device_.stream(), device_.copies());
  for (const BroadcastStep& step : BroadcastSteps(plan, kPiece)) {
    for (const UploadPlan::Copy& copy : step.copies) {
      if (!status.ok() || !first) break;
      status = device_.Run("cudaMemcpyAsync", [&] {
        return cudaMemcpyAsync(block.as<std::byte>() + copy.to, copy.from, copy.size,
                               cudaMemcpyHostToDevice, device_.copies());
      });
    }
    if (status.ok() && first) status = after(device_.copies(), device_.stream());
    if (!status.ok()) return status;
    status = comm_->Broadcast(block.as<std::byte>() + step.begin, step.size, device_.stream());
  }
  return status;
}

absl::StatusOr<bool> Uploader::AllHave(bool mine) {
  const int32_t value = mine ? 1 : 0;
  int32_t* const at = agreed_.as<int32_t>();
  absl::Status status = device_.ToDevice(at, &value, sizeof(value));
  if (status.ok()) status = comm_->Least(at, device_.stream());
  if (!status.ok()) return status;
  const absl::StatusOr<int32_t> least = device_.Read(at);
  if (!least.ok()) return least.status();
  return *least != 0;
}

absl::Status Uploader::OpenLibrary(const std::string& library) {
  if (nccl_ != nullptr) return absl::OkStatus();
  absl::StatusOr<std::shared_ptr<const Nccl>> nccl = Nccl::Open(library);
  if (!nccl.ok()) return nccl.status();
  nccl_ = *std::move(nccl);
  return absl::OkStatus();
}

absl::StatusOr<RankLink::Invitation> Uploader::Invite(const std::string& library) {
  if (absl::Status status = OpenLibrary(library); !status.ok()) return status;
  if (absl::Status status = device_.api().Enter(); !status.ok()) return status;
  return nccl_->MakeId();
}

absl::Status Uploader::Join(const std::string& library, const Invitation& invitation, int rank,
                            int ranks) {
  if (absl::Status status = OpenLibrary(library); !status.ok()) return status;
  if (absl::Status status = device_.api().Enter(); !status.ok()) return status;
  absl::StatusOr<Block> agreed = device_.pool().Acquire(sizeof(int32_t));
  if (!agreed.ok()) return agreed.status();
  agreed_ = *std::move(agreed);
  absl::Status status = device_.Run("cudaEventCreateWithFlags", [&] {
    return cudaEventCreateWithFlags(&event_, cudaEventDisableTiming);
  });
  if (!status.ok()) return status;
  absl::StatusOr<std::unique_ptr<NcclComm>> comm = NcclComm::Join(nccl_, invitation, rank, ranks);
  if (!comm.ok()) return comm.status();
  comm_ = *std::move(comm);
  // Connections between the ranks are made when they are first used: do it now, when there is time.
  if (const absl::StatusOr<bool> all = AllHave(true); !all.ok()) return all.status();
  status = comm_->Broadcast(agreed_.as<int32_t>(), sizeof(int32_t), device_.stream());
  return status.ok() ? Wait() : status;
}

}  // namespace voxeld::gpu::cuda
