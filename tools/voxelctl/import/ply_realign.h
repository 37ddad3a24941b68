// Mends binary PLY clouds that were once copied as text: every CR LF became LF, so each lost byte
// shifts all that follows it. Such files are in circulation, packaged ones among them.
#pragma once

#include <cstdint>
#include <optional>

#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct RealignedPly {
  SourceFile file;            // with as many bytes as the header announces
  uint64_t lost_bytes = 0;    // that the copy had dropped
  uint64_t lost_entries = 0;  // vertices that could not be made out: each repeats the one before it
};

// Nothing unless the file has the marks of such a copy, holds vertices alone, of fixed size and
// with normals in f32, and every shift can be found: a vertex is taken to be in place if its normal
// is of unit length, and so are those that follow.
std::optional<RealignedPly> RealignPly(const SourceFile& file, const PlyHeader& header);

}  // namespace voxeld::voxelctl
