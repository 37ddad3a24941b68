#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

std::span<std::byte> DeltaBuffer::Grow(size_t size) {
  const size_t before = bytes_.size();
  bytes_.resize(before + size);
  return std::span(bytes_).subspan(before);
}

void DeltaBuffer::Put(const ModelGeometry& g) {
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
