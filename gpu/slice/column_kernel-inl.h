// The functions that column_kernel.cc calls, compiled once for each instruction set.
#if defined(VOXELD_GPU_SLICE_COLUMN_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_SLICE_COLUMN_KERNEL_INL_H_
#undef VOXELD_GPU_SLICE_COLUMN_KERNEL_INL_H_
#else
#define VOXELD_GPU_SLICE_COLUMN_KERNEL_INL_H_
#endif

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR

inline void LevelChunksIn(const LevelTables& tables, std::span<const ChunkToLevel> chunks) {
  for (const ChunkToLevel& chunk : chunks) {
    for (size_t row = 0; row < kChunkRows; ++row) {
      const size_t block = row / kBlockWords, at = row % kBlockWords;
      const uint32_t rgb = Deinterleave(std::max(
          chunk.words[block][at], chunk.also[block] != nullptr ? chunk.also[block][at] : 0));
      uint32_t base = 0;
      for (size_t c = 0; c < 3; ++c) {
        const uint32_t channel = rgb >> (16 - 8 * c) & 0xFF;
        base |= tables.base[c][channel];
        chunk.levels[(1 + c) * kChunkRows + row] = tables.rise[c][channel];
      }
      chunk.levels[row] = static_cast<uint8_t>(base);
    }
  }
}

inline void QuantizeChunk(const uint8_t* levels, uint64_t dither, uint8_t* pixels) {
  constexpr uint32_t kStep[3] = {1 << 5, 1 << 2, 1};
  for (size_t row = 0; row < kChunkRows; ++row) {
    const uint64_t below = dither >> (row % 8 * 8) & 0xFF;
    uint32_t pixel = levels[row];
    for (size_t c = 0; c < 3; ++c) {
      if (levels[(1 + c) * kChunkRows + row] > below) pixel += kStep[c];
    }
    pixels[row] = static_cast<uint8_t>(pixel);
  }
}

inline void Transpose(const uint8_t (&columns)[kColumnsTogether][kChunkRows], uint8_t* out,
                      size_t stride) {
  for (size_t row = 0; row < kChunkRows; ++row) {
    for (size_t i = 0; i < kColumnsTogether; ++i) out[row * stride + i] = columns[i][row];
  }
}

#else  // vectors

using Bytes = hn::CappedTag<uint8_t, kChunkRows>;
using VBytes = hn::Vec<Bytes>;

// Maps nibble n of a colour's 24 interleaved bits to the bits of a channel that it holds, in their
// places.
struct NibbleTables {
  uint8_t bits[3][6][16];

  constexpr NibbleTables() : bits() {
    constexpr int kLowest[3] = {1, 2, 0};  // red, green, blue
    for (int channel = 0; channel < 3; ++channel) {
      for (int nibble = 0; nibble < 6; ++nibble) {
        for (int value = 0; value < 16; ++value) {
          for (int bit = 0; bit < 4; ++bit) {
            const int at = nibble * 4 + bit - kLowest[channel];
            if ((value >> bit & 1) != 0 && at >= 0 && at % 3 == 0) {
              bits[channel][nibble][value] |= static_cast<uint8_t>(1 << (at / 3));
            }
          }
        }
      }
    }
  }
};
alignas(16) constexpr NibbleTables kNibbles;

#if HWY_TARGET == HWY_AVX3_DL
// The places of byte b of each of 32 words.
struct WordBytes {
  uint8_t at[3][64];

  constexpr WordBytes() : at() {
    for (int byte = 0; byte < 3; ++byte) {
      for (int word = 0; word < 32; ++word) at[byte][word] = static_cast<uint8_t>(word * 4 + byte);
    }
  }
};
alignas(64) constexpr WordBytes kWordBytes;
#endif

HWY_ATTR inline VBytes HighNibble(VBytes v) {
  const Bytes d;
  const hn::Repartition<uint16_t, Bytes> d16;
  return hn::And(hn::BitCast(d, hn::ShiftRight<4>(hn::BitCast(d16, v))), hn::Set(d, 0x0F));
}

