// Crowds: layers of many solids that the device moves.
#include <numeric>
#include <utility>

#include "gpu/cuda/cuda_volume.h"
#include "gpu/cuda/item_lists.h"
#include "gpu/cuda/kernels.h"

namespace voxeld::gpu::cuda {

absl::Status CudaVolume::EnterCrowds(std::span<const Drawable* const> drawables,
                                     std::span<const uint32_t> slots, Crowds& formed,
                                     std::vector<PairedDrawable>& pairs) {
  if (pairs.size() < least_crowd_) return absl::OkStatus();
  for (size_t i = 0; i < drawables.size(); ++i) {
    const GeometryRecord& record = drawables[i]->geometry->view.record;
    if (!IsSolid(record.kind) || record.drawn_by == DrawnBy::kCpu) continue;
    if (slots_[slots[i]].items != 1) continue;  // without an inverse
    Crowd& crowd = formed[drawables[i]->layer];
    crowd.layer = layer_slots_.at(drawables[i]->layer->record.id);
    crowd.drawables.push_back(drawables[i]);
    crowd.slots.push_back(slots[i]);
  }
  absl::erase_if(formed, [&](const auto& entry) {
    return entry.second.count() < least_crowd_ ||
           entry.second.count() != entry.first->drawables.size();
  });
  absl::flat_hash_set<uint32_t> taken;
  for (auto it = formed.begin(); it != formed.end();) {
    Crowd& crowd = it->second;
    absl::StatusOr<bool> whole = index_.MayHaveWhole(crowd.count());
    if (*whole) {
      const absl::StatusOr<UploadedList> list =
          UploadItems(device_, crowd.slots, [](uint32_t) { return 1; });
      if (!list.ok()) return list.status();
      whole = index_.SetWhole(crowd.layer, table_.as<TableEntry>(), looks_.as<LayerLook>(),
                              list->list, crowd.count(), tiles_.view());
      if (!whole.ok()) return whole.status();
    }
    if (*whole) {
      taken.insert(crowd.layer);
      ++it;
    } else {
      formed.erase(it++);
    }
  }
  std::erase_if(pairs, [&](const PairedDrawable& d) { return taken.contains(d.layer); });
  return absl::OkStatus();
}

bool CudaVolume::OnLayerMove(Layer& layer) {
  const auto it = crowds_.find(&layer);
  if (it == crowds_.end()) return false;
  it->second.moved = true;
  it->second.marks |= layer.drawn;
  return true;
}

absl::Status CudaVolume::BringCrowd(Crowd& crowd) {
  std::vector<Affine> transforms;
  std::vector<uint64_t> firsts;
  absl::StatusOr<Block> block;
  if (crowd.there.size() == 0) {
    firsts.resize(crowd.slots.size() + 1);
    std::iota(firsts.begin(), firsts.end(), uint64_t{0});
    block = device_.Upload(firsts.data(), firsts.size());
    if (!block.ok()) return block.status();
    crowd.firsts = *std::move(block);
    block = device_.Upload(crowd.slots.data(), crowd.slots.size());
    if (!block.ok()) return block.status();
    crowd.there = *std::move(block);
  }
  if (crowd.moved && crowd.transforms.size() == 0) {
    transforms.reserve(crowd.drawables.size());
    for (const Drawable* drawable : crowd.drawables)
      transforms.push_back(drawable->record.transform);
    block = device_.Upload(transforms.data(), transforms.size());
    if (!block.ok()) return block.status();
    crowd.transforms = *std::move(block);
  }
  // The uploaded data lies in memory that is freed when this call returns.
  return firsts.empty() && transforms.empty() ? absl::OkStatus() : device_.Wait();
}

absl::StatusOr<bool> CudaVolume::MoveCrowd(const Layer& layer, Crowd& crowd) {
  absl::Status status = BringCrowd(crowd);
  if (absl::IsResourceExhausted(status)) return false;
  ItemList list;
  list.slots = crowd.there.as<uint32_t>();
  list.firsts = crowd.firsts.as<uint64_t>();
  list.count = crowd.count();
  if (status.ok() && crowd.marks) {
    status = device_.Run("MarkTiles", [&] {
      return MarkTiles(table_.as<TableEntry>(), list, crowd.count(), tiles_.view(),
                       device_.stream());
    });
  }
  if (!status.ok()) return status;
  // A hidden layer is not drawn, before or after the move.
  if (crowd.marks || layer.drawn) dirty_ = RoughBox::Everything();
  crowd.marks = false;
  if (!crowd.moved) return true;
  const absl::StatusOr<Block> singular = device_.Zeros(sizeof(uint32_t));
  if (absl::IsResourceExhausted(singular.status())) return false;
  if (!singular.ok()) return singular.status();
  status = device_.Run("MoveSolids", [&] {
    return MoveSolids(table_.as<TableEntry>(), list.slots, crowd.transforms.as<Affine>(),
                      Compose(view_, layer.record.transform), list.count, singular->as<uint32_t>(),
                      device_.stream());
  });
  if (!status.ok()) return status;
  const absl::StatusOr<bool> whole =
      index_.SetWhole(crowd.layer, table_.as<TableEntry>(), looks_.as<LayerLook>(), list,
                      list.count, tiles_.view());
  if (!whole.ok() || !*whole) return whole;
  const absl::StatusOr<uint32_t> flat = device_.Read(singular->as<uint32_t>());
  if (!flat.ok()) return flat.status();
  if (*flat != 0) return false;
  crowd.moved = false;
  return true;
}

absl::Status CudaVolume::MoveCrowds() {
  std::vector<const Layer*> apart;
  for (auto& [layer, crowd] : crowds_) {
    if (!crowd.moved && !crowd.marks) continue;
    const absl::StatusOr<bool> together = MoveCrowd(*layer, crowd);
    if (!together.ok()) return together.status();
    if (!*together) apart.push_back(layer);
  }
  for (const Layer* layer : apart) Disperse(layer);
  return left_.empty() && marks_.empty() ? absl::OkStatus() : MarkLeft();
}

void CudaVolume::Disperse(const Layer* layer) {
  const auto it = crowds_.find(layer);
  if (it == crowds_.end()) return;
  const Crowd crowd = std::move(it->second);
  crowds_.erase(it);
  index_.Loosen(crowd.layer);
  if (crowd.marks) marks_.insert(marks_.end(), crowd.slots.begin(), crowd.slots.end());
  if (!crowd.moved) return;
  // The table does not have their current places: they are added again.
  for (size_t i = 0; i < crowd.slots.size(); ++i) {
    const Drawable* const drawable = crowd.drawables[i];
    slot_of_.erase(drawable);
    left_.push_back(crowd.slots[i]);
    kept_.push_back(drawable->geometry);
    pending_.insert(drawable);
  }
}

void CudaVolume::DisperseAll() {
  while (!crowds_.empty()) Disperse(crowds_.begin()->first);
}

}  // namespace voxeld::gpu::cuda
