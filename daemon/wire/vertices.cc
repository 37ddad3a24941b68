#include "daemon/wire/vertices.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/payload.h"
#include "daemon/wire/vertex_copy.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};

// Returns: the bytes of one element; 0 if the type does not fit the array.
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

// One of the arrays: its field, the field that may replace it, and the location of the bytes.
struct Array {
  const char* name;
  const char* range_name;
  const v1::MemoryRange* range;  // null: none
  Payload payload;               // for a range, set after it has been checked
  std::shared_ptr<const void> mapping = {};

  bool given() const { return range != nullptr || !payload.empty(); }
};

// Finds the bytes and compares their number with the expected one.
MaybeFault CheckArray(const FieldPath& path, uint64_t count, uint64_t element_bytes,
                      const DecodeContext& context, Array* array) {
  // count < 2³² and element_bytes ≤ 12: no overflow.
  const uint64_t want = count * element_bytes;
  const uint64_t sent = array->payload.size();
  if (array->range == nullptr) {
    if (sent == want) return {};
    return Fault{FieldPath(path, array->name).ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", ShowBytes(sent, element_bytes, "element"), "; ", count,
                              " elements of ", element_bytes, " bytes need ", want)};
  }
  const FieldPath in(path, array->range_name);
  if (sent != 0) {
    return Fault{
        in.ToString(), Reason::kInvalidValue,
        absl::StrCat("is set, and ", array->name, " has ", sent, " bytes; give one of them")};
  }
  if (array->range->size() != want) {
    return Fault{FieldPath(in, "size").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("is ", array->range->size(), "; ", count, " elements of ",
                              element_bytes, " bytes need ", want)};
  }
  MappedRange mapped;
  if (auto fault = ReadRange(in, *array->range, context, &mapped)) return fault;
  array->payload = Payload(mapped.bytes);
  array->mapping = std::move(mapped.mapping);
  return {};
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

// Finds the fault in positions that are known to have one.
MaybeFault FindFloat(const FieldPath& path, std::span<const float> positions) {
  for (size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) {
      return BadPosition(path, i, Show(positions[i]), "give a finite number");
    }
  }
  return {};
}

MaybeFault FindInt32(const FieldPath& path, const Payload& payload) {
  MaybeFault fault;
  size_t i = 0;
  payload.ForEachRun(sizeof(int32_t), [&](const char* data, size_t count) {
    for (size_t k = 0; k < count && !fault; ++k, ++i) {
      int32_t value;
      std::memcpy(&value, data + k * sizeof(value), sizeof(value));
      if (value <= kGreatestI32 && value >= -kGreatestI32) continue;
      fault =
          BadPosition(path, i, std::to_string(value), "I32 positions lie within ±16777216 (2²⁴)");
    }
  });
  return fault;
}

MaybeFault ToPositions(const FieldPath& path, v1::ElementType type, const Payload& payload,
                       GeometryData* out) {
  const std::span<float> to = out->arrays.writable_positions();
  PositionBounds bounds;
  switch (type) {
    case v1::ELEMENT_TYPE_I16:
      CopyInt16Positions(payload, to, &bounds);
      break;
    case v1::ELEMENT_TYPE_I32:
      if (!CopyInt32Positions(payload, to, &bounds)) return FindInt32(path, payload);
      break;
    default:
      if (!CopyFloatPositions(payload, to, &bounds)) return FindFloat(path, to);
      break;
  }
  std::copy(bounds.least, bounds.least + 3, out->min);
  std::copy(bounds.greatest, bounds.greatest + 3, out->max);
  return {};
}

MaybeFault ToIndices(const FieldPath& path, v1::ElementType type, const Payload& payload,
                     uint32_t vertex_count, std::span<uint32_t> out) {
  if (type == v1::ELEMENT_TYPE_U16 ? CopyIndices16(payload, vertex_count, out)
                                   : CopyIndices32(payload, vertex_count, out)) {
    return {};
  }
  const auto bad =
      std::find_if(out.begin(), out.end(), [&](uint32_t i) { return i >= vertex_count; });
  return Fault{FieldPath(path, "indices", bad - out.begin()).ToString(), Reason::kIndexOutOfRange,
               absl::StrCat("is ", *bad, "; there are ", vertex_count, " vertices, so 0 to ",
                            vertex_count - 1, " are possible")};
}

