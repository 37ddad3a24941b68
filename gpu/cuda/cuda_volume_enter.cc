// Adds drawables to the table, and to the index of pairs, of lines, of points or of triangles.
#include <algorithm>
#include <cmath>
#include <deque>
#include <thread>
#include <type_traits>
#include <utility>

#include "gpu/cuda/cpu_voxels.h"
#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/item_lists.h"
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/line_kernels.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {

void CudaVolume::ChooseIndex(const Drawable& drawable, const TableEntry& entry, const Cut* cut,
                             Slot& slot) const {
  IndexedBy by = IndexFor(entry.record);
  if (by == IndexedBy::kPairs) return;
  if (by == IndexedBy::kPoints && !points_suit_) by = IndexedBy::kLines;
  if (by == IndexedBy::kLines && !lines_suit_) return;
  if (by != IndexedBy::kTriangles && entry.source.radius > 0) return;
  if (cut != nullptr) return ChooseIndexOfCut(by, *cut, slot);
  const auto* const arrays = static_cast<const DeviceArrays*>(drawable.geometry->memory.get());
  if (arrays == nullptr || !arrays->bounds) return;
  const GeometryBounds& bounds = *arrays->bounds;
  const Affine& map = entry.source.map;
  double lo[3] = {}, hi[3] = {};
  for (int corner = 0; corner < 8; ++corner) {
    const Point3d p =
        Map(map, corner & 1 ? bounds.hi[0] : bounds.lo[0], corner & 2 ? bounds.hi[1] : bounds.lo[1],
            corner & 4 ? bounds.hi[2] : bounds.lo[2]);
    const double at[3] = {p.x, p.y, p.z};
    for (int a = 0; a < 3; ++a) {
      lo[a] = corner == 0 ? at[a] : std::min(lo[a], at[a]);
      hi[a] = corner == 0 ? at[a] : std::max(hi[a], at[a]);
    }
  }
  // Differences of floats were rounded, and so are mapped vertices, in proportion to the terms of
  // the mapping.
  constexpr double kSpare = 1.000001, kMostTerms = 1e11;
  double extent[3] = {};
  for (int a = 0; a < 3 && by == IndexedBy::kTriangles; ++a) {
    double terms = std::abs(map.m[a * 4 + 3]);
    for (int b = 0; b < 3; ++b) {
      const double m = std::abs(map.m[a * 4 + b]);
      extent[a] += m * bounds.extent[b] * kSpare;
      terms += m * std::max(std::abs(bounds.lo[b]), std::abs(bounds.hi[b]));
    }
    if (!(terms < kMostTerms)) return;
  }
  ChooseIndexOf(by, {{lo[0], lo[1], lo[2]}, {hi[0], hi[1], hi[2]}}, extent, slot);
}

// `box` holds all vertices; those of a triangle are at most `extent` apart, in voxels.
void CudaVolume::ChooseIndexOf(IndexedBy by, const RoughBox& box, const double extent[3],
                               Slot& slot) {
  const bool suits = by == IndexedBy::kLines    ? AreThin(box.lo, box.hi)
                     : by == IndexedBy::kPoints ? AreNear(box.lo, box.hi)
                                                : AreCompact(box.lo, box.hi, extent);
  if (!suits) return;
  slot.indexed_by = by;
  slot.box = box;
  if (by != IndexedBy::kTriangles) return;
  // Allows for snapping, for voxels that are only touched, and for counting the last one.
  int32_t voxels[3];
  for (int a = 0; a < 3; ++a) voxels[a] = static_cast<int32_t>(extent[a]) + 4;
  slot.regions_each = RegionsOfExtent(voxels);
}

void CudaVolume::ChooseIndexOfCut(IndexedBy by, const Cut& cut, Slot& slot) {
  if (cut.vertices.empty()) return;
  const auto at = [&](size_t vertex, size_t a) {
    return static_cast<double>(cut.vertices[vertex].v[a]) / kUnitsPerVoxel;
  };
  RoughBox box = RoughBox::Nothing();
  double extent[3] = {};
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < cut.vertices.size(); ++i) {
      box.lo[a] = std::min(box.lo[a], at(i, a));
      box.hi[a] = std::max(box.hi[a], at(i, a));
    }
    for (size_t first = 0; first + 3 <= cut.indices.size(); first += 3) {
      const uint32_t* const corner = &cut.indices[first];
      const auto [low, high] = std::minmax({at(corner[0], a), at(corner[1], a), at(corner[2], a)});
      extent[a] = std::max(extent[a], high - low);
    }
  }
  ChooseIndexOf(by, box, extent, slot);
}

