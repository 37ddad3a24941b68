// Repairs binary PLY clouds that were once copied as text: every CR LF became LF, so each lost byte
// shifts everything after it. Such files are in circulation, including packaged ones.
#pragma once

#include <cstdint>
#include <optional>

#include "tools/voxelctl/import/ply_header.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct RealignedPly {
  SourceFile file;            // with as many bytes as the header declares
  uint64_t lost_bytes = 0;    // dropped by the copy
  uint64_t lost_entries = 0;  // vertices that could not be recovered: each repeats the previous one
};

// Returns nothing unless the file has the signs of such a copy, contains only vertices, of fixed
// size and with normals in f32, and every shift can be found. A vertex is considered in place if
// its normal and those of the following vertices have unit length.
std::optional<RealignedPly> RealignPly(const SourceFile& file, const PlyHeader& header);

}  // namespace voxeld::voxelctl