// The arrays of a message, wherever they are stored.
struct Arrays {
  Array positions, indices, colors;
};

Arrays ArraysOf(const v1::Vertices& in, const DecodeContext& context) {
  const auto find = [&](const std::string& field) {
    return context.payloads != nullptr ? context.payloads->Find(field) : Payload(field);
  };
  return {
      {"positions", "positions_in", in.has_positions_in() ? &in.positions_in() : nullptr,
       find(in.positions())},
      {"indices", "indices_in", in.has_indices_in() ? &in.indices_in() : nullptr,
       find(in.indices())},
      {"colors", "colors_in", in.has_colors_in() ? &in.colors_in() : nullptr, find(in.colors())}};
}

// Checks that types fit their arrays, and that arrays exist if a type or count refers to them.
MaybeFault CheckTypes(const FieldPath& path, const v1::Vertices& in, const Payload& indices,
                      bool with_indices) {
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
  if (!with_indices && (in.index_count() != 0 || !indices.empty())) {
    return Fault{FieldPath(path, in.index_count() != 0 ? "index_count" : "indices").ToString(),
                 Reason::kInvalidValue,
                 absl::StrCat("is not empty (", in.index_count(), " indices, ", indices.size(),
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

// Checks whether colours belong to segments or triangles. For points, both settings are equivalent.
MaybeFault CheckColorsOf(const FieldPath& path, const v1::Vertices& in, bool colored,
                         gpu::PrimitiveKind kind, bool* of_elements) {
  *of_elements = false;
  const FieldPath at(path, "colors_of");
  switch (in.colors_of()) {
    case v1::Vertices::COLORS_OF_UNSPECIFIED:
    case v1::Vertices::VERTICES:
      return {};
    case v1::Vertices::ELEMENTS:
      break;
    default:
      return UnknownEnum(at, in.colors_of(), "VERTICES, ELEMENTS");
  }
  if (!colored) {
    return Fault{at.ToString(), Reason::kInvalidValue,
                 "is ELEMENTS without colors; leave it unset, or give colors"};
  }
  *of_elements = kind == gpu::PrimitiveKind::kSegments || kind == gpu::PrimitiveKind::kTriangles;
  if (*of_elements || kind == gpu::PrimitiveKind::kPoints) return {};
  return Fault{at.ToString(), Reason::kInvalidValue,
               "is ELEMENTS, which are segments and triangles; give VERTICES"};
}

// Returns: the number of corners of all elements, counted separately for each.
uint64_t CountCorners(const gpu::GeometryRecord& record) {
  const uint64_t corners = record.index_count != 0 ? record.index_count : record.vertex_count;
  if (record.kind == gpu::PrimitiveKind::kTriangles || record.topology == gpu::Topology::kList) {
    return corners;
  }
  return 2 * (record.topology == gpu::Topology::kLoop ? corners : corners - 1);
}

// Returns: the vertex of corner `i`, numbered consecutively over all elements.
uint32_t VertexOfCorner(const gpu::GeometryRecord& record, std::span<const uint32_t> indices,
                        uint64_t i) {
  const bool listed =
      record.kind == gpu::PrimitiveKind::kTriangles || record.topology == gpu::Topology::kList;
  const uint64_t corners = indices.empty() ? record.vertex_count : indices.size();
  const uint64_t at = listed ? i : (i / 2 + i % 2) % corners;
  return indices.empty() ? static_cast<uint32_t>(at) : indices[at];
}

}  // namespace

MaybeFault ToVertices(const FieldPath& path, const v1::Vertices& in, bool with_indices,
                      const DecodeContext& context, GeometryData* out) {
  const Limits& limits = context.limits;
  Arrays arrays = ArraysOf(in, context);
  if (auto fault = CheckTypes(path, in, arrays.indices.payload, with_indices)) return fault;
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
  const bool colored = arrays.colors.given() || in.color_type() != v1::ELEMENT_TYPE_UNSPECIFIED;
  if (auto fault = CheckArray(path, in.count(), PositionBytes(in.position_type()), context,
                              &arrays.positions)) {
    return fault;
  }
  if (auto fault = CheckArray(path, in.index_count(), IndexBytes(in.index_type()), context,
                              &arrays.indices)) {
    return fault;
  }
  bool of_elements;
  if (auto fault = CheckColorsOf(path, in, colored, out->record.kind, &of_elements)) return fault;
  const bool of_vertices = colored && !of_elements;
  if (of_vertices) {
    if (auto fault =
            CheckArray(path, in.count(), ColorBytes(in.color_type()), context, &arrays.colors)) {
      return fault;
    }
  }

  out->record.vertex_count = in.count();
  out->record.index_count = in.index_count();
  if (of_vertices) out->record.color_mode = gpu::ColorMode::kPerVertex;
  absl::StatusOr<gpu::GeometryArrays> kept =
      gpu::GeometryArrays::Allocate(out->record, context.pool);
  if (!kept.ok()) {
    return Fault{FieldPath(path, "positions").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", kept.status().message())};
  }
  out->arrays = *std::move(kept);
  if (auto fault = ToPositions(path, in.position_type(), arrays.positions.payload, out)) {
    return fault;
  }
  if (auto fault = ToIndices(path, in.index_type(), arrays.indices.payload, in.count(),
                             out->arrays.writable_indices())) {
    return fault;
  }
  if (of_vertices) {
    CopyColors(arrays.colors.payload, ColorBytes(in.color_type()), out->arrays.writable_colors());
  }
  return {};
}

MaybeFault ToElementColors(const FieldPath& path, const v1::Vertices& in,
                           const DecodeContext& context, GeometryData* out) {
  if (in.colors_of() != v1::Vertices::ELEMENTS) return {};
  const uint64_t corners = CountCorners(out->record);
  const size_t each = out->record.kind == gpu::PrimitiveKind::kTriangles ? 3 : 2;
  Array colors = ArraysOf(in, context).colors;
  if (auto fault =
          CheckArray(path, corners / each, ColorBytes(in.color_type()), context, &colors)) {
    return fault;
  }
  if (auto fault = CheckCount(path, "colors_of", corners, context.limits.max_vertices_per_entity,
                              "max_vertices_per_entity")) {
    fault->message =
        absl::StrCat("makes ", corners, " corners of elements; max_vertices_per_entity allows ",
                     context.limits.max_vertices_per_entity);
    return fault;
  }
  gpu::GeometryRecord record = out->record;
  record.vertex_count = static_cast<uint32_t>(corners);
  record.index_count = 0;
  record.color_mode = gpu::ColorMode::kPerVertex;
  record.topology = gpu::Topology::kList;
  absl::StatusOr<gpu::GeometryArrays> kept = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!kept.ok()) {
    return Fault{FieldPath(path, "colors_of").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", kept.status().message())};
  }
  std::vector<uint32_t> of_elements(corners / each);
  CopyColors(colors.payload, ColorBytes(in.color_type()), of_elements);
  for (size_t i = 0; i < corners; ++i) {
    const size_t vertex = VertexOfCorner(out->record, out->arrays.indices(), i);
    const float* const position = &out->arrays.positions()[vertex * 3];
    std::copy_n(position, 3, &kept->writable_positions()[i * 3]);
    kept->writable_colors()[i] = of_elements[i / each];
    // The bounds include only vertices that are used.
    for (int a = 0; a < 3; ++a) {
      const double value = double{position[a]};
      out->min[a] = i == 0 ? value : std::min(out->min[a], value);
      out->max[a] = i == 0 ? value : std::max(out->max[a], value);
    }
  }
  out->record = record;
  out->arrays = *std::move(kept);
  return {};
}

}  // namespace voxeld::daemon::wire
