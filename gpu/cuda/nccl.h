// NCCL, opened at run time: the functions that are used, with our own declarations, so that nothing
// is built or shipped with it. (The names, numbers and layouts are those of its documented
// interface, unchanged since its version 2.7.) Independent of CUDA, except for the name of a
// stream.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

struct CUstream_st;  // cudaStream_t points to it

namespace voxeld::gpu::cuda {

// The library. Thread-safe.
class Nccl {
 public:
  using Id = std::array<std::byte, 128>;  // identifies a communicator to its ranks

  // Returns the places to try, in order: `path`, $VOXELD_NCCL, the loader's path. `environment`
  // returns a variable's value; empty if it is not set.
  static std::vector<std::string> Places(
      const std::string& path, const std::function<std::string(const char*)>& environment);
  // Opens the first place that works. Errors: FailedPrecondition names all places that were tried,
  // and the reasons.
  static absl::StatusOr<std::shared_ptr<const Nccl>> Open(const std::vector<std::string>& places);
  static absl::StatusOr<std::shared_ptr<const Nccl>> Open(const std::string& path);
  ~Nccl();
  Nccl(const Nccl&) = delete;
  Nccl& operator=(const Nccl&) = delete;

  const std::string& place() const { return place_; }
  absl::StatusOr<std::string> Version() const;  // "2.28.9"
  absl::StatusOr<Id> MakeId() const;

 private:
  friend class NcclComm;
  struct Functions;
  Nccl();
  absl::Status Told(const char* what, int result) const;

  std::string place_;
  const std::unique_ptr<Functions> functions_;
};

// One rank's end of a communicator. Thread-bound. Work is queued in the given stream.
class NcclComm {
 public:
  // Joins with the current device; waits for all ranks. Errors: FailedPrecondition on failure.
  static absl::StatusOr<std::unique_ptr<NcclComm>> Join(std::shared_ptr<const Nccl> nccl,
                                                        const Nccl::Id& id, int rank, int ranks);
  // Aborts, without waiting for other ranks.
  ~NcclComm();
  NcclComm(const NcclComm&) = delete;
  NcclComm& operator=(const NcclComm&) = delete;

  int rank() const { return rank_; }
  // Copies rank 0's bytes to the same memory of all ranks. Errors: DataLoss if it cannot be queued.
  absl::Status Broadcast(void* at, size_t bytes, CUstream_st* stream);
  // Replaces each rank's value by the least of all.
  absl::Status Least(int32_t* value, CUstream_st* stream);
  // Errors: DataLoss if an operation has failed since.
  absl::Status Check() const;

 private:
  NcclComm(std::shared_ptr<const Nccl> nccl, void* comm, int rank)
      : nccl_(std::move(nccl)), comm_(comm), rank_(rank) {}

  const std::shared_ptr<const Nccl> nccl_;
  void* const comm_;
  const int rank_;
};

}  // namespace voxeld::gpu::cuda
