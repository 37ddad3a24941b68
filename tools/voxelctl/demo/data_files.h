// Where the files are that scenes are made of.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::voxelctl {

// One file that a scene needs.
struct SceneFile {
  // Below a root, the best first: any of them will do.
  std::vector<std::string> names;
  std::string brought_by;  // for people: "Debian's package pymol-data"
};

// Where data may lie, in the order in which it is looked for: `given` (--data, empty: none); build/data, share/voxeld/data and
// data as they lie beside a `program` (its path) that was built, installed or unpacked from a bundle; /usr/share/voxeld/data;
// /usr/share, for Debian's packages.
std::vector<std::string> DataRoots(const std::string& given, const std::string& program);

// This program's own path; empty where the system does not say.
std::string ProgramPath();

// The first that is there: each name below each root, below its node_modules, and by its last part alone. NotFound says what brings one, and which would have done.
absl::StatusOr<std::string> FindSceneFile(const SceneFile& file,
                                          const std::vector<std::string>& roots);

// All of them, in order; the first that is missing is told.
absl::StatusOr<std::vector<std::string>> FindSceneFiles(const std::vector<SceneFile>& files,
                                                        const std::vector<std::string>& roots);

}  // namespace voxeld::voxelctl
