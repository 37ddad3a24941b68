// Finds which voxels implicit shapes cover, before they are drawn: the values along each axis from
// which P is computed, the state of each tile, then the tiles' rows (covered-inl.h), by
// interpreting programs; and then which of these Φ and the rings leave.
#include "gpu/cuda/covered-inl.h"
#include "gpu/cuda/implicit_kernels.h"
#include "gpu/cuda/items-inl.h"
#include "gpu/implicit/field.h"
#include "gpu/primitives/implicit.h"

namespace voxeld::gpu::cuda {
namespace {

static_assert(kCoveredEdge == kTileSize);
static_assert(kCoversNothing == Implicit::kNothing && kCoversEverything == Implicit::kEverything);

// Interprets a program directly.
class InterpretedFormula {
 public:
  using Of = implicit::Field;
  __device__ InterpretedFormula(const CoveredView& view, const Of& field, uint32_t y, uint32_t z)
      : view_(view), field_(field), y_(y), z_(z) {}

  __device__ Six Values(uint32_t x) const {
    Six q[3];
    if (field_.hoisted().needs_coordinates()) {
      const Six dx = CoveredDistance(view_.axis[0], x, Six());
      const auto across = [&](int a, uint32_t place) {
        return implicit::ConstantLike(dx, CoveredDistance(view_.axis[a], place, 0.0f));
      };
      field_.Coordinates(dx, across(1, y_), across(2, z_), q);
    }
    return field_.Rest(q, [&](uint32_t v) {
      const int a = field_.hoisted().axis_of(v);
      return a == 0 ? CoveredValue(view_.axis[0], v, x, Six())
                    : implicit::ConstantLike(
                          Six(), CoveredValue(view_.axis[a], v, a == 1 ? y_ : z_, 0.0f));
    });
  }
  __device__ bool IsWithin(uint32_t x) const {
    implicit::Dual<float> dual[3];
    if (field_.hoisted().needs_coordinates()) {
      float q[3];
      field_.Coordinates(CoveredDistance(view_.axis[0], x, 0.0f),
                         CoveredDistance(view_.axis[1], y_, 0.0f),
                         CoveredDistance(view_.axis[2], z_, 0.0f), q);
      field_.WithGradients(q, dual);
    }
    return field_.IsWithin(field_.Rest(dual, [&](uint32_t v) {
      const int a = field_.hoisted().axis_of(v);
      return CoveredValue(view_.axis[a], v, a == 0 ? x : a == 1 ? y_ : z_, implicit::Dual<float>());
    }));
  }

 private:
  const CoveredView& view_;
  const implicit::Field& field_;
  const uint32_t y_, z_;
};

__global__ void FindTilesKernel(const TableEntry* table,
                                const __grid_constant__ CoveredViews views) {
  const CoveredView& view = views.at(blockIdx.y);
  const uint64_t i = Thread();
  if (i >= view.items) return;
  const Source& source = table[view.slot].source;
  const Box3 box = BlockOf(source, static_cast<uint32_t>(i));
  view.reach[i] =
      IsEmpty(box) ? Implicit::kNothing : Implicit::ReachOf(implicit::Field(source), box);
}

__global__ void FindAlongKernel(const TableEntry* table,
                                const __grid_constant__ CoveredViews views) {
  const CoveredView& view = views.at(blockIdx.y);
  uint64_t place = Thread();
  int a = 0;
  for (; a < 3 && place >= view.axis[a].places; ++a) place -= view.axis[a].places;
  if (a == 3) return;
  const CoveredAxis& axis = view.axis[a];
  const Source& source = table[view.slot].source;
  const float d = source.solid.Distance(a, int64_t{view.lo[a]} - 1 + static_cast<int64_t>(place));
  axis.distance[place] = d;
  implicit::Field(source).DualHoistedAlong(
      a, d, [&](const implicit::Dual<float>& value, uint32_t v) {
        const size_t at = size_t{v - axis.first} * axis.places + place;
        axis.value[at] = value.value;
        axis.dual[at] = {value.value, {value.d[0], value.d[1], value.d[2]}};
      });
}

__global__ void __launch_bounds__(kCoveredThreads)
    FindCoveredKernel(const TableEntry* table, const __grid_constant__ CoveredViews views) {
  __shared__ CoveredScratch scratch;
  const CoveredView& view = views.at(blockIdx.y);
  const implicit::Field field(table[view.slot].source);
  FindCoveredItems<InterpretedFormula>(view, field, scratch);
}

// Each thread handles a row.
__global__ void BoundCoveredKernel(const TableEntry* table,
                                   const __grid_constant__ CoveredViews views) {
  const CoveredView& view = views.at(blockIdx.y);
  const uint64_t i = Thread();
  const uint32_t item = static_cast<uint32_t>(i / kCoveredRows),
                 row = static_cast<uint32_t>(i % kCoveredRows);
  if (!view.bounded || item >= view.items || view.reach[item] == kCoversNothing) return;
  const implicit::Field field(table[view.slot].source);
  const CoveredTile tile(view, item);
  uint32_t covered = view.rows[i];
  for (uint32_t left = covered; left != 0; left &= left - 1) {
    const int32_t x = __ffs(static_cast<int>(left)) - 1;
    const int32_t at[3] = {x, static_cast<int32_t>(row) % kCoveredEdge,
                           static_cast<int32_t>(row) / kCoveredEdge};
    float q[3];
    field.CoordinatesOf(tile.lo[0] - tile.skipped[0] + at[0], tile.lo[1] - tile.skipped[1] + at[1],
                        tile.lo[2] - tile.skipped[2] + at[2], q);
    if (!field.IsBounded(q)) covered &= ~(1u << x);
  }
  view.rows[i] = static_cast<uint16_t>(covered);
}

dim3 CoveredBlocks(const CoveredViews& views) {
  return {(views.most_items + kCoveredAtOnce - 1) / kCoveredAtOnce, views.count};
}

}  // namespace

cudaError_t FindTiles(const TableEntry* table, const CoveredViews& views, cudaStream_t stream) {
  FindTilesKernel<<<dim3(Blocks(views.most_items), views.count), kItemThreads, 0, stream>>>(table,
                                                                                            views);
  return cudaGetLastError();
}
cudaError_t FindAlong(const TableEntry* table, const CoveredViews& views, cudaStream_t stream) {
  FindAlongKernel<<<dim3(Blocks(views.most_places), views.count), kItemThreads, 0, stream>>>(table,
                                                                                             views);
  return cudaGetLastError();
}
cudaError_t FindCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream) {
  FindCoveredKernel<<<CoveredBlocks(views), kCoveredThreads, 0, stream>>>(table, views);
  return cudaGetLastError();
}
cudaError_t FindCoveredBy(cudaKernel_t kernel, const CoveredViews& views, cudaStream_t stream) {
  CoveredViews argument = views;
  void* arguments[] = {&argument};
  return cudaLaunchKernel(kernel, CoveredBlocks(views), kCoveredThreads, arguments, 0, stream);
}
cudaError_t BoundCovered(const TableEntry* table, const CoveredViews& views, cudaStream_t stream) {
  BoundCoveredKernel<<<dim3(Blocks(uint64_t{views.most_items} * kCoveredRows), views.count),
                       kItemThreads, 0, stream>>>(table, views);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
