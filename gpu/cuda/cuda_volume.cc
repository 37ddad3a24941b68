#include "gpu/cuda/cuda_volume.h"

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "gpu/assemble/delta_plan.h"
#include "gpu/cuda/cpu_voxels.h"
#include "gpu/cuda/draw_kernels.h"
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/line_kernels.h"
#include "gpu/cuda/upload_plan.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {
namespace {

// What a geometry's arrays lie in, and where what they say lies: if its items may be thin lines.
struct DeviceArrays {
  std::shared_ptr<Block> block;
  std::optional<GeometryBounds> bounds;
};

// Beyond as many items as there are, what has gone is swept out of the index.
constexpr uint64_t kSpareItems = 65536;

// The same array, at its place in device memory. Never looked at by the host.
template <typename T>
std::span<const T> Moved(std::span<const T> array, const std::byte* host, std::byte* device) {
  if (array.empty()) return array;
  const auto offset = reinterpret_cast<const std::byte*>(array.data()) - host;
  return {reinterpret_cast<const T*>(device + offset), array.size()};
}

}  // namespace

// ------------------------------------------------------------------------------------------- tiles

absl::StatusOr<DeviceTiles> DeviceTiles::Make(Device& device, const TileGrid& grid,
                                              std::span<const uint8_t> owned, bool keep_colors) {
  DeviceTiles tiles;
  tiles.grid = grid;
  tiles.regions = RegionGrid::Of(grid);
  const size_t count = grid.count(), regions = tiles.regions.count();
  for (const auto& [block, bytes] :
       {std::pair(&tiles.dirty, count),
        {&tiles.region_dirty, regions},
        {&tiles.dirty_list, regions * sizeof(uint32_t)},
        {&tiles.lit, count * sizeof(uint32_t)},
        {&tiles.colors, keep_colors ? count * kTileVoxels * sizeof(uint32_t) : 0},
        {&tiles.counters, sizeof(Counters)}}) {
    if (bytes == 0) continue;
    absl::StatusOr<Block> zeros = device.Zeros(bytes);
    if (!zeros.ok()) return zeros.status();
    *block = *std::move(zeros);
  }
  absl::StatusOr<Block> uploaded = device.Upload(owned.data(), owned.size());
  if (!uploaded.ok()) return uploaded.status();
  tiles.owned = *std::move(uploaded);
  tiles.owned_here.assign(owned.begin(), owned.end());
  return tiles;
}

VolumeView DeviceTiles::view() const {
  return {grid,
          owned.as<uint8_t>(),
          dirty.as<uint8_t>(),
          region_dirty.as<uint8_t>(),
          dirty_list.as<uint32_t>(),
          lit.as<uint32_t>(),
          colors.as<uint32_t>(),
          counters.as<Counters>()};
}

absl::Status CudaVolume::SetView(DeviceTiles tiles, const Affine& view, bool all_dirty) {
  if (reciprocals_.size() == 0) {
    std::vector<uint64_t> reciprocals = {ThinReciprocal(1)};
    for (int32_t n = 1; n <= kMaxThinSteps; ++n) reciprocals.push_back(ThinReciprocal(n));
    absl::StatusOr<Block> block = device_.Upload(reciprocals.data(), reciprocals.size());
    if (!block.ok()) return block.status();
    if (absl::Status status = device_.Wait(); !status.ok()) return status;
    reciprocals_ = *std::move(block);
  }
  tiles_ = std::move(tiles);
  view_ = view;
  scene_.MapClips(view_, true);
  listed_ = all_dirty;
  index_.Clear();
  lines_.Reset(tiles_.grid);
  lines_suit_ = LineIndex::Suits(tiles_.grid);
  slots_.clear();
  free_slots_.clear();
  dead_slots_.clear();
  slot_of_.clear();
  pending_.clear();
  marks_.clear();
  left_.clear();
  kept_.clear();
  live_items_ = dead_items_ = 0;
  singular_ = 0;
  for (const auto& [id, drawable] : scene_.drawables()) pending_.insert(drawable.get());
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------- deltas

absl::Status CudaVolume::Apply(std::span<const std::byte> delta, BulkSource* bulk) {
  std::vector<std::unique_ptr<Drawable>> gone;
  const absl::Status status = scene_.Apply(delta, bulk, *this, gone);
  arrays_ = nullptr;
  scene_.MapClips(view_, false);
  bulk_.clear();
  bounds_.clear();
  return status;
}

// The arrays of all geometries go over into one piece of memory.
absl::Status CudaVolume::OnPlan(const DeltaPlan& plan) {
  UploadPlan uploads;
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->record.drawn_by == DrawnBy::kCpu ||
        geometry->positions.empty() || geometry->bulk != nullptr) {
      continue;
    }
    uploads.AddInline(*geometry);
  }
  arrays_begin_ = uploads.inline_begin();
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->record.drawn_by == DrawnBy::kCpu ||
        geometry->positions.empty() || geometry->bulk == nullptr) {
      continue;
    }
    const float* const positions = geometry->positions.data();
    if (!bulk_.contains(positions)) bulk_[positions] = uploads.AddBulk(*geometry);
  }
  if (uploads.size() == 0) return FindGeometryBounds(plan);
  absl::StatusOr<Block> block = device_.pool().Acquire(uploads.size());
  if (!block.ok()) return block.status();
  for (const UploadPlan::Copy& copy : uploads.copies()) {
    absl::Status status = device_.ToDevice(block->as<std::byte>() + copy.to, copy.from, copy.size);
    if (!status.ok()) return status;
  }
  arrays_ = std::make_shared<Block>(*std::move(block));
  if (absl::Status status = FindGeometryBounds(plan); !status.ok()) return status;
  // The delta's memory is given back when Apply returns, and so may bulk memory be.
  return device_.Wait();
}

