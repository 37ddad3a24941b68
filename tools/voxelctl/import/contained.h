// Reading in a process of its own what a library may stumble over.
#pragma once

#include <functional>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// What `read` returns (parts, format, note and up; no volumes), from a copy of this process with 4 GiB of memory, two minutes of the
// processor and ten in all: if it crashes, runs away or takes more, that is InvalidArgument, and nothing of it is left here. It ends
// with the process that asked, however that ends.
absl::StatusOr<Model> ReadContained(const SourceFile& file,
                                    const std::function<absl::StatusOr<Model>()>& read);

// The same for bytes.
absl::StatusOr<std::string> ReadBytesContained(
    const SourceFile& file, const std::function<absl::StatusOr<std::string>()>& read);

}  // namespace voxeld::voxelctl
