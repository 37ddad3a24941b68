// Memory that two processes share: a memfd that can be neither shrunk nor grown, mapped in both.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Thread-safe. The pages that were never written cost nothing.
class Segment {
 public:
  // ResourceExhausted if the system has no memory or descriptors left.
  static absl::StatusOr<std::shared_ptr<Segment>> Create(size_t size);
  // One that the other process made: takes `fd`. InvalidArgument unless it has that size and the
  // seals.
  static absl::StatusOr<std::shared_ptr<Segment>> Adopt(int fd, size_t size);
  ~Segment();
  Segment(const Segment&) = delete;
  Segment& operator=(const Segment&) = delete;

  std::span<std::byte> bytes() const { return {data_, size_}; }
  int fd() const { return fd_; }

 private:
  static absl::StatusOr<std::shared_ptr<Segment>> Map(int fd, size_t size);
  Segment(int fd, std::byte* data, size_t size) : fd_(fd), data_(data), size_(size) {}

  const int fd_;
  std::byte* const data_;
  const size_t size_;
};

}  // namespace voxeld::gpu
