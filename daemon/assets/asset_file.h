// Reads and writes the file of one asset.
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

// An asset file that is being written. Errors: ResourceExhausted if the disk is full or no
// descriptors are left, else Unavailable.
class AssetFile {
 public:
  // Opens the file with mode 0600. `empty`: truncates it; otherwise existing content stays.
  static absl::StatusOr<AssetFile> Open(const std::string& path, bool empty);

  absl::Status Write(uint64_t offset, std::string_view bytes);
  // Flushes the file to the disk and renames it to `path`. On an error it keeps its previous path.
  absl::Status Keep(const std::string& path);

 private:
  AssetFile(std::string path, Descriptor file) : path_(std::move(path)), file_(std::move(file)) {}

  std::string path_;
  Descriptor file_;
};

// Reads exactly this range. Errors: OutOfRange if the file is shorter or missing, Unavailable if it
// cannot be read.
absl::StatusOr<wire::MappedRange> ReadAssetFile(const std::string& path, uint64_t offset,
                                                uint64_t size);

// Returns: the SHA-256 of the first `size` bytes. Errors: as for ReadAssetFile.
absl::StatusOr<std::string> HashAssetFile(const std::string& path, uint64_t size);
std::string HashBytes(std::string_view bytes);

// Updates the file's time, which tells a later ReadFolder that the asset was in use.
void TouchAssetFile(const std::string& path);

}  // namespace voxeld::daemon::assets
