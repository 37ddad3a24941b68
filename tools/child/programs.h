// Where the project's programs find each other: beside themselves, also where they were copied to.
#pragma once

#include <filesystem>
#include <string>

namespace voxeld::child {

// `name` in the running program's folder, else in the one above.
inline std::string ProgramBeside(const std::string& name) {
  const std::filesystem::path folder =
      std::filesystem::read_symlink("/proc/self/exe").parent_path();
  const std::filesystem::path beside = folder / name;
  return (std::filesystem::exists(beside) ? beside : folder.parent_path() / name).string();
}

}  // namespace voxeld::child
