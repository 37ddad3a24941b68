#include "gpu/cuda/upload_plan.h"

#include <algorithm>

#include "gpu/bulk/bulk_pool.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr size_t kAlign = BulkPool::kAlign;

}  // namespace

void UploadPlan::AddInline(const GeometryView& view) {
  if (copies_.empty()) {
    copies_.push_back({.from = reinterpret_cast<const std::byte*>(view.positions.data())});
  }
  Copy& copy = copies_.front();
  // Records are in ascending order, and so are the arrays in each.
  const auto include = [&](auto array) {
    if (array.empty()) return;
    const auto* end = reinterpret_cast<const std::byte*>(array.data() + array.size());
    copy.size = std::max(copy.size, static_cast<size_t>(end - copy.from));
  };
  include(view.positions);
  include(view.indices);
  include(view.colors);
  size_ = copy.size;
}

size_t UploadPlan::AddBulk(const GeometryView& view) {
  const auto* from = reinterpret_cast<const std::byte*>(view.positions.data());
  const size_t size = ArrayLayout::Of(view.record).size;
  if (segment_ == view.bulk_segment && !copies_.empty()) {
    Copy& last = copies_.back();
    const std::byte* const end = last.from + last.size;
    // The bytes between them belong to the same block as those before.
    if (from >= end && from < end + kAlign) {
      const auto distance = static_cast<size_t>(from - last.from);
      last.size = distance + size;
      size_ = last.to + last.size;
      return last.to + distance;
    }
  }
  const size_t to = (size_ + kAlign - 1) / kAlign * kAlign;
  copies_.push_back({from, size, to});
  segment_ = view.bulk_segment;
  size_ = to + size;
  return to;
}

}  // namespace voxeld::gpu::cuda
