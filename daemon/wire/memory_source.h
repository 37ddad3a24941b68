// What a request may name in place of payloads (voxeld.v1.MemoryRange). The decoder reads it through
// this; where it comes from (daemon/local, daemon/assets) is not its business.
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

// Bytes that stay there, and as they are, for as long as `mapping` lives.
struct MappedRange {
  std::string_view bytes;
  std::shared_ptr<const void> mapping;
};

class MemorySource {
 public:
  virtual ~MemorySource() = default;

  // `size` bytes from `offset` of the memory that the client calls `memory`. Thread-safe.
  //
  // NotFound: there is no such memory. OutOfRange: it ends before. Anything else: it cannot be read
  // now. Each message goes on from the name of the field at fault, as in "is 7; …": memory, size,
  // memory.
  virtual absl::StatusOr<MappedRange> Find(uint64_t memory, uint64_t offset,
                                           uint64_t size) const = 0;
};

class AssetSource {
 public:
  static constexpr size_t kDigestBytes = 32;

  virtual ~AssetSource() = default;

  // `size` bytes from `offset` of the content whose SHA-256 is `digest`, so many bytes. It counts as used.
  // Thread-safe; reads a file.
  //
  // NotFound: it is not here, or not yet whole. OutOfRange: it ends before. Anything else: it cannot be
  // read now. Messages as above: asset, size, asset.
  virtual absl::StatusOr<MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                                uint64_t size) = 0;
};

// Each may be none.
struct Sources {
  const MemorySource* memory = nullptr;
  AssetSource* assets = nullptr;
  // What has what was read of assets, while a request is decoded; none: nothing is charged.
  Budget* budget = nullptr;
};

}  // namespace voxeld::daemon::wire