namespace {

bool CanBeThin(const GeometryRecord& record) {
  if (record.drawn_by == DrawnBy::kCpu || record.thickness != 0) return false;
  return record.kind == PrimitiveKind::kPoints ||
         (record.kind == PrimitiveKind::kSegments && record.sampling != LineSampling::kCover);
}

// Up to so many vertices the host looks through itself.
constexpr size_t kFewVertices = 1024;

}  // namespace

// Where all geometries lie whose items may be thin lines: large ones are looked through on the
// device.
absl::Status CudaVolume::FindGeometryBounds(const DeltaPlan& plan) {
  std::vector<const GeometryView*> large;
  for (const DeltaStep& step : plan.steps) {
    const auto* geometry = std::get_if<GeometryView>(&step);
    if (geometry == nullptr || geometry->positions.empty() || !CanBeThin(geometry->record))
      continue;
    const std::span<const float> p = geometry->positions;
    if (p.size() > 3 * kFewVertices) {
      large.push_back(geometry);
      continue;
    }
    GeometryBounds bounds;
    for (size_t a = 0; a < 3; ++a) {
      bounds.lo[a] = bounds.hi[a] = static_cast<double>(p[a]);
      for (size_t i = a; i < p.size(); i += 3) {
        bounds.lo[a] = std::min(bounds.lo[a], static_cast<double>(p[i]));
        bounds.hi[a] = std::max(bounds.hi[a], static_cast<double>(p[i]));
      }
    }
    bounds_[p.data()] = bounds;
  }
  if (large.empty()) return absl::OkStatus();
  std::vector<uint32_t> bits;
  for (size_t i = 0; i < large.size(); ++i) bits.insert(bits.end(), {~0u, ~0u, ~0u, 0u, 0u, 0u});
  const absl::StatusOr<Block> found = device_.Upload(bits.data(), bits.size());
  if (!found.ok()) return found.status();
  for (size_t i = 0; i < large.size(); ++i) {
    const std::span<const float> p = large[i]->positions;
    absl::Status status = device_.Run("FindBounds", [&] {
      return FindBounds(OnDevice(*large[i], p).data(), static_cast<uint32_t>(p.size() / 3),
                        found->as<uint32_t>() + i * 6, device_.stream());
    });
    if (!status.ok()) return status;
  }
  absl::Status status =
      device_.ToHost(bits.data(), found->as<uint32_t>(), bits.size() * sizeof(uint32_t));
  if (status.ok()) status = device_.Wait();
  if (!status.ok()) return status;
  for (size_t i = 0; i < large.size(); ++i) {
    GeometryBounds bounds;
    for (size_t a = 0; a < 3; ++a) {
      bounds.lo[a] = static_cast<double>(FromOrderedBits(bits[i * 6 + a]));
      bounds.hi[a] = static_cast<double>(FromOrderedBits(bits[i * 6 + 3 + a]));
    }
    bounds_[large[i]->positions.data()] = bounds;
  }
  return absl::OkStatus();
}

