// A scene's change as flat bytes: the data that is passed to an engine, whatever its kind.
//
// A delta is a sequence of records, each 16-byte aligned: RecordHeader, a fixed struct, arrays. It
// is little-endian and has no pointers. Ids are the caller's and unique within their kind. Records
// apply in order; the order of drawables has no influence on what is drawn.
//
//   geometry  immutable content: a kind of primitive, its parameters and arrays,
//             in its own coordinates
//   drawable  puts a geometry into a layer, under a transform, with a priority; several may
//             share one
//   layer     how its voxels combine with those below, and where it is drawn
//
// A geometry's arrays are in its record, or in bulk memory that the record refers to.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "gpu/bulk/bulk_block.h"
#include "gpu/records.h"

namespace voxeld::gpu {

// Returns the number of entries in a geometry's array of colours.
uint64_t ColorCount(const GeometryRecord& g);

// The layout of a geometry's arrays, in a record or in bulk memory: positions at the beginning,
// each array padded to 16 bytes.
struct ArrayLayout {
  uint64_t indices = 0, colors = 0;  // offsets
  uint64_t size = 0;                 // of all arrays, padding included

  static ArrayLayout Of(const GeometryRecord& g);
};

// Returns whether two layers are drawn in the same part of the scene, by their records' values.
inline bool SameClip(const LayerRecord& a, const LayerRecord& b) {
  return std::equal(a.planes, a.planes + a.plane_count, b.planes, b.planes + b.plane_count) &&
         std::equal(a.cylinders, a.cylinders + a.cylinder_count, b.cylinders,
                    b.cylinders + b.cylinder_count) &&
         a.has_region == b.has_region && (a.has_region == 0 || a.region == b.region);
}

// Appends records to a span. Overruns are counted, not written: use the SizeOf functions to size
// the span.
class DeltaWriter {
 public:
  explicit DeltaWriter(std::span<std::byte> out) : out_(out) {}

  static size_t SizeOf(const GeometryRecord& g);  // with its arrays
  static constexpr size_t kSizeOfBulkGeometry =
      sizeof(RecordHeader) + sizeof(GeometryRecord) + sizeof(BulkRef);
  static size_t SizeOf(const DrawableRecord&) {
    return sizeof(RecordHeader) + sizeof(DrawableRecord);
  }
  static size_t SizeOf(const LayerRecord&) { return sizeof(RecordHeader) + sizeof(LayerRecord); }
  static constexpr size_t kSizeOfId = sizeof(RecordHeader) + sizeof(IdRecord);
  static constexpr size_t kSizeOfReset = sizeof(RecordHeader);

  // Spans must have the lengths that the record states (indices: index_count; colors: vertex_count
  // with kPerVertex, else empty).
  void PutGeometry(const GeometryRecord& g, std::span<const float> positions,
                   std::span<const uint32_t> indices, std::span<const uint32_t> colors);
  // `arrays` holds the arrays in the order of ArrayLayout. Their contents must already have been
  // checked as ReadDelta checks those in records.
  void PutGeometry(const GeometryRecord& g, BulkBlock arrays);
  void PutDrawable(const DrawableRecord& d);
  void PutLayer(const LayerRecord& l);
  void Drop(Op op, uint64_t id);  // kDropGeometry, kDropDrawable, kDropLayer
  void Reset();

  size_t size() const { return size_; }
  bool overrun() const { return size_ > out_.size(); }
  // The blocks that the delta refers to. They go to the engine together with it
  // (StagingBlock::Refer).
  std::vector<BulkBlock> TakeReferred() { return std::move(referred_); }

 private:
  void Append(const void* data, size_t size);
  void Pad();
  void Begin(Op op, size_t size);

  std::span<std::byte> out_;
  size_t size_ = 0;
  std::vector<BulkBlock> referred_;
};

// A geometry in a delta: views into the block, or into bulk memory.
struct GeometryView {
  GeometryRecord record;
  std::span<const float> positions;  // 3 · vertex_count
  std::span<const uint32_t> indices;
  std::span<const uint32_t> colors;
  std::shared_ptr<const void> bulk;  // keeps bulk memory; null if the arrays lie in the delta
  uint64_t bulk_segment = 0;         // the segment that holds them

  bool HasArrays() const { return !positions.empty() || !indices.empty(); }
};

// ReadDelta calls these functions in the order of the records. An error from any of them ends the
// reading.
struct DeltaVisitor {
  virtual ~DeltaVisitor() = default;
  virtual absl::Status OnGeometry(const GeometryView& g) = 0;
  virtual absl::Status OnDrawable(const DrawableRecord& d) = 0;
  virtual absl::Status OnLayer(const LayerRecord& l) = 0;
  virtual absl::Status OnDrop(Op op, uint64_t id) = 0;
  virtual absl::Status OnReset() = 0;
};

// Checks every record (sizes, counts, enums, indices in range, finite numbers) and passes it to
// `visitor`. Requires: `delta` is 16-byte aligned. `bulk` finds arrays in bulk memory; null if
// the delta has none. ReadDelta checks that those arrays are complete, but not their contents,
// which their writer has checked. Errors: InvalidArgument with the byte offset, the value and the
// values that are valid.
absl::Status ReadDelta(std::span<const std::byte> delta, DeltaVisitor& visitor,
                       BulkSource* bulk = nullptr);

}  // namespace voxeld::gpu