uint32_t CudaVolume::TakeSlot() {
  if (free_slots_.empty()) {
    slots_.emplace_back();
    return static_cast<uint32_t>(slots_.size() - 1);
  }
  const uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  return slot;
}

TableEntry CudaVolume::EntryOf(const Drawable& d, WorkedOut& worked_out) const {
  const GeometryView& view = d.geometry->view;
  TableEntry entry;
  entry.record = view.record;
  entry.source.tint = d.record.tint;
  entry.priority = d.record.priority;
  entry.erase = d.record.erase;
  entry.layer = layer_slots_.at(d.layer->record.id);
  entry.alive = 1;
  const Affine map = Compose(Compose(view_, d.layer->record.transform), d.record.transform);
  if (IsCurved(view.record.kind) && view.record.drawn_by != DrawnBy::kCpu) {
    worked_out.cut = std::make_unique<Cut>(CutCurved(OnHost(d), map, tiles_.grid));
    entry.record = worked_out.cut->record;
    entry.source.radius = RadiusOf(view.record, map);
    return entry;
  }
  WithPrimitive(view.record.kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    if constexpr (kIsSolid<Primitive>) {
      entry.source.solid = Solid::Of(Compose(map, Primitive::CanonicalMap(view.record)));
    } else if constexpr (std::is_same_v<Primitive, Implicit>) {
      worked_out.hoisted = Implicit::Place(view.record, OnHost(d).indices.data(), map, tiles_.grid,
                                           /*tiles=*/1, entry.source.solid, entry.source.implicit);
      entry.source.positions = view.positions.data();
      entry.source.indices = view.indices.data();
    } else if constexpr (std::is_same_v<Primitive, Samples>) {
      Samples::Place(view.record, OnHost(d).indices.data(), map, tiles_.grid, /*tiles=*/1,
                     entry.source.solid, entry.source.implicit);
      entry.source.indices = view.indices.data();
    } else {
      entry.source.positions = view.positions.data();
      entry.source.indices = view.indices.data();
      entry.source.colors = view.colors.data();
      entry.source.map = map;
      entry.source.radius = RadiusOf(view.record, map);
      if (IsCells(view.record)) Points::PlaceCells(map, entry.source);
      if constexpr (std::is_same_v<Primitive, Filled>) {
        Filled::Place(BoundsOf(d, map), /*tiles=*/1, entry.source.solid, entry.source.implicit);
      }
    }
  });
  return entry;
}

absl::Status CudaVolume::Place(const Drawable& drawable, const WorkedOut& worked_out,
                               TableEntry& entry, uint32_t slot) {
  if (worked_out.cut != nullptr) return PlaceCut(*worked_out.cut, entry, slots_[slot]);
  if (entry.record.kind == PrimitiveKind::kFilled) return PlaceFilled(entry, slots_[slot]);
  return worked_out.hoisted.empty() ? absl::OkStatus()
                                    : PlaceImplicit(drawable, worked_out.hoisted, entry, slot);
}

absl::Status CudaVolume::PlaceCut(const Cut& cut, TableEntry& entry, Slot& slot) {
  if (cut.vertices.empty()) return absl::OkStatus();
  absl::StatusOr<Block> block = device_.Upload(cut.vertices.data(), cut.vertices.size());
  if (!block.ok()) return block.status();
  slot.vertices = *std::move(block);
  entry.source.vertices = slot.vertices.as<Int3>();
  if (!cut.indices.empty()) {
    block = device_.Upload(cut.indices.data(), cut.indices.size());
    if (!block.ok()) return block.status();
    slot.indices = *std::move(block);
    entry.source.indices = slot.indices.as<uint32_t>();
  }
  if (!cut.colors.empty()) {
    block = device_.Upload(cut.colors.data(), cut.colors.size());
    if (!block.ok()) return block.status();
    slot.colors = *std::move(block);
    entry.source.colors = slot.colors.as<uint32_t>();
  }
  return absl::OkStatus();
}