// An array of a geometry of the delta under way, where it lies on the device.
template <typename T>
std::span<const T> CudaVolume::OnDevice(const GeometryView& view, std::span<const T> array) const {
  if (view.bulk == nullptr) return Moved(array, arrays_begin_, arrays_->as<std::byte>());
  return Moved(array, reinterpret_cast<const std::byte*>(view.positions.data()),
               arrays_->as<std::byte>() + bulk_.at(view.positions.data()));
}

RetainedGeometry CudaVolume::Retain(const GeometryView& view) {
  if (view.record.drawn_by == DrawnBy::kCpu) return SceneObserver::Retain(view);
  RetainedGeometry kept{view, nullptr};
  kept.view.bulk = nullptr;
  if (view.positions.empty()) return kept;
  kept.view.positions = OnDevice(view, view.positions);
  kept.view.indices = OnDevice(view, view.indices);
  kept.view.colors = OnDevice(view, view.colors);
  const auto bounds = bounds_.find(view.positions.data());
  kept.memory = std::make_shared<DeviceArrays>(
      arrays_, bounds == bounds_.end() ? std::nullopt : std::optional(bounds->second));
  return kept;
}

void CudaVolume::OnLeave(Drawable& drawable) {
  if (pending_.erase(&drawable) > 0) return;
  const auto it = slot_of_.find(&drawable);
  if (it == slot_of_.end()) return;
  const uint32_t slot = it->second;
  slot_of_.erase(it);
  if (drawable.layer->record.visible != 0) marks_.push_back(slot);
  left_.push_back(slot);
  kept_.push_back(drawable.geometry);
  singular_ -= slots_[slot].singular ? 1 : 0;
}

void CudaVolume::OnEnter(Drawable& drawable) { pending_.insert(&drawable); }

void CudaVolume::OnLayerLook(Layer& layer, const LayerRecord& next) {
  const LayerRecord& now = layer.record;
  if (LooksSame(now, next) || (now.visible == 0 && next.visible == 0)) return;
  // Nothing of it was to be seen, and it enters anew.
  if (now.visible == 0 && !(now.transform == next.transform)) return;
  for (const Drawable* drawable : layer.drawables) {
    const auto it = slot_of_.find(drawable);
    if (it != slot_of_.end()) marks_.push_back(it->second);
  }
}

// ------------------------------------------------------------------------------------------- frames

namespace {

// Brings an array on the device up to date; `there` is what it holds.
template <typename T>
absl::Status PutArray(Device& device, Block& block, const std::vector<T>& now,
                      std::vector<T>& there) {
  if (now == there) return absl::OkStatus();
  there.clear();  // not known while it is being written
  if (now.empty()) return absl::OkStatus();
  absl::Status status = device.pool().Grow<T>(block, now.size(), 0, device.stream());
  if (!status.ok()) return status;
  status = device.ToDevice(block.as<T>(), now.data(), now.size() * sizeof(T));
  if (status.ok()) there = now;
  return status;
}

}  // namespace

absl::Status CudaVolume::PutLayers() {
  absl::flat_hash_map<uint64_t, uint32_t> slots;
  std::vector<const Layer*> fresh;
  std::fill(looks_now_.begin(), looks_now_.end(), LayerLook());
  half_spaces_now_.clear();
  const auto put = [&](const Layer& layer, uint32_t slot) {
    const LayerRecord& record = layer.record;
    const VoxelClip& clip = *layer.clip;
    looks_now_[slot] = {layer.rank,
                        record.visible,
                        record.opacity,
                        record.blend,
                        static_cast<uint32_t>(half_spaces_now_.size()),
                        clip.count};
    half_spaces_now_.insert(half_spaces_now_.end(), clip.half_spaces,
                            clip.half_spaces + clip.count);
    slots[record.id] = slot;
  };
  for (const auto& [id, layer] : scene_.layers()) {
    const auto it = layer_slots_.find(id);
    if (it == layer_slots_.end()) {
      fresh.push_back(layer.get());
    } else {
      put(*layer, it->second);
    }
  }
  free_layer_slots_.clear();
  for (size_t slot = looks_now_.size(); slot-- > 0;) {
    if (looks_now_[slot].rank < 0) free_layer_slots_.push_back(static_cast<uint32_t>(slot));
  }
  if (slots.size() + fresh.size() > kMaxLayers) {
    return absl::ResourceExhaustedError(absl::StrCat("the scene has ", slots.size() + fresh.size(),
                                                     " layers; this engine draws ", kMaxLayers,
                                                     " at most"));
  }
  for (const Layer* layer : fresh) {
    if (free_layer_slots_.empty()) {
      free_layer_slots_.push_back(static_cast<uint32_t>(looks_now_.size()));
      looks_now_.emplace_back();
    }
    put(*layer, free_layer_slots_.back());
    free_layer_slots_.pop_back();
  }
  layer_slots_ = std::move(slots);
  absl::Status status = PutArray(device_, looks_, looks_now_, looks_there_);
  if (status.ok()) status = PutArray(device_, half_spaces_, half_spaces_now_, half_spaces_there_);
  return status;
}

