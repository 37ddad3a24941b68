#include "gpu/assemble/triangle_kernel.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

// Vectors whose size is known when this is compiled.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gpu/assemble/triangle_kernel.cc"
#include "hwy/cache_control.h"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

#include "gpu/assemble/triangle_find-inl.h"
#include "gpu/assemble/triangle_kernel-inl.h"

#if HWY_ONCE
namespace voxeld::gpu {
namespace {

HWY_EXPORT(FindTrianglesIn);
HWY_EXPORT(DrawTrianglesIn);
HWY_EXPORT(TriangleTargetIn);

}  // namespace

void FindTriangles(SmallTriangles& triangles, uint32_t part, const WalkGrid& grid,
                   const uint8_t* owned, TriangleMemory& memory, FoundSpans& found) {
  HWY_DYNAMIC_DISPATCH(FindTrianglesIn)
  (triangles, part, grid, owned, memory, found);
}

void DrawTriangles(std::span<const TriangleMemory> parts, std::span<const BinItem> items,
                   const int32_t lo[3], const int32_t hi[3], uint32_t* words, TileRows& touched) {
  HWY_DYNAMIC_DISPATCH(DrawTrianglesIn)(parts.data(), items, lo, hi, words, touched);
}

std::string TriangleTarget() { return HWY_DYNAMIC_DISPATCH(TriangleTargetIn)(); }

}  // namespace voxeld::gpu
#endif
