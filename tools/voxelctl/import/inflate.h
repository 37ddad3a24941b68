// gzip, as far as is asked for.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// The first `most` bytes of what `packed`, a part of `file`, decompresses to, or all if it is fewer. However much more there
// would be, no more memory than for these is taken. InvalidArgument if it is damaged before that.
absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed,
                                    uint64_t most);

}  // namespace voxeld::voxelctl
