// Slice images whose pixels are voxels of planes, packed tile by tile while the volume is drawn.
//
// Each voxel of a sparse volume lies in a cache line of its own, which slicing would have to fetch
// from memory again. Instead, while a tile is in the nearest cache, its bits are written directly
// to their places in the slice images; slicing then only has to copy.
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
  // Returns nullopt if this method does not apply. It requires one bit per channel in planes, and
  // slices that are planes of the grid (Sampler::planes). [begin, end): the owned slices.
  static std::optional<PlanePacker> Create(const Sampler& sampler,
                                           const display::FrameLayout& layout,
                                           const display::Tone& tone, int32_t begin, int32_t end);

  // Sets where slice images are stored from now on: those of the owned slices, one after another,
  // initially as for a volume without light.
  void SetPictures(std::span<uint8_t> bytes);

  // A tile that is passed twice counts once.
  void OnTile(uint32_t tile, const uint32_t* colors, const TileRows& rows) override;

  // Returns whether a slice image's bytes have changed since the last call. Must not be called
  // while tiles are passed.
  bool TakeDiffers(size_t picture);

  uint64_t memory_bytes() const { return rows_.size() * sizeof(rows_[0]); }

 private:
  // Bit y of row z: something may be lit in the tile's 16 voxels along x.
  using LitRows = std::array<uint16_t, kTileSize>;
  // For each row of a tile's plane, the bits of red, green and blue, 16 each; those of the byte
  // that comes first are in the lower eight.
  using PlaneBits = std::array<uint64_t, kTileSize>;
  // The place of a tile's plane in a slice image.
  struct Place {
    uint32_t rows = 0;  // bit y: it is a row of the slice image
    size_t at = 0;      // of row 0, which may lie before the slice image
    size_t bytes = 2;   // one or two per row
    uint64_t seen = 0;  // mask for PlaneBits
  };

  PlanePacker() = default;
  std::optional<Place> PlaceOf(const int32_t (&ijk)[3]) const;
  // For a colour, the dither values below which its channels are lit.
  struct Under {
    uint32_t of[3] = {};

    // Returns the bits of a voxel whose dither is `below`, in the format of PlaneBits for pixel 0.
    uint64_t Bits(uint32_t below) const {
      return uint64_t{of[0] > below} | uint64_t{of[1] > below} << 16 |
             uint64_t{of[2] > below} << 32;
    }
  };
  // Bits for a colour that fills whole rows, by x modulo 8 and y.
  struct RunBits {
    uint32_t word = 0, sub = 0;
    uint32_t known = 0;  // bit x: the bits of x are computed
    uint64_t bits[8][kTileSize];
  };
  Under UnderOf(uint32_t word) const;
  uint32_t CollectBits(const uint32_t* colors, uint32_t lit_rows, uint32_t sub, RunBits& run,
                       PlaneBits& bits) const;
  void PutUniform(uint32_t tile, int32_t tile_z, const uint32_t* colors, const Place& place);
  void Put(size_t picture, const Place& place, uint32_t rows, const PlaneBits& bits);

  TileGrid grid_;
  // Under how many of the 64 thresholds a channel is lit: its bit is set if that is greater than
  // the dither.
  std::array<std::array<uint8_t, 256>, 3> lit_under_;
  // Maps byte b of an interleaved colour to its bits at their places in 0x00RRGGBB.
  std::array<std::array<uint32_t, 256>, 3> rgb_of_;
  size_t sub_frames_ = 1, width_ = 0, height_ = 0;
  size_t row_bytes_ = 0, plane_bytes_ = 0, picture_bytes_ = 0;
  int32_t first_row_ = 0;                      // the y of pixel row 0
  std::vector<uint64_t> dither_;               // eight for each sub-frame
  std::vector<std::vector<uint32_t>> slices_;  // the owned slices, counted from the first, by z
  std::span<uint8_t> pictures_;
  std::vector<LitRows> rows_;     // for each tile: where its slice images are lit
  std::vector<uint8_t> differs_;  // for each slice image; set by atomic_ref
};

}  // namespace voxeld::gpu
