// Where one asset's bytes lie: a file of a folder, or memory that has no name.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::daemon::assets {

// What has been removed can be read on by whoever has it. Thread-safe but for Write, Keep and Remove.
class AssetFile {
 public:
  // A new one, or the one at `path`, whose size is told; an empty path: memory, mode 0600 otherwise.
  // ResourceExhausted (the disk is full, descriptors are out), else Unavailable.
  static absl::StatusOr<std::shared_ptr<AssetFile>> Open(const std::string& path, uint64_t* size);

  // All of `bytes` from `offset` on. ResourceExhausted if there is no room, else Unavailable.
  absl::Status Write(uint64_t offset, std::string_view bytes);
  absl::Status Empty();

  // Exactly that range, copied. Unavailable if it is not there.
  absl::StatusOr<wire::MappedRange> Read(uint64_t offset, uint64_t size) const;

  // The SHA-256 of the first `size` bytes.
  absl::StatusOr<std::string> Hash(uint64_t size) const;

  // On the disk, under another path. In memory nothing.
  absl::Status Keep(const std::string& path);
  void Remove();
  // That it is in use, for whoever reads the folder later.
  void Touch() const;

 private:
  AssetFile(std::string path, Descriptor file) : path_(std::move(path)), file_(std::move(file)) {}

  std::string path_;  // empty: memory
  Descriptor file_;
};

}  // namespace voxeld::daemon::assets
