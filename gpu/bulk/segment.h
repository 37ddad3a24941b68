// A run of memory that processes may share: a memfd that can be neither shrunk nor grown, mapped
// where it is needed; or, where nobody else is, ordinary memory of the same shape.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Thread-safe. The pages that were never written cost nothing.
class Segment {
 public:
  // ResourceExhausted if the system has no memory or descriptors left.
  static absl::StatusOr<std::shared_ptr<Segment>> Create(size_t size);
  // The same, but nobody who is handed the descriptor can write to it (where the system knows such a
  // seal: Linux 5.1).
  static absl::StatusOr<std::shared_ptr<Segment>> CreateReadOnlyForOthers(size_t size);
  // Without a descriptor.
  static absl::StatusOr<std::shared_ptr<Segment>> CreatePrivate(size_t size);

  // One that the other process made: takes `fd`. InvalidArgument unless it has that size and the
  // seals.
  static absl::StatusOr<std::shared_ptr<Segment>> Adopt(int fd, size_t size);
  // The same, not to be written: the system would end the process.
  static absl::StatusOr<std::shared_ptr<Segment>> AdoptReadOnly(int fd, size_t size);
  ~Segment();
  Segment(const Segment&) = delete;
  Segment& operator=(const Segment&) = delete;

  // Of this process: how often the system had no memory for one. Any thread.
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
