#include "gpu/cuda/cuda_volume.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/cuda/draw_kernels.h"
#include "gpu/cuda/item_lists.h"
#include "gpu/cuda/kernels.h"
#include "gpu/derived_bytes.h"

namespace voxeld::gpu::cuda {
namespace {

// If there are more removed items than live ones, plus this many, they are removed from the index.
constexpr uint64_t kSpareItems = 65536;
constexpr size_t kSpareSlots = 1 << 16;  // tables with fewer slots are never made smaller

uint64_t IndexBytes(const Tuning& tuning, const cudaDeviceProp& device) {
  if (tuning.index_bytes != 0) return tuning.index_bytes;
  return std::min(uint64_t{16} << 30, uint64_t{device.totalGlobalMem} / 4);
}

}  // namespace

CudaVolume::CudaVolume(Device& device, Uploader& uploader, const Tuning& tuning)
    : device_(device),
      uploader_(uploader),
      list_budget_{
          Pool(device.pool(), IndexBytes(tuning, device.api().device())),
          static_cast<uint64_t>(static_cast<double>(IndexBytes(tuning, device.api().device())) *
                                tuning.index_share_kept)},
      index_(device, list_budget_),
      lines_(device, list_budget_, tuning.few_lines),
      points_(device, list_budget_, tuning.points_each, tuning.few_points),
      triangles_(device, list_budget_),
      formulas_(device.api(), tuning.compile_formulas),
      least_crowd_(tuning.least_crowd) {}

void RoughBox::Add(const RoughBox& other) {
  for (int a = 0; a < 3; ++a) {
    lo[a] = std::min(lo[a], other.lo[a]);
    hi[a] = std::max(hi[a], other.hi[a]);
  }
}

double RoughBox::ShareOf(const RegionGrid& regions) const {
  double share = 1;
  for (int a = 0; a < 3; ++a) {
    const double count = regions.blocks[a] << kBlockBits, size = 1 << RegionBits(a);
    const double begin = std::clamp(std::floor(lo[a] / size), 0.0, count);
    const double end = std::clamp(std::floor(hi[a] / size) + 1, begin, count);
    share *= (end - begin) / count;
  }
  return share;
}

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
  tiles_ = std::move(tiles);
  view_ = view;
  scene_.MapClips(view_, true);
  listed_ = all_dirty;
  dirty_ = all_dirty ? RoughBox::Everything() : RoughBox::Nothing();
  counted_ = true;
  lines_suit_ = LineIndex::Suits(device_.api(), tiles_.grid);
  points_suit_ = PointIndex::Suits(device_.api(), tiles_.grid);
  pass_planes_ = INT32_MAX;
  marks_.clear();
  left_.clear();
  kept_.clear();
  EnterAllAgain();
  return absl::OkStatus();
}

void CudaVolume::EnterAllAgain() {
  index_.Clear();
  lines_.Reset(tiles_.grid, tiles_.owned_here);
  points_.Reset(tiles_.grid, tiles_.owned_here);
  triangles_.Reset(tiles_.grid, tiles_.owned_here);
  slots_ = std::vector<Slot>();
  free_slots_ = std::vector<uint32_t>();
  dead_slots_ = std::vector<uint32_t>();
  slot_of_ = {};
  pending_ = {};
  crowds_.clear();
  table_ = Block();
  live_items_ = dead_items_ = 0;
  singular_ = 0;
  for (const auto& [id, drawable] : scene_.drawables()) pending_.insert(drawable.get());
}

// ------------------------------------------------------------------------------------------- frames

