// Finds the project's programs, which lie beside each other, also when they have been copied.
#pragma once

#include <filesystem>
#include <string>

namespace voxeld::child {

// Returns the path of `name` in the running program's folder, or in the folder above it.
inline std::string ProgramBeside(const std::string& name) {
  const std::filesystem::path folder =
      std::filesystem::read_symlink("/proc/self/exe").parent_path();
  const std::filesystem::path beside = folder / name;
  return (std::filesystem::exists(beside) ? beside : folder.parent_path() / name).string();
}

}  // namespace voxeld::child
