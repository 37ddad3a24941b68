#include "gpu/geometry_arrays.h"

#include <cstdlib>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kArrayAlign = 16;

}  // namespace

absl::StatusOr<GeometryArrays> GeometryArrays::Allocate(const GeometryRecord& record,
                                                        BulkPool* pool) {
  const ArrayLayout layout = ArrayLayout::Of(record);
  GeometryArrays arrays;
  if (layout.size == 0) return arrays;
  std::byte* at = nullptr;
  if (pool != nullptr && layout.size >= kLeastBulk) {
    absl::StatusOr<BulkPool::Fresh> fresh = pool->Allocate(layout.size);
    if (!fresh.ok()) return fresh.status();
    at = fresh->bytes.data();
    arrays.block_ = std::move(fresh->block);
  } else {
    at = static_cast<std::byte*>(std::aligned_alloc(
        kArrayAlign, (layout.size + kArrayAlign - 1) / kArrayAlign * kArrayAlign));
    if (at == nullptr) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the system has no ", layout.size, " bytes of memory left"));
    }
    arrays.memory_ = {at, [](std::byte* memory) { std::free(memory); }};
  }
  arrays.positions_ = {reinterpret_cast<float*>(at), size_t{record.vertex_count} * 3};
  arrays.indices_ = {reinterpret_cast<uint32_t*>(at + layout.indices), record.index_count};
  arrays.colors_ = {reinterpret_cast<uint32_t*>(at + layout.colors), ColorCount(record)};
  return arrays;
}

GeometryArrays GeometryArrays::Of(const GeometryRecord& record, std::span<const float> positions,
                                  std::span<const uint32_t> indices,
                                  std::span<const uint32_t> colors) {
  GeometryArrays arrays = Allocate(record, nullptr).value();
  const auto copy = [](auto from, auto to) {
    if (!from.empty()) std::memcpy(to.data(), from.data(), to.size_bytes());
  };
  copy(positions, arrays.positions_);
  copy(indices, arrays.indices_);
  copy(colors, arrays.colors_);
  return arrays;
}

}  // namespace voxeld::gpu
