#include "tests/conformance/scene_model.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <utility>

#include "gpu/bulk/bulk_pool.h"

namespace voxeld::gpu::conformance {

namespace {

// Returns a pool whose segments are so small that they are created and removed while the tests run.
BulkPool& Bulk() {
  static const std::shared_ptr<BulkPool> pool =
      BulkPool::Create({.segment_bytes = 4096, .keep_bytes = 0});
  return *pool;
}

// Chosen at random, but always alike for the same geometry.
bool InBulk(const ModelGeometry& g) {
  return !g.positions.empty() &&
         std::hash<uint64_t>()(g.record.id * 0x9E3779B97F4A7C15u >> 17) % 2 == 0;
}

BulkBlock BlockOf(const ModelGeometry& g) {
  const ArrayLayout layout = ArrayLayout::Of(g.record);
  BulkPool::Fresh fresh = Bulk().Allocate(layout.size).value();
  const auto put = [&](uint64_t at, const auto& values) {
    std::ranges::copy(std::as_bytes(std::span(values)),
                      fresh.bytes.begin() + static_cast<ptrdiff_t>(at));
  };
  put(0, g.positions);
  put(layout.indices, g.indices);
  put(layout.colors, g.colors);
  return fresh.block;
}

}  // namespace

std::span<std::byte> DeltaBuffer::Grow(size_t size) {
  const size_t before = bytes_.size();
  bytes_.resize(before + size);
  return std::span(bytes_).subspan(before);
}

void DeltaBuffer::Put(const ModelGeometry& g) {
  if (InBulk(g)) {
    DeltaWriter writer(Grow(DeltaWriter::kSizeOfBulkGeometry));
    writer.PutGeometry(g.record, BlockOf(g));
    for (BulkBlock& block : writer.TakeReferred()) referred_.push_back(std::move(block));
    return;
  }
  DeltaWriter writer(Grow(DeltaWriter::SizeOf(g.record)));
  writer.PutGeometry(g.record, g.positions, g.indices, g.colors);
}

void DeltaBuffer::Put(const DrawableRecord& d) {
  DeltaWriter writer(Grow(DeltaWriter::SizeOf(d)));
  writer.PutDrawable(d);
}

void DeltaBuffer::Put(const LayerRecord& l) {
  DeltaWriter writer(Grow(DeltaWriter::SizeOf(l)));
  writer.PutLayer(l);
}

void DeltaBuffer::Drop(Op op, uint64_t id) {
  DeltaWriter writer(Grow(DeltaWriter::kSizeOfId));
  writer.Drop(op, id);
}

void DeltaBuffer::Reset() {
  DeltaWriter writer(Grow(DeltaWriter::kSizeOfReset));
  writer.Reset();
}

void DeltaBuffer::PutWhole(const SceneModel& scene) {
  Reset();
  for (const auto& [id, layer] : scene.layers) Put(layer);
  for (const auto& [id, geometry] : scene.geometries) Put(geometry);
  for (const auto& [id, drawable] : scene.drawables) Put(drawable);
}

}  // namespace voxeld::gpu::conformance
