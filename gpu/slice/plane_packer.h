// Pictures whose pixels are voxels of planes, packed tile by tile as the volume is drawn.
//
// A sparse volume's voxels lie in a cache line each, which slicing would fetch from memory again. While a tile is in the
// nearest cache, its bits go straight to where they belong in the pictures; what slicing does after that is copying.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"
#include "gpu/assemble/volume.h"
#include "gpu/slice/levels.h"
#include "gpu/slice/sampler.h"

namespace voxeld::gpu {

class PlanePacker final : public TileObserver {
 public:
  // Nothing where it does not apply: one bit a channel in planes, of slices that are planes of the grid (Sampler::planes).
  // [begin, end): the slices owned.
  static std::optional<PlanePacker> Create(const Sampler& sampler,
                                           const display::FrameLayout& layout,
                                           const display::Tone& tone, int32_t begin, int32_t end);

  // Where pictures are kept from now on: the owned slices', one after another, as they are of a volume without light.
  void SetPictures(std::span<uint8_t> bytes);

  // A tile given twice counts once.
  void OnTile(uint32_t tile, const uint32_t* colors, const TileRows& rows) override;

  // Whether a picture's bytes differ from what they were when this was asked for the last time. Not while tiles are given.
  bool TakeDiffers(size_t picture);

  uint64_t memory_bytes() const { return rows_.size() * sizeof(rows_[0]); }

 private:
  // Bit y of row z: something may be lit in x of 16 voxels of the tile.
  using LitRows = std::array<uint16_t, kTileSize>;
  // Of each row of a tile's plane the bits of red, green and blue, 16 each, those of the byte that comes first in the
  // lower eight.
  using PlaneBits = std::array<uint64_t, kTileSize>;
  // Where a tile's plane lies in a picture.
  struct Place {
    uint32_t rows = 0;  // bit y: a picture's row
    size_t at = 0;      // of row 0, which may lie before the picture
    size_t bytes = 2;   // one or two of a row
    uint64_t seen = 0;  // of PlaneBits
  };

  PlanePacker() = default;
  std::optional<Place> PlaceOf(const int32_t (&ijk)[3]) const;
  // Of a colour, what its channels are lit under.
  struct Under {
    uint32_t of[3] = {};

    // Of a voxel whose dither is `below`: as PlaneBits have those of pixel 0.
    uint64_t Bits(uint32_t below) const {
      return uint64_t{of[0] > below} | uint64_t{of[1] > below} << 16 |
             uint64_t{of[2] > below} << 32;
    }
  };
  // Bits of a colour of which whole rows are, by x modulo 8 and y.
  struct RunBits {
    uint32_t word = 0, sub = 0;
    uint32_t known = 0;  // bit x: those of x are there
    uint64_t bits[8][kTileSize];
  };
  Under UnderOf(uint32_t word) const;
  uint32_t CollectBits(const uint32_t* colors, uint32_t lit_rows, uint32_t sub, RunBits& run,
                       PlaneBits& bits) const;
  void PutUniform(uint32_t tile, int32_t tile_z, const uint32_t* colors, const Place& place);
  void Put(size_t picture, const Place& place, uint32_t rows, const PlaneBits& bits);

  TileGrid grid_;
  // Under how many of the 64 thresholds a channel is lit: its bit is set where that is greater than the dither.
  std::array<std::array<uint8_t, 256>, 3> lit_under_;
  // Byte b of an interleaved colour → its bits where they belong in 0x00RRGGBB.
  std::array<std::array<uint32_t, 256>, 3> rgb_of_;
  size_t sub_frames_ = 1, width_ = 0, height_ = 0;
  size_t row_bytes_ = 0, plane_bytes_ = 0, picture_bytes_ = 0;
  int32_t first_row_ = 0;                      // y of pixel row 0
  std::vector<uint64_t> dither_;               // eight of each sub-frame
  std::vector<std::vector<uint32_t>> slices_;  // of those owned, counted from the first, by z
  std::span<uint8_t> pictures_;
  std::vector<LitRows> rows_;     // of each tile: where its pictures have light
  std::vector<uint8_t> differs_;  // of each picture; set by atomic_ref
};

}  // namespace voxeld::gpu
