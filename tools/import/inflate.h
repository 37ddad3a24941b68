// Decompression of gzip and related formats, up to a requested size.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

// kEither accepts gzip's header or zlib's; kRaw is one stream without a header.
enum class Deflated : uint8_t { kGzip, kEither, kRaw };

// Decompresses `packed`, a part of `file`, up to its first `most` bytes. It never needs memory for
// more than these, however long the data are. Calls `take` with successive pieces of at most 1 MiB
// each. Errors: InvalidArgument if the data are damaged before that point.
absl::Status InflatePieces(const SourceFile& file, absl::string_view packed, uint64_t most,
                           Deflated kind, const std::function<void(absl::string_view)>& take);

// Returns the first `most` bytes in one string.
absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed, uint64_t most,
                                    Deflated kind = Deflated::kGzip);

}  // namespace voxeld::voxelctl
