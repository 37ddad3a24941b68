#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/export/export_files.h"
#include "tools/voxelctl/export/lit_pixels.h"
#include "tools/voxelctl/export/little_endian.h"
#include "tools/voxelctl/files/whole_file.h"
#include "tools/voxelctl/render/palette.h"

namespace voxeld::voxelctl {
namespace {

constexpr int32_t kModelSide = 256;
constexpr int kVoxColors = 255;  // 0 marks an empty voxel
constexpr uint32_t kVoxVersion = 150;

using Cell = std::array<int32_t, 3>;

std::string Chunk(const char* id, const std::string& content, const std::string& children = "") {
  std::string out = id;
  PutU32(&out, static_cast<uint32_t>(content.size()));
  PutU32(&out, static_cast<uint32_t>(children.size()));
  return out + content + children;
}

void PutString(std::string* out, const std::string& text) {
  PutU32(out, static_cast<uint32_t>(text.size()));
  *out += text;
}

void PutDictionary(std::string* out, const std::map<std::string, std::string>& entries) {
  PutU32(out, static_cast<uint32_t>(entries.size()));
  for (const auto& [key, value] : entries) {
    PutString(out, key);
    PutString(out, value);
  }
}

// Returns node `number`, which places node `child`.
std::string Transform(uint32_t number, uint32_t child, const std::string& move) {
  std::string content;
  PutU32(&content, number);
  PutDictionary(&content, {});
  PutU32(&content, child);
  PutU32(&content, 0xffffffff);  // reserved
  PutU32(&content, 0xffffffff);  // in no layer
  PutU32(&content, 1);           // frames
  PutDictionary(&content, move.empty() ? std::map<std::string, std::string>{}
                                       : std::map<std::string, std::string>{{"_t", move}});
  return Chunk("nTRN", content);
}

std::string Shape(uint32_t number, uint32_t model) {
  std::string content;
  PutU32(&content, number);
  PutDictionary(&content, {});
  PutU32(&content, 1);
  PutU32(&content, model);
  PutDictionary(&content, {});
  return Chunk("nSHP", content);
}

// The lit voxels, by blocks.
class Voxels {
 public:
  explicit Voxels(const display::VoxelGrid& grid) : grid_(grid), size_{grid.nx, grid.ny, grid.nz} {}

  // Returns false if the position is outside of the grid.
  bool Light(const display::Vec3& at, const uint8_t* rgb) {
    Cell cell, block;
    const double from[3] = {(at.x - grid_.origin_mm.x) / grid_.pitch_mm.x,
                            (at.y - grid_.origin_mm.y) / grid_.pitch_mm.y,
                            (at.z - grid_.origin_mm.z) / grid_.pitch_mm.z};
    uint32_t within = 0;
    for (size_t a = 0; a < 3; ++a) {
      // Pixels of flat slices are either on the faces of voxels or in their centres.
      const double place = std::floor(from[a] + 1e-6);
      if (!(place >= 0 && place < size_[a])) return false;
      cell[a] = static_cast<int32_t>(place);
      block[a] = cell[a] / kModelSide;
      within |= static_cast<uint32_t>(cell[a] % kModelSide) << (8 * a);
    }
    const Color8 color = {rgb[0], rgb[1], rgb[2]};
    const auto [voxel, is_new] = blocks_[block].try_emplace(within, color);
    const auto light = [](const Color8& c) { return c[0] + c[1] + c[2]; };
    if (!is_new && light(color) > light(voxel->second)) voxel->second = color;
    return true;
  }

  bool empty() const { return blocks_.empty(); }

  std::string File(ExportSummary* summary) const {
    ColorCount colors;
    for (const auto& [block, voxels] : blocks_) {
      for (const auto& [within, color] : voxels) colors.Add(color);
    }
    absl::flat_hash_map<uint32_t, uint8_t> places;
    const std::vector<Color8> palette = colors.Cut(kVoxColors, &places);

    std::string models, nodes, children;
    uint32_t model = 0;
    for (const auto& [block, voxels] : blocks_) {
      models += Model(block, voxels, places);
      const uint32_t node = 2 + 2 * model;
      nodes += Transform(node, node + 1, Move(block)) + Shape(node + 1, model);
      PutU32(&children, node);
      summary->items += voxels.size();
      ++model;
    }
    summary->models = model;
    std::string group;
    PutU32(&group, 1);
    PutDictionary(&group, {});
    PutU32(&group, model);
    std::string rgba;
    for (size_t i = 0; i < 256; ++i) {
      const Color8 color = i < palette.size() ? palette[i] : Color8{};
      rgba.append(reinterpret_cast<const char*>(color.data()), 3);
      rgba.push_back(static_cast<char>(0xff));
    }
    std::string file = "VOX ";
    PutU32(&file, kVoxVersion);
    return file + Chunk("MAIN", "",
                        models + Transform(0, 1, "") + Chunk("nGRP", group + children) + nodes +
                            Chunk("RGBA", rgba));
  }

 private:
  // Keyed by x, y and z within it, 8 bits each.
  using Block = absl::flat_hash_map<uint32_t, Color8>;

  int32_t Side(const Cell& block, size_t axis) const {
    return std::min(kModelSide, size_[axis] - block[axis] * kModelSide);
  }

  std::string Model(const Cell& block, const Block& voxels,
                    const absl::flat_hash_map<uint32_t, uint8_t>& places) const {
    std::string size, xyzi;
    for (size_t a = 0; a < 3; ++a) PutU32(&size, static_cast<uint32_t>(Side(block, a)));
    PutU32(&xyzi, static_cast<uint32_t>(voxels.size()));
    // Sorted, so that the same volume always gives the same file.
    const std::map<uint32_t, Color8> sorted(voxels.begin(), voxels.end());
    for (const auto& [within, color] : sorted) {
      PutU32(&xyzi, within | (uint32_t{places.at(ColorCount::Key(color))} + 1) << 24);
    }
    return Chunk("SIZE", size) + Chunk("XYZI", xyzi);
  }

  // Returns the position of the centre of the block's model.
  std::string Move(const Cell& block) const {
    Cell to;
    for (size_t a = 0; a < 3; ++a) {
      to[a] = block[a] * kModelSide + Side(block, a) / 2 - (a < 2 ? size_[a] / 2 : 0);
    }
    return absl::StrCat(to[0], " ", to[1], " ", to[2]);
  }

  const display::VoxelGrid& grid_;
  const Cell size_;
  std::map<Cell, Block> blocks_;
};

}  // namespace

absl::Status WriteVox(const std::string& path, const Volume& volume, ExportSummary* summary) {
  *summary = {};
  Voxels voxels(volume.geometry.grid);
  ForEachLit(volume, [&](const display::Vec3& at, const uint8_t* rgb) {
    if (!voxels.Light(at, rgb)) ++summary->left_out;
  });
  if (voxels.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(EscapeForTerminal(path),
                     ": no voxel is lit, and a .vox file has one at least; voxelctl entities says "
                     "what is up"));
  }
  const std::string file = voxels.File(summary);
  summary->bytes = file.size();
  return WriteWholeFile(path, file);
}

}  // namespace voxeld::voxelctl
