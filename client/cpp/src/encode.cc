#include "client/cpp/src/encode.h"

#include <cstring>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode_parts.h"
#include "client/cpp/src/encode_payload.h"
#include "client/cpp/src/encode_shapes.h"
#include "voxeld/v1/primitives.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {
namespace {

// Field numbers come from the generated code, so that each is defined in one place.
using v1::Batch;
using v1::StreamRequest;

absl::StatusOr<Rope> EncodeVertices(const Vertices& v) {
  const size_t count = v.positions.size() / 3;
  if (count == 0 || v.positions.size() % 3 != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("positions has ", v.positions.size(),
                     " numbers; x y z of each vertex and at least one vertex is right"));
  }
  const bool of_elements = v.colors_of == Vertices::ColorsOf::kElements;
  if (of_elements && (v.colors.empty() || v.colors.size() % 3 != 0)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "colors has ", v.colors.size(), " bytes; r g b of each segment or triangle is right"));
  }
  if (!of_elements && !v.colors.empty() && v.colors.size() != 3 * count) {
    return absl::InvalidArgumentError(absl::StrCat("colors has ", v.colors.size(), " bytes for ",
                                                   count, " vertices; ", 3 * count,
                                                   " or none is right"));
  }
  if (!v.indices.empty() && !v.short_indices.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("indices has ", v.indices.size(),
                                                   " and short_indices ", v.short_indices.size(),
                                                   " numbers; one of them must be empty"));
  }
  std::string head;
  AppendUnsigned(v1::Vertices::kCountFieldNumber, count, &head);
  AppendUnsigned(v1::Vertices::kPositionTypeFieldNumber, v1::ELEMENT_TYPE_F32, &head);
  if (!v.colors.empty())
    AppendUnsigned(v1::Vertices::kColorTypeFieldNumber, v1::ELEMENT_TYPE_RGB8, &head);
  if (of_elements)
    AppendUnsigned(v1::Vertices::kColorsOfFieldNumber, v1::Vertices::ELEMENTS, &head);
  const size_t indices = v.indices.size() + v.short_indices.size();
  if (indices > 0) {
    AppendUnsigned(v1::Vertices::kIndexTypeFieldNumber,
                   v.indices.empty() ? v1::ELEMENT_TYPE_U16 : v1::ELEMENT_TYPE_U32, &head);
    AppendUnsigned(v1::Vertices::kIndexCountFieldNumber, indices, &head);
  }
  Rope rope(std::move(head));
  AppendPayload(v1::Vertices::kIndicesFieldNumber, v1::Vertices::kIndicesInFieldNumber, v.indices,
                &rope);
  AppendPayload(v1::Vertices::kIndicesFieldNumber, v1::Vertices::kIndicesInFieldNumber,
                v.short_indices, &rope);
  AppendPayload(v1::Vertices::kColorsFieldNumber, v1::Vertices::kColorsInFieldNumber, v.colors,
                &rope);
  AppendPayload(v1::Vertices::kPositionsFieldNumber, v1::Vertices::kPositionsInFieldNumber,
                v.positions, &rope);
  return rope;
}

void AppendThickness(int field, const Thickness& thickness, std::string* out) {
  std::string inner;
  AppendFloat(v1::Thickness::kValueFieldNumber, thickness.value, &inner);
  AppendUnsigned(
      v1::Thickness::kUnitFieldNumber,
      thickness.unit == Thickness::Unit::kUnits ? v1::Thickness::UNITS : v1::Thickness::VOXELS,
      &inner);
  AppendPresentBytes(field, inner, out);
}

// The wire's enumerations begin with UNSPECIFIED and then match ours.
template <typename Enum>
uint64_t AfterUnspecified(Enum value) {
  return static_cast<uint64_t>(value) + 1;
}

struct ShapeEncoder {
  std::string before;  // precedes the shape within the primitive: its colour

