// The files that assimp may open.
#pragma once

#include <assimp/IOSystem.hpp>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// Gives assimp the checked bytes of `file`, and the files that ReadOtherFile allows. Assimp finds
// no other files and cannot write. Not thread-safe. `file` must outlive it.
class AssimpFiles final : public Assimp::IOSystem {
 public:
  // `prepared` replaces the bytes of `file` unless it is empty.
  explicit AssimpFiles(const SourceFile& file, std::string prepared = "")
      : file_(file), prepared_(std::move(prepared)) {}

  bool Exists(const char* path) const override { return Find(path) != nullptr; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* path, const char* mode) override;
  void Close(Assimp::IOStream* stream) override;

 private:
  const std::string* Find(const std::string& path) const;

  const SourceFile& file_;
  const std::string prepared_;
  // By path; null if the file may not be read.
  mutable std::map<std::string, std::unique_ptr<std::string>> others_;
};

}  // namespace voxeld::voxelctl
