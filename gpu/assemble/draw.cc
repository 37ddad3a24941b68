#include "gpu/assemble/draw.h"

#include <algorithm>

#include "gpu/assemble/inside.h"
#include "gpu/assemble/triangle_kernel.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kVertexRun = 1024;
constexpr int32_t kBlockTiles = 4;    // of implicit shapes: looked at together first
constexpr size_t kMostFetched = 128;  // faces, which the first cache holds

// The walks among the items, where others have no place among the walks.
void DrawWalksAlone(const Bins& bins, std::span<const BinItem> items, uint32_t* words,
                    TileRows& touched) {
  constexpr size_t kMost = 512;
  BinItem walks[kMost];
  size_t size = 0;
  for (const BinItem& item : items) {
    if (item.count() == 0) continue;
    walks[size++] = item;
    if (size < kMost) continue;
    DrawSpans(bins.walks.data(), walks, words, touched);
    size = 0;
  }
  DrawSpans(bins.walks.data(), {walks, size}, words, touched);
}

}  // namespace

bool FillIn(Drawable& d, uint64_t inside_bytes, Executor& executor) {
  if (d.source.record->kind != PrimitiveKind::kFilled || d.source.inside != nullptr) return false;
  const uint64_t words = InsideRows{d.source.solid.bounds}.size();
  if (words == 0 || words > inside_bytes / sizeof(uint32_t)) return false;
  d.inside = FindInside(d.source, executor);
  d.source.inside = d.inside.data();
  return true;
}

bool IsSingular(const Drawable& d) {
  return WithPrimitive(d.geometry->view.record.kind, [&](auto primitive) {
    return kIsInverted<typename decltype(primitive)::type> && !d.source.solid.drawable;
  });
}

void DrawItems(const Drawable& d, std::span<const BinItem> items, const TileGrid& grid,
               const Box3& box, uint32_t* words) {
  TileRows touched;
  DrawItems(d, d.bins, items, grid, box, words, touched);
}

void DrawItems(const Drawable& d, const Bins& bins, std::span<const BinItem> items,
               const TileGrid& grid, const Box3& box, uint32_t* words, TileRows& touched) {
  if (bins.chosen && !bins.all_fast) {
    DrawWalksAlone(bins, items, words, touched);
  } else if (bins.walk_count > 0) {
    DrawSpans(bins.walks.data(), items, words, touched);
  }
  if (bins.triangle_parts > 0) {
    const WalkGrid axes(grid);
    int32_t lo[3], hi[3];
    for (int r = 0; r < 3; ++r) lo[r] = box.lo[axes.axis[r]], hi[r] = box.hi[axes.axis[r]];
    DrawTriangles(bins.triangles, items, lo, hi, words, touched);
  }
  if (bins.all_fast) return;
  touched = TileRows::All();
  const uint32_t priority = d.record.priority;
  const bool erase = d.record.erase != 0;
  if (d.source.record->kind == PrimitiveKind::kFilled) {
    // A tile lies in one block.
    const uint32_t word = MakeWord(priority, erase, d.source.UniformColor());
    if (!items.empty()) DrawInside(d.source, box, grid, word, words);
    return;
  }
  uint32_t rgb_before = 0;
  uint32_t word = MakeWord(priority, erase, rgb_before);
  const auto raise = [&](int32_t x, int32_t y, int32_t z, uint32_t rgb) {
    if (rgb != rgb_before) {
      rgb_before = rgb;
      word = MakeWord(priority, erase, rgb);
    }
    uint32_t& at = words[grid.IndexInTile(x, y, z)];
    at = std::max(at, word);
  };
  WithPrimitive(d.source.record->kind, [&](auto primitive) {
    for (const BinItem& item : items) {
      if (item.count() == 0) {
        decltype(primitive)::type::EmitVoxels(d.source, item.item, box, raise);
      }
    }
  });
}

void FetchItems(const Drawable& d, std::span<const BinItem> items) {
  if (d.bins.triangle_parts == 0) return;
  for (const BinItem& item : items.first(std::min(items.size(), kMostFetched))) {
    if (item.count() != 0) {
      __builtin_prefetch(d.bins.triangles[item.part()].units.data() + item.item);
    }
  }
}

void PrepareDrawable(Drawable& d, const Affine& view_map, const TileGrid& grid,
                     std::span<const uint8_t> owned, Executor& executor) {
  BinScratch scratch;
  MapDrawable(d, view_map, grid, executor);
  BinItems(d.source, grid, owned, d.record.priority, d.record.erase != 0, executor, scratch,
           d.bins);
}

void MapDrawable(Drawable& d, const Affine& view_map, const TileGrid& grid, Executor& executor,
                 uint64_t inside_bytes) {
  const GeometryView& view = d.geometry->view;
  const Affine map = Compose(Compose(view_map, d.layer->record.transform), d.record.transform);
  d.source = {};
  d.source.record = &view.record;
  d.source.tint = d.record.tint;
  d.cut = nullptr;
  d.inside = std::vector<uint32_t>();
  if (IsCurved(view.record.kind)) {
    d.cut = std::make_unique<Cut>(CutCurved(view, map, grid));
    d.source.record = &d.cut->record;
    d.source.vertices = d.cut->vertices.data();
    d.source.indices = d.cut->indices.data();
    d.source.colors = d.cut->colors.data();
    d.source.radius = RadiusOf(view.record, map);
    return;
  }
  WithPrimitive(view.record.kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    if constexpr (kIsSolid<Primitive>) {
      d.source.solid = Solid::Of(Compose(map, Primitive::CanonicalMap(view.record)));
    } else if constexpr (std::is_same_v<Primitive, Implicit>) {
      d.hoisted = Implicit::Place(view.record, view.indices.data(), map, grid, kBlockTiles,
                                  d.source.solid, d.source.implicit);
      d.source.implicit.hoisted = d.hoisted.data();
      d.source.positions = view.positions.data();
      d.source.indices = view.indices.data();
    } else if constexpr (std::is_same_v<Primitive, Samples>) {
      Samples::Place(view.record, view.indices.data(), map, grid, kBlockTiles, d.source.solid,
                     d.source.implicit);
      d.source.indices = view.indices.data();
    } else if (IsCells(view.record)) {
      d.source.positions = view.positions.data();
      d.source.indices = view.indices.data();
      d.source.colors = view.colors.data();
      Points::PlaceCells(map, d.source);
    } else {
      d.vertices.resize(view.record.vertex_count);
      const size_t runs = (d.vertices.size() + kVertexRun - 1) / kVertexRun;
      executor.For(runs, 1, [&](size_t run, int) {
        const size_t end = std::min(d.vertices.size(), (run + 1) * kVertexRun);
        for (size_t i = run * kVertexRun; i < end; ++i) {
          d.vertices[i] = SnapPoint(map, &view.positions[i * 3]);
        }
      });
      d.source.vertices = d.vertices.data();
      d.source.indices = view.indices.data();
      d.source.colors = view.colors.data();
      d.source.radius = RadiusOf(view.record, map);
      if constexpr (std::is_same_v<Primitive, Filled>) {
        Filled::Place(BoundsOfVertices(d.source, grid), kBlockTiles, d.source.solid,
                      d.source.implicit);
        FillIn(d, inside_bytes, executor);
      }
    }
  });
}

}  // namespace voxeld::gpu
