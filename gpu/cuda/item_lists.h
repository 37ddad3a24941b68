// Lists of drawables' items (types.h) on the device.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

// An ItemList and its memory.
struct UploadedList {
  Block slots, firsts;
  ItemList list;
  uint64_t items = 0;
};

// firsts[i]: where the row of slots[i] begins; the last element is the end.
inline absl::StatusOr<UploadedList> UploadList(Device& device, std::span<const uint32_t> slots,
                                               std::span<const uint64_t> firsts) {
  UploadedList uploaded;
  uploaded.items = firsts.back() - firsts.front();
  uploaded.list.count = static_cast<uint32_t>(slots.size());
  if (slots.size() <= kFewRows) {
    std::copy(slots.begin(), slots.end(), uploaded.list.few_slots);
    std::copy(firsts.begin(), firsts.end(), uploaded.list.few_firsts);
    return uploaded;
  }
  absl::StatusOr<Block> block = device.Upload(slots.data(), slots.size());
  if (!block.ok()) return block.status();
  uploaded.slots = *std::move(block);
  block = device.Upload(firsts.data(), firsts.size());
  if (!block.ok()) return block.status();
  uploaded.firsts = *std::move(block);
  uploaded.list.slots = uploaded.slots.as<uint32_t>();
  uploaded.list.firsts = uploaded.firsts.as<uint64_t>();
  return uploaded;
}

// Uploads the items of drawables by slot; items_of(slot) is their number.
template <typename ItemsOf>
absl::StatusOr<UploadedList> UploadItems(Device& device, std::span<const uint32_t> slots,
                                         ItemsOf&& items_of) {
  std::vector<uint64_t> firsts = {0};
  firsts.reserve(slots.size() + 1);
  for (const uint32_t slot : slots) firsts.push_back(firsts.back() + items_of(slot));
  return UploadList(device, slots, firsts);
}

}  // namespace voxeld::gpu::cuda
