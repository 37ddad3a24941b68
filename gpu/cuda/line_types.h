// Thin lines on the device (gpu/primitives/thin_line.h), sorted by the regions of the volume that
// they touch. Plain data, used by host and device.
#pragma once

#include <cstdint>

#include "gpu/cuda/types.h"
#include "gpu/primitives/thin_line.h"

namespace voxeld::gpu::cuda {

// A region is the part that a block of threads draws at once in shared memory: 32×32×16 voxels,
// 2×2×1 tiles.
VOXELD_HD inline constexpr int RegionBits(int axis) { return TrackBits(axis); }
inline constexpr uint32_t kRegionVoxels = 1u << 14;
// Regions are numbered by blocks of 4×4×4 (2^kBlockBits), and within a block.
inline constexpr int kBlockBits = 2;
inline constexpr uint32_t kRegionsInBlock = 1u << 3 * kBlockBits;

struct RegionGrid {
  int32_t blocks[3] = {};
  // A box, in blocks, that holds all regions that are drawn: regions outside it are not needed.
  int32_t drawn_lo[3] = {}, drawn_hi[3] = {};

  VOXELD_HD static RegionGrid Of(const TileGrid& tiles) {
    RegionGrid g;
    for (int a = 0; a < 3; ++a) {
      const int32_t size = 1 << (RegionBits(a) + kBlockBits);
      g.blocks[a] = g.drawn_hi[a] = (tiles.voxels[a] + size - 1) / size;
    }
    return g;
  }
  VOXELD_HD uint32_t block_count() const {
    return static_cast<uint32_t>(blocks[0]) * static_cast<uint32_t>(blocks[1]) *
           static_cast<uint32_t>(blocks[2]);
  }
  VOXELD_HD uint32_t count() const { return block_count() * kRegionsInBlock; }
  // Returns the number of regions with the same z.
  VOXELD_HD uint32_t count_of_plane() const {
    return static_cast<uint32_t>(blocks[0] * blocks[1]) << 2 * kBlockBits;
  }
  VOXELD_HD bool DrawsBlock(const int32_t at[3]) const {
    for (int a = 0; a < 3; ++a) {
      if (at[a] < drawn_lo[a] || at[a] >= drawn_hi[a]) return false;
    }
    return true;
  }
  VOXELD_HD bool DrawsAll() const {
    bool all = true;
    for (int a = 0; a < 3; ++a) all &= drawn_lo[a] == 0 && drawn_hi[a] == blocks[a];
    return all;
  }
  VOXELD_HD bool Draws(uint32_t region) const {
    int32_t block[3];
    BlockCoordinates(region / kRegionsInBlock, block);
    return DrawsBlock(block);
  }
  // Returns the number of drawn regions, and the number of a region among them; for a block of
  // drawn regions, its number among all blocks.
  VOXELD_HD uint32_t drawn_count() const {
    uint32_t count = kRegionsInBlock;
    for (int a = 0; a < 3; ++a) count *= static_cast<uint32_t>(drawn_hi[a] - drawn_lo[a]);
    return count;
  }
  VOXELD_HD uint32_t NumberDrawn(uint32_t region) const {
    if (DrawsAll()) return region;
    int32_t at[3];
    BlockCoordinates(region / kRegionsInBlock, at);
    for (int a = 0; a < 3; ++a) at[a] -= drawn_lo[a];
    const int32_t nx = drawn_hi[0] - drawn_lo[0], ny = drawn_hi[1] - drawn_lo[1];
    return static_cast<uint32_t>((at[2] * ny + at[1]) * nx + at[0]) * kRegionsInBlock +
           region % kRegionsInBlock;
  }
  VOXELD_HD uint32_t DrawnBlock(uint32_t number) const {
    if (DrawsAll()) return number;
    const uint32_t nx = static_cast<uint32_t>(drawn_hi[0] - drawn_lo[0]),
                   ny = static_cast<uint32_t>(drawn_hi[1] - drawn_lo[1]);
    const int32_t at[3] = {drawn_lo[0] + static_cast<int32_t>(number % nx),
                           drawn_lo[1] + static_cast<int32_t>(number / nx % ny),
                           drawn_lo[2] + static_cast<int32_t>(number / nx / ny)};
    return BlockAt(at);
  }
  VOXELD_HD uint32_t BlockAt(const int32_t at[3]) const {
    return static_cast<uint32_t>((at[2] * blocks[1] + at[1]) * blocks[0] + at[0]);
  }
  VOXELD_HD void BlockCoordinates(uint32_t block, int32_t at[3]) const {
    at[0] = static_cast<int32_t>(block % static_cast<uint32_t>(blocks[0]));
    block /= static_cast<uint32_t>(blocks[0]);
    at[1] = static_cast<int32_t>(block % static_cast<uint32_t>(blocks[1]));
    at[2] = static_cast<int32_t>(block / static_cast<uint32_t>(blocks[1]));
  }
  // Returns the number of a region within its block, from its coordinates.
  VOXELD_HD static uint32_t InBlock(const int32_t at[3]) {
    constexpr int32_t kMask = (1 << kBlockBits) - 1;
    return static_cast<uint32_t>((((at[2] & kMask) << kBlockBits | (at[1] & kMask)) << kBlockBits) |
                                 (at[0] & kMask));
  }
  VOXELD_HD uint32_t RegionAt(const int32_t at[3]) const {
    const int32_t block[3] = {at[0] >> kBlockBits, at[1] >> kBlockBits, at[2] >> kBlockBits};
    return BlockAt(block) * kRegionsInBlock + InBlock(at);
  }
  VOXELD_HD void RegionCoordinates(uint32_t region, int32_t at[3]) const {
    BlockCoordinates(region / kRegionsInBlock, at);
    for (int a = 0; a < 3; ++a) {
      at[a] = at[a] << kBlockBits |
              static_cast<int32_t>(region >> (a * kBlockBits) & ((1u << kBlockBits) - 1));
    }
  }
};

// A batch's lines: the sorting data of all lines, followed by the drawing data of all, so that data
// that is read repeatedly lies close together.
struct LineArrays {
  ThinLine* lines = nullptr;
  ThinTrack* tracks = nullptr;