  absl::StatusOr<Rope> operator()(const Points& points) const {
    if (!points.vertices.indices.empty() || !points.vertices.short_indices.empty()) {
      return absl::InvalidArgumentError("points have indices; none is right");
    }
    std::string fields;
    AppendThickness(v1::Points::kThicknessFieldNumber, points.thickness, &fields);
    AppendUnsigned(v1::Points::kSplatFieldNumber, AfterUnspecified(points.splat), &fields);
    return OverVertices(points.vertices, v1::Points::kVerticesFieldNumber, fields,
                        v1::Primitive::kPointsFieldNumber);
  }
  absl::StatusOr<Rope> operator()(const Segments& segments) const {
    std::string fields;
    AppendUnsigned(v1::Segments::kTopologyFieldNumber, AfterUnspecified(segments.topology),
                   &fields);
    AppendUnsigned(v1::Segments::kSamplingFieldNumber, AfterUnspecified(segments.sampling),
                   &fields);
    AppendThickness(v1::Segments::kThicknessFieldNumber, segments.thickness, &fields);
    return OverVertices(segments.vertices, v1::Segments::kVerticesFieldNumber, fields,
                        v1::Primitive::kSegmentsFieldNumber);
  }
  absl::StatusOr<Rope> operator()(const Mesh& mesh) const {
    std::string fields;
    AppendUnsigned(v1::Mesh::kRuleFieldNumber, AfterUnspecified(mesh.rule), &fields);
    AppendUnsigned(v1::Mesh::kFillFieldNumber, AfterUnspecified(mesh.fill), &fields);
    if (mesh.shell.value != 0) AppendThickness(v1::Mesh::kShellFieldNumber, mesh.shell, &fields);
    absl::StatusOr<Rope> vertices = EncodeVertices(mesh.vertices);
    if (!vertices.ok()) return vertices.status();
    Rope rope = Wrap(fields, v1::Mesh::kVerticesFieldNumber, *std::move(vertices));
    if (mesh.texture.has_value()) {
      const size_t count = mesh.vertices.positions.size() / 3;
      if (mesh.texture->coordinates.size() != 2 * count) {
        return absl::InvalidArgumentError(
            absl::StrCat("texture.coordinates has ", mesh.texture->coordinates.size(),
                         " numbers for ", count, " vertices; ", 2 * count, " are right"));
      }
      Rope texture;
      AppendPayload(v1::Texture::kPictureFieldNumber, v1::Texture::kPictureInFieldNumber,
                    mesh.texture->picture, &texture);
      AppendPayload(v1::Texture::kCoordinatesFieldNumber, v1::Texture::kCoordinatesInFieldNumber,
                    mesh.texture->coordinates, &texture);
      rope.Append(Wrap("", v1::Mesh::kTextureFieldNumber, std::move(texture)));
    }
    return Wrap(before, v1::Primitive::kMeshFieldNumber, std::move(rope));
  }
  absl::StatusOr<Rope> operator()(const Curve& curve) const {
    std::string fields;
    AppendUnsigned(v1::Curve::kFormFieldNumber, AfterUnspecified(curve.form), &fields);
    AppendUnsigned(v1::Curve::kClosedFieldNumber, curve.closed ? 1 : 0, &fields);
    AppendUnsigned(v1::Curve::kSamplingFieldNumber, AfterUnspecified(curve.sampling), &fields);
    AppendThickness(v1::Curve::kThicknessFieldNumber, curve.thickness, &fields);
    return OverVertices(curve.vertices, v1::Curve::kVerticesFieldNumber, fields,
                        v1::Primitive::kCurveFieldNumber);
  }
  absl::StatusOr<Rope> operator()(const BezierSurface& surface) const {
    std::string fields;
    AppendUnsigned(v1::BezierSurface::kRuleFieldNumber, AfterUnspecified(surface.rule), &fields);
    AppendUnsigned(v1::BezierSurface::kFillFieldNumber, AfterUnspecified(surface.fill), &fields);
    if (surface.shell.value != 0)
      AppendThickness(v1::BezierSurface::kShellFieldNumber, surface.shell, &fields);
    return OverVertices(surface.vertices, v1::BezierSurface::kVerticesFieldNumber, fields,
                        v1::Primitive::kBezierSurfaceFieldNumber);
  }
  absl::StatusOr<Rope> operator()(const Box& box) const {
    std::string fields;
    AppendVec3(v1::Box::kCenterFieldNumber, box.center, &fields);
    AppendVec3(v1::Box::kSizeFieldNumber, box.size, &fields);
    AppendUnsigned(v1::Box::kFillFieldNumber, AfterUnspecified(box.fill), &fields);
    AppendUnsigned(v1::Box::kRuleFieldNumber, AfterUnspecified(box.rule), &fields);
    if (box.shell.value != 0) AppendThickness(v1::Box::kShellFieldNumber, box.shell, &fields);
    return Wrap(before, v1::Primitive::kBoxFieldNumber, Rope(std::move(fields)));
  }
  absl::StatusOr<Rope> operator()(const Sphere& sphere) const {
    std::string fields;
    AppendVec3(v1::Sphere::kCenterFieldNumber, sphere.center, &fields);
    AppendDouble(v1::Sphere::kRadiusFieldNumber, sphere.radius, &fields);
    AppendUnsigned(v1::Sphere::kFillFieldNumber, AfterUnspecified(sphere.fill), &fields);
    AppendUnsigned(v1::Sphere::kRuleFieldNumber, AfterUnspecified(sphere.rule), &fields);
    if (sphere.shell.value != 0)
      AppendThickness(v1::Sphere::kShellFieldNumber, sphere.shell, &fields);
    return Wrap(before, v1::Primitive::kSphereFieldNumber, Rope(std::move(fields)));
  }
  absl::StatusOr<Rope> operator()(const Cylinder& cylinder) const {
    std::string fields;
    AppendVec3(v1::Cylinder::kCenterFieldNumber, cylinder.center, &fields);
    AppendDouble(v1::Cylinder::kRadiusFieldNumber, cylinder.radius, &fields);
    AppendDouble(v1::Cylinder::kHeightFieldNumber, cylinder.height, &fields);
    AppendUnsigned(v1::Cylinder::kFillFieldNumber, AfterUnspecified(cylinder.fill), &fields);
    AppendUnsigned(v1::Cylinder::kRuleFieldNumber, AfterUnspecified(cylinder.rule), &fields);
    if (cylinder.shell.value != 0)
      AppendThickness(v1::Cylinder::kShellFieldNumber, cylinder.shell, &fields);
    return Wrap(before, v1::Primitive::kCylinderFieldNumber, Rope(std::move(fields)));
  }
  absl::StatusOr<Rope> operator()(const HeightMap& map) const {
    const size_t samples = size_t{map.columns} * map.rows;
    if (samples == 0 || map.heights.size() != samples) {
      return absl::InvalidArgumentError(absl::StrCat("heights has ", map.heights.size(),
                                                     " numbers for ", map.columns, " columns and ",
                                                     map.rows, " rows; one for each is right"));
    }
    if (!map.colors.empty() && map.colors.size() != 3 * samples) {
      return absl::InvalidArgumentError(absl::StrCat("colors has ", map.colors.size(),
                                                     " bytes for ", samples, " heights; ",
                                                     3 * samples, " or none is right"));
    }
    std::string fields;
    AppendVec3(v1::HeightMap::kCornerFieldNumber, map.corner, &fields);
    AppendVec3(v1::HeightMap::kEdgeAFieldNumber, map.edge_a, &fields);
    AppendVec3(v1::HeightMap::kEdgeBFieldNumber, map.edge_b, &fields);
    AppendVec3(v1::HeightMap::kUpFieldNumber, map.up, &fields);
    AppendUnsigned(v1::HeightMap::kColumnsFieldNumber, map.columns, &fields);
    AppendUnsigned(v1::HeightMap::kRowsFieldNumber, map.rows, &fields);
    AppendUnsigned(v1::HeightMap::kRuleFieldNumber, AfterUnspecified(map.rule), &fields);
    AppendUnsigned(v1::HeightMap::kFillFieldNumber, AfterUnspecified(map.fill), &fields);
    if (map.shell.value != 0) AppendThickness(v1::HeightMap::kShellFieldNumber, map.shell, &fields);
    Rope rope(std::move(fields));
    AppendPayload(v1::HeightMap::kPictureFieldNumber, v1::HeightMap::kPictureInFieldNumber,
                  map.picture, &rope);
    AppendPayload(v1::HeightMap::kColorsFieldNumber, v1::HeightMap::kColorsInFieldNumber,
                  map.colors, &rope);
    AppendPayload(v1::HeightMap::kHeightsFieldNumber, v1::HeightMap::kHeightsInFieldNumber,
                  map.heights, &rope);
    return Wrap(before, v1::Primitive::kHeightMapFieldNumber, std::move(rope));
  }
  absl::StatusOr<Rope> operator()(const Volume& volume) const {
    const auto* bytes = std::get_if<Array<uint8_t>>(&volume.grid.samples);
    if (volume.colors && bytes == nullptr) {
      return absl::InvalidArgumentError(
          "samples are colours but not bytes; r g b a of each is right");
    }
    absl::StatusOr<Rope> grid = EncodeGrid(volume.grid, volume.colors);
    if (!grid.ok()) return grid.status();
    std::string fields;
    if (volume.transfer.has_value()) {
      AppendPresentBytes(v1::Volume::kTransferFieldNumber, EncodeTransfer(*volume.transfer),
                         &fields);
    }
    return Wrap(before, v1::Primitive::kVolumeFieldNumber,
                Wrap(fields, v1::Volume::kGridFieldNumber, *std::move(grid)));
  }
  absl::StatusOr<Rope> operator()(const Isosurface& surface) const {
    absl::StatusOr<Rope> grid = EncodeGrid(surface.grid, false);
    if (!grid.ok()) return grid.status();
    std::string fields;
    AppendDouble(v1::Isosurface::kLevelFieldNumber, surface.level, &fields);
    AppendUnsigned(v1::Isosurface::kFillFieldNumber, AfterUnspecified(surface.fill), &fields);
    AppendUnsigned(v1::Isosurface::kRuleFieldNumber, AfterUnspecified(surface.rule), &fields);
    AppendThickness(v1::Isosurface::kShellFieldNumber, surface.shell, &fields);
    return Wrap(before, v1::Primitive::kIsosurfaceFieldNumber,
                Wrap(fields, v1::Isosurface::kGridFieldNumber, *std::move(grid)));
  }
  // The other shapes are encoded as a complete primitive, which is appended to `before`.
  template <typename Measured>
  absl::StatusOr<Rope> operator()(const Measured& shape) const {
    absl::StatusOr<std::string> encoded = EncodeShape(shape);
    if (!encoded.ok()) return encoded.status();
    return Rope(before + *encoded);
  }
  absl::StatusOr<Rope> operator()(const Instance& instance) const {
    std::string fields;
    AppendBytes(v1::Instance::kObjectFieldNumber, instance.object, &fields);
    if (const uint32_t tint = RgbOf(instance.tint); tint != RgbOf(Color())) {
      std::string rgb;
      AppendFixed32(v1::Color::kRgbFieldNumber, tint, &rgb);
      AppendPresentBytes(v1::Instance::kTintFieldNumber, rgb, &fields);
    }
    return Wrap(before, v1::Primitive::kInstanceFieldNumber, Rope(std::move(fields)));
  }

