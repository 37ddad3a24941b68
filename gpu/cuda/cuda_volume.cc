#include "gpu/cuda/cuda_volume.h"

#include <algorithm>
#include <thread>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "gpu/assemble/delta_plan.h"
#include "gpu/cuda/cpu_voxels.h"
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/upload_plan.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {
namespace {

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
                                              std::span<const uint8_t> owned) {
  DeviceTiles tiles;
  tiles.grid = grid;
  const size_t count = grid.count();
  for (const auto& [block, bytes] : {std::pair(&tiles.dirty, count),
                                     {&tiles.dirty_list, count * sizeof(uint32_t)},
                                     {&tiles.lit, count * sizeof(uint32_t)},
                                     {&tiles.colors, count * kTileVoxels * sizeof(uint32_t)},
                                     {&tiles.counters, sizeof(Counters)}}) {
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
          dirty_list.as<uint32_t>(),
          lit.as<uint32_t>(),
          colors.as<uint32_t>(),
          counters.as<Counters>()};
}

void CudaVolume::SetView(DeviceTiles tiles, const Affine& view) {
  tiles_ = std::move(tiles);
  view_ = view;
  scene_.MapClips(view_, true);
  listed_ = false;
  index_.Clear();
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
}

// ------------------------------------------------------------------------------------------- deltas

absl::Status CudaVolume::Apply(std::span<const std::byte> delta, BulkSource* bulk) {
  std::vector<std::unique_ptr<Drawable>> gone;
  const absl::Status status = scene_.Apply(delta, bulk, *this, gone);
  arrays_ = nullptr;
  scene_.MapClips(view_, false);
  bulk_.clear();
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
  if (uploads.size() == 0) return absl::OkStatus();
  absl::StatusOr<Block> block = device_.pool().Acquire(uploads.size());
  if (!block.ok()) return block.status();
  for (const UploadPlan::Copy& copy : uploads.copies()) {
    absl::Status status = device_.ToDevice(block->as<std::byte>() + copy.to, copy.from, copy.size);
    if (!status.ok()) return status;
  }
  // The delta's memory is given back when Apply returns, and so may bulk memory be.
  if (absl::Status status = device_.Wait(); !status.ok()) return status;
  arrays_ = std::make_shared<Block>(*std::move(block));
  return absl::OkStatus();
}

RetainedGeometry CudaVolume::Retain(const GeometryView& view) {
  if (view.record.drawn_by == DrawnBy::kCpu) return SceneObserver::Retain(view);
  RetainedGeometry kept{view, nullptr};
  kept.view.bulk = nullptr;
  if (view.positions.empty()) return kept;
  const bool in_bulk = view.bulk != nullptr;
  const std::byte* const host =
      in_bulk ? reinterpret_cast<const std::byte*>(view.positions.data()) : arrays_begin_;
  std::byte* const device =
      arrays_->as<std::byte>() + (in_bulk ? bulk_.at(view.positions.data()) : 0);
  kept.view.positions = Moved(view.positions, host, device);
  kept.view.indices = Moved(view.indices, host, device);
  kept.view.colors = Moved(view.colors, host, device);
  kept.memory = arrays_;
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

absl::Status CudaVolume::MarkLeft() {
  if (!marks_.empty()) {
    std::sort(marks_.begin(), marks_.end());
    marks_.erase(std::unique(marks_.begin(), marks_.end()), marks_.end());
    const absl::StatusOr<UploadedList> list =
        UploadList(device_, marks_, [&](uint32_t slot) { return slots_[slot].items; });
    if (!list.ok()) return list.status();
    if (list->items > 0) {
      absl::Status status = device_.Run("MarkTiles", [&] {
        return MarkTiles(table_.as<TableEntry>(), list->list, list->items, tiles_.view(),
                         device_.stream());
      });
      if (!status.ok()) return status;
    }
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
  for (const uint32_t slot : left_) {
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
        slots_[slot].singular = kIsSolid<Primitive> && !entry.source.solid.drawable;
      });
    }
    singular += slots_[slot].singular ? 1 : 0;
    entries.push_back(entry);
  }
  absl::Status status = PutDrawables(slots, entries);
  if (status.ok()) {
    const absl::StatusOr<UploadedList> list =
        UploadList(device_, slots, [&](uint32_t slot) { return slots_[slot].items; });
    status = list.status();
    if (status.ok()) {
      status = index_.Add(table_.as<TableEntry>(), looks_.as<LayerLook>(), list->list, list->items,
                          tiles_.view());
    }
    for (const uint32_t slot : slots) live_items_ += slots_[slot].items;
  } else {
    for (const uint32_t taken : slots) slots_[taken] = {};
    free_slots_.insert(free_slots_.end(), slots.begin(), slots.end());
    return status;
  }
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

absl::Status CudaVolume::Update(const SliceIndexView& slices) {
  if (absl::Status status = PutLayers(); !status.ok()) return status;
  if (absl::Status status = MarkLeft(); !status.ok()) return status;
  if (absl::Status status = Enter(); !status.ok()) return status;
  const VolumeView view = tiles_.view();
  absl::Status status;
  if (listed_) {
    status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(view.dirty, view.owned, view.grid.count(), cudaMemcpyDeviceToDevice,
                             device_.stream());
    });
    if (!status.ok()) return status;
  }
  status = device_.Zero(&view.counters->dirty, 2 * sizeof(uint32_t));
  if (!status.ok()) return status;
  status = device_.Run("ListDirty", [&] { return ListDirty(view, device_.stream()); });
  if (!status.ok()) return status;
  const uint32_t blocks = std::min<uint32_t>(
      view.grid.count(), 2 * static_cast<uint32_t>(device_.api().device().multiProcessorCount));
  status = device_.Run("DrawTiles", [&] {
    return DrawTiles(table_.as<TableEntry>(), looks_.as<LayerLook>(),
                     half_spaces_.as<VoxelHalfSpace>(), index_.view(), view, slices, blocks,
                     device_.stream());
  });
  listed_ = !status.ok();
  return status;
}

}  // namespace voxeld::gpu::cuda
