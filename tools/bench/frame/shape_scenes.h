// Scenes of shapes other than lines, points and triangles.
#pragma once

#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// Returns a display of nz slices of nx × ny pixels, whose voxels are its pixels.
gpu::Target Stack(int32_t nx, int32_t ny, int32_t nz, display::PixelFormat format);
// Returns a scene with one opaque layer.
Scene OneLayer(std::string name, gpu::Target target);

// A gyroid of 8 periods along each side, with a shell one voxel thick, in 512³.
Scene Gyroid(double share);
// x² + y² + z² = r² as an expression, in n³, with r slightly less than half the side.
Scene ImplicitSphere(int32_t n);
// `count` instances of a sphere of radius 4 in 512³.
Scene InstancedSpheres(uint64_t count, uint64_t seed);
// 256³ samples of 16 bits in 512³, rotated: drawn through a colour table, or as the surface at
// their middle value.
Scene SampledVolume(bool by_level, double share);
// `count` coloured points in 512³.
Scene CubePoints(uint64_t count, uint64_t seed);

}  // namespace voxeld::bench::frame
