#include "daemon/wire/vertices.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

static_assert(std::endian::native == std::endian::little,
              "payloads are little-endian and read by memcpy");

constexpr int32_t kGreatestI32 = 1 << 24;  // beyond it floats skip integers

constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

// Bytes of one element; 0 if the type does not fit the array.
uint64_t PositionBytes(v1::ElementType type) {
  switch (type) {
    case v1::ELEMENT_TYPE_UNSPECIFIED:
    case v1::ELEMENT_TYPE_F32:
    case v1::ELEMENT_TYPE_I32:
      return 12;
    case v1::ELEMENT_TYPE_I16:
      return 6;
    default:
      return 0;
  }
}

uint64_t IndexBytes(v1::ElementType type) {
  switch (type) {
    case v1::ELEMENT_TYPE_UNSPECIFIED:
    case v1::ELEMENT_TYPE_U32:
      return 4;
    case v1::ELEMENT_TYPE_U16:
      return 2;
    default:
      return 0;
  }
}

uint64_t ColorBytes(v1::ElementType type) {
  switch (type) {
    case v1::ELEMENT_TYPE_UNSPECIFIED:
    case v1::ELEMENT_TYPE_RGB8:
      return 3;
    case v1::ELEMENT_TYPE_RGBX8:
      return 4;
    default:
      return 0;
  }
}

// One of the arrays: its field, the one that may stand in its place, and where the bytes are.
struct Payload {
  const char* name;
  const std::string& sent;
  const char* range_name;
  const v1::MemoryRange* range;  // null: none
  MappedRange mapped = {};       // of the range, once it is checked

  std::string_view bytes() const { return range != nullptr ? mapped.bytes : sent; }
  bool given() const { return range != nullptr || !sent.empty(); }
  uint64_t size() const { return range != nullptr ? range->size() : sent.size(); }
};

// Finds the bytes, and holds their number against what is wanted.
MaybeFault CheckPayload(const FieldPath& path, uint64_t count, uint64_t element_bytes,
                        LocalRanges& ranges, Payload* payload) {
  // count < 2³² and element_bytes ≤ 12: no overflow.
  const uint64_t want = count * element_bytes;
  if (payload->range == nullptr) {
    if (payload->sent.size() == want) return {};
    return Fault{FieldPath(path, payload->name).ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", payload->sent.size(), " bytes; ", count, " elements of ",
                              element_bytes, " bytes need ", want)};
  }
  const FieldPath in(path, payload->range_name);
  if (!payload->sent.empty()) {
    return Fault{in.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is set, and ", payload->name, " has ", payload->sent.size(),
                              " bytes; give one of them")};
  }
  if (payload->size() != want) {
    return Fault{FieldPath(in, "size").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("is ", payload->size(), "; ", count, " elements of ", element_bytes,
                              " bytes need ", want)};
  }
  return ranges.Read(in, *payload->range, &payload->mapped);
}

MaybeFault CheckCount(const FieldPath& path, const char* name, uint64_t count, uint64_t limit,
                      const char* limit_name) {
  if (count <= limit) return {};
  return Fault{FieldPath(path, name).ToString(), Reason::kQuotaExceeded,
               absl::StrCat("is ", count, "; ", limit_name, " allows ", limit)};
}

