// Cached device memory: blocks come from a pool of released blocks, so a loop of frames with
// similar needs allocates nothing.
//
// All work on the blocks is ordered by one stream, so a released block may be handed out again at
// once. Work on them in another stream must wait for the first stream, and the first stream must
// wait for it before any block is released. A pool may be a part of another, with a limit of its
// own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/cuda/api.h"

namespace voxeld::gpu::cuda {

class Pool;

// A block of device memory, which returns to its pool when it is destroyed.
class Block {
 public:
  Block() = default;
  Block(Pool* pool, void* data, size_t size) : pool_(pool), data_(data), size_(size) {}
  Block(Block&& other) noexcept { *this = std::move(other); }
  Block& operator=(Block&& other) noexcept {
    std::swap(pool_, other.pool_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~Block();

  template <typename T>
  T* as() const {
    return static_cast<T*>(data_);
  }
  size_t size() const { return size_; }

 private:
  Pool* pool_ = nullptr;
  void* data_ = nullptr;
  size_t size_ = 0;
};

// Thread-bound. Must outlive its blocks.
class Pool {
 public:
  explicit Pool(Api& api) : api_(api) {}
  // Creates a part of `whole`, which must outlive it: memory that it holds counts in `whole`, too.
  // It never holds more than `limit` bytes.
  Pool(Pool& whole, size_t limit);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  // Returns at least `size` bytes, 256-byte aligned. Errors: ResourceExhausted if the device has no
  // memory left, or the limit is reached, even after cached blocks have been freed.
  absl::StatusOr<Block> Acquire(size_t size);
  // The same for `count` values, with room to grow: a block that is too small is replaced, and its
  // first `keep` values are copied in `stream`.
  template <typename T>
  absl::Status Grow(Block& block, size_t count, size_t keep, cudaStream_t stream) {
    if (count * sizeof(T) <= block.size()) return absl::OkStatus();
    absl::StatusOr<Block> next = Acquire(count * sizeof(T) + count * sizeof(T) / 2);
    if (absl::IsResourceExhausted(next.status())) next = Acquire(count * sizeof(T));
    if (!next.ok()) return next.status();
    if (keep > 0) {
      absl::Status copied = api_.Call("cudaMemcpyAsync", [&] {
        return cudaMemcpyAsync(next->as<T>(), block.as<T>(), keep * sizeof(T),
                               cudaMemcpyDeviceToDevice, stream);
      });
      if (!copied.ok()) return copied;
    }
    block = *std::move(next);
    return absl::OkStatus();
  }

  // Starts to measure the peak of used(), here and in the parts.
  void BeginPeak();
  // Frees the kept blocks of each pool (this one and its parts) that holds more than twice its peak
  // since BeginPeak, plus 64 MiB.
  // Blocks until the device is idle.
  void TrimAfterPeak();

  size_t held() const { return held_; }  // handed out or kept
  size_t used() const { return used_; }  // handed out
  size_t limit() const { return limit_; }

 private:
  friend class Block;
  void GiveBack(void* data, size_t size) {
    free_.emplace(size, data);
    used_ -= size;
  }
  // Returns whether there was anything to free.
  bool FreeKept();
  // Frees the cached blocks of the whole pool that this is a part of, and of all its parts.
  bool FreeAllKept();
  Block HandOut(void* data, size_t size) {
    used_ += size;
    if (used_ > peak_) peak_ = used_;
    return Block(this, data, size);
  }

  Api& api_;
  Pool* const whole_ = nullptr;
  const size_t limit_ = SIZE_MAX;
  std::vector<Pool*> parts_;
  std::multimap<size_t, void*> free_;      // by size
  size_t held_ = 0, used_ = 0, peak_ = 0;  // bytes
};

inline Block::~Block() {
  if (data_ != nullptr) pool_->GiveBack(data_, size_);
}

}  // namespace voxeld::gpu::cuda