Box3 CudaVolume::BoundsOf(const Drawable& d, const Affine& map) const {
  const TileGrid& grid = tiles_.grid;
  // The arrays of geometries that the CPU draws are in the host's memory.
  const bool on_device = d.geometry->view.record.drawn_by != DrawnBy::kCpu;
  const auto* const arrays =
      on_device ? static_cast<const DeviceArrays*>(d.geometry->memory.get()) : nullptr;
  if (arrays == nullptr || !arrays->bounds) {
    return {{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
  }
  return VoxelsAround(arrays->bounds->lo, arrays->bounds->hi, map, grid, 0);
}

absl::Status CudaVolume::PlaceFilled(TableEntry& entry, Slot& slot) {
  const uint64_t bytes = InsideRows{entry.source.solid.bounds}.size() * sizeof(uint32_t);
  if (bytes == 0) return absl::OkStatus();
  absl::StatusOr<std::optional<Block>> room = RoomToKeep(bytes + Filled::Count(entry.source));
  if (!room.ok()) return room.status();
  // Without memory for it, tiles test all triangles.
  if (!room->has_value()) return absl::OkStatus();
  slot.inside = **std::move(room);
  uint32_t* const inside = slot.inside.as<uint32_t>();
  if (absl::Status status = device_.Zero(inside, bytes); !status.ok()) return status;
  uint8_t* const tiles = slot.inside.as<uint8_t>() + bytes;
  entry.source.inside = inside;
  entry.source.inside_tiles = tiles;
  return device_.Run("FindInside", [&] {
    return cuda::FindInside(entry.source, entry.record, inside, tiles, device_.stream());
  });
}

absl::Status CudaVolume::DrawInto(TableEntry& entry, const Drawable& drawable, Slot& slot) {
  if (executor_ == nullptr) {
    executor_ = MakeExecutor(static_cast<int>(std::max(1u, std::thread::hardware_concurrency())));
  }
  const CpuVoxels drawn = DrawOnCpu(drawable, view_, tiles_.grid, tiles_.owned_here, *executor_);
  absl::StatusOr<Block> block = device_.Upload(drawn.tiles.data(), drawn.tiles.size());
  if (!block.ok()) return block.status();
  slot.tiles = *std::move(block);
  block = device_.Upload(drawn.begin.data(), drawn.begin.size());
  if (!block.ok()) return block.status();
  slot.begin = *std::move(block);
  block = device_.Upload(drawn.voxels.data(), drawn.voxels.size());
  if (!block.ok()) return block.status();
  slot.voxels = *std::move(block);
  // The uploaded data lies in memory that is about to be freed.
  if (absl::Status status = device_.Wait(); !status.ok()) return status;
  slot.items = static_cast<uint32_t>(drawn.tiles.size());
  slot.singular = drawn.singular;
  entry.record.kind = kDrawnByCpu;
  entry.drawn = {slot.tiles.as<uint32_t>(), slot.begin.as<uint64_t>(), slot.voxels.as<uint64_t>()};
  return absl::OkStatus();
}

// The old table is kept until the new one is complete.
absl::Status CudaVolume::GrowTable() {
  if (slots_.size() * sizeof(TableEntry) <= table_.size()) return absl::OkStatus();
  const size_t entries = table_.size() / sizeof(TableEntry);
  Block grown;
  absl::Status status = device_.pool().Grow<TableEntry>(grown, slots_.size(), 0, device_.stream());
  if (status.ok() && entries > 0) {
    status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(grown.as<void>(), table_.as<void>(), entries * sizeof(TableEntry),
                             cudaMemcpyDeviceToDevice, device_.stream());
    });
    if (status.ok()) {
      status = device_.Run("Rebase", [&] {
        return Rebase(grown.as<TableEntry>(), static_cast<uint32_t>(entries), device_.stream());
      });
    }
  }
  if (status.ok()) table_ = std::move(grown);
  return status;
}

namespace {

FewEntries FewOf(std::span<const uint32_t> slots, std::span<const TableEntry> entries) {
  FewEntries few;
  std::copy(slots.begin(), slots.end(), few.slots);
  std::copy(entries.begin(), entries.end(), few.entries);
  return few;
}

}  // namespace

bool CudaVolume::AreFew(std::span<const uint32_t> slots,
                        std::span<const TableEntry> entries) const {
  if (slots.size() > kFewRows) return false;
  const IndexedBy by = slots_[slots[0]].indexed_by;
  if (by != IndexedBy::kLines && by != IndexedBy::kPoints) return false;
  uint64_t items = 0;
  for (size_t i = 0; i < slots.size(); ++i) {
    const Slot& slot = slots_[slots[i]];
    if (slot.indexed_by != by || entries[i].layer != entries[0].layer) return false;
    items += slot.items;
  }
  return items > 0 && items <= (by == IndexedBy::kLines ? kMostFewLines : kMostFewPoints);
}

