#include "gpu/slice/plane_packer.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <utility>

#include "gpu/slice/lit_bits.h"
#include "gpu/word.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kChannels = 3;

// Returns the bit of pixel x of 16 within a channel's bits.
constexpr uint32_t BitOf(uint32_t x) { return x ^ 7; }

bool AreAlike(const uint32_t* row) {
  uint32_t differs = 0;
  for (int32_t i = 1; i < kTileSize; ++i) differs |= row[i] ^ row[0];
  return differs == 0;
}

// Returns whether a tile has the same colour everywhere.
bool IsUniform(const uint32_t* colors, const TileRows& rows) {
  if (!(rows == TileRows::All())) return false;
  constexpr size_t kPlane = kTileSize * kTileSize;
  for (size_t begin = 0; begin < kTileVoxels; begin += kPlane) {
    uint32_t differs = 0;
    for (size_t i = begin; i < begin + kPlane; ++i) differs |= colors[i] ^ colors[0];
    if (differs != 0) return false;
  }
  return true;
}

}  // namespace

std::optional<PlanePacker> PlanePacker::Create(const Sampler& sampler,
                                               const display::FrameLayout& layout,
                                               const display::Tone& tone, int32_t begin,
                                               int32_t end) {
  if (layout.format != display::PixelFormat::kBitPlanes || layout.bits_per_channel() != 1 ||
      tone.sampling != display::Sampling::kMax || sampler.planes().empty()) {
    return std::nullopt;
  }
  PlanePacker out;
  out.grid_ = sampler.grid();
  const LevelTables levels = LevelTables::Of(layout, tone);
  for (size_t channel = 0; channel < kChannels; ++channel) {
    for (size_t c = 0; c < 256; ++c) {
      const int under = levels.base[channel][c] * 64 + levels.rise[channel][c];
      out.lit_under_[channel][c] = static_cast<uint8_t>(under);
    }
  }
  for (uint32_t byte = 0; byte < 3; ++byte) {
    for (uint32_t c = 0; c < 256; ++c) out.rgb_of_[byte][c] = Deinterleave(c << (8 * byte));
  }
  out.sub_frames_ = static_cast<size_t>(layout.sub_frames);
  out.width_ = static_cast<size_t>(layout.width);
  out.height_ = static_cast<size_t>(layout.height);
  out.row_bytes_ = (out.width_ + 7) / 8;
  out.plane_bytes_ = out.row_bytes_ * out.height_;
  out.picture_bytes_ = layout.bytes_per_slice();
  out.first_row_ = sampler.first_row();
  for (uint32_t sub = 0; sub < out.sub_frames_; ++sub) {
    for (uint32_t u = 0; u < 8; ++u) {
      out.dither_.push_back(DitherColumn(u, sub, static_cast<uint32_t>(out.sub_frames_)));
    }
  }
  out.slices_.resize(static_cast<size_t>(out.grid_.tiles[2]) * kTileSize);
  for (int32_t slice = begin; slice < end; ++slice) {
    const int32_t z = sampler.planes()[static_cast<size_t>(slice)];
    out.slices_[static_cast<size_t>(z)].push_back(static_cast<uint32_t>(slice - begin));
  }
  out.rows_.assign(out.grid_.count(), {});
  out.differs_.assign(static_cast<size_t>(end - begin) * out.sub_frames_, 0);
  return out;
}

void PlanePacker::SetPictures(std::span<uint8_t> bytes) { pictures_ = bytes; }

bool PlanePacker::TakeDiffers(size_t picture) { return std::exchange(differs_[picture], 0) != 0; }

std::optional<PlanePacker::Place> PlanePacker::PlaceOf(const int32_t (&ijk)[3]) const {
  const size_t u0 = static_cast<size_t>(ijk[0]) * kTileSize;
  const int32_t v0 = ijk[1] * kTileSize - first_row_;  // the row of the tile's y 0
  if (u0 >= width_) return std::nullopt;
  Place place;
  for (int32_t y = 0; y < kTileSize; ++y) {
    if (v0 + y >= 0 && v0 + y < static_cast<int32_t>(height_)) place.rows |= 1u << y;
  }
  if (place.rows == 0) return std::nullopt;
  place.at = static_cast<size_t>(v0) * row_bytes_ + u0 / 8;
  place.bytes = std::min<size_t>(2, row_bytes_ - u0 / 8);
  for (uint32_t x = 0; x < std::min<size_t>(kTileSize, width_ - u0); ++x) {
    place.seen |= uint64_t{1} << BitOf(x);
  }
  place.seen |= place.seen << 16 | place.seen << 32;
  return place;
}

