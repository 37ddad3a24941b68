// A run of memory that processes can share: a memfd that can be neither shrunk nor grown, mapped
// where it is needed; or, if no other process needs it, ordinary memory with the same interface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Thread-safe. Pages that were never written take no memory.
class Segment {
 public:
  // Errors: ResourceExhausted if the system has no memory or descriptors left.
  static absl::StatusOr<std::shared_ptr<Segment>> Create(size_t size);
  // The same, but a process that receives the descriptor cannot write to the memory (if the system
  // has that seal: Linux 5.1).
  static absl::StatusOr<std::shared_ptr<Segment>> CreateReadOnlyForOthers(size_t size);
  // The same, without a descriptor.
  static absl::StatusOr<std::shared_ptr<Segment>> CreatePrivate(size_t size);

  // Maps a segment that another process created. Takes ownership of `fd`. Errors: InvalidArgument
  // unless it has that size and the seals.
  static absl::StatusOr<std::shared_ptr<Segment>> Adopt(int fd, size_t size);
  // The same, read-only: on a write, the system terminates the process.
  static absl::StatusOr<std::shared_ptr<Segment>> AdoptReadOnly(int fd, size_t size);
  ~Segment();
  Segment(const Segment&) = delete;
  Segment& operator=(const Segment&) = delete;

  // Returns how often the system was out of memory for a segment of this process. Any thread.
  static uint64_t Refused();

  std::span<std::byte> bytes() const { return {data_, size_}; }
  int fd() const { return fd_; }  // −1: none

 private:
  static absl::StatusOr<std::shared_ptr<Segment>> Map(int fd, size_t size, int protection);
  static absl::StatusOr<std::shared_ptr<Segment>> AdoptAs(int fd, size_t size, int protection);
  Segment(int fd, std::byte* data, size_t size) : fd_(fd), data_(data), size_(size) {}

  const int fd_;
  std::byte* const data_;
  const size_t size_;
};

}  // namespace voxeld::gpu