namespace {

// Brings an array on the device up to date; `there` is its current contents.
template <typename T>
absl::Status PutArray(Device& device, Block& block, const std::vector<T>& now,
                      std::vector<T>& there) {
  if (now == there) return absl::OkStatus();
  there.clear();  // unknown while it is being written
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
  cylinders_now_.clear();
  const auto put = [&](const Layer& layer, uint32_t slot) {
    const LayerRecord& record = layer.record;
    const VoxelClip& clip = *layer.clip;
    looks_now_[slot] = {layer.rank,
                        layer.seen() ? 1u : 0,
                        layer.drawn ? 1u : 0,
                        -1,  // slots are not known yet
                        record.opacity,
                        record.blend,
                        static_cast<uint32_t>(half_spaces_now_.size()),
                        clip.count,
                        static_cast<uint32_t>(cylinders_now_.size()),
                        clip.cylinder_count};
    cylinders_now_.insert(cylinders_now_.end(), clip.cylinders,
                          clip.cylinders + clip.cylinder_count);
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
  for (const auto& [id, layer] : scene_.layers()) {
    if (layer->mask == nullptr) continue;
    looks_now_[slots.at(id)].mask = static_cast<int32_t>(slots.at(layer->mask->record.id));
  }
  layer_slots_ = std::move(slots);
  absl::Status status = PutArray(device_, looks_, looks_now_, looks_there_);
  if (status.ok()) status = PutArray(device_, half_spaces_, half_spaces_now_, half_spaces_there_);
  if (status.ok()) status = PutArray(device_, cylinders_, cylinders_now_, cylinders_there_);
  return status;
}

absl::Status CudaVolume::MarkPairs(std::span<const uint32_t> slots) {
  const absl::StatusOr<UploadedList> list =
      UploadItems(device_, slots, [&](uint32_t slot) { return slots_[slot].items; });
  if (!list.ok()) return list.status();
  if (list->items == 0) return absl::OkStatus();
  return device_.Run("MarkTiles", [&] {
    return MarkTiles(table_.as<TableEntry>(), list->list, list->items, tiles_.view(),
                     device_.stream());
  });
}

// Kills the pairs of those in `left_` that the index of pairs still names.
absl::Status CudaVolume::KillPairs() {
  std::vector<uint32_t> slots;
  std::copy_if(left_.begin(), left_.end(), std::back_inserter(slots),
               [&](uint32_t slot) { return slots_[slot].indexed_by == IndexedBy::kPairs; });
  if (slots.empty()) return absl::OkStatus();
  const absl::StatusOr<Block> there = device_.Upload(slots.data(), slots.size());
  if (!there.ok()) return there.status();
  return device_.Run("Kill", [&] {
    return Kill(table_.as<TableEntry>(), there->as<uint32_t>(), static_cast<uint32_t>(slots.size()),
                device_.stream());
  });
}

absl::Status CudaVolume::MarkLeft() {
  if (!marks_.empty()) {
    std::sort(marks_.begin(), marks_.end());
    marks_.erase(std::unique(marks_.begin(), marks_.end()), marks_.end());
    const auto of_regions = std::partition(marks_.begin(), marks_.end(), [&](uint32_t slot) {
      return slots_[slot].indexed_by == IndexedBy::kPairs;
    });
    absl::Status status = MarkPairs({marks_.begin(), of_regions});
    // Each index finds its own items.
    for (const IndexedBy by : kByRegion) {
      if (!status.ok()) return status;
      status = IndexOf(by).Mark({of_regions, marks_.end()}, tiles_.region_dirty.as<uint8_t>());
    }
    if (!status.ok()) return status;
    for (const uint32_t slot : marks_) dirty_.Add(slots_[slot].box);
    marks_.clear();
  }
  if (left_.empty()) return absl::OkStatus();
  if (absl::Status status = KillPairs(); !status.ok()) return status;
  index_.Forget(left_);
  absl::Status status;
  for (const IndexedBy by : kByRegion) {
    if (status = IndexOf(by).Drop(left_); !status.ok()) return status;
  }
  for (const uint32_t slot : left_) {
    dirty_.Add(slots_[slot].box);
    if (slots_[slot].indexed_by != IndexedBy::kPairs) {
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
  if (live_items_ == 0) {
    index_.Clear();
    free_slots_.insert(free_slots_.end(), dead_slots_.begin(), dead_slots_.end());
    dead_slots_.clear();
    dead_items_ = 0;
  }
  // Later work in the stream may reuse their memory: it runs after the work queued here.
  kept_.clear();
  if (dead_items_ + dead_slots_.size() > live_items_ + kSpareItems) {
    status = index_.DropDead(table_.as<TableEntry>(), tiles_.grid.count());
    if (absl::IsResourceExhausted(status)) {
      DeferPairs();  // uses the memory that is available
    } else if (!status.ok()) {
      return status;
    }
    free_slots_.insert(free_slots_.end(), dead_slots_.begin(), dead_slots_.end());
    dead_slots_.clear();
    dead_items_ = 0;
  }
  // Tables do not shrink. If most of their slots are free, the few drawables that are left get new
  // tables.
  if (slots_.size() > kSpareSlots && slot_of_.size() < slots_.size() / 8) EnterAllAgain();
  return absl::OkStatus();
}

void CudaVolume::DeferPairs() {
  DisperseAll();
  std::vector<PairedDrawable> drawables;
  for (const auto& [drawable, slot] : slot_of_) {
    if (slots_[slot].indexed_by != IndexedBy::kPairs) continue;
    drawables.push_back({slot, layer_slots_.at(drawable->layer->record.id), slots_[slot].items});
  }
  index_.Defer(std::move(drawables));
}

absl::StatusOr<DrawView> CudaVolume::ViewForDrawing(uint32_t group) {
  DrawView view;
  const auto drawn = [](const LayerLook& look) { return look.drawn != 0; };
  if (std::count_if(looks_now_.begin(), looks_now_.end(), drawn) > 1) {
    Block& below = below_[group];
    const size_t blocks =
        std::min(tiles_.regions.count(),
                 kDrawBlocks * static_cast<uint32_t>(device_.api().device().multiProcessorCount));
    const size_t bytes = blocks * kRegionVoxels * sizeof(uint32_t);
    if (below.size() < bytes) {
      below = Block();
      absl::StatusOr<Block> block = device_.pool().Acquire(bytes);
      if (!block.ok()) return block.status();
      below = *std::move(block);
    }
    view.below = below.as<uint32_t>();
  }
  view.table = table_.as<TableEntry>();
  view.layers = looks_.as<LayerLook>();
  view.half_spaces = half_spaces_.as<VoxelHalfSpace>();
  view.cylinders = cylinders_.as<VoxelCylinder>();
  view.pairs = index_.view();
  view.lines = lines_.view();
  view.points = points_.view();
  view.triangles = triangles_.view();
  view.volume = tiles_.view();
  view.regions = tiles_.regions;
  return view;
}

absl::Status CudaVolume::Draw(DrawView& view, DrawTo to, cudaStream_t stream) {
  // Whether all drawables are in one layer that is shown without blending.
  bool plain = true, masked = false;
  absl::flat_hash_set<uint32_t> layers;
  const auto keep_drawn = [&](auto& list) {
    uint32_t kept = 0;
    for (uint32_t b = 0; b < list.count; ++b) {
      const LayerLook& look = looks_now_[list.batches[b].layer];
      if (look.drawn == 0) continue;
      masked |= look.mask >= 0;
      layers.insert(list.batches[b].layer);
      plain &= look.blend == BlendMode::kOver && look.opacity == 255;
      list.batches[kept++] = list.batches[b];
    }
    list.count = kept;
  };
  keep_drawn(view.lines);
  keep_drawn(view.points);
  keep_drawn(view.triangles);
  const LayerLook first = layers.empty() ? LayerLook() : looks_now_[*layers.begin()];
  view.clipped = first.half_spaces != 0 || first.cylinders != 0;
  bool any = masked || view.pairs.count > 0 || view.unlisted.items > 0;
  for (uint32_t b = 0; b < view.lines.count; ++b) {
    any |= view.lines.batches[b].lists.spans == nullptr;
  }
  for (uint32_t b = 0; b < view.points.count; ++b) {
    any |= view.points.batches[b].records == nullptr;
  }
  for (uint32_t b = 0; b < view.triangles.count; ++b) {
    any |= view.triangles.batches[b].begin == nullptr;
  }
  const auto draw = any ? DrawAll : plain && layers.size() <= 1 ? DrawOneLayer : DrawLines;
  return device_.Run("DrawRegions", [&] {
    return draw(view, to, static_cast<uint32_t>(device_.api().device().multiProcessorCount),
                stream);
  });
}

double CudaVolume::ItemsToDraw() const {
  const uint64_t items = live_items_ + lines_.live() + points_.live() + triangles_.live();
  return static_cast<double>(items) * dirty_.ShareOf(tiles_.regions);
}

uint64_t CudaVolume::host_bytes() const {
  uint64_t bytes = scene_.memory_bytes() + VectorBytes(slots_) + HashBytes(slot_of_) +
                   HashBytes(pending_) + index_.host_bytes();
  for (const std::vector<uint32_t>* slots : {&free_slots_, &dead_slots_, &marks_, &left_}) {
    bytes += VectorBytes(*slots);
  }
  return bytes + lines_.host_bytes() + points_.host_bytes() + triangles_.host_bytes();
}

absl::Status CudaVolume::TakeIn() {
  if (absl::Status status = PutLayers(); !status.ok()) return status;
  if (absl::Status status = MarkLeft(); !status.ok()) return status;
  if (absl::Status status = MoveCrowds(); !status.ok()) return status;
  // Removed drawables have released their memory by now; this frame's allocations follow.
  device_.pool().BeginPeak();
  if (absl::Status status = Enter(); !status.ok()) return status;
  for (const IndexedBy by : kByRegion) {
    if (absl::Status status = IndexOf(by).Merge(); !status.ok()) return status;
    if (absl::Status status = IndexOf(by).SortDeferred(); !status.ok()) return status;
  }
  return index_.AddDeferred(table_.as<TableEntry>(), tiles_.view());
}

absl::Status CudaVolume::ListDirty(const DrawGroups& groups) {
  const VolumeView volume = tiles_.view();
  absl::Status status;
  if (listed_) {
    status = device_.Run("cudaMemcpyAsync", [&] {
      return cudaMemcpyAsync(volume.dirty, volume.owned, volume.grid.count(),
                             cudaMemcpyDeviceToDevice, device_.stream());
    });
    if (!status.ok()) return status;
  }
  if (counted_)
    status =
        device_.Zero(volume.counters->dirty, sizeof(Counters::dirty) + sizeof(Counters::taken));
  if (!status.ok()) return status;
  listed_ = counted_ = true;
  groups_ = groups;
  return device_.Run("ListDirty", [&] {
    return cuda::ListDirty(volume, tiles_.regions, groups, device_.stream());
  });
}

absl::Status CudaVolume::DrawGroup(uint32_t group, const SliceIndexView& slices,
                                   const PackedView* packed, cudaStream_t stream) {
  absl::StatusOr<DrawView> all = ViewForDrawing(group);
  if (!all.ok()) return all.status();
  DrawView& view = *all;
  view.slices = slices;
  if (packed != nullptr) view.packed = *packed;
  const size_t before = group == 0 ? 0 : static_cast<size_t>(groups_.end[group - 1]);
  view.list = view.volume.dirty_list + before * tiles_.regions.count_of_plane();
  view.listed = &view.volume.counters->dirty[group];
  view.taken = &view.volume.counters->taken[group];
  absl::Status status =
      DrawListed(view, packed != nullptr ? DrawTo::kPictures : DrawTo::kTiles, stream);
  if (status.ok() && group + 1 == groups_.count) {
    listed_ = false;
    dirty_ = RoughBox::Nothing();
  }
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
  counters.dirty[0] = static_cast<uint32_t>(list.size());
  if (list.empty()) return absl::OkStatus();
  const absl::StatusOr<Block> regions = device_.Upload(list.data(), list.size());
  if (!regions.ok()) return regions.status();
  const absl::StatusOr<Block> counts = device_.Upload(&counters, 1);
  if (!counts.ok()) return counts.status();
  absl::StatusOr<DrawView> all = ViewForDrawing(0);
  if (!all.ok()) return all.status();
  DrawView& view = *all;
  view.volume.counters = counts->as<Counters>();
  view.list = regions->as<uint32_t>();
  view.listed = view.volume.counters->dirty;
  view.taken = view.volume.counters->taken;
  view.read = {box, out};
  if (absl::Status status = DrawListed(view, DrawTo::kReader, device_.stream()); !status.ok())
    return status;
  return device_.Wait();
}

}  // namespace voxeld::gpu::cuda