 private:
  static absl::StatusOr<Rope> EncodeGrid(const Grid& grid, bool colors) {
    const uint64_t samples = uint64_t{grid.size_a} * grid.size_b * grid.size_c * (colors ? 4 : 1);
    const size_t given = std::visit([](const auto& array) { return array.size(); }, grid.samples);
    if (samples == 0 || given != samples) {
      return absl::InvalidArgumentError(
          absl::StrCat("samples has ", given, " numbers for a grid of ", grid.size_a, " by ",
                       grid.size_b, " by ", grid.size_c, "; ", samples, " are right"));
    }
    std::string fields;
    AppendVec3(v1::Grid::kCornerFieldNumber, grid.corner, &fields);
    AppendVec3(v1::Grid::kEdgeAFieldNumber, grid.edge_a, &fields);
    AppendVec3(v1::Grid::kEdgeBFieldNumber, grid.edge_b, &fields);
    AppendVec3(v1::Grid::kEdgeCFieldNumber, grid.edge_c, &fields);
    AppendUnsigned(v1::Grid::kSizeAFieldNumber, grid.size_a, &fields);
    AppendUnsigned(v1::Grid::kSizeBFieldNumber, grid.size_b, &fields);
    AppendUnsigned(v1::Grid::kSizeCFieldNumber, grid.size_c, &fields);
    constexpr v1::ElementType kTypes[] = {v1::ELEMENT_TYPE_F32, v1::ELEMENT_TYPE_U16,
                                          v1::ELEMENT_TYPE_U8};
    AppendUnsigned(v1::Grid::kTypeFieldNumber,
                   colors ? v1::ELEMENT_TYPE_RGBA8 : kTypes[grid.samples.index()], &fields);
    AppendUnsigned(v1::Grid::kFilterFieldNumber, AfterUnspecified(grid.filter), &fields);
    Rope rope(std::move(fields));
    std::visit(
        [&](const auto& array) {
          AppendPayload(v1::Grid::kSamplesFieldNumber, v1::Grid::kSamplesInFieldNumber, array,
                        &rope);
        },
        grid.samples);
    return rope;
  }

