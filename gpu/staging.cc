#include "gpu/staging.h"

#include <cstdlib>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kAlign = 16;

struct Free {
  void operator()(void* data) const { std::free(data); }
};
using Data = std::unique_ptr<void, Free>;

class HeapMemory final : public StagingBlock::Memory {
 public:
  HeapMemory(Data data, size_t size, std::shared_ptr<std::atomic<uint64_t>> held)
      : data_(std::move(data)), size_(size), held_(std::move(held)) {}
  ~HeapMemory() override { held_->fetch_sub(size_); }
  std::span<std::byte> bytes() override { return {static_cast<std::byte*>(data_.get()), size_}; }

 private:
  const Data data_;
  size_t size_;
  std::shared_ptr<std::atomic<uint64_t>> held_;
};

}  // namespace

StagingPool::StagingPool(uint64_t limit_bytes)
    : limit_bytes_(limit_bytes), held_(std::make_shared<std::atomic<uint64_t>>(0)) {}

absl::StatusOr<StagingBlock> StagingPool::Acquire(size_t size) {
  uint64_t held = held_->load();
  do {
    if (size > limit_bytes_ || held > limit_bytes_ - size) {
      return absl::ResourceExhaustedError(absl::StrCat("staging: ", size, " bytes asked for, ",
                                                       held, " held, limit ", limit_bytes_,
                                                       "; send less at once or raise the limit"));
    }
  } while (!held_->compare_exchange_weak(held, held + size));
  // Never ask for 0 bytes, for which the system may return no block.
  Data data(std::aligned_alloc(kAlign, (size / kAlign + 1) * kAlign));
  if (data == nullptr) {
    held_->fetch_sub(size);
    return absl::ResourceExhaustedError(
        absl::StrCat("staging: the system has no ", size, " bytes of memory left"));
  }
  return StagingBlock(std::make_shared<HeapMemory>(std::move(data), size, held_));
}

}  // namespace voxeld::gpu
