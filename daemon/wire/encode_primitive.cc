#include "daemon/wire/encode_primitive.h"

#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <string>
#include <variant>

#include "daemon/wire/convert.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

static_assert(std::endian::native == std::endian::little,
              "payloads are little-endian and written by memcpy");

// Size of the fields other than arrays and names, with their tags and lengths.
constexpr uint64_t kFixedBytes = 128;
constexpr uint64_t kTransformBytes = 104;

// Access to the arrays, regardless of how they are stored.
std::span<const float> PositionsOf(const GeometryData& in) { return in.arrays.positions(); }
std::span<const uint32_t> IndicesOf(const GeometryData& in) { return in.arrays.indices(); }
std::span<const uint32_t> ColorsOf(const GeometryData& in) { return in.arrays.colors(); }

template <typename T>
void Pack(std::span<const T> in, std::string* out) {
  out->assign(reinterpret_cast<const char*>(in.data()), in.size_bytes());
}

void PackColors(std::span<const uint32_t> in, std::string* out) {
  out->resize(in.size() * 3);
  char* to = out->data();
  for (const uint32_t color : in) {
    *to++ = static_cast<char>(color >> 16);
    *to++ = static_cast<char>(color >> 8);
    *to++ = static_cast<char>(color);
  }
}

}  // namespace

void VerticesToWire(const GeometryData& in, v1::Vertices* out) {
  out->set_count(in.record.vertex_count);
  out->set_position_type(v1::ELEMENT_TYPE_F32);
  Pack(PositionsOf(in), out->mutable_positions());
  if (in.record.index_count != 0) {
    out->set_index_type(v1::ELEMENT_TYPE_U32);
    out->set_index_count(in.record.index_count);
    Pack(IndicesOf(in), out->mutable_indices());
  }
  if (in.record.color_mode == gpu::ColorMode::kPerVertex) {
    out->set_color_type(v1::ELEMENT_TYPE_RGB8);
    PackColors(ColorsOf(in), out->mutable_colors());
  }
}

