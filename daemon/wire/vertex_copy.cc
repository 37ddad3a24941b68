#include "daemon/wire/vertex_copy.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace voxeld::daemon::wire {
namespace {

static_assert(std::endian::native == std::endian::little,
              "payloads are little-endian and read by memcpy");

// Vertices are converted in blocks of this size, whose bounds are computed while they are in the L1
// cache.
constexpr size_t kBlock = 1024;

// Compiler vectors: four vertices fill three of them, whose lanes cycle through the axes.
typedef float Float4 __attribute__((vector_size(16)));
typedef int32_t Int4 __attribute__((vector_size(16)));

constexpr int32_t kExponent = 0x7F800000;  // all ones: infinity or NaN

class Scan {
 public:
  // Copies from `in` to `out`, which may be the same.
  void Copy(const char* in, size_t vertices, float* out) {
    Float4 low[3], high[3];
    Int4 bad = bad_;
    std::copy(low_, low_ + 3, low);
    std::copy(high_, high_ + 3, high);
    for (; vertices >= 4; vertices -= 4, in += 48, out += 12) {
      for (int k = 0; k < 3; ++k) {
        Float4 v;
        std::memcpy(&v, in + 16 * k, sizeof(v));
        std::memcpy(out + 4 * k, &v, sizeof(v));
        const Int4 exponent = reinterpret_cast<Int4>(v) & kExponent;
        bad |= exponent == kExponent;
        low[k] = v < low[k] ? v : low[k];
        high[k] = v > high[k] ? v : high[k];
      }
    }
    std::copy(low, low + 3, low_);
    std::copy(high, high + 3, high_);
    bad_ = bad;
    for (size_t i = 0; i < 3 * vertices; ++i) {
      float v;
      std::memcpy(&v, in + 4 * i, sizeof(v));
      out[i] = v;
      bad_[0] |= (std::bit_cast<int32_t>(v) & kExponent) == kExponent ? -1 : 0;
      // Lane i of the first vector is axis i.
      Include(v, static_cast<int>(i % 3));
    }
  }

  bool finite() const { return (bad_[0] | bad_[1] | bad_[2] | bad_[3]) == 0; }

  void Get(PositionBounds* bounds) const {
    for (int axis = 0; axis < 3; ++axis) {
      bounds->least[axis] = low_[0][axis];
      bounds->greatest[axis] = high_[0][axis];
      for (int lane = axis; lane < 12; lane += 3) {
        bounds->least[axis] = std::min(bounds->least[axis], low_[lane / 4][lane % 4]);
        bounds->greatest[axis] = std::max(bounds->greatest[axis], high_[lane / 4][lane % 4]);
      }
    }
  }

 private:
  void Include(float v, int axis) {
    if (v < low_[0][axis]) low_[0][axis] = v;
    if (v > high_[0][axis]) high_[0][axis] = v;
  }

  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static constexpr Float4 kMost = {kInfinity, kInfinity, kInfinity, kInfinity};
  Float4 low_[3] = {kMost, kMost, kMost}, high_[3] = {-kMost, -kMost, -kMost};
  Int4 bad_ = {};
};

template <typename T>
bool CopyIntegerPositions(const Payload& in, std::span<float> out, PositionBounds* bounds) {
  Scan scan;
  int32_t least = 0, greatest = 0;
  float* to = out.data();
  in.ForEachRun(3 * sizeof(T), [&](const char* data, size_t count) {
    while (count > 0) {
      const size_t vertices = std::min(count, kBlock);
      for (size_t i = 0; i < 3 * vertices; ++i) {
        T value;
        std::memcpy(&value, data + i * sizeof(T), sizeof(T));
        least = std::min<int32_t>(least, value);
        greatest = std::max<int32_t>(greatest, value);
        to[i] = static_cast<float>(value);
      }
      scan.Copy(reinterpret_cast<const char*>(to), vertices, to);
      data += vertices * 3 * sizeof(T);
      to += vertices * 3;
      count -= vertices;
    }
  });
  scan.Get(bounds);
  return least >= -kGreatestI32 && greatest <= kGreatestI32;
}

template <typename T>
bool CopyIndices(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out) {
  uint32_t greatest = 0;
  uint32_t* to = out.data();
  in.ForEachRun(sizeof(T), [&](const char* data, size_t count) {
    uint32_t here = 0;
    for (size_t i = 0; i < count; ++i) {
      T value;
      std::memcpy(&value, data + i * sizeof(T), sizeof(T));
      here = std::max<uint32_t>(here, value);
      to[i] = value;
    }
    greatest = std::max(greatest, here);
    to += count;
  });
  return out.empty() || greatest < vertex_count;
}

uint32_t FromBytes(uint32_t rgbx) { return __builtin_bswap32(rgbx) >> 8; }

}  // namespace

bool CopyFloatPositions(const Payload& in, std::span<float> out, PositionBounds* bounds) {
  Scan scan;
  float* to = out.data();
  in.ForEachRun(12, [&](const char* data, size_t count) {
    scan.Copy(data, count, to);
    to += 3 * count;
  });
  scan.Get(bounds);
  return scan.finite();
}

bool CopyInt32Positions(const Payload& in, std::span<float> out, PositionBounds* bounds) {
  return CopyIntegerPositions<int32_t>(in, out, bounds);
}

void CopyInt16Positions(const Payload& in, std::span<float> out, PositionBounds* bounds) {
  CopyIntegerPositions<int16_t>(in, out, bounds);
}

bool CopyIndices32(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out) {
  return CopyIndices<uint32_t>(in, vertex_count, out);
}

bool CopyIndices16(const Payload& in, uint32_t vertex_count, std::span<uint32_t> out) {
  return CopyIndices<uint16_t>(in, vertex_count, out);
}

void CopyColors(const Payload& in, size_t element_bytes, std::span<uint32_t> out) {
  uint32_t* to = out.data();
  in.ForEachRun(element_bytes, [&](const char* data, size_t count) {
    // Every element except the last may be read together with the following byte.
    const size_t whole = element_bytes == 4 ? count : count - 1;
    for (size_t i = 0; i < whole; ++i) {
      uint32_t value;
      std::memcpy(&value, data + i * element_bytes, sizeof(value));
      to[i] = FromBytes(value);
    }
    for (size_t i = whole; i < count; ++i) {
      uint32_t value = 0;
      std::memcpy(&value, data + i * element_bytes, 3);
      to[i] = FromBytes(value);
    }
    to += count;
  });
}

}  // namespace voxeld::daemon::wire
