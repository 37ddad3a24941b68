// A scene's change as flat bytes: what goes through the engine's door, whoever is behind it.
//
// A delta is a sequence of records, each 16-byte aligned: RecordHeader, a fixed struct, arrays.
// Little-endian; no pointers; ids are the caller's and unique within their kind. Records apply in
// order; order between drawables has no influence on what is drawn.
//
//   geometry  immutable content: a kind of primitive, its parameters and arrays,
//             in its own coordinates
//   drawable  puts a geometry into a layer, under a transform, with a priority; several may
//             share one
//   layer     how its voxels combine with those below, and where it is drawn
//
// A geometry's arrays lie in its record, or in bulk memory that the record refers to.
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
#include "gpu/affine.h"
#include "gpu/bulk/bulk_block.h"
#include "gpu/portable.h"

namespace voxeld::gpu {

enum class Op : uint32_t {
  kPutGeometry = 1,      // GeometryRecord, positions, indices, colors. The id must be new
  kDropGeometry = 2,     // IdRecord; no drawable may use it any more at the end of the delta
  kPutDrawable = 3,      // DrawableRecord; replaces one of the same id
  kDropDrawable = 4,     // IdRecord
  kPutLayer = 5,         // LayerRecord; replaces one of the same id
  kDropLayer = 6,        // IdRecord; no drawable may be in it any more at the end of the delta
  kReset = 7,            // nothing follows: forget everything
  kPutBulkGeometry = 8,  // GeometryRecord, BulkRef: as kPutGeometry, its arrays in bulk memory
};

enum class PrimitiveKind : uint32_t {
  kPoints = 1,     // a voxel each, or a ball of `thickness`
  kSegments = 2,   // list, strip or loop
  kTriangles = 3,  // indexed or not
  kBox = 4,        // centre params[0..2], full sizes params[3..5] along its own axes
  kSphere = 5,     // centre params[0..2], radius params[3] (an ellipsoid under a transform)
  kCylinder = 6,   // centre params[0..2], radius params[3], height params[4] along its own z
  kImplicit = 7,   // its program (implicit/program.h) is the indices, its rings are positions;
                   // with params[6] = 1 only from params[0..2] to params[3..5]
  kCurves = 8,  // cubic Béziers: list (4 points each) or strip (they share ends), drawn as segments
  kPatches = 9,   // bicubic Béziers: 16 points each, along u first, drawn as triangles
  kSamples = 10,  // a grid of samples (primitives/samples.h), which the indices hold; no positions;
                  // of a surface coloured by its place params[0..3] say how
  kFilled = 11,   // what triangles enclose (primitives/filled.h), indexed or not; of one colour
};

// Worked out through the inverse of its map, and kept in its parameters alone.
VOXELD_HD constexpr bool IsSolid(PrimitiveKind kind) {
  return kind == PrimitiveKind::kBox || kind == PrimitiveKind::kSphere ||
         kind == PrimitiveKind::kCylinder;
}

// Made of control points, and cut into straight pieces where it is drawn (gpu/curves/).
constexpr bool IsCurved(PrimitiveKind kind) {
  return kind == PrimitiveKind::kCurves || kind == PrimitiveKind::kPatches;
}

enum class LineSampling : uint32_t { kThin = 0, kEuclidean = 1, kCover = 2 };
enum class SurfaceRule : uint32_t { kThin = 0, kCover = 1 };
enum class Fill : uint32_t { kSurface = 0, kSolid = 1 };
enum class Topology : uint32_t { kList = 0, kStrip = 1, kLoop = 2 };
// What a thick point is: a ball, one that fades out from its middle, or a cube along the voxels.
enum class Splat : uint32_t { kBall = 0, kSoft = 1, kCube = 2, kCell = 3 };
enum class ColorMode : uint32_t { kUniform = 0, kPerVertex = 1 };
enum class ThicknessUnit : uint32_t { kVoxels = 0, kUnits = 1 };
// What covers the voxels: whatever the engine has, or its CPU even where it has a GPU.
enum class DrawnBy : uint32_t { kEngine = 0, kCpu = 1 };
enum class BlendMode : uint32_t { kOver = 0, kAdd = 1, kErase = 2 };

struct RecordHeader {
  Op op;
  uint32_t reserved = 0;
  uint64_t size;  // of the whole record, this header and padding included; a multiple of 16
};

struct IdRecord {
  uint64_t id;
  uint64_t reserved = 0;
};

// Arrays follow in this order, each padded to 16 bytes: positions f32[vertex_count][3], indices
// u32[index_count], colors u32[ColorCount]: with kPerVertex 0x00RRGGBB of each vertex; with a texture f32[2] of each vertex,
// its place on it, and the texture (primitives/texture.h).
struct GeometryRecord {
  uint64_t id = 0;
  PrimitiveKind kind = PrimitiveKind::kPoints;
  uint32_t color = 0x00FFFFFF;  // kUniform
  ColorMode color_mode = ColorMode::kUniform;
  LineSampling sampling = LineSampling::kThin;  // kSegments, kCurves
  SurfaceRule rule = SurfaceRule::kThin;        // surfaces
  Fill fill = Fill::kSurface;                   // kBox, kSphere, kCylinder, kImplicit, kSamples
  Topology topology = Topology::kList;          // kSegments, kCurves
  ThicknessUnit thickness_unit = ThicknessUnit::kVoxels;
  // Diameter of points and segments, of surfaces of kTriangles, kPatches, kImplicit and kSamples
  // their thickness; 0: one voxel. kUnits: scaled by ∛|det| of the map.
  float thickness = 0;
  uint32_t vertex_count = 0;
  uint32_t index_count = 0;  // 0: vertices as they stand
  float params[8] = {};
  DrawnBy drawn_by = DrawnBy::kEngine;  // the same voxels
  Splat splat = Splat::kBall;           // kPoints
  // Of kTriangles: a picture that colours are multiplied by; 1 to kMostTextureSide, both 0: none.
  uint16_t texture_width = 0, texture_height = 0;
};
inline constexpr uint32_t kMostTextureSide = 8192;

// Whether its points are cells (points.h).
constexpr bool IsCells(const GeometryRecord& record) {
  return record.kind == PrimitiveKind::kPoints && record.splat == Splat::kCell;
}

// Entries of a geometry's array of colours.
uint64_t ColorCount(const GeometryRecord& g);

// Where a geometry's arrays lie, in a record or in bulk memory: positions at the beginning, each
// array padded to 16 bytes.
struct ArrayLayout {
  uint64_t indices = 0, colors = 0;  // offsets
  uint64_t size = 0;                 // of all, padding included

