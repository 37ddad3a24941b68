// The drawing of regions while some lines have no lists: pass by pass, each with lists of what it draws.
#include <algorithm>
#include <utility>

#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/draw_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// The axis along which blocks are cut in two; −1: there is one.
int AxisToCut(const int32_t lo[3], const int32_t hi[3]) {
  for (int a = 2; a >= 0; --a) {
    if (hi[a] - lo[a] > 1) return a;
  }
  return -1;
}

}  // namespace

absl::Status CudaVolume::DrawListed(DrawView& view, DrawTo to, cudaStream_t stream) {
  const LineIndex::Seen seen = [&](uint32_t layer) { return looks_now_[layer].visible != 0; };
  const uint64_t lines = lines_.CountDeferred(seen);
  if (lines == 0) return Draw(view, to, stream);
  if (lines < pass_lines_) pass_planes_ = INT32_MAX;
  pass_lines_ = lines;
  return DrawInPasses(view, to, seen);
}

absl::Status CudaVolume::DrawInPasses(const DrawView& all, DrawTo to, const LineIndex::Seen& seen) {
  const RegionGrid& regions = tiles_.regions;
  absl::StatusOr<Block> list = device_.pool().Acquire(regions.count() * sizeof(uint32_t));
  if (!list.ok()) return list.status();
  absl::StatusOr<Block> found = device_.pool().Acquire(sizeof(PickedRegions));
  if (!found.ok()) return found.status();
  auto* const picked_there = found->as<PickedRegions>();
  std::vector<RegionGrid> left;  // the next one last
  const int32_t planes = std::min(pass_planes_, regions.blocks[2]);
  for (int32_t z = 0; z < regions.blocks[2]; z += planes) {
    left.push_back(regions);
    left.back().drawn_lo[2] = z;
    left.back().drawn_hi[2] = std::min(z + planes, regions.blocks[2]);
  }
  while (!left.empty()) {
    RegionGrid pass = left.back();
    left.pop_back();
    PickedRegions picked;
    absl::Status status = device_.ToDevice(picked_there, &picked, sizeof(picked));
    if (!status.ok()) return status;
    status = device_.Run("PickRegions", [&] {
      return PickRegions(all, pass, list->as<uint32_t>(), picked_there, device_.stream());
    });
    if (!status.ok()) return status;
    const absl::StatusOr<PickedRegions> read = device_.Read(picked_there);
    if (!read.ok()) return read.status();
    if (read->count == 0) continue;
    std::copy_n(read->lo, 3, pass.drawn_lo);
    std::copy_n(read->hi, 3, pass.drawn_hi);
    const int axis = AxisToCut(pass.drawn_lo, pass.drawn_hi);
    const absl::StatusOr<bool> sorted = lines_.SortWithin(pass, seen, axis < 0);
    if (!sorted.ok()) return sorted.status();
    if (!*sorted && axis >= 0) {
      const int32_t half = (pass.drawn_hi[axis] - pass.drawn_lo[axis] + 1) / 2;
      if (axis == 2) pass_planes_ = half;
      left.insert(left.end(), 2, pass);
      left.rbegin()[0].drawn_hi[axis] = left.rbegin()[1].drawn_lo[axis] =
          pass.drawn_lo[axis] + half;
      continue;
    }
    DrawView view = all;
    view.lines = lines_.view();
    view.list = list->as<uint32_t>();
    view.listed = &picked_there->count;
    view.taken = &picked_there->taken;
    status = Draw(view, to, device_.stream());
    // In the stream, who has the lists' memory next comes after the drawing.
    lines_.EndPass();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::cuda
