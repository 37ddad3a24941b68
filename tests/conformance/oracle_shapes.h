// Determines which voxels a drawable covers, by other formulations than the engine's: rational
// arithmetic in 128 bits, voxel by voxel. Only the formulas in floating point are the published
// ones, in a second implementation; for solids, solids_test.cc checks in closed form that they
// describe the shape.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "gpu/delta.h"
#include "tests/conformance/oracle.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

// Called only for voxels inside the volume.
using Plot = std::function<void(int64_t x, int64_t y, int64_t z, uint32_t rgb)>;

// Position in 2⁻⁸ voxel.
struct Units {
  int64_t v[3];
};

struct OracleLine {
  Units s, e;
  uint32_t color_s, color_e;
  LineSampling sampling;
};

// Where a triangle's corners are on a texture (gpu/primitives/texture.h); without texels, it has
// none.
struct OracleTexture {
  const uint32_t* texels = nullptr;
  uint64_t width = 0, height = 0;
  float at[3][2] = {};
};
struct OracleTriangle {
  Units v[3];
  uint32_t color[3];
  SurfaceRule rule;
  OracleTexture texture = {};
};

// outer ∘ inner in double precision.
Affine OracleCompose(const Affine& outer, const Affine& inner);
// Multiplies each channel: a·b/255, rounded to the nearest.
uint32_t OracleTint(uint32_t rgb, uint32_t tint);
// Returns the transformed vertex, rounded to the nearest unit, half up.
Units OracleSnap(const Affine& map, const float* p);
// Returns the cube root of the factor by which a map scales volumes.
double OracleScale(const Affine& map);

void PlotLine(const OracleLine& line, const DenseVolume& grid, const Plot& plot);
// Plots the voxels with centres within `radius` units of the segment.
void PlotCapsule(const OracleLine& line, int64_t radius, const DenseVolume& grid, const Plot& plot);
void PlotTriangle(const OracleTriangle& t, const DenseVolume& grid, const Plot& plot);
// Plots the voxels with centres within `radius` units of the triangle.
void PlotThick(const OracleTriangle& t, int64_t radius, const DenseVolume& grid, const Plot& plot);
// Returns half the thickness in units. Tests use only maps for which a cube root by libm rounds to
// the same unit.
int64_t OracleRadius(const GeometryRecord& g, const Affine& map);

// A second implementation of gpu/primitives/solid.h's coordinates of voxel centres.
struct OracleFrame {
  float inverse[3][3];
  int64_t origin[3], rest[3];
  double reach[3];  // of the shape from its origin, in voxels

  void Coordinates(int64_t x, int64_t y, int64_t z, float q[3]) const;
};
// Returns false if no inverse exists.
bool SetOracleFrame(const Affine& map, bool keep_thin, OracleFrame& frame);
// Sets the range of voxels of a program's domain, including a few around it, as a half-open range.
void OracleDomain(const GeometryRecord& g, const Affine& map, int64_t low[3], int64_t high[3]);

void PlotImplicit(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                  const Plot& plot);
void PlotSamples(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                 const Plot& plot);
void PlotFilled(std::span<const OracleTriangle> triangles, const DenseVolume& grid,
                const Plot& plot);
// `map`: geometry → voxel space.
void PlotSolid(const GeometryRecord& g, const Affine& map, const DenseVolume& grid,
               const Plot& plot);

// Plots everything that a geometry covers under a map.
void PlotGeometry(const ModelGeometry& g, const Affine& map, const DenseVolume& grid,
                  const Plot& plot, uint32_t tint = 0xFFFFFF);

}  // namespace voxeld::gpu::conformance