  static constexpr size_t kBytes = sizeof(ThinLine) + sizeof(ThinTrack);  // per line
  static LineArrays Of(void* items, uint32_t count) {
    ThinLine* const lines = static_cast<ThinLine*>(items);
    return {lines, reinterpret_cast<ThinTrack*>(lines + count)};
  }
};

// The part of a line in a block of regions: `count` voxels from k on.
struct LinePiece {
  uint32_t line;
  uint32_t bits;  // k, and from bit 16 on the count

  VOXELD_HD static LinePiece Of(uint32_t line, int32_t k, int32_t count) {
    return {line, static_cast<uint32_t>(k) | static_cast<uint32_t>(count) << 16};
  }
  VOXELD_HD int32_t k() const { return static_cast<int32_t>(bits & 0xFFFF); }
  VOXELD_HD uint32_t count() const { return bits >> 16; }
};

// The part of a line in a region: `count` voxels from k on.
struct alignas(8) LineSpan {
  uint32_t line;
  // k; from bit 16 on the count; from bit 23 on the region in its block; the top bit is set if the
  // line has a colour gradient.
  uint32_t bits;

  VOXELD_HD static LineSpan Of(uint32_t line, int32_t k, int32_t count, uint32_t region,
                               bool mixed) {
    return {line, static_cast<uint32_t>(k) | static_cast<uint32_t>(count) << 16 | region << 23 |
                      (mixed ? 1u << 31 : 0u)};
  }
  VOXELD_HD int32_t k() const { return static_cast<int32_t>(bits & 0xFFFF); }
  VOXELD_HD uint32_t count() const { return bits >> 16 & 0x7F; }
  VOXELD_HD uint32_t region() const { return bits >> 23 & (kRegionsInBlock - 1); }
  VOXELD_HD bool mixed() const { return bits >> 31 != 0; }
};

// The number of pieces that are sorted at once, all of one block, and the greatest number of spans
// of a piece.
inline constexpr uint32_t kPieceChunk = 512;
inline constexpr uint32_t kMostSpansOfPiece = 3 * ((1 << kBlockBits) - 1) + 1;

// Spans by region. A block's chunks are chunk_begin[b] to chunk_begin[b + 1]; the spans of its
// region r in chunk c are spans[base[c] + offsets[c][r]] to spans[base[c] + offsets[c][r + 1]].
struct SpanLists {
  const uint32_t* chunk_begin = nullptr;
  const uint32_t* base = nullptr;
  const uint16_t* offsets = nullptr;  // kRegionsInBlock + 1 per chunk
  const uint64_t* regions = nullptr;  // by block, bits: the regions that have any
  const LineSpan* spans = nullptr;

  VOXELD_HD bool Has(uint32_t region) const {
    return regions[region / kRegionsInBlock] >> region % kRegionsInBlock & 1;
  }
};

// Lines of one layer, with their spans by region. Without spans (null), the only list is `regions`,
// and the drawing threads test all lines.
struct LineBatchView {
  const ThinLine* lines = nullptr;
  const ThinTrack* tracks = nullptr;
  const uint32_t* ends = nullptr;  // the word at E, if colours differ along a line; else null
  uint32_t layer = 0;              // the slot of the layer
  uint32_t count = 0;              // lines
  SpanLists lists;

  template <bool>
  VOXELD_HD bool Has(uint32_t region) const {
    return lists.Has(region);
  }
};

inline constexpr uint32_t kMaxRegionBatches = 24;
inline constexpr uint32_t kMaxRegionLayers = 8;
struct LineBatchList {
  LineBatchView batches[kMaxRegionBatches];
  uint32_t count = 0;
};

// The sorting of a batch: into blocks, then into regions.
inline constexpr uint32_t kLineChunk = 256;
struct LineSort {
  RegionGrid grid;
  uint32_t piece_capacity = 0, span_capacity = 0;
  uint32_t* block_counts = nullptr;  // by block; initially 0
  uint32_t* block_begin = nullptr;   // by block, and the end
  uint32_t* line_offsets = nullptr;  // by chunk of lines and block
  LinePiece* pieces = nullptr;
  // The resulting lists, and the number of all spans, initially 0, including those that did not
  // fit.
  uint32_t* chunk_begin = nullptr;
  uint32_t* base = nullptr;
  uint16_t* offsets = nullptr;
  uint64_t* regions = nullptr;  // initially 0
  LineSpan* spans = nullptr;
  uint32_t* span_count = nullptr;
  uint8_t* dirty = nullptr;  // by region: marks regions that have any; or null
};

}  // namespace voxeld::gpu::cuda
