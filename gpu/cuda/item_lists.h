// Lists of drawables' items (types.h) on the device.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "gpu/cuda/device.h"
#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

// An ItemList with the memory that it lies in.
struct UploadedList {
  Block slots, first;
  ItemList list;
  uint64_t items = 0;
};

// The items of drawables by slot; items_of(slot): how many.
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

}  // namespace voxeld::gpu::cuda