  absl::StatusOr<Rope> OverVertices(const Vertices& vertices, int vertices_field,
                                    const std::string& fields, int primitive_field) const {
    absl::StatusOr<Rope> encoded = EncodeVertices(vertices);
    if (!encoded.ok()) return encoded.status();
    return Wrap(before, primitive_field, Wrap(fields, vertices_field, *std::move(encoded)));
  }
};

Rope EncodeUpsert(const UpsertOperation& upsert) {
  std::string key, fields;
  AppendBytes(v1::Upsert::kLayerFieldNumber, upsert.layer, &key);
  AppendBytes(v1::Upsert::kIdFieldNumber, upsert.id, &key);
  if (upsert.transform != Affine())
    AppendAffine(v1::Entity::kTransformFieldNumber, upsert.transform, &fields);
  AppendUnsigned(v1::Entity::kPriorityFieldNumber, upsert.priority, &fields);
  AppendUnsigned(v1::Entity::kEraseFieldNumber, upsert.erase ? 1 : 0, &fields);
  AppendSigned(v1::Entity::kLifetimeNsFieldNumber, upsert.lifetime_ns, &fields);
  AppendBytes(v1::Entity::kLabelFieldNumber, upsert.label, &fields);
  return Wrap(key, v1::Upsert::kEntityFieldNumber,
              Wrap(fields, v1::Entity::kPrimitiveFieldNumber, upsert.primitive));
}

