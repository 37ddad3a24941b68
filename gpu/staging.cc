#include "gpu/staging.h"

#include <new>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr std::align_val_t kAlign{16};

class HeapMemory final : public StagingBlock::Memory {
 public:
  HeapMemory(std::byte* data, size_t size, std::shared_ptr<std::atomic<uint64_t>> held)
      : data_(data), size_(size), held_(std::move(held)) {}
  ~HeapMemory() override {
    ::operator delete(data_, kAlign);
    held_->fetch_sub(size_);
  }
  std::span<std::byte> bytes() override { return {data_, size_}; }

 private:
  std::byte* data_;
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
  void* data = ::operator new(size, kAlign, std::nothrow);
  if (data == nullptr) {
    held_->fetch_sub(size);
    return absl::ResourceExhaustedError(
        absl::StrCat("staging: the system has no ", size, " bytes of memory left"));
  }
  return StagingBlock(std::make_shared<HeapMemory>(static_cast<std::byte*>(data), size, held_));
}

}  // namespace voxeld::gpu
