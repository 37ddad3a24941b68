// Finds the files that scenes are made of.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::voxelctl {

// One file that a scene needs.
struct SceneFile {
  // Paths below a root, in order of preference; any of them will do.
  std::vector<std::string> names;
  std::string brought_by;  // for people: "Debian's package pymol-data"
};

// Returns the folders that may contain data, in search order: `given` (--data; empty: none);
// build/data, share/voxeld/data and data, relative to a `program` (its path) that was built,
// installed or unpacked from a bundle; /usr/share/voxeld/data; /usr/share, for Debian's packages.
std::vector<std::string> DataRoots(const std::string& given, const std::string& program);

// Returns this program's own path; empty if the system does not provide it.
std::string ProgramPath();

// Returns the first existing file: each name is tried below each root, below the root's
// node_modules, and by its last component alone. Errors: NotFound with how to get one, and the
// names that would have been accepted.
absl::StatusOr<std::string> FindSceneFile(const SceneFile& file,
                                          const std::vector<std::string>& roots);

// Returns all of them, in order. The error reports the first missing one.
absl::StatusOr<std::vector<std::string>> FindSceneFiles(const std::vector<SceneFile>& files,
                                                        const std::vector<std::string>& roots);

}  // namespace voxeld::voxelctl
