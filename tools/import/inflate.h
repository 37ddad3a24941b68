// gzip, as far as is asked for.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

enum class Deflated : uint8_t { kGzip, kRaw };  // kRaw: without a header, and one stream

// The first `most` bytes of what `packed`, a part of `file`, decompresses to, or all if it is fewer. However much more there
// would be, no more memory than for these is taken. InvalidArgument if it is damaged before that.
absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed, uint64_t most,
                                    Deflated kind = Deflated::kGzip);

}  // namespace voxeld::voxelctl