Rope Request(int field, std::string fields) { return Wrap("", field, Rope(std::move(fields))); }

struct OperationEncoder {
  Rope operator()(const UpsertOperation& upsert) const {
    return Wrap("", StreamRequest::kUpsertFieldNumber, EncodeUpsert(upsert));
  }
  Rope operator()(const DeleteOperation& removal) const {
    std::string fields;
    AppendBytes(v1::Delete::kLayerFieldNumber, removal.layer, &fields);
    switch (removal.what) {
      case DeleteOperation::What::kId:
        AppendPresentBytes(v1::Delete::kIdFieldNumber, removal.text, &fields);
        break;
      case DeleteOperation::What::kPrefix:
        AppendPresentBytes(v1::Delete::kPrefixFieldNumber, removal.text, &fields);
        break;
      case DeleteOperation::What::kLayer:
        AppendPresentUnsigned(v1::Delete::kAllOfLayerFieldNumber, 1, &fields);
        break;
      case DeleteOperation::What::kAllMine:
        AppendPresentUnsigned(v1::Delete::kAllMineFieldNumber, 1, &fields);
        break;
    }
    return Request(StreamRequest::kDeleteFieldNumber, std::move(fields));
  }
  Rope operator()(const TransformOperation& move) const {
    std::string fields;
    AppendBytes(v1::SetTransform::kLayerFieldNumber, move.layer, &fields);
    AppendBytes(v1::SetTransform::kIdFieldNumber, move.id, &fields);
    AppendAffine(v1::SetTransform::kTransformFieldNumber, move.transform, &fields);
    return Request(StreamRequest::kSetTransformFieldNumber, std::move(fields));
  }
  Rope operator()(const LayerOperation& layer) const {
    const LayerLook& look = layer.look;
    std::string fields;
    AppendBytes(v1::LayerState::kLayerFieldNumber, layer.layer, &fields);
    if (look.visible)
      AppendPresentUnsigned(v1::LayerState::kVisibleFieldNumber, *look.visible ? 1 : 0, &fields);
    if (look.opacity)
      AppendPresentUnsigned(v1::LayerState::kOpacityFieldNumber, *look.opacity, &fields);
    if (look.order) AppendPresentZigzag(v1::LayerState::kOrderFieldNumber, *look.order, &fields);
    if (look.blend)
      AppendUnsigned(v1::LayerState::kBlendFieldNumber, AfterUnspecified(*look.blend), &fields);
    if (look.transform)
      AppendAffine(v1::LayerState::kTransformFieldNumber, *look.transform, &fields);
    if (look.clip) {
      AppendClip(v1::LayerState::kClipFieldNumber, *look.clip, &fields);
    }
    if (look.region) {
      std::string corners;
      if (!look.region->everything) {
        AppendVec3(v1::Box3::kMinFieldNumber, look.region->min, &corners);
        AppendVec3(v1::Box3::kMaxFieldNumber, look.region->max, &corners);
      }
      AppendPresentBytes(v1::LayerState::kRegionFieldNumber, corners, &fields);
    }
    if (look.mask) AppendPresentBytes(v1::LayerState::kMaskLayerFieldNumber, *look.mask, &fields);
    return Request(StreamRequest::kLayerStateFieldNumber, std::move(fields));
  }
  Rope operator()(const DefineOperation& define) const {
    std::string fields;
    AppendBytes(v1::DefineObject::kObjectFieldNumber, define.object, &fields);
    return Wrap("", StreamRequest::kDefineObjectFieldNumber,
                Wrap(fields, v1::DefineObject::kDefinitionFieldNumber, define.definition));
  }
  Rope operator()(const RemoveObjectOperation& remove) const {
    std::string fields;
    AppendBytes(v1::DeleteObject::kObjectFieldNumber, remove.object, &fields);
    AppendUnsigned(v1::DeleteObject::kCascadeFieldNumber, remove.cascade ? 1 : 0, &fields);
    return Request(StreamRequest::kDeleteObjectFieldNumber, std::move(fields));
  }
  // Frames are encoded as several messages elsewhere.
  Rope operator()(const FrameOperation&) const { return Rope(); }
};

}  // namespace