// Collects the bits of a tile's plane, which has voxels that are not black only at the x in
// `lit_rows`. Bit y of the result: row y may have bits.
uint32_t PlanePacker::CollectBits(const uint32_t* colors, uint32_t lit_rows, uint32_t sub,
                                  RunBits& run, PlaneBits& bits) const {
  // Dither starts at pixel row 0.
  const uint32_t turn = static_cast<uint32_t>(8 - first_row_ % 8);
  uint32_t lit_ys = 0;
  for (; lit_rows != 0; lit_rows &= lit_rows - 1) {
    const uint32_t x = static_cast<uint32_t>(std::countr_zero(lit_rows));
    const uint32_t* const from = colors + x * kTileSize;
    const uint64_t dither = dither_[sub * 8 + x % 8];
    uint32_t lit = LitBits(from, kTileSize, 0);
    lit_ys |= lit;
    if (lit == (1u << kTileSize) - 1 && AreAlike(from)) {
      if (run.word != from[0] || run.sub != sub) {
        run.word = from[0];
        run.sub = sub;
        run.known = 0;
      }
      uint64_t* const of = run.bits[x % 8];
      if ((run.known >> x % 8 & 1) == 0) {
        run.known |= 1u << x % 8;
        const Under under = UnderOf(from[0]);
        for (uint32_t y = 0; y < kTileSize; ++y) {
          of[y] = under.Bits(dither >> ((y + turn) % 8 * 8) & 0xFF);
        }
      }
      for (uint32_t y = 0; y < kTileSize; ++y) bits[y] |= of[y] << BitOf(x);
      continue;
    }
    // Neighbouring voxels often have the same colour.
    uint32_t word = 0;
    Under under;
    for (; lit != 0; lit &= lit - 1) {
      const uint32_t y = static_cast<uint32_t>(std::countr_zero(lit));
      if (from[y] != word) under = UnderOf(word = from[y]);
      bits[y] |= under.Bits(dither >> ((y + turn) % 8 * 8) & 0xFF) << BitOf(x);
    }
  }
  return lit_ys;
}

PlanePacker::Under PlanePacker::UnderOf(uint32_t word) const {
  const uint32_t rgb =
      rgb_of_[0][word & 0xFF] | rgb_of_[1][word >> 8 & 0xFF] | rgb_of_[2][word >> 16 & 0xFF];
  return {{lit_under_[0][rgb >> 16], lit_under_[1][rgb >> 8 & 0xFF], lit_under_[2][rgb & 0xFF]}};
}

void PlanePacker::Put(size_t picture, const Place& place, uint32_t rows, const PlaneBits& bits) {
  uint8_t* const first = pictures_.data() + picture * picture_bytes_;
  uint32_t differs = 0;
  for (rows &= place.rows; rows != 0; rows &= rows - 1) {
    const size_t y = static_cast<size_t>(std::countr_zero(rows));
    const uint64_t now = bits[y] & place.seen;
    uint8_t* const to = first + (place.at + y * row_bytes_);
    for (size_t channel = 0; channel < kChannels; ++channel) {
      uint8_t* const byte = to + channel * plane_bytes_;
      const auto low = static_cast<uint8_t>(now >> (16 * channel));
      const auto high = static_cast<uint8_t>(now >> (16 * channel + 8));
      if (place.bytes == 2) {
        const uint8_t two[2] = {low, high};
        uint16_t was, is;
        std::memcpy(&was, byte, 2);
        std::memcpy(&is, two, 2);
        std::memcpy(byte, &is, 2);
        differs |= static_cast<uint32_t>(was ^ is);
      } else {
        differs |= static_cast<uint32_t>(*byte ^ low);
        *byte = low;
      }
    }
  }
  if (differs != 0) {
    std::atomic_ref<uint8_t>(differs_[picture]).store(1, std::memory_order_relaxed);
  }
}

// All planes of a tile of one colour have the same bits.
void PlanePacker::PutUniform(uint32_t tile, int32_t tile_z, const uint32_t* colors,
                             const Place& place) {
  constexpr uint32_t kAll = (1u << kTileSize) - 1;
  RunBits run;
  for (uint32_t sub = 0; sub < sub_frames_; ++sub) {
    PlaneBits bits = {};
    CollectBits(colors, kAll, sub, run, bits);
    for (size_t z = 0; z < kTileSize; ++z) {
      for (const uint32_t slice : slices_[static_cast<size_t>(tile_z * kTileSize) + z]) {
        Put(slice * sub_frames_ + sub, place, kAll, bits);
      }
    }
  }
  rows_[tile].fill(static_cast<uint16_t>(kAll));
}

void PlanePacker::OnTile(uint32_t tile, const uint32_t* colors, const TileRows& rows) {
  int32_t ijk[3];
  grid_.Coordinates(tile, ijk);
  const std::optional<Place> place = PlaceOf(ijk);
  if (!place) return;
  if (IsUniform(colors, rows)) return PutUniform(tile, ijk[2], colors, *place);
  PlaneBits bits = {};  // zeros between planes
  RunBits run;
  for (size_t z = 0; z < kTileSize; ++z) {
    const uint32_t lit_rows = rows.bits[z / 4] >> (z % 4 * 16) & 0xFFFF;
    const uint32_t before = std::exchange(rows_[tile][z], uint16_t{0});
    if ((lit_rows | before) == 0) continue;
    const auto& slices = slices_[static_cast<size_t>(ijk[2] * kTileSize) + z];
    for (uint32_t sub = 0; sub < sub_frames_ && !slices.empty(); ++sub) {
      const uint32_t now =
          CollectBits(colors + z * kTileSize * kTileSize, lit_rows, sub, run, bits);
      for (const uint32_t slice : slices) {
        Put(slice * sub_frames_ + sub, *place, now | before, bits);
      }
      rows_[tile][z] = static_cast<uint16_t>(now);
      for (uint32_t left = now; left != 0; left &= left - 1) {
        bits[static_cast<size_t>(std::countr_zero(left))] = 0;
      }
    }
  }
}

}  // namespace voxeld::gpu