// Returns table[index] for a table of 256 bytes.
HWY_ATTR inline VBytes LookUp(const uint8_t* table, VBytes index) {
#if HWY_TARGET == HWY_AVX3_DL
  const auto part = [&](int i) HWY_ATTR { return _mm512_load_si512(table + 64 * i); };
  const __m512i low = _mm512_permutex2var_epi8(part(0), index.raw, part(1));
  const __m512i high = _mm512_permutex2var_epi8(part(2), index.raw, part(3));
  return VBytes{_mm512_mask_blend_epi8(_mm512_movepi8_mask(index.raw), low, high)};
#else
  const Bytes d;
  VBytes out = hn::Zero(d);
  for (uint8_t high = 0; high < 16; ++high) {
    // The value is below 0x80 only if the upper nibble is `high`; for other values the look-up
    // gives 0.
    VBytes at = hn::SaturatedAdd(hn::Xor(index, hn::Set(d, static_cast<uint8_t>(high << 4))),
                                 hn::Set(d, 0x70));
#if !HWY_ARCH_X86 || HWY_TARGET == HWY_EMU128
    at = hn::And(at, hn::Set(d, 0x8F));  // the other targets use the bits between as well
#endif
    out = hn::Or(out, hn::TableLookupBytesOr0(hn::LoadDup128(d, table + 16 * high), at));
  }
  return out;
#endif
}

#if HWY_TARGET == HWY_AVX3_DL
// Returns byte `byte` of 64 words in four vectors.
HWY_ATTR inline VBytes BytesOfWords(const __m512i (&words)[4], size_t byte) {
  const __m512i at = _mm512_load_si512(kWordBytes.at[byte]);
  const __m512i low = _mm512_permutex2var_epi8(words[0], at, words[1]);
  const __m512i high = _mm512_permutex2var_epi8(words[2], at, words[3]);
  return VBytes{_mm512_inserti64x4(low, _mm512_castsi512_si256(high), 1)};
}

HWY_ATTR inline void LoadWords(const ChunkToLevel& chunk, __m512i (&words)[4]) {
  for (int i = 0; i < 4; ++i) {
    words[i] = _mm512_loadu_si512(chunk.words[i]);
    if (chunk.also[0] != nullptr) {
      words[i] = _mm512_max_epu32(words[i], _mm512_loadu_si512(chunk.also[i]));
    }
  }
}
#else
HWY_ATTR inline void LoadWords(const ChunkToLevel& chunk, uint32_t (&words)[kChunkRows]) {
  const hn::CappedTag<uint32_t, kBlockWords> d;
  for (size_t block = 0; block < kChunkRows / kBlockWords; ++block) {
    for (size_t at = 0; at < kBlockWords; at += hn::Lanes(d)) {
      auto v = hn::LoadU(d, chunk.words[block] + at);
      if (chunk.also[0] != nullptr) v = hn::Max(v, hn::LoadU(d, chunk.also[block] + at));
      hn::Store(v, d, words + block * kBlockWords + at);
    }
  }
}
#endif

