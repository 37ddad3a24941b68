#include "tools/voxelctl/demo/data_files.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

std::vector<std::string> DataRoots(const std::string& given, const std::string& program) {
  std::vector<std::string> roots;
  if (!given.empty()) roots.push_back(given);
  if (!program.empty()) {
    const fs::path bin = fs::path(program).parent_path();
    // build/PRESET/bin/voxelctl, PREFIX/bin/voxelctl and BUNDLE/bin/voxelctl.
    roots.push_back((bin.parent_path().parent_path() / "data").string());
    roots.push_back((bin.parent_path() / "share/voxeld/data").string());
    roots.push_back((bin.parent_path() / "data").string());
  }
  roots.emplace_back("/usr/share/voxeld/data");
  roots.emplace_back("/usr/share");
  return roots;
}

std::string ProgramPath() {
  std::error_code error;
  const fs::path path = fs::read_symlink("/proc/self/exe", error);
  return error ? "" : path.string();
}

absl::StatusOr<std::string> FindSceneFile(const SceneFile& file,
                                          const std::vector<std::string>& roots) {
  for (const std::string& name : file.names) {
    for (const fs::path root : roots) {
      for (const fs::path& place :
           {root / name, root / "node_modules" / name, root / fs::path(name).filename()}) {
        if (IsFile(place)) return place.string();
      }
    }
  }
  return absl::NotFoundError(
      absl::StrCat(file.brought_by, " brings ", absl::StrJoin(file.names, " or "),
                   ", which is in none of ", EscapeForTerminal(absl::StrJoin(roots, ", "))));
}

absl::StatusOr<std::vector<std::string>> FindSceneFiles(const std::vector<SceneFile>& files,
                                                        const std::vector<std::string>& roots) {
  std::vector<std::string> found;
  for (const SceneFile& file : files) {
    absl::StatusOr<std::string> path = FindSceneFile(file, roots);
    if (!path.ok()) return path.status();
    found.push_back(*std::move(path));
  }
  return found;
}

}  // namespace voxeld::voxelctl