namespace {

void ThicknessToWire(const gpu::GeometryRecord& in, v1::Thickness* out) {
  out->set_value(in.thickness);
  out->set_unit(in.thickness_unit == gpu::ThicknessUnit::kUnits ? v1::Thickness::UNITS
                                                                : v1::Thickness::VOXELS);
}

v1::SurfaceRule RuleToWire(gpu::SurfaceRule in) {
  return in == gpu::SurfaceRule::kCover ? v1::SURFACE_RULE_COVER : v1::SURFACE_RULE_THIN;
}

v1::Fill FillToWire(gpu::Fill in) {
  return in == gpu::Fill::kSolid ? v1::FILL_SOLID : v1::FILL_SURFACE;
}

v1::Segments::Topology TopologyToWire(gpu::Topology in) {
  switch (in) {
    case gpu::Topology::kList:
      return v1::Segments::LIST;
    case gpu::Topology::kStrip:
      return v1::Segments::STRIP;
    case gpu::Topology::kLoop:
      return v1::Segments::LOOP;
  }
  return v1::Segments::TOPOLOGY_UNSPECIFIED;
}

v1::LineSampling SamplingToWire(gpu::LineSampling in) {
  switch (in) {
    case gpu::LineSampling::kThin:
      return v1::LINE_SAMPLING_THIN;
    case gpu::LineSampling::kEuclidean:
      return v1::LINE_SAMPLING_EUCLIDEAN;
    case gpu::LineSampling::kCover:
      return v1::LINE_SAMPLING_COVER;
  }
  return v1::LINE_SAMPLING_UNSPECIFIED;
}

void Vec3ToWire(const float* in, v1::Vec3* out) {
  out->set_x(double{in[0]});
  out->set_y(double{in[1]});
  out->set_z(double{in[2]});
}

void GeometryToWire(const GeometryData& in, v1::Primitive* out) {
  if (!in.as_sent.empty()) {
    out->ParseFromString(in.as_sent);
    return;
  }
  const gpu::GeometryRecord& record = in.record;
  out->mutable_color()->set_rgb(record.color);
  switch (record.kind) {
    case gpu::PrimitiveKind::kPoints: {
      v1::Points* points = out->mutable_points();
      ThicknessToWire(record, points->mutable_thickness());
      if (record.splat == gpu::Splat::kSoft) points->set_splat(v1::Points::SOFT);
      if (record.splat == gpu::Splat::kCube) points->set_splat(v1::Points::CUBE);
      if (record.splat == gpu::Splat::kCell) points->set_splat(v1::Points::CELL);
      return VerticesToWire(in, points->mutable_vertices());
    }
    case gpu::PrimitiveKind::kSegments: {
      v1::Segments* segments = out->mutable_segments();
      segments->set_topology(TopologyToWire(record.topology));
      segments->set_sampling(SamplingToWire(record.sampling));
      ThicknessToWire(record, segments->mutable_thickness());
      return VerticesToWire(in, segments->mutable_vertices());
    }
    case gpu::PrimitiveKind::kFilled:
      out->mutable_mesh()->set_fill(v1::FILL_SOLID);
      [[fallthrough]];
    case gpu::PrimitiveKind::kTriangles:
      out->mutable_mesh()->set_rule(RuleToWire(record.rule));
      if (record.thickness != 0) ThicknessToWire(record, out->mutable_mesh()->mutable_shell());
      return VerticesToWire(in, out->mutable_mesh()->mutable_vertices());
    case gpu::PrimitiveKind::kBox: {
      v1::Box* box = out->mutable_box();
      Vec3ToWire(record.params, box->mutable_center());
      Vec3ToWire(record.params + 3, box->mutable_size());
      box->set_fill(FillToWire(record.fill));
      box->set_rule(RuleToWire(record.rule));
      return;
    }
    case gpu::PrimitiveKind::kSphere: {
      v1::Sphere* sphere = out->mutable_sphere();
      Vec3ToWire(record.params, sphere->mutable_center());
      sphere->set_radius(double{record.params[3]});
      sphere->set_fill(FillToWire(record.fill));
      sphere->set_rule(RuleToWire(record.rule));
      return;
    }
    case gpu::PrimitiveKind::kCylinder: {
      v1::Cylinder* cylinder = out->mutable_cylinder();
      Vec3ToWire(record.params, cylinder->mutable_center());
      cylinder->set_radius(double{record.params[3]});
      cylinder->set_height(double{record.params[4]});
      cylinder->set_fill(FillToWire(record.fill));
      cylinder->set_rule(RuleToWire(record.rule));
      return;
    }
    case gpu::PrimitiveKind::kImplicit:  // stored as they were sent
    case gpu::PrimitiveKind::kCurves:
    case gpu::PrimitiveKind::kPatches:
    case gpu::PrimitiveKind::kSamples:
      return;
  }
}

}  // namespace

void Encode(const Content& in, v1::Primitive* out) {
  if (const auto* instance = std::get_if<InstanceRef>(&in)) {
    out->mutable_instance()->set_object(instance->object);
    if (instance->tint != 0x00FFFFFF)
      out->mutable_instance()->mutable_tint()->set_rgb(instance->tint);
    return;
  }
  if (const auto* group = std::get_if<GroupPtr>(&in)) {
    out->ParseFromString((*group)->as_sent);
    return;
  }
  GeometryToWire(*std::get<GeometryPtr>(in), out);
}

void Encode(const ObjectData& in, v1::Object* out) {
  out->mutable_parts()->Reserve(static_cast<int>(in.parts.size()));
  for (const ObjectPart& part : in.parts) {
    v1::Object::Part* to = out->add_parts();
    Encode(part.content, to->mutable_primitive());
    ToWire(part.transform, to->mutable_transform());
  }
}

uint64_t EncodedBytes(const Content& in) {
  if (const auto* instance = std::get_if<InstanceRef>(&in)) {
    return kFixedBytes + instance->object.size();
  }
  if (const auto* group = std::get_if<GroupPtr>(&in)) return kFixedBytes + (*group)->as_sent.size();
  const GeometryData& geometry = *std::get<GeometryPtr>(in);
  if (!geometry.as_sent.empty()) return kFixedBytes + geometry.as_sent.size();
  return kFixedBytes + PositionsOf(geometry).size_bytes() + IndicesOf(geometry).size_bytes() +
         ColorsOf(geometry).size() * 3;
}

uint64_t EncodedBytes(const ObjectData& in) {
  uint64_t bytes = 0;
  for (const ObjectPart& part : in.parts) {
    bytes += EncodedBytes(part.content) + kTransformBytes;
  }
  return bytes;
}

}  // namespace voxeld::daemon::wire