absl::StatusOr<Rope> EncodePrimitive(const Shape& shape, Color color,
                                     const std::optional<ColorScale>& scale) {
  std::string before;
  // An instance has the colours of its object. Black is present and empty, unlike the default,
  // white.
  if (!std::holds_alternative<Instance>(shape)) {
    std::string rgb;
    AppendFixed32(v1::Color::kRgbFieldNumber, RgbOf(color), &rgb);
    AppendPresentBytes(v1::Primitive::kColorFieldNumber, rgb, &before);
  }
  if (scale.has_value()) {
    if (scale->scalars.asset().has_value()) {
      return absl::InvalidArgumentError(
          "the scalars of a colour scale are an asset; give the numbers themselves");
    }
    AppendPresentBytes(v1::Primitive::kColorScaleFieldNumber, EncodeColorScale(*scale), &before);
  }
  return std::visit(ShapeEncoder{std::move(before)}, shape);
}

absl::StatusOr<DefineOperation> EncodeDefinition(std::string object,
                                                 const std::vector<Part>& parts) {
  DefineOperation define{.object = std::move(object), .definition = {}, .uses = {}};
  for (size_t i = 0; i < parts.size(); ++i) {
    absl::StatusOr<Rope> primitive =
        EncodePrimitive(parts[i].shape, parts[i].color, parts[i].color_scale);
    if (!primitive.ok()) {
      return absl::Status(primitive.status().code(),
                          absl::StrCat("part ", i, " of the object \"", define.object,
                                       "\": ", primitive.status().message()));
    }
    std::string fields;
    if (parts[i].transform != Affine())
      AppendAffine(v1::Object::Part::kTransformFieldNumber, parts[i].transform, &fields);
    define.definition.Append(
        Wrap("", v1::Object::kPartsFieldNumber,
             Wrap(fields, v1::Object::Part::kPrimitiveFieldNumber, *std::move(primitive))));
    if (const auto* instance = std::get_if<Instance>(&parts[i].shape))
      define.uses.push_back(instance->object);
  }
  return define;
}

