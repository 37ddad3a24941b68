// A scene as plain data: what the oracle draws and what deltas are written from.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::gpu::conformance {

struct ModelGeometry {
  GeometryRecord record;
  std::vector<float> positions;
  std::vector<uint32_t> indices;
  std::vector<uint32_t> colors;
};

struct SceneModel {
  std::map<uint64_t, ModelGeometry> geometries;
  std::map<uint64_t, DrawableRecord> drawables;
  std::map<uint64_t, LayerRecord> layers;
};

// One delta, growing.
class DeltaBuffer {
 public:
  void Put(const ModelGeometry& g);
  void Put(const DrawableRecord& d);
  void Put(const LayerRecord& l);
  void Drop(Op op, uint64_t id);
  void Reset();
  // Forgets everything and puts `scene`.
  void PutWhole(const SceneModel& scene);

  const std::vector<std::byte>& bytes() const { return bytes_; }
  // What it refers to: of some geometries, by chance, the arrays lie in bulk memory.
  const std::vector<BulkBlock>& referred() const { return referred_; }

 private:
  std::span<std::byte> Grow(size_t size);
  std::vector<std::byte> bytes_;
  std::vector<BulkBlock> referred_;
};

}  // namespace voxeld::gpu::conformance