  static ArrayLayout Of(const GeometryRecord& g);
};

struct DrawableRecord {
  uint64_t id = 0;
  uint64_t geometry = 0;
  uint64_t layer = 0;
  uint32_t priority = 0;       // 0 to 126
  uint32_t erase = 0;          // 1: removes what is of lower or equal priority in its layer
  uint32_t tint = 0x00FFFFFF;  // its colours are multiplied by it, 0xFF being 1
  uint32_t reserved[3] = {};
  Affine transform;  // geometry's coordinates → layer's
};

// A half-space of the scene: a·x + b·y + c·z + d ≥ 0. Its normal is not zero.
struct ClipPlane {
  double a = 0, b = 0, c = 0, d = 0;
  bool operator==(const ClipPlane&) const = default;
};
inline constexpr uint32_t kMaxClipPlanes = 20;

// What is around a line of the scene: where `unit`⁻¹ takes a point to x² + y² ≤ 1, at any z. `unit` has an inverse.
struct ClipCylinder {
  Affine unit;  // x² + y² ≤ 1 → scene
  bool operator==(const ClipCylinder&) const = default;
};
inline constexpr uint32_t kMaxClipCylinders = 4;

// A box of the scene, its faces included; min < max.
struct Region {
  double min[3] = {}, max[3] = {};
  bool operator==(const Region&) const = default;
};

// Layers combine in ascending (order, id). Where there are planes, cylinders or a region, only voxels that lie
// inside all of them (gpu/clip.h) are the layer's: the others it does not cover. Where there is a mask, only voxels that
// this layer covers, as its own planes, cylinders and region leave it; whether it is visible, and what its own mask is,
// makes no difference.
struct LayerRecord {
  uint64_t id = 0;  // the number of creation
  int32_t order = 0;
  uint32_t visible = 1;
  uint32_t opacity = 255;  // 0 to 255
  BlendMode blend = BlendMode::kOver;
  uint32_t plane_count = 0;     // 0 to kMaxClipPlanes
  uint32_t has_region = 0;      // 1: `region` holds
  uint32_t cylinder_count = 0;  // 0 to kMaxClipCylinders
  uint32_t has_mask = 0;        // 1: `mask` holds
  uint64_t mask = 0;            // the id of a layer, which need not be there
  Affine transform;             // layer's coordinates → scene's
  ClipPlane planes[kMaxClipPlanes];
  ClipCylinder cylinders[kMaxClipCylinders];
  Region region;
};

// Whether two layers are drawn in the same part of the scene, as it is written.
inline bool SameClip(const LayerRecord& a, const LayerRecord& b) {
  return std::equal(a.planes, a.planes + a.plane_count, b.planes, b.planes + b.plane_count) &&
         std::equal(a.cylinders, a.cylinders + a.cylinder_count, b.cylinders,
                    b.cylinders + b.cylinder_count) &&
         a.has_region == b.has_region && (a.has_region == 0 || a.region == b.region);
}

// Appends records to a span. Overruns are counted, not written:
// size the span with the Size functions.
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
  // `arrays` holds them as ArrayLayout says; what they contain has been checked as ReadDelta checks
  // those in records.
  void PutGeometry(const GeometryRecord& g, BulkBlock arrays);
  void PutDrawable(const DrawableRecord& d);
  void PutLayer(const LayerRecord& l);
  void Drop(Op op, uint64_t id);  // kDropGeometry, kDropDrawable, kDropLayer
  void Reset();

