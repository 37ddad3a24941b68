// Adds implicit shapes: allocates memory for the state of their tiles and for the voxels that they
// cover, which are found before anything is drawn.
#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include "absl/container/btree_map.h"
#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/implicit_kernels.h"
#include "gpu/implicit/field.h"
#include "gpu/primitives/implicit.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr size_t kMostViews = 32768;  // for which one kernel is launched

// Lays out Slot::covered: for each axis duals, values, distances; then rows. If `base` is null,
// only computes the size.
uint64_t LayOut(const TableEntry& entry, const implicit::HoistedView& hoisted, std::byte* base,
                CoveredView* view) {
  uint64_t at = 0;
  const auto take = [&](uint64_t bytes) {
    const uint64_t begin = at;
    at += (bytes + 15) / 16 * 16;
    return base == nullptr ? nullptr : base + begin;
  };
  const Box3& bounds = entry.source.solid.bounds;
  for (int a = 0; a < 3; ++a) {
    CoveredAxis axis;
    axis.places = static_cast<uint32_t>(bounds.hi[a] - bounds.lo[a]) + kCoveredSpare;
    axis.first = hoisted.begin(a);
    axis.end = hoisted.end(a);
    const uint64_t values = uint64_t{axis.end - axis.first} * axis.places;
    axis.dual = reinterpret_cast<CoveredDual*>(take(values * sizeof(CoveredDual)));
    axis.value = reinterpret_cast<float*>(take(values * sizeof(float)));
    axis.distance = reinterpret_cast<float*>(take(axis.places * sizeof(float)));
    if (view != nullptr) view->axis[a] = axis;
  }
  std::byte* const rows =
      take(uint64_t{Implicit::Count(entry.source)} * kCoveredRows * sizeof(uint16_t));
  if (view != nullptr) view->rows = reinterpret_cast<uint16_t*>(rows);
  return at;
}

CoveredView ViewOf(const TableEntry& entry, uint32_t slot, const implicit::ProgramView& program) {
  const Source& source = entry.source;
  CoveredView view;
  view.hoisted = source.implicit.hoisted;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) view.inverse[a][b] = source.solid.inverse[a][b];
    view.lo[a] = source.solid.bounds.lo[a];
    view.hi[a] = source.solid.bounds.hi[a];
    view.first[a] = source.implicit.first[a];
    view.blocks[a] = source.implicit.blocks[a];
  }
  view.voxel = source.implicit.voxel;
  view.half = source.implicit.half;
  view.items = Implicit::Count(source);
  view.slot = slot;
  view.solid = entry.record.fill == Fill::kSolid;
  view.cover = entry.record.rule == SurfaceRule::kCover;
  view.bounded = program.bound() != 0 || program.rings() != 0;
  return view;
}

uint32_t PlacesOf(const CoveredView& view) {
  return view.axis[0].places + view.axis[1].places + view.axis[2].places;
}

}  // namespace

// Allocates memory that is kept; none if lists would keep too much with it.
absl::StatusOr<std::optional<Block>> CudaVolume::RoomToKeep(uint64_t bytes) {
  if (list_budget_.pool.used() + bytes > list_budget_.most_kept) return std::nullopt;
  absl::StatusOr<Block> block = list_budget_.pool.Acquire(bytes);
  if (absl::IsResourceExhausted(block.status())) return std::nullopt;
  if (!block.ok()) return block.status();
  return *std::move(block);
}