absl::Status CudaVolume::PutDrawables(std::span<const uint32_t> slots,
                                      std::span<const TableEntry> entries) {
  const uint32_t count = static_cast<uint32_t>(slots.size());
  if (count <= kFewRows) {
    const FewEntries few = FewOf(slots, entries);
    return device_.Run("PutEntries", [&] {
      return PutFewEntries(table_.as<TableEntry>(), few, count, device_.stream());
    });
  }
  const absl::StatusOr<Block> uploaded = device_.Upload(entries.data(), entries.size());
  if (!uploaded.ok()) return uploaded.status();
  const absl::StatusOr<Block> places = device_.Upload(slots.data(), slots.size());
  if (!places.ok()) return places.status();
  return device_.Run("PutEntries", [&] {
    return PutEntries(table_.as<TableEntry>(), uploaded->as<TableEntry>(), places->as<uint32_t>(),
                      count, device_.stream());
  });
}

absl::Status CudaVolume::Enter() {
  constexpr uint64_t kMostWorkedOut = 64u << 20;  // approximate bytes in uploads
  if (pending_.empty()) return absl::OkStatus();
  const std::vector<const Drawable*> drawables(pending_.begin(), pending_.end());
  std::vector<uint32_t> slots;
  std::vector<TableEntry> entries;
  placed_.clear();
  formulas_.BeginFrame();
  slots.reserve(drawables.size());
  entries.reserve(drawables.size());
  std::deque<WorkedOut> worked_out;
  uint64_t held = 0;  // bytes of the cuts in it
  bool uploads = false;
  absl::Status status;
  uint32_t singular = 0;
  uint64_t coming[4] = {};                  // items, by index
  absl::flat_hash_set<uint32_t> layers[4];  // by index
  for (const IndexedBy by : kByRegion) layers[static_cast<size_t>(by)] = IndexOf(by).Layers();
  for (const Drawable* drawable : drawables) {
    const uint32_t slot = TakeSlot();
    WorkedOut& mine = worked_out.emplace_back();
    TableEntry entry = EntryOf(*drawable, mine);
    entry.source.record = &entry.record;
    slots.push_back(slot);
    slots_[slot] = {};
    const bool by_cpu = entry.record.drawn_by == DrawnBy::kCpu;
    uploads |= mine.cut != nullptr || !mine.hoisted.empty();
    held += mine.cut != nullptr ? mine.cut->bytes() : 0;
    status =
        by_cpu ? DrawInto(entry, *drawable, slots_[slot]) : Place(*drawable, mine, entry, slot);
    if (!status.ok()) break;
    if (!by_cpu) {
      WithPrimitive(entry.record.kind, [&](auto primitive) {
        using Primitive = typename decltype(primitive)::type;
        slots_[slot].items = Primitive::Count(entry.source);
        ChooseIndex(*drawable, entry, mine.cut.get(), slots_[slot]);
        slots_[slot].singular = kIsInverted<Primitive> && !entry.source.solid.drawable;
      });
      IndexedBy& by = slots_[slot].indexed_by;
      auto& taken = layers[static_cast<size_t>(by)];
      uint64_t& items = coming[static_cast<size_t>(by)];
      if (by != IndexedBy::kPairs &&
          (slots_[slot].items > IndexOf(by).most_items() ||
           !IndexOf(by).MayHave(items + slots_[slot].items) ||
           (!taken.contains(entry.layer) && taken.size() >= kMaxRegionLayers))) {
        by = IndexedBy::kPairs;
      }
      if (by != IndexedBy::kPairs) {
        taken.insert(entry.layer);
        items += slots_[slot].items;
      }
    }
    singular += slots_[slot].singular ? 1 : 0;
    entries.push_back(entry);
    if (held > kMostWorkedOut) {
      status = device_.Wait();
      if (!status.ok()) break;
      worked_out.clear();
      held = 0;
    }
  }
  // The uploaded data lies in memory that is freed when this call returns.
  if (uploads) {
    const absl::Status waited = device_.Wait();
    if (status.ok()) status = waited;
  }
  const bool few = status.ok() && AreFew(slots, entries);
  if (status.ok()) status = GrowTable();
  if (status.ok() && !few) status = PutDrawables(slots, entries);
  if (status.ok()) status = FindImplicit();
  if (!status.ok()) {
    for (const uint32_t taken : slots) slots_[taken] = {};
    free_slots_.insert(free_slots_.end(), slots.begin(), slots.end());
    return status;
  }
  std::vector<PairedDrawable> pairs;
  Crowds formed;
  for (size_t i = 0; i < slots.size(); ++i) {
    const Slot& slot = slots_[slots[i]];
    if (slot.indexed_by != IndexedBy::kPairs) continue;
    pairs.push_back({slots[i], entries[i].layer, slot.items});
    live_items_ += slot.items;
  }
  if (few) {
    const FewEntries them = FewOf(slots, entries);
    status = EnterRegions(slots_[slots[0]].indexed_by, drawables, slots, &them);
  } else {
    status = EnterCrowds(drawables, slots, formed, pairs);
    if (status.ok()) status = EnterPairs(pairs);
    for (const IndexedBy by : kByRegion) {
      if (status.ok()) status = EnterRegions(by, drawables, slots, nullptr);
    }
  }
  if (!status.ok()) {
    // They are removed again, and are added with the next frame.
    for (const auto& [layer, crowd] : formed) index_.Loosen(crowd.layer);
    left_.insert(left_.end(), slots.begin(), slots.end());
    return status;
  }
  for (size_t i = 0; i < slots.size(); ++i) {
    slot_of_[drawables[i]] = slots[i];
    dirty_.Add(slots_[slots[i]].box);
  }
  crowds_.merge(formed);
  singular_ += singular;
  pending_.clear();
  return absl::OkStatus();
}

