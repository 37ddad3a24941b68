// gzip, as far as is asked for.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// kEither: gzip's header or zlib's; kRaw: without a header, and one stream
enum class Deflated : uint8_t { kGzip, kEither, kRaw };

// The first `most` bytes of what `packed`, a part of `file`, decompresses to, or all if it is fewer. However much more there
// would be, no more memory than for these is taken. InvalidArgument if it is damaged before that.
// Calls `take` with piece after piece of the same, each of at most 1 MiB.
absl::Status InflatePieces(const SourceFile& file, absl::string_view packed, uint64_t most,
                           Deflated kind, const std::function<void(absl::string_view)>& take);

// The first `most` bytes in one.
absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed, uint64_t most,
                                    Deflated kind = Deflated::kGzip);

}  // namespace voxeld::voxelctl