namespace {

// An ItemList with the memory that it lies in.
struct UploadedList {
  Block slots, first;
  ItemList list;
  uint64_t items = 0;
};

template <typename ItemsOf>
absl::StatusOr<UploadedList> UploadList(Device& device, std::span<const uint32_t> slots,
                                        ItemsOf&& items_of) {
  std::vector<uint64_t> first = {0};
  first.reserve(slots.size() + 1);
  for (const uint32_t slot : slots) first.push_back(first.back() + items_of(slot));
  UploadedList uploaded;
  absl::StatusOr<Block> block = device.Upload(slots.data(), slots.size());
  if (!block.ok()) return block.status();
  uploaded.slots = *std::move(block);
  block = device.Upload(first.data(), first.size());
  if (!block.ok()) return block.status();
  uploaded.first = *std::move(block);
  uploaded.list = {uploaded.slots.as<uint32_t>(), uploaded.first.as<uint64_t>(),
                   static_cast<uint32_t>(slots.size())};
  uploaded.items = first.back();
  return uploaded;
}

}  // namespace

absl::Status CudaVolume::MarkPairs(std::span<const uint32_t> slots) {
  const absl::StatusOr<UploadedList> list =
      UploadList(device_, slots, [&](uint32_t slot) { return slots_[slot].items; });
  if (!list.ok()) return list.status();
  if (list->items == 0) return absl::OkStatus();
  return device_.Run("MarkTiles", [&] {
    return MarkTiles(table_.as<TableEntry>(), list->list, list->items, tiles_.view(),
                     device_.stream());
  });
}

absl::Status CudaVolume::MarkLeft() {
  if (!marks_.empty()) {
    std::sort(marks_.begin(), marks_.end());
    marks_.erase(std::unique(marks_.begin(), marks_.end()), marks_.end());
    const auto thin = std::partition(marks_.begin(), marks_.end(),
                                     [&](uint32_t slot) { return !slots_[slot].thin; });
    absl::Status status = MarkPairs({marks_.begin(), thin});
    if (!status.ok()) return status;
    status = lines_.Mark({thin, marks_.end()}, tiles_.region_dirty.as<uint8_t>());
    if (!status.ok()) return status;
    marks_.clear();
  }
  if (left_.empty()) return absl::OkStatus();
  const absl::StatusOr<Block> slots = device_.Upload(left_.data(), left_.size());
  if (!slots.ok()) return slots.status();
  absl::Status status = device_.Run("Kill", [&] {
    return Kill(table_.as<TableEntry>(), slots->as<uint32_t>(), static_cast<uint32_t>(left_.size()),
                device_.stream());
  });
  if (!status.ok()) return status;
  std::vector<uint32_t> thin;
  for (const uint32_t slot : left_) {
    if (slots_[slot].thin) thin.push_back(slot);
  }
  if (status = lines_.Drop(thin); !status.ok()) return status;
  for (const uint32_t slot : left_) {
    if (slots_[slot].thin) {
      free_slots_.push_back(slot);
      slots_[slot] = {};
      continue;
    }
    live_items_ -= slots_[slot].items;
    dead_items_ += slots_[slot].items;
    dead_slots_.push_back(slot);
    slots_[slot] = {.items = slots_[slot].items};
  }
  left_.clear();
  // Their memory may be handed out again: in the stream, after what has just been queued.
  kept_.clear();
  if (dead_items_ + dead_slots_.size() > live_items_ + kSpareItems) {
    status = index_.DropDead(table_.as<TableEntry>(), tiles_.grid.count());
    if (absl::IsResourceExhausted(status)) return absl::OkStatus();  // later, then
    if (!status.ok()) return status;
    free_slots_.insert(free_slots_.end(), dead_slots_.begin(), dead_slots_.end());
    dead_slots_.clear();
    dead_items_ = 0;
  }
  return absl::OkStatus();
}

