// NCCL, opened at run time: what is used of it, by declarations of our own, so that nothing is built
// or shipped with it. (The names, numbers and layouts are those of its documented interface, the same
// since its version 2.7.) Knows no CUDA but the name of a stream.
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
  using Id = std::array<std::byte, 128>;  // by which the ranks of a communicator meet

  // Where it is looked for, in order: `path`, $VOXELD_NCCL, what the loader finds. `environment`: a
  // variable's value; empty if it is not set.
  static std::vector<std::string> Places(
      const std::string& path, const std::function<std::string(const char*)>& environment);
  // The first that there is. FailedPrecondition names all that were tried, and why not.
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

// One rank's end of a communicator. Thread-bound. What it queues goes into the stream that is named.
class NcclComm {
 public:
  // Of the device that is current; waits for all ranks. FailedPrecondition if it cannot be.
  static absl::StatusOr<std::unique_ptr<NcclComm>> Join(std::shared_ptr<const Nccl> nccl,
                                                        const Nccl::Id& id, int rank, int ranks);
  // Aborts: waits for no other rank.
  ~NcclComm();
  NcclComm(const NcclComm&) = delete;
  NcclComm& operator=(const NcclComm&) = delete;

  int rank() const { return rank_; }
  // Rank 0's bytes into the same memory of all. DataLoss if it cannot be queued.
  absl::Status Broadcast(void* at, size_t bytes, CUstream_st* stream);
  // The least of all ranks' values, in place of each.
  absl::Status Least(int32_t* value, CUstream_st* stream);
  // DataLoss if something has gone wrong since.
  absl::Status Check() const;

 private:
  NcclComm(std::shared_ptr<const Nccl> nccl, void* comm, int rank)
      : nccl_(std::move(nccl)), comm_(comm), rank_(rank) {}

  const std::shared_ptr<const Nccl> nccl_;
  void* const comm_;
  const int rank_;
};

}  // namespace voxeld::gpu::cuda
