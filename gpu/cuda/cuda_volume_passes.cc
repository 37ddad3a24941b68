// Draws regions while some items have no lists: pass by pass, each with lists for its own regions.
#include <algorithm>
#include <utility>

#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/draw_kernels.h"

namespace voxeld::gpu::cuda {
namespace {

// Returns the axis along which blocks are halved; −1 if there is only one.
int AxisToCut(const int32_t lo[3], const int32_t hi[3]) {
  for (int a = 2; a >= 0; --a) {
    if (hi[a] - lo[a] > 1) return a;
  }
  return -1;
}

}  // namespace

uint64_t CudaVolume::CountDeferred(const Seen& seen) const {
  return index_.CountDeferred(seen) + lines_.CountDeferred(seen) + points_.CountDeferred(seen) +
         triangles_.CountDeferred(seen);
}

absl::Status CudaVolume::DrawListed(DrawView& view, DrawTo to, cudaStream_t stream) {
  const Seen seen = [&](uint32_t layer) { return looks_now_[layer].drawn != 0; };
  const uint64_t items = CountDeferred(seen);
  if (items == 0) return Draw(view, to, stream);
  if (items < pass_items_) pass_planes_ = INT32_MAX;
  pass_items_ = items;
  absl::Status status = index_.BeginPasses(seen);
  if (status.ok()) status = DrawInPasses(view, to, seen);
  EndPass();
  index_.EndPasses();
  return status;
}

absl::StatusOr<bool> CudaVolume::SortPass(const RegionGrid& pass, const Seen& seen, bool some) {
  absl::StatusOr<bool> lines = lines_.SortWithin(pass, seen, some);
  if (!lines.ok() || (!*lines && !some)) return lines;
  absl::StatusOr<bool> points = points_.SortWithin(pass, seen, some);
  if (!points.ok() || (!*points && !some)) return points;
  absl::StatusOr<bool> triangles = triangles_.SortWithin(pass, seen, some);
  if (!triangles.ok() || (!*triangles && !some)) return triangles;
  absl::StatusOr<bool> pairs = index_.SortWithin(table_.as<TableEntry>(), tiles_.view(), pass);
  if (!pairs.ok()) return pairs;
  return *lines && *points && *triangles && *pairs;
}

void CudaVolume::EndPass() {
  lines_.EndPass();
  points_.EndPass();
  triangles_.EndPass();
  index_.EndPass();
}

absl::Status CudaVolume::DrawInPasses(const DrawView& all, DrawTo to, const Seen& seen) {
  const RegionGrid& regions = tiles_.regions;
  absl::StatusOr<Block> list = device_.pool().Acquire(regions.count() * sizeof(uint32_t));
  if (!list.ok()) return list.status();
  absl::StatusOr<Block> found = device_.pool().Acquire(sizeof(PickedRegions));
  if (!found.ok()) return found.status();
  auto* const picked_there = found->as<PickedRegions>();
  std::vector<RegionGrid> left;  // the next one is last
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
    const absl::StatusOr<bool> sorted = SortPass(pass, seen, axis < 0);
    if (!sorted.ok()) return sorted.status();
    if (!*sorted && axis >= 0) {
      EndPass();
      const int32_t half = (pass.drawn_hi[axis] - pass.drawn_lo[axis] + 1) / 2;
      if (axis == 2) pass_planes_ = half;
      left.insert(left.end(), 2, pass);
      left.rbegin()[0].drawn_hi[axis] = left.rbegin()[1].drawn_lo[axis] =
          pass.drawn_lo[axis] + half;
      continue;
    }
    DrawView view = all;
    view.pairs = index_.view();
    view.unlisted = index_.unlisted();
    view.lines = lines_.view();
    view.points = points_.view();
    view.triangles = triangles_.view();
    view.list = list->as<uint32_t>();
    view.listed = &picked_there->count;
    view.taken = &picked_there->taken;
    status = Draw(view, to, device_.stream());
    // In the stream, the next user of the lists' memory comes after the drawing.
    EndPass();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::cuda
