#include "tools/import/assimp_files.h"

#include <assimp/MemoryIOWrapper.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <utility>

namespace voxeld::voxelctl {

Assimp::IOStream* AssimpFiles::Open(const char* path, const char* mode) {
  if (std::strpbrk(mode, "wa+") != nullptr) return nullptr;
  const std::string* const bytes = Find(path);
  if (bytes == nullptr) return nullptr;
  return new Assimp::MemoryIOStream(reinterpret_cast<const uint8_t*>(bytes->data()), bytes->size());
}

void AssimpFiles::Close(Assimp::IOStream* stream) { delete stream; }

const std::string* AssimpFiles::Find(const std::string& path) const {
  if (path == file_.path) return prepared_.empty() ? &file_.bytes : &prepared_;
  const auto [at, is_new] = others_.try_emplace(path);
  if (is_new) {
    // Assimp prefixes the names that it finds with the folder.
    const std::string folder = std::filesystem::path(file_.path).parent_path().string() + "/";
    std::string name = path;
    if (folder != "/" && name.starts_with(folder)) name.erase(0, folder.size());
    absl::StatusOr<SourceFile> other = ReadOtherFile(file_, name);
    if (other.ok()) at->second = std::make_unique<std::string>(std::move(other->bytes));
  }
  return at->second.get();
}

}  // namespace voxeld::voxelctl