HWY_ATTR inline void LevelChunksIn(const LevelTables& tables,
                                   std::span<const ChunkToLevel> chunks) {
  const Bytes d;
  const size_t lanes = hn::Lanes(d);
  for (const ChunkToLevel& chunk : chunks) {
#if HWY_TARGET == HWY_AVX3_DL
    __m512i words[4];
#else
    alignas(64) uint32_t words[kChunkRows];
#endif
    LoadWords(chunk, words);
    for (size_t row = 0; row < kChunkRows; row += lanes) {
      VBytes bytes[3];
#if HWY_TARGET == HWY_AVX3_DL
      for (size_t byte = 0; byte < 3; ++byte) bytes[byte] = BytesOfWords(words, byte);
#else
      VBytes none;
      hn::LoadInterleaved4(d, reinterpret_cast<const uint8_t*>(words + row), bytes[0], bytes[1],
                           bytes[2], none);
#endif
      VBytes channel[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
      for (int nibble = 0; nibble < 6; ++nibble) {
        const VBytes byte = bytes[nibble / 2];
        const VBytes value = nibble % 2 == 0 ? hn::And(byte, hn::Set(d, 0x0F)) : HighNibble(byte);
        for (int c = 0; c < 3; ++c) {
          const VBytes table = hn::LoadDup128(d, kNibbles.bits[c][nibble]);
          channel[c] = hn::Or(channel[c], hn::TableLookupBytes(table, value));
        }
      }
      VBytes base = hn::Zero(d);
      for (int c = 0; c < 3; ++c) {
        base = hn::Or(base, LookUp(tables.base[c], channel[c]));
        hn::StoreU(LookUp(tables.rise[c], channel[c]), d,
                   chunk.levels + (1 + static_cast<size_t>(c)) * kChunkRows + row);
      }
      hn::StoreU(base, d, chunk.levels + row);
    }
  }
}

// Computes a chunk's pixels: bytes of RGB332.
HWY_ATTR inline void QuantizeChunk(const uint8_t* levels, uint64_t dither, uint8_t* pixels) {
  const Bytes d;
  const hn::RebindToSigned<Bytes> ds;  // values below 128
  const auto below = hn::BitCast(ds, hn::Set(hn::Repartition<uint64_t, Bytes>(), dither));
  constexpr uint8_t kStep[3] = {1 << 5, 1 << 2, 1};
  for (size_t row = 0; row < kChunkRows; row += hn::Lanes(d)) {
    VBytes pixel = hn::LoadU(d, levels + row);
    for (size_t c = 0; c < 3; ++c) {
      const auto rise = hn::BitCast(ds, hn::LoadU(d, levels + (1 + c) * kChunkRows + row));
      const auto lifted = hn::RebindMask(d, hn::Gt(rise, below));
      pixel = hn::IfThenElse(lifted, hn::Add(pixel, hn::Set(d, kStep[c])), pixel);
    }
    hn::StoreU(pixel, d, pixels + row);
  }
}

// Transposes columns of a chunk into rows, `stride` apart. Sixteen columns take four rounds, in
// each of which the highest bit of a column's number becomes the lowest of its place; a vector
// holds sixteen rows of a column in each block. Rows of two groups of sixteen columns are stored
// together.
HWY_ATTR inline void Transpose(const uint8_t (&columns)[kColumnsTogether][kChunkRows], uint8_t* out,
                               size_t stride) {
  static_assert(kColumnsTogether == 32, "two sixteens");
  const hn::CappedTag<uint8_t, 32> d;
  using V = hn::Vec<decltype(d)>;
  const auto round = [d](const V(&in)[16], V(&to)[16]) HWY_ATTR {
    for (size_t i = 0; i < 8; ++i) {
      to[2 * i] = hn::InterleaveLower(d, in[i], in[i + 8]);
      to[2 * i + 1] = hn::InterleaveUpper(d, in[i], in[i + 8]);
    }
  };
  for (size_t row = 0; row < kChunkRows; row += hn::Lanes(d)) {
    V rows[2][16];
    for (size_t half = 0; half < 2; ++half) {
      V a[16], b[16];
      for (size_t i = 0; i < 16; ++i) a[i] = hn::LoadU(d, columns[half * 16 + i] + row);
      round(a, b);
      round(b, a);
      round(a, b);
      round(b, rows[half]);
    }
    for (size_t i = 0; i < 16; ++i) {
#if HWY_MAX_BYTES >= 32
      hn::StoreU(hn::ConcatLowerLower(d, rows[1][i], rows[0][i]), d, out + (row + i) * stride);
      hn::StoreU(hn::ConcatUpperUpper(d, rows[1][i], rows[0][i]), d, out + (row + 16 + i) * stride);
#else
      hn::StoreU(rows[0][i], d, out + (row + i) * stride);
      hn::StoreU(rows[1][i], d, out + (row + i) * stride + 16);
#endif
    }
  }
}

#endif

// Draws a block of columns of one chunk.
HWY_ATTR inline void DrawBlock(const uint8_t* const* levels, const uint64_t (&dither)[8],
                               uint8_t* out, size_t stride) {
  if (std::all_of(levels, levels + kColumnsTogether,
                  [](const uint8_t* p) { return p == nullptr; })) {
    for (size_t row = 0; row < kChunkRows; ++row) {
      std::memset(out + row * stride, 0, kColumnsTogether);
    }
    return;
  }
  alignas(64) uint8_t pixels[kColumnsTogether][kChunkRows];
  for (size_t i = 0; i < kColumnsTogether; ++i) {
    if (levels[i] != nullptr) {
      QuantizeChunk(levels[i], dither[i % 8], pixels[i]);
    } else {
      std::memset(pixels[i], 0, kChunkRows);
    }
  }
  Transpose(pixels, out, stride);
}

// Goes block by block through all slice images: neighbouring slices have most of a block's columns
// in common.
HWY_ATTR inline void DrawRgb332In(std::span<const uint8_t* const> levels, size_t columns,
                                  size_t chunks, const uint64_t (&dither)[8], uint8_t* out) {
  const size_t places = chunks * columns;
  const size_t pictures = levels.size() / places;
  for (size_t chunk = 0; chunk < chunks; ++chunk) {
    for (size_t u0 = 0; u0 < columns; u0 += kColumnsTogether) {
      for (size_t picture = 0; picture < pictures; ++picture) {
        DrawBlock(levels.data() + picture * places + chunk * columns + u0, dither,
                  out + (picture * places + chunk * columns) * kChunkRows + u0, columns);
      }
    }
  }
}

inline const char* ColumnTargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu
HWY_AFTER_NAMESPACE();

#endif  // VOXELD_GPU_SLICE_COLUMN_KERNEL_INL_H_
