// Reads and checks the contents of a .vox file; vox_model.cc converts them to a model.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

struct VoxVoxel {
  uint8_t x = 0, y = 0, z = 0, color = 0;
};

struct VoxGrid {
  std::array<uint32_t, 3> size = {};  // 1 to 256 each; voxels lie within
  std::vector<VoxVoxel> voxels;
};

// A rotation by quarter turns, with mirroring: row r has `sign[r]` in the column `column[r]`.
struct VoxTurn {
  std::array<uint8_t, 3> column = {0, 1, 2};
  std::array<int8_t, 3> sign = {1, 1, 1};
};

struct VoxNode {
  enum class Kind : uint8_t { kTransform, kGroup, kShape };
  Kind kind = Kind::kGroup;
  bool hidden = false;
  std::vector<int32_t> children;  // for a shape, its grid
  int32_t layer = -1;             // for a transform; -1: none
  std::array<int32_t, 3> move = {};
  VoxTurn turn;
};

struct VoxScene {
  std::vector<VoxGrid> grids;
  std::array<Rgb, 256> palette = {};  // by a voxel's colour; 0 means none
  std::map<int32_t, VoxNode> nodes;   // 0 is the root; may be empty
  std::set<int32_t> hidden_layers;
  std::set<int32_t> later_grids;  // models of key frames after the first
  // Contents that are left out:
  uint64_t later_frames = 0;    // key frames after the first of each node
  uint64_t materials = 0;       // glass, metal, light and the like: all but diffuse
  uint64_t unknown_chunks = 0;  // unknown to MagicaVoxel's description and this reader
};

absl::StatusOr<VoxScene> ReadVoxChunks(const SourceFile& file);

}  // namespace voxeld::voxelctl
