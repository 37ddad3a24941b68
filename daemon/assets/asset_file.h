// One asset's bytes on the disk.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::daemon::assets {

// One that is being written. Statuses: ResourceExhausted (the disk is full, descriptors are out), else
// Unavailable.
class AssetFile {
 public:
  // Mode 0600. `empty`: what is there goes; else it stays.
  static absl::StatusOr<AssetFile> Open(const std::string& path, bool empty);

  absl::Status Write(uint64_t offset, std::string_view bytes);
  // On the disk, under another path, when it returns. An error: it has the path that it had.
  absl::Status Keep(const std::string& path);

 private:
  AssetFile(std::string path, Descriptor file) : path_(std::move(path)), file_(std::move(file)) {}

  std::string path_;
  Descriptor file_;
};

// Exactly that range. OutOfRange: the file is shorter, or not there. Unavailable: it cannot be read.
absl::StatusOr<wire::MappedRange> ReadAssetFile(const std::string& path, uint64_t offset,
                                                uint64_t size);

// The SHA-256 of the first `size` bytes; statuses as above.
absl::StatusOr<std::string> HashAssetFile(const std::string& path, uint64_t size);
std::string HashBytes(std::string_view bytes);

// That it is in use, for whoever reads the folder later.
void TouchAssetFile(const std::string& path);

}  // namespace voxeld::daemon::assets