absl::Status CudaVolume::EnterPairs(std::span<const PairedDrawable> drawables) {
  if (drawables.empty()) return absl::OkStatus();
  const absl::StatusOr<size_t> added =
      index_.Add(table_.as<TableEntry>(), looks_.as<LayerLook>(), drawables, tiles_.view());
  if (!added.ok()) return added.status();
  std::vector<uint32_t> deferred;
  for (const PairedDrawable& d : drawables.subspan(*added)) {
    if (looks_now_[d.layer].drawn != 0) deferred.push_back(d.slot);
  }
  return deferred.empty() ? absl::OkStatus() : MarkPairs(deferred);
}

// Goes layer by layer.
absl::Status CudaVolume::EnterRegions(IndexedBy by, std::span<const Drawable* const> drawables,
                                      std::span<const uint32_t> slots, const FewEntries* entries) {
  RegionIndex& index = IndexOf(by);
  absl::flat_hash_map<uint32_t, std::vector<Arriving>> layers;  // by slot
  for (size_t i = 0; i < slots.size(); ++i) {
    const Slot& slot = slots_[slots[i]];
    if (slot.indexed_by != by) continue;
    const Drawable& drawable = *drawables[i];
    std::vector<Arriving>& groups = layers[layer_slots_.at(drawable.layer->record.id)];
    if (groups.empty() || groups.back().first.back() + slot.items > index.most_items()) {
      groups.emplace_back();
    }
    Arriving& arriving = groups.back();
    arriving.slots.push_back(slots[i]);
    arriving.first.push_back(arriving.first.back() + slot.items);
    arriving.drawn = drawable.layer->drawn;
    arriving.regions_each = std::max(arriving.regions_each, slot.regions_each);
    const GeometryRecord& record = drawable.geometry->view.record;
    arriving.mixed |= by != IndexedBy::kPoints && record.kind != PrimitiveKind::kPoints &&
                      record.color_mode == ColorMode::kPerVertex && drawable.record.erase == 0;
  }
  for (const auto& [layer, groups] : layers) {
    for (const Arriving& arriving : groups) {
      absl::Status status = EnterGroup(index, layer, arriving, entries);
      if (!status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

absl::Status CudaVolume::EnterGroup(RegionIndex& index, uint32_t layer, const Arriving& arriving,
                                    const FewEntries* entries) {
  const absl::StatusOr<UploadedList> list =
      UploadItems(device_, arriving.slots, [&](uint32_t slot) { return slots_[slot].items; });
  if (!list.ok()) return list.status();
  return index.Add(table_.as<TableEntry>(),
                   {.layer = layer,
                    .drawn = arriving.drawn,
                    .mixed = arriving.mixed,
                    .regions_each = arriving.regions_each,
                    .list = list->list,
                    .slots = arriving.slots,
                    .first = arriving.first,
                    .entries = entries},
                   tiles_.region_dirty.as<uint8_t>());
}

}  // namespace voxeld::gpu::cuda