bool CudaVolume::IsThin(const Drawable& drawable, const TableEntry& entry) const {
  if (!lines_suit_ || !CanBeThin(entry.record) || entry.source.radius > 0) return false;
  const auto* const arrays = static_cast<const DeviceArrays*>(drawable.geometry->memory.get());
  if (arrays == nullptr || !arrays->bounds) return false;
  const GeometryBounds& bounds = *arrays->bounds;
  double lo[3] = {}, hi[3] = {};
  for (int corner = 0; corner < 8; ++corner) {
    const Point3d p =
        Map(entry.source.map, corner & 1 ? bounds.hi[0] : bounds.lo[0],
            corner & 2 ? bounds.hi[1] : bounds.lo[1], corner & 4 ? bounds.hi[2] : bounds.lo[2]);
    const double at[3] = {p.x, p.y, p.z};
    for (int a = 0; a < 3; ++a) {
      lo[a] = corner == 0 ? at[a] : std::min(lo[a], at[a]);
      hi[a] = corner == 0 ? at[a] : std::max(hi[a], at[a]);
    }
  }
  return AreThin(lo, hi);
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

TableEntry CudaVolume::EntryOf(const Drawable& d) const {
  const GeometryView& view = d.geometry->view;
  TableEntry entry;
  entry.record = view.record;
  entry.priority = d.record.priority;
  entry.erase = d.record.erase;
  entry.layer = layer_slots_.at(d.layer->record.id);
  entry.alive = 1;
  const Affine map = Compose(Compose(view_, d.layer->record.transform), d.record.transform);
  WithPrimitive(view.record.kind, [&](auto primitive) {
    using Primitive = typename decltype(primitive)::type;
    if constexpr (kIsSolid<Primitive>) {
      entry.source.solid = Solid::Of(Compose(map, Primitive::CanonicalMap(view.record)));
    } else {
      entry.source.positions = view.positions.data();
      entry.source.indices = view.indices.data();
      entry.source.colors = view.colors.data();
      entry.source.map = map;
      entry.source.radius = RadiusOf(view.record, map);
    }
  });
  return entry;
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
  // What goes over lies in memory that is about to go.
  if (absl::Status status = device_.Wait(); !status.ok()) return status;
  slot.items = static_cast<uint32_t>(drawn.tiles.size());
  slot.singular = drawn.singular;
  entry.record.kind = kDrawnByCpu;
  entry.drawn = {slot.tiles.as<uint32_t>(), slot.begin.as<uint64_t>(), slot.voxels.as<uint64_t>()};
  return absl::OkStatus();
}

// The old table stays until all is right in the new one.
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

absl::Status CudaVolume::PutDrawables(std::span<const uint32_t> slots,
                                      std::span<const TableEntry> entries) {
  if (absl::Status status = GrowTable(); !status.ok()) return status;
  const absl::StatusOr<Block> uploaded = device_.Upload(entries.data(), entries.size());
  if (!uploaded.ok()) return uploaded.status();
  const absl::StatusOr<Block> places = device_.Upload(slots.data(), slots.size());
  if (!places.ok()) return places.status();
  return device_.Run("PutEntries", [&] {
    return PutEntries(table_.as<TableEntry>(), uploaded->as<TableEntry>(), places->as<uint32_t>(),
                      static_cast<uint32_t>(slots.size()), device_.stream());
  });
}

absl::Status CudaVolume::Enter() {
  if (pending_.empty()) return absl::OkStatus();
  const std::vector<const Drawable*> drawables(pending_.begin(), pending_.end());
  std::vector<uint32_t> slots;
  std::vector<TableEntry> entries;
  slots.reserve(drawables.size());
  entries.reserve(drawables.size());
  uint32_t singular = 0;
  absl::flat_hash_set<uint32_t> line_layers = lines_.Layers();
  for (const Drawable* drawable : drawables) {
    const uint32_t slot = TakeSlot();
    TableEntry entry = EntryOf(*drawable);
    entry.source.record = &entry.record;
    slots.push_back(slot);
    slots_[slot] = {};
    if (entry.record.drawn_by == DrawnBy::kCpu) {
      if (absl::Status status = DrawInto(entry, *drawable, slots_[slot]); !status.ok()) {
        for (const uint32_t taken : slots) slots_[taken] = {};
        free_slots_.insert(free_slots_.end(), slots.begin(), slots.end());
        return status;
      }
    } else {
      WithPrimitive(entry.record.kind, [&](auto primitive) {
        using Primitive = typename decltype(primitive)::type;
        slots_[slot].items = Primitive::Count(entry.source);
        slots_[slot].thin = IsThin(*drawable, entry) && (line_layers.contains(entry.layer) ||
                                                         line_layers.size() < kMaxLineLayers);
        if (slots_[slot].thin) line_layers.insert(entry.layer);
        slots_[slot].singular = kIsSolid<Primitive> && !entry.source.solid.drawable;
      });
    }
    singular += slots_[slot].singular ? 1 : 0;
    entries.push_back(entry);
  }
  if (absl::Status status = PutDrawables(slots, entries); !status.ok()) {
    for (const uint32_t taken : slots) slots_[taken] = {};
    free_slots_.insert(free_slots_.end(), slots.begin(), slots.end());
    return status;
  }
  std::vector<uint32_t> pairs;
  for (const uint32_t slot : slots) {
    if (slots_[slot].thin) continue;
    pairs.push_back(slot);
    live_items_ += slots_[slot].items;
  }
  absl::Status status = EnterPairs(pairs);
  if (status.ok()) status = EnterLines(drawables, slots);
  if (!status.ok()) {
    // They go again, and come anew with the next frame.
    left_.insert(left_.end(), slots.begin(), slots.end());
    return status;
  }
  for (size_t i = 0; i < slots.size(); ++i) slot_of_[drawables[i]] = slots[i];
  singular_ += singular;
  pending_.clear();
  return absl::OkStatus();
}

absl::Status CudaVolume::EnterPairs(std::span<const uint32_t> slots) {
  if (slots.empty()) return absl::OkStatus();
  const absl::StatusOr<UploadedList> list =
      UploadList(device_, slots, [&](uint32_t slot) { return slots_[slot].items; });
  if (!list.ok()) return list.status();
  return index_.Add(table_.as<TableEntry>(), looks_.as<LayerLook>(), list->list, list->items,
                    tiles_.view());
}

// Layer by layer.
absl::Status CudaVolume::EnterLines(std::span<const Drawable* const> drawables,
                                    std::span<const uint32_t> slots) {
  struct Arriving {
    std::vector<uint32_t> slots;
    std::vector<uint64_t> first = {0};
    bool visible = false, mixed = false;
  };
  absl::flat_hash_map<uint32_t, Arriving> layers;
  for (size_t i = 0; i < slots.size(); ++i) {
    if (!slots_[slots[i]].thin) continue;
    const Drawable& drawable = *drawables[i];
    Arriving& arriving = layers[layer_slots_.at(drawable.layer->record.id)];
    arriving.slots.push_back(slots[i]);
    arriving.first.push_back(arriving.first.back() + slots_[slots[i]].items);
    arriving.visible = drawable.layer->record.visible != 0;
    const GeometryRecord& record = drawable.geometry->view.record;
    arriving.mixed |= record.kind == PrimitiveKind::kSegments &&
                      record.color_mode == ColorMode::kPerVertex && drawable.record.erase == 0;
  }
  for (const auto& [layer, arriving] : layers) {
    const absl::StatusOr<UploadedList> list =
        UploadList(device_, arriving.slots, [&](uint32_t slot) { return slots_[slot].items; });
    if (!list.ok()) return list.status();
    absl::Status status = lines_.Add(table_.as<TableEntry>(),
                                     {.layer = layer,
                                      .visible = arriving.visible,
                                      .mixed = arriving.mixed,
                                      .list = list->list,
                                      .slots = arriving.slots,
                                      .first = arriving.first},
                                     tiles_.region_dirty.as<uint8_t>());
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

DrawView CudaVolume::ViewForDrawing() const {
  DrawView view;
  view.table = table_.as<TableEntry>();
  view.layers = looks_.as<LayerLook>();
  view.half_spaces = half_spaces_.as<VoxelHalfSpace>();
  view.pairs = index_.view();
  view.lines = lines_.view();
  view.reciprocals = reciprocals_.as<uint64_t>();
  view.volume = tiles_.view();
  view.regions = tiles_.regions;
  return view;
}

absl::Status CudaVolume::Draw(DrawView& view, DrawTo to) {
  // Whether all that there is lies in one layer, to be seen as it is.
  bool plain = true;
  absl::flat_hash_set<uint32_t> layers;
  LineBatchList seen;
  for (uint32_t b = 0; b < view.lines.count; ++b) {
    const LayerLook& look = looks_now_[view.lines.batches[b].layer];
    if (look.visible == 0) continue;
    seen.batches[seen.count++] = view.lines.batches[b];
    layers.insert(view.lines.batches[b].layer);
    plain &= look.blend == BlendMode::kOver && look.opacity == 255;
  }
  view.lines = seen;
  view.clipped = !layers.empty() && looks_now_[*layers.begin()].half_spaces != 0;
  const auto draw = view.pairs.count > 0          ? DrawAll
                    : plain && layers.size() <= 1 ? DrawOneLayer
                                                  : DrawLines;
  return device_.Run("DrawRegions", [&] {
    return draw(view, to, static_cast<uint32_t>(device_.api().device().multiProcessorCount),
                device_.stream());
  });
}

absl::Status CudaVolume::Update(const SliceIndexView& slices, const PackedView* packed) {
  if (absl::Status status = PutLayers(); !status.ok()) return status;
  if (absl::Status status = MarkLeft(); !status.ok()) return status;
  if (absl::Status status = Enter(); !status.ok()) return status;
  if (absl::Status status = lines_.Merge(); !status.ok()) return status;
  DrawView view = ViewForDrawing();
  view.slices = slices;
  if (packed != nullptr) view.packed = *packed;
  const VolumeView& volume = view.volume;
  absl::Status status;
  if (listed_) {
    status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(volume.dirty, volume.owned, volume.grid.count(),
                             cudaMemcpyDeviceToDevice, device_.stream());
    });
    if (!status.ok()) return status;
  }
  status = device_.Zero(&volume.counters->dirty, 2 * sizeof(uint32_t));
  if (!status.ok()) return status;
  listed_ = true;
  status =
      device_.Run("ListDirty", [&] { return ListDirty(volume, view.regions, device_.stream()); });
  if (!status.ok()) return status;
  status = Draw(view, packed != nullptr ? DrawTo::kPictures : DrawTo::kTiles);
  listed_ = !status.ok();
  return status;
}

absl::Status CudaVolume::Read(const Box3& box, uint32_t* out) {
  if (tiles_.colors.size() != 0) {
    const int32_t size[3] = {box.hi[0] - box.lo[0], box.hi[1] - box.lo[1], box.hi[2] - box.lo[2]};
    return device_.Run("ReadBox",
                       [&] { return ReadBox(tiles_.view(), box.lo, size, out, device_.stream()); });
  }
  std::vector<uint32_t> list;
  const Box3 tiles = tiles_.grid.TilesOf(box);
  for (int32_t k = tiles.lo[2]; k < tiles.hi[2]; ++k) {
    for (int32_t j = tiles.lo[1] / 2; j < (tiles.hi[1] + 1) / 2; ++j) {
      for (int32_t i = tiles.lo[0] / 2; i < (tiles.hi[0] + 1) / 2; ++i) {
        const int32_t at[3] = {i, j, k};
        list.push_back(tiles_.regions.RegionAt(at));
      }
    }
  }
  Counters counters;
  counters.dirty = static_cast<uint32_t>(list.size());
  if (list.empty()) return absl::OkStatus();
  const absl::StatusOr<Block> regions = device_.Upload(list.data(), list.size());
  if (!regions.ok()) return regions.status();
  const absl::StatusOr<Block> counts = device_.Upload(&counters, 1);
  if (!counts.ok()) return counts.status();
  DrawView view = ViewForDrawing();
  view.volume.dirty_list = regions->as<uint32_t>();
  view.volume.counters = counts->as<Counters>();
  view.read = {box, out};
  if (absl::Status status = Draw(view, DrawTo::kReader); !status.ok()) return status;
  return device_.Wait();
}

}  // namespace voxeld::gpu::cuda
