// The records of a scene's change (delta.h): plain data, used by the engines, their kernels and
// their callers.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/affine.h"
#include "gpu/portable.h"

namespace voxeld::gpu {

enum class Op : uint32_t {
  kPutGeometry = 1,      // GeometryRecord, positions, indices, colors. The id must be new
  kDropGeometry = 2,     // IdRecord; at the end of the delta no drawable may use it
  kPutDrawable = 3,      // DrawableRecord; replaces one of the same id
  kDropDrawable = 4,     // IdRecord
  kPutLayer = 5,         // LayerRecord; replaces one of the same id
  kDropLayer = 6,        // IdRecord; at the end of the delta no drawable may be in it
  kReset = 7,            // no body: discards everything
  kPutBulkGeometry = 8,  // GeometryRecord, BulkRef: as kPutGeometry, its arrays in bulk memory
};

enum class PrimitiveKind : uint32_t {
  kPoints = 1,     // one voxel each, or a ball of `thickness`
  kSegments = 2,   // list, strip or loop
  kTriangles = 3,  // indexed or not
  kBox = 4,        // centre params[0..2], full sizes params[3..5] along its own axes
  kSphere = 5,     // centre params[0..2], radius params[3] (an ellipsoid under a transform)
  kCylinder = 6,   // centre params[0..2], radius params[3], height params[4] along its own z
  kImplicit = 7,   // its program (implicit/program.h) is the indices, its rings are the
                   // positions; with params[6] = 1, only from params[0..2] to params[3..5]
  kCurves = 8,  // cubic Béziers: list (4 points each) or strip (they share ends), drawn as segments
  kPatches = 9,   // bicubic Béziers: 16 points each, along u first, drawn as triangles
  kSamples = 10,  // a grid of samples (primitives/samples.h), held in the indices; no positions;
                  // if a surface is coloured by its place, params[0..3] say how
  kFilled = 11,   // the inside of triangles (primitives/filled.h), indexed or not; in one colour
};

// Returns whether the primitive is computed through the inverse of its map, from its parameters
// alone.
VOXELD_HD constexpr bool IsSolid(PrimitiveKind kind) {
  return kind == PrimitiveKind::kBox || kind == PrimitiveKind::kSphere ||
         kind == PrimitiveKind::kCylinder;
}

// Returns whether the primitive consists of control points and is cut into straight pieces where it
// is drawn (gpu/curves/).
constexpr bool IsCurved(PrimitiveKind kind) {
  return kind == PrimitiveKind::kCurves || kind == PrimitiveKind::kPatches;
}

enum class LineSampling : uint32_t { kThin = 0, kEuclidean = 1, kCover = 2 };
enum class SurfaceRule : uint32_t { kThin = 0, kCover = 1 };
enum class Fill : uint32_t { kSurface = 0, kSolid = 1 };
enum class Topology : uint32_t { kList = 0, kStrip = 1, kLoop = 2 };
// The shape of a thick point: a ball, a ball that fades out from its middle, a cube along the
// voxels, or a cell (points.h).
enum class Splat : uint32_t { kBall = 0, kSoft = 1, kCube = 2, kCell = 3 };
enum class ColorMode : uint32_t { kUniform = 0, kPerVertex = 1 };
enum class ThicknessUnit : uint32_t { kVoxels = 0, kUnits = 1 };
// Which processor draws: the engine's own, or the CPU even if the engine has a GPU.
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

// The arrays follow in this order, each padded to 16 bytes: positions f32[vertex_count][3], indices
// u32[index_count], colors u32[ColorCount]. The colours are, with kPerVertex, 0x00RRGGBB for each
// vertex; with a texture, f32[2] for each vertex, its place on the texture, and then the texture
// (primitives/texture.h).
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
  // The diameter of points and segments; the thickness of surfaces of kTriangles, kPatches,
  // kImplicit and kSamples. 0: one voxel. kUnits: scaled by ∛|det| of the map.
  float thickness = 0;
  uint32_t vertex_count = 0;
  uint32_t index_count = 0;  // 0: vertices as they stand
  float params[8] = {};
  DrawnBy drawn_by = DrawnBy::kEngine;  // the voxels are the same either way
  Splat splat = Splat::kBall;           // kPoints
  // For kTriangles: a texture that colours are multiplied by; 1 to kMostTextureSide, both 0: none.
  uint16_t texture_width = 0, texture_height = 0;
};
inline constexpr uint32_t kMostTextureSide = 8192;

// Returns whether its points are cells (points.h).
constexpr bool IsCells(const GeometryRecord& record) {
  return record.kind == PrimitiveKind::kPoints && record.splat == Splat::kCell;
}

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

// The inside of a cylinder around a line of the scene: `unit`⁻¹ takes its points to x² + y² ≤ 1, at
// any z. `unit` has an inverse.
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

// Layers combine in ascending (order, id). With planes, cylinders or a region, the layer covers
// only voxels that lie inside all of them (gpu/clip.h). With a mask, it covers only voxels that the
// mask layer covers, as limited by that layer's own planes, cylinders and region. Whether the mask
// layer is visible, and what its own mask is, makes no difference.
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
  uint64_t mask = 0;            // the id of a layer, which need not exist
  Affine transform;             // layer's coordinates → scene's
  ClipPlane planes[kMaxClipPlanes];
  ClipCylinder cylinders[kMaxClipCylinders];
  Region region;
};

}  // namespace voxeld::gpu