Rope EncodeOperation(const Operation& operation) {
  return std::visit(OperationEncoder(), operation);
}

Rope EncodeFrameBegin(std::string_view layer) {
  std::string fields;
  AppendBytes(v1::FrameBegin::kLayerFieldNumber, layer, &fields);
  return Request(StreamRequest::kFrameBeginFieldNumber, std::move(fields));
}

Rope EncodeFrameEnd(std::string_view layer) {
  std::string fields;
  AppendBytes(v1::FrameEnd::kLayerFieldNumber, layer, &fields);
  return Request(StreamRequest::kFrameEndFieldNumber, std::move(fields));
}

void Batcher::Add(const UpsertOperation& upsert) {
  const Rope encoded = Wrap("", Batch::kUpsertsFieldNumber, EncodeUpsert(upsert));
  // Equal hashes of two entities only cost an extra message.
  const std::hash<std::string_view> hash;
  const size_t entity = hash(upsert.layer) * 31 + hash(upsert.id);
  const bool fits = open_.size() + encoded.size() <= most_bytes_ && !entities_.contains(entity);
  if (upserts_ > 0 && !fits) Flush();
  open_.Append(encoded);
  entities_.insert(entity);
  ++upserts_;
}

void Batcher::Flush() {
  if (upserts_ == 0) return;
  messages_.push_back({Wrap("", StreamRequest::kBatchFieldNumber, std::exchange(open_, Rope())),
                       std::exchange(upserts_, 0)});
  entities_.clear();
}

std::vector<Batcher::Message> Batcher::Take() {
  Flush();
  return std::exchange(messages_, {});
}

Rope EncodeCommit(const CommitRecord& commit) {
  std::string fields;
  AppendUnsigned(v1::Commit::kFrameIdFieldNumber, commit.frame_id, &fields);
  AppendSigned(v1::Commit::kSendTimeNsFieldNumber, commit.send_time_ns, &fields);
  AppendSigned(v1::Commit::kPresentAtNsFieldNumber, commit.present_at_ns, &fields);
  AppendUnsigned(v1::Commit::kMustShowFieldNumber, commit.must_show ? 1 : 0, &fields);
  AppendUnsigned(v1::Commit::kDurableFieldNumber, commit.durable ? 1 : 0, &fields);
  AppendUnsigned(v1::Commit::kClientDropsFieldNumber, commit.client_drops, &fields);
  return Request(StreamRequest::kCommitFieldNumber, std::move(fields));
}

Rope EncodePing(int64_t client_time_ns) {
  std::string fields;
  AppendSigned(v1::Ping::kClientTimeNsFieldNumber, client_time_ns, &fields);
  return Request(StreamRequest::kPingFieldNumber, std::move(fields));
}

void AddSequence(uint64_t sequence, Rope* request) {
  std::string field;
  AppendUnsigned(StreamRequest::kSequenceFieldNumber, sequence, &field);
  request->Prepend(field);
}

}  // namespace voxeld::client