  size_t size() const { return size_; }
  bool overrun() const { return size_ > out_.size(); }
  // The blocks that the delta refers to, which go to the engine with it (StagingBlock::Refer).
  std::vector<BulkBlock> TakeReferred() { return std::move(referred_); }

 private:
  void Append(const void* data, size_t size);
  void Pad();
  void Begin(Op op, size_t size);

  std::span<std::byte> out_;
  size_t size_ = 0;
  std::vector<BulkBlock> referred_;
};

// A geometry as it lies in a delta: views into the block, or into bulk memory.
struct GeometryView {
  GeometryRecord record;
  std::span<const float> positions;  // 3 · vertex_count
  std::span<const uint32_t> indices;
  std::span<const uint32_t> colors;
  std::shared_ptr<const void> bulk;  // keeps bulk memory; null if the arrays lie in the delta
  uint64_t bulk_segment = 0;         // in which they lie

  bool HasArrays() const { return !positions.empty() || !indices.empty(); }
};

// What ReadDelta calls, in order. An error from any ends the reading.
struct DeltaVisitor {
  virtual ~DeltaVisitor() = default;
  virtual absl::Status OnGeometry(const GeometryView& g) = 0;
  virtual absl::Status OnDrawable(const DrawableRecord& d) = 0;
  virtual absl::Status OnLayer(const LayerRecord& l) = 0;
  virtual absl::Status OnDrop(Op op, uint64_t id) = 0;
  virtual absl::Status OnReset() = 0;
};

// Checks every record (sizes, counts, enums, indices in range, finite numbers) and hands
// it to `visitor`. InvalidArgument with the byte offset, the value and what would be right.
// `delta` is 16-byte aligned. `bulk` finds what lies in bulk memory: that its arrays are there, whole,
// is checked; what they contain was, by who wrote them. Null: there is none.
absl::Status ReadDelta(std::span<const std::byte> delta, DeltaVisitor& visitor,
                       BulkSource* bulk = nullptr);

}  // namespace voxeld::gpu
