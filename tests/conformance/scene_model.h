// A scene as plain data: the oracle draws it, and deltas are written from it.
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

// One delta, to which operations are appended.
class DeltaBuffer {
 public:
  void Put(const ModelGeometry& g);
  void Put(const DrawableRecord& d);
  void Put(const LayerRecord& l);
  void Drop(Op op, uint64_t id);
  void Reset();
  // Forgets everything and inserts `scene`.
  void PutWhole(const SceneModel& scene);

  const std::vector<std::byte>& bytes() const { return bytes_; }
  // Returns the bulk memory that it refers to: the arrays of some geometries, chosen at random, are
  // there.
  const std::vector<BulkBlock>& referred() const { return referred_; }

 private:
  std::span<std::byte> Grow(size_t size);
  std::vector<std::byte> bytes_;
  std::vector<BulkBlock> referred_;
};

}  // namespace voxeld::gpu::conformance
