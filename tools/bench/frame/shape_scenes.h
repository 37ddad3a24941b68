// Scenes of shapes other than lines, points and triangles.
#pragma once

#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// A display of nz slices of nx × ny pixels that are the voxels.
gpu::Target Stack(int32_t nx, int32_t ny, int32_t nz, display::PixelFormat format);
// One opaque layer.
Scene OneLayer(std::string name, gpu::Target target);

// A gyroid of 8 periods a side, its shell one voxel thick, in 512³.
Scene Gyroid(double share);
// x² + y² + z² = r², r a little less than half the side, in n³: as an expression.
Scene ImplicitSphere(int32_t n);
// `count` instances of a sphere of radius 4 in 512³.
Scene InstancedSpheres(uint64_t count, uint64_t seed);
// 256³ numbers of 16 bits in 512³, turned: through a table of colours, or the surface at their middle.
Scene SampledVolume(bool by_level, double share);
// `count` coloured points in 512³.
Scene CubePoints(uint64_t count, uint64_t seed);

}  // namespace voxeld::bench::frame
