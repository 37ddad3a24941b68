// Memory that a request may name in place of payloads (voxeld.v1.MemoryRange). The decoder reads it
// through these interfaces, which daemon/local and daemon/assets implement.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::daemon {
class Budget;
}

namespace voxeld::daemon::wire {

// Bytes that stay valid and unchanged as long as `mapping` exists.
struct MappedRange {
  std::string_view bytes;
  std::shared_ptr<const void> mapping;
};

class MemorySource {
 public:
  virtual ~MemorySource() = default;

  // Returns: `size` bytes from `offset` of the client's memory `memory`. Thread-safe.
  //
  // Errors: NotFound if the memory does not exist; OutOfRange if it ends earlier; any other error
  // means that it cannot be read now. Each message continues after the name of the faulty field, as
  // in "is 7; …": respectively memory, size, memory.
  virtual absl::StatusOr<MappedRange> Find(uint64_t memory, uint64_t offset,
                                           uint64_t size) const = 0;
};

class AssetSource {
 public:
  static constexpr size_t kDigestBytes = 32;

  virtual ~AssetSource() = default;

  // Returns: `size` bytes from `offset` of the content whose SHA-256 is `digest`, a string of
  // kDigestBytes. Marks it as used. Thread-safe; reads a file.
  //
  // Errors: NotFound if the asset is missing or incomplete; OutOfRange if it ends earlier; any
  // other error means that it cannot be read now. Messages are as above: asset, size, asset.
  virtual absl::StatusOr<MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                                uint64_t size) = 0;
};

// Either source may be null.
struct Sources {
  const MemorySource* memory = nullptr;
  AssetSource* assets = nullptr;
  // Charged for bytes read from assets while a request is decoded; null: not charged.
  Budget* budget = nullptr;
};

}  // namespace voxeld::daemon::wire