MaybeFault BadPosition(const FieldPath& path, size_t at, const std::string& value,
                       const char* right) {
  const FieldPath element(path, "positions", static_cast<int64_t>(at / 3));
  return Fault{FieldPath(element, kAxes[at % 3]).ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", value, "; ", right)};
}

MaybeFault ToFloatPositions(const FieldPath& path, std::string_view payload,
                            std::vector<float>* out) {
  std::memcpy(out->data(), payload.data(), payload.size());
  for (size_t i = 0; i < out->size(); ++i) {
    if (!std::isfinite((*out)[i])) {
      return BadPosition(path, i, Show((*out)[i]), "give a finite number");
    }
  }
  return {};
}

template <typename T>
MaybeFault ToIntegerPositions(const FieldPath& path, std::string_view payload,
                              std::vector<float>* out) {
  const char* in = payload.data();
  for (size_t i = 0; i < out->size(); ++i, in += sizeof(T)) {
    T value;
    std::memcpy(&value, in, sizeof(T));
    if constexpr (std::is_same_v<T, int32_t>) {
      if (value > kGreatestI32 || value < -kGreatestI32) {
        return BadPosition(path, i, std::to_string(value),
                           "I32 positions lie within ±16777216 (2²⁴)");
      }
    }
    (*out)[i] = static_cast<float>(value);
  }
  return {};
}

MaybeFault ToPositions(const FieldPath& path, const v1::Vertices& in, std::string_view payload,
                       GeometryData* out) {
  out->positions.resize(size_t{in.count()} * 3);
  MaybeFault fault;
  switch (in.position_type()) {
    case v1::ELEMENT_TYPE_I16:
      fault = ToIntegerPositions<int16_t>(path, payload, &out->positions);
      break;
    case v1::ELEMENT_TYPE_I32:
      fault = ToIntegerPositions<int32_t>(path, payload, &out->positions);
      break;
    default:
      fault = ToFloatPositions(path, payload, &out->positions);
      break;
  }
  if (fault) return fault;

  std::array<float, 3> least = {out->positions[0], out->positions[1], out->positions[2]};
  std::array<float, 3> greatest = least;
  for (size_t i = 0; i < out->positions.size(); i += 3) {
    for (size_t axis = 0; axis < 3; ++axis) {
      least[axis] = std::min(least[axis], out->positions[i + axis]);
      greatest[axis] = std::max(greatest[axis], out->positions[i + axis]);
    }
  }
  std::copy(least.begin(), least.end(), out->min);
  std::copy(greatest.begin(), greatest.end(), out->max);
  return {};
}

template <typename T>
MaybeFault ToIndices(const FieldPath& path, std::string_view payload, uint32_t vertex_count,
                     std::vector<uint32_t>* out) {
  const char* in = payload.data();
  for (size_t i = 0; i < out->size(); ++i, in += sizeof(T)) {
    T value;
    std::memcpy(&value, in, sizeof(T));
    if (value >= vertex_count) {
      return Fault{FieldPath(path, "indices", static_cast<int64_t>(i)).ToString(),
                   Reason::kIndexOutOfRange,
                   absl::StrCat("is ", value, "; there are ", vertex_count, " vertices, so 0 to ",
                                vertex_count - 1, " are possible")};
    }
    (*out)[i] = value;
  }
  return {};
}

void ToColors(std::string_view payload, size_t element_bytes, std::vector<uint32_t>* out) {
  const auto* in = reinterpret_cast<const unsigned char*>(payload.data());
  for (size_t i = 0; i < out->size(); ++i, in += element_bytes) {
    (*out)[i] = uint32_t{in[0]} << 16 | uint32_t{in[1]} << 8 | uint32_t{in[2]};
  }
}

// Types that fit their arrays, and arrays that are there where a type or count speaks of them.
MaybeFault CheckTypes(const FieldPath& path, const v1::Vertices& in, bool with_indices) {
  if (PositionBytes(in.position_type()) == 0) {
    return UnknownEnum(FieldPath(path, "position_type"), in.position_type(),
                       "ELEMENT_TYPE_F32, ELEMENT_TYPE_I16, ELEMENT_TYPE_I32");
  }
  if (ColorBytes(in.color_type()) == 0) {
    return UnknownEnum(FieldPath(path, "color_type"), in.color_type(),
                       "ELEMENT_TYPE_RGB8, ELEMENT_TYPE_RGBX8");
  }
  if (IndexBytes(in.index_type()) == 0) {
    return UnknownEnum(FieldPath(path, "index_type"), in.index_type(),
                       "ELEMENT_TYPE_U16, ELEMENT_TYPE_U32");
  }
  if (!with_indices && (in.index_count() != 0 || !in.indices().empty())) {
    return Fault{FieldPath(path, in.index_count() != 0 ? "index_count" : "indices").ToString(),
                 Reason::kInvalidValue,
                 absl::StrCat("is not empty (", in.index_count(), " indices, ", in.indices().size(),
                              " bytes); points take no indices")};
  }
  if (!with_indices && in.has_indices_in()) {
    return Fault{FieldPath(path, "indices_in").ToString(), Reason::kInvalidValue,
                 "is set; points take no indices"};
  }
  if (in.index_type() != v1::ELEMENT_TYPE_UNSPECIFIED && in.index_count() == 0) {
    return Fault{FieldPath(path, "index_type").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", static_cast<int>(in.index_type()),
                              " without indices; leave it unset, or give index_count and indices")};
  }
  return {};
}

}  // namespace

MaybeFault ToVertices(const FieldPath& path, const v1::Vertices& in, bool with_indices,
                      const Limits& limits, LocalRanges& ranges, GeometryData* out) {
  if (auto fault = CheckTypes(path, in, with_indices)) return fault;
  if (in.count() == 0) {
    return Fault{FieldPath(path, "count").ToString(), Reason::kInvalidValue,
                 "is 0; give at least 1 vertex"};
  }
  if (auto fault = CheckCount(path, "count", in.count(), limits.max_vertices_per_entity,
                              "max_vertices_per_entity")) {
    return fault;
  }
  if (auto fault = CheckCount(path, "index_count", in.index_count(), limits.max_indices_per_entity,
                              "max_indices_per_entity")) {
    return fault;
  }
  Payload positions{"positions", in.positions(), "positions_in",
                    in.has_positions_in() ? &in.positions_in() : nullptr};
  Payload indices{"indices", in.indices(), "indices_in",
                  in.has_indices_in() ? &in.indices_in() : nullptr};
  Payload colors{"colors", in.colors(), "colors_in",
                 in.has_colors_in() ? &in.colors_in() : nullptr};
  const bool colored = colors.given() || in.color_type() != v1::ELEMENT_TYPE_UNSPECIFIED;
  if (auto fault =
          CheckPayload(path, in.count(), PositionBytes(in.position_type()), ranges, &positions)) {
    return fault;
  }
  if (auto fault =
          CheckPayload(path, in.index_count(), IndexBytes(in.index_type()), ranges, &indices)) {
    return fault;
  }
  if (colored) {
    if (auto fault = CheckPayload(path, in.count(), ColorBytes(in.color_type()), ranges, &colors)) {
      return fault;
    }
  }

  out->record.vertex_count = in.count();
  out->record.index_count = in.index_count();
  if (auto fault = ToPositions(path, in, positions.bytes(), out)) return fault;
  out->indices.resize(in.index_count());
  auto fault = in.index_type() == v1::ELEMENT_TYPE_U16
                   ? ToIndices<uint16_t>(path, indices.bytes(), in.count(), &out->indices)
                   : ToIndices<uint32_t>(path, indices.bytes(), in.count(), &out->indices);
  if (fault) return fault;
  if (colored) {
    out->record.color_mode = gpu::ColorMode::kPerVertex;
    out->colors.resize(in.count());
    ToColors(colors.bytes(), ColorBytes(in.color_type()), &out->colors);
  }
  return {};
}

}  // namespace voxeld::daemon::wire
