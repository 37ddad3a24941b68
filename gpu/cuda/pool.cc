#include "gpu/cuda/pool.h"

#include <algorithm>
#include <bit>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr size_t kLeast = 4096;
constexpr size_t kKeptBytes = 64 << 20;  // are kept, however little is in use

// Rounds up to eighths of a power of two, so that slightly different sizes fit the same block.
size_t RoundUp(size_t size) {
  size = std::max(size, kLeast);
  const size_t step = std::bit_floor(size) / 8;
  return (size + step - 1) & ~(step - 1);
}

}  // namespace

Pool::Pool(Pool& whole, size_t limit) : api_(whole.api_), whole_(&whole), limit_(limit) {
  whole.parts_.push_back(this);
}

Pool::~Pool() {
  FreeKept();
  if (whole_ != nullptr) std::erase(whole_->parts_, this);
}

bool Pool::FreeKept() {
  const bool any = !free_.empty();
  for (const auto& [size, data] : free_) {
    cudaFree(data);
    held_ -= size;
    if (whole_ != nullptr) whole_->held_ -= size;
  }
  free_.clear();
  return any;
}

bool Pool::FreeAllKept() {
  Pool& whole = whole_ != nullptr ? *whole_ : *this;
  bool any = whole.FreeKept();
  for (Pool* part : whole.parts_) any |= part->FreeKept();
  return any;
}

void Pool::BeginPeak() {
  peak_ = used_;
  for (Pool* part : parts_) part->BeginPeak();
}

void Pool::TrimAfterPeak() {
  for (Pool* part : parts_) part->TrimAfterPeak();
  size_t held = held_;
  for (const Pool* part : parts_) held -= part->held_;
  if (held > 2 * peak_ + kKeptBytes) FreeKept();
}

absl::StatusOr<Block> Pool::Acquire(size_t size) {
  size = RoundUp(size);
  const auto it = free_.lower_bound(size);
  if (it != free_.end() && it->first <= size + size / 4) {
    Block block = HandOut(it->second, it->first);
    free_.erase(it);
    return block;
  }
  if (held_ > limit_ - std::min(size, limit_)) FreeKept();
  if (size > limit_ || held_ > limit_ - size) {
    return absl::ResourceExhaustedError(absl::StrCat(size, " bytes were asked for beside ", held_,
                                                     "; no more than ", limit_, " may be taken"));
  }
  void* data = nullptr;
  const auto allocate = [&] {
    return api_.Call("cudaMalloc", [&] { return cudaMalloc(&data, size); });
  };
  absl::Status status = allocate();
  if (absl::IsResourceExhausted(status) && FreeAllKept()) status = allocate();
  if (!status.ok()) return status;
  held_ += size;
  if (whole_ != nullptr) whole_->held_ += size;
  return HandOut(data, size);
}

}  // namespace voxeld::gpu::cuda