absl::Status CudaVolume::PlaceImplicit(const Drawable& drawable, std::span<const uint32_t> hoisted,
                                       TableEntry& entry, uint32_t slot) {
  Slot& mine = slots_[slot];
  absl::StatusOr<Block> words = device_.Upload(hoisted.data(), hoisted.size());
  if (!words.ok()) return words.status();
  mine.hoisted = *std::move(words);
  entry.source.implicit.hoisted = mine.hoisted.as<uint32_t>();
  PlacedImplicit placed;
  placed.view = ViewOf(entry, slot, {OnHost(drawable).indices.data()});
  if (placed.view.items == 0) return absl::OkStatus();
  // Without memory for the state of its tiles, that state is computed whenever a tile is drawn; the
  // same holds for the covered voxels without memory for them.
  absl::StatusOr<std::optional<Block>> room = RoomToKeep(placed.view.items * sizeof(float));
  if (!room.ok()) return room.status();
  if (!room->has_value()) return absl::OkStatus();
  mine.reach = **std::move(room);
  placed.view.reach = mine.reach.as<float>();
  entry.source.implicit.reach = placed.view.reach;
  const implicit::HoistedView parts{hoisted.data()};
  room = RoomToKeep(LayOut(entry, parts, nullptr, nullptr));
  if (!room.ok()) return room.status();
  if (room->has_value()) {
    mine.covered = **std::move(room);
    LayOut(entry, parts, mine.covered.as<std::byte>(), &placed.view);
    entry.source.implicit.rows = placed.view.rows;
    absl::StatusOr<cudaKernel_t> formula = formulas_.Find(hoisted);
    if (!formula.ok()) return formula.status();
    placed.formula = *formula;
  }
  placed_.push_back(placed);
  return absl::OkStatus();
}

// Calls f(views) for all of them, as many at once as one kernel takes, sorted by size, because a
// kernel is launched with as many tiles for each as the largest has.
template <typename F>
absl::Status CudaVolume::ForViews(std::vector<CoveredView> all, F&& f) {
  std::sort(all.begin(), all.end(),
            [](const CoveredView& a, const CoveredView& b) { return a.items < b.items; });
  for (size_t begin = 0, end; begin < all.size(); begin = end) {
    CoveredViews views;
    for (end = begin; end < all.size() && end - begin < kMostViews; ++end) {
      if (std::bit_width(all[end].items) != std::bit_width(all[begin].items)) break;
      views.most_items = all[end].items;
      views.most_places = std::max(views.most_places, PlacesOf(all[end]));
    }
    const std::span<const CoveredView> some(&all[begin], end - begin);
    views.count = static_cast<uint32_t>(some.size());
    Block uploaded;
    if (some.size() <= kFewCovered) {
      std::copy(some.begin(), some.end(), views.few);
    } else {
      absl::StatusOr<Block> block = device_.Upload(some.data(), some.size());
      // The uploaded data lies in memory that is freed when this call returns.
      if (!block.ok()) return block.status();
      uploaded = *std::move(block);
      views.views = uploaded.as<CoveredView>();
      // The uploaded data lies in memory that is freed when this call returns.
      if (absl::Status status = device_.Wait(); !status.ok()) return status;
    }
    if (absl::Status status = f(views); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status CudaVolume::FindImplicit() {
  std::vector<CoveredView> all, with_rows, bounded;
  absl::btree_map<cudaKernel_t, std::vector<CoveredView>> by_formula;
  for (const PlacedImplicit& placed : placed_) {
    all.push_back(placed.view);
    if (placed.view.rows == nullptr) continue;
    with_rows.push_back(placed.view);
    by_formula[placed.formula].push_back(placed.view);
    if (placed.view.bounded) bounded.push_back(placed.view);
  }
  const TableEntry* const table = table_.as<TableEntry>();
  const cudaStream_t stream = device_.stream();
  absl::Status status = ForViews(all, [&](const CoveredViews& views) {
    return device_.Run("FindTiles", [&] { return FindTiles(table, views, stream); });
  });
  if (!status.ok()) return status;
  status = ForViews(with_rows, [&](const CoveredViews& views) {
    return device_.Run("FindAlong", [&] { return FindAlong(table, views, stream); });
  });
  for (const auto& [formula, views_of] : by_formula) {
    if (!status.ok()) return status;
    status = ForViews(views_of, [&, kernel = formula](const CoveredViews& views) {
      return device_.Run("FindCovered", [&] {
        return kernel == nullptr ? FindCovered(table, views, stream)
                                 : FindCoveredBy(kernel, views, stream);
      });
    });
  }
  if (!status.ok()) return status;
  return ForViews(bounded, [&](const CoveredViews& views) {
    return device_.Run("BoundCovered", [&] { return BoundCovered(table, views, stream); });
  });
}

}  // namespace voxeld::gpu::cuda
