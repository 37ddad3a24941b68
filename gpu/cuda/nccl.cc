#include "gpu/cuda/nccl.h"

#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cuda/opened_library.h"

namespace voxeld::gpu::cuda {
namespace {

// Values of nccl.h, as far as they are used.
constexpr int kSuccess = 0;     // ncclSuccess
constexpr int kInProgress = 7;  // ncclInProgress
constexpr int kUint8 = 1;       // ncclUint8
constexpr int kInt32 = 2;       // ncclInt32
constexpr int kMin = 3;         // ncclMin
struct UniqueId {               // ncclUniqueId
  char internal[128];
};
static_assert(sizeof(UniqueId) == sizeof(Nccl::Id));

}  // namespace

struct Nccl::Functions {
  int (*get_version)(int*) = nullptr;
  const char* (*get_error_string)(int) = nullptr;
  int (*get_unique_id)(UniqueId*) = nullptr;
  int (*comm_init_rank)(void**, int, UniqueId, int) = nullptr;
  int (*comm_abort)(void*) = nullptr;
  int (*comm_get_async_error)(void*, int*) = nullptr;
  int (*broadcast)(const void*, void*, size_t, int, int, void*, CUstream_st*) = nullptr;
  int (*all_reduce)(const void*, void*, size_t, int, int, void*, CUstream_st*) = nullptr;
};

Nccl::Nccl() : functions_(std::make_unique<Functions>()) {}

Nccl::~Nccl() = default;

std::vector<std::string> Nccl::Places(const std::string& path,
                                      const std::function<std::string(const char*)>& environment) {
  std::vector<std::string> places;
  if (!path.empty()) places.push_back(path);
  if (std::string named = environment("VOXELD_NCCL"); !named.empty()) places.push_back(named);
  places.insert(places.end(), {"libnccl.so.2", "libnccl.so"});
  return places;
}

absl::StatusOr<std::shared_ptr<const Nccl>> Nccl::Open(const std::vector<std::string>& places) {
  std::shared_ptr<Nccl> nccl(new Nccl());
  Functions& functions = *nccl->functions_;
  const WantedFunction wanted[] = {
      {"ncclGetVersion", functions.get_version},
      {"ncclGetErrorString", functions.get_error_string},
      {"ncclGetUniqueId", functions.get_unique_id},
      {"ncclCommInitRank", functions.comm_init_rank},
      {"ncclCommAbort", functions.comm_abort},
      {"ncclCommGetAsyncError", functions.comm_get_async_error},
      {"ncclBroadcast", functions.broadcast},
      {"ncclAllReduce", functions.all_reduce},
  };
  absl::StatusOr<std::string> place = OpenLibrary("NCCL", places, wanted);
  if (!place.ok()) return place.status();
  nccl->place_ = *std::move(place);
  return nccl;
}

absl::StatusOr<std::shared_ptr<const Nccl>> Nccl::Open(const std::string& path) {
  return Open(Places(path, Environment));
}

absl::Status Nccl::Told(const char* what, int result) const {
  if (result == kSuccess) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(what, " (", place_, "): ", functions_->get_error_string(result)));
}

absl::StatusOr<std::string> Nccl::Version() const {
  int version = 0;
  if (absl::Status status = Told("ncclGetVersion", functions_->get_version(&version));
      !status.ok()) {
    return absl::FailedPreconditionError(status.message());
  }
  // The version is major · 10,000 + minor · 100 + patch; before 2.9 it had major · 1,000.
  const int major = version >= 10000 ? version / 10000 : version / 1000;
  const int rest = version >= 10000 ? version % 10000 : version % 1000;
  return absl::StrCat(major, ".", rest / 100, ".", rest % 100);
}

absl::StatusOr<Nccl::Id> Nccl::MakeId() const {
  UniqueId made{};
  if (absl::Status status = Told("ncclGetUniqueId", functions_->get_unique_id(&made));
      !status.ok()) {
    return absl::FailedPreconditionError(status.message());
  }
  Id id;
  std::memcpy(id.data(), &made, sizeof(made));
  return id;
}

absl::StatusOr<std::unique_ptr<NcclComm>> NcclComm::Join(std::shared_ptr<const Nccl> nccl,
                                                         const Nccl::Id& id, int rank, int ranks) {
  UniqueId meeting{};
  std::memcpy(&meeting, id.data(), sizeof(meeting));
  void* comm = nullptr;
  const absl::Status status =
      nccl->Told("ncclCommInitRank", nccl->functions_->comm_init_rank(&comm, ranks, meeting, rank));
  if (!status.ok()) return absl::FailedPreconditionError(status.message());
  return std::unique_ptr<NcclComm>(new NcclComm(std::move(nccl), comm, rank));
}

NcclComm::~NcclComm() { nccl_->functions_->comm_abort(comm_); }

absl::Status NcclComm::Broadcast(void* at, size_t bytes, CUstream_st* stream) {
  return nccl_->Told("ncclBroadcast", nccl_->functions_->broadcast(at, at, bytes, kUint8,
                                                                   /*root=*/0, comm_, stream));
}

absl::Status NcclComm::Least(int32_t* value, CUstream_st* stream) {
  return nccl_->Told("ncclAllReduce",
                     nccl_->functions_->all_reduce(value, value, 1, kInt32, kMin, comm_, stream));
}

absl::Status NcclComm::Check() const {
  int error = kSuccess;
  if (absl::Status status = nccl_->Told("ncclCommGetAsyncError",
                                        nccl_->functions_->comm_get_async_error(comm_, &error));
      !status.ok()) {
    return status;
  }
  return error == kInProgress ? absl::OkStatus() : nccl_->Told("NCCL", error);
}

}  // namespace voxeld::gpu::cuda
