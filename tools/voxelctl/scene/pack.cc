#include "tools/voxelctl/scene/pack.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

static_assert(std::endian::native == std::endian::little, "payloads are little-endian");

constexpr uint64_t kPieceBytes = 512 << 10;
constexpr uint64_t kMessageOverhead = 4096;
constexpr uint64_t kVertexBytes = 3 * sizeof(float) + 3;
constexpr uint32_t kU16Vertices = 65536;  // of which 16-bit indices can speak
constexpr uint32_t kNone = UINT32_MAX;

// 0 means that the server did not say.
uint64_t AtMost(uint64_t wanted, uint64_t limit) {
  return limit == 0 ? wanted : std::min(wanted, limit);
}

// Gathers elements of one kind until a piece is full.
class Piece {
 public:
  Piece(Kind kind, const v1::Limits& limits)
      : kind_(kind),
        most_bytes_(AtMost(kPieceBytes, limits.max_message_bytes() > 2 * kMessageOverhead
                                            ? limits.max_message_bytes() - kMessageOverhead
                                            : limits.max_message_bytes())),
        most_vertices_(AtMost(kU16Vertices, limits.max_vertices_per_entity())),
        most_indices_(AtMost(UINT32_MAX, limits.max_indices_per_entity())) {}

  Kind kind() const { return kind_; }
  bool empty() const { return count_ == 0; }
  uint64_t vertices() const { return count_; }
  uint64_t indices() const { return index_count_; }

  // Whether an element of `corners` new vertices at most still fits.
  bool HasRoom(uint32_t corners) const {
    const uint64_t bytes = positions_.size() + colors_.size() + indices_.size();
    return count_ + corners <= most_vertices_ && index_count_ + corners <= most_indices_ &&
           bytes + corners * (kVertexBytes + sizeof(uint16_t)) <= most_bytes_;
  }

  uint32_t AddVertex(const Point3& p, const Rgb& c) {
    const float xyz[3] = {static_cast<float>(p.x), static_cast<float>(p.y),
                          static_cast<float>(p.z)};
    char bytes[sizeof xyz];
    std::memcpy(bytes, xyz, sizeof xyz);
    positions_.append(bytes, sizeof bytes);
    colors_.append({static_cast<char>(c.r), static_cast<char>(c.g), static_cast<char>(c.b)});
    return count_++;
  }

  void AddIndex(uint32_t index) {
    indices_.append({static_cast<char>(index & 0xff), static_cast<char>(index >> 8)});
    ++index_count_;
  }

  // The piece as a primitive; leaves this one empty.
  v1::Primitive Take() {
    v1::Primitive primitive;
    v1::Vertices* vertices = nullptr;
    switch (kind_) {
      case Kind::kPoints:
        vertices = primitive.mutable_points()->mutable_vertices();
        break;
      case Kind::kSegments:
        vertices = primitive.mutable_segments()->mutable_vertices();
        break;
      case Kind::kTriangles:
        vertices = primitive.mutable_mesh()->mutable_vertices();
        break;
    }
    vertices->set_count(count_);
    vertices->set_position_type(v1::ELEMENT_TYPE_F32);
    vertices->set_color_type(v1::ELEMENT_TYPE_RGB8);
    vertices->set_positions(std::exchange(positions_, {}));
    vertices->set_colors(std::exchange(colors_, {}));
    if (index_count_ > 0) {
      vertices->set_index_type(v1::ELEMENT_TYPE_U16);
      vertices->set_index_count(index_count_);
      vertices->set_indices(std::exchange(indices_, {}));
    }
    count_ = index_count_ = 0;
    return primitive;
  }

 private:
  const Kind kind_;
  const uint64_t most_bytes_, most_vertices_, most_indices_;
  uint32_t count_ = 0, index_count_ = 0;
  std::string positions_, colors_, indices_;
};

class Packer {
 public:
  Packer(const std::string& object, const v1::Limits& limits, const RequestSink& sink)
      : object_(object), limits_(limits), sink_(sink) {}

  absl::Status Add(const Part& part, Piece* piece) {
    const size_t corners = part.kind == Kind::kPoints ? 1 : part.kind == Kind::kSegments ? 2 : 3;
    const size_t elements =
        part.kind == Kind::kPoints ? part.positions.size() : part.indices.size() / corners;
    std::vector<uint32_t> in_piece(part.positions.size(), kNone);
    std::vector<uint32_t> used;
    for (size_t e = 0; e < elements; ++e) {
      if (!piece->HasRoom(static_cast<uint32_t>(corners))) {
        absl::Status status = Flush(piece);
        if (!status.ok()) return status;
        for (const uint32_t vertex : used) in_piece[vertex] = kNone;
        used.clear();
      }
      for (size_t c = 0; c < corners; ++c) {
        const uint32_t vertex =
            corners == 1 ? static_cast<uint32_t>(e) : part.indices[e * corners + c];
        if (in_piece[vertex] == kNone) {
          in_piece[vertex] = piece->AddVertex(part.positions[vertex], part.colors[vertex]);
          used.push_back(vertex);
        }
        if (corners > 1) piece->AddIndex(in_piece[vertex]);
      }
    }
    return absl::OkStatus();
  }

  absl::Status Flush(Piece* piece) {
    if (piece->empty()) return absl::OkStatus();
    const uint64_t most_parts = AtMost(UINT64_MAX, limits_.max_parts_per_object());
    if (static_cast<uint64_t>(root_.parts_size()) >= most_parts) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the model needs over ", most_parts,
                       " pieces, which is the server's max_parts_per_object"));
    }
    sizes_.vertices += piece->vertices();
    sizes_.indices += piece->indices();
    const std::string name = absl::StrCat(object_, "/", root_.parts_size());
    v1::Object definition;
    *definition.add_parts()->mutable_primitive() = piece->Take();
    root_.add_parts()->mutable_primitive()->mutable_instance()->set_object(name);
    return Define(name, std::move(definition));
  }

  absl::StatusOr<PackedSizes> Finish() {
    const absl::Status status = Define(object_, std::move(root_));
    if (!status.ok()) return status;
    return sizes_;
  }

 private:
  absl::Status Define(const std::string& name, v1::Object definition) {
    v1::StreamRequest request;
    request.mutable_define_object()->set_object(name);
    *request.mutable_define_object()->mutable_definition() = std::move(definition);
    ++sizes_.objects;
    sizes_.bytes += request.ByteSizeLong();
    return sink_(std::move(request));
  }

  const std::string& object_;
  const v1::Limits& limits_;
  const RequestSink& sink_;
  v1::Object root_;
  PackedSizes sizes_;
};

void SetAffine(const gpu::Affine& transform, v1::Affine* out) {
  for (const double value : transform.m) out->add_m(value);
}

}  // namespace

absl::StatusOr<PackedSizes> PackObject(const Model& model, const std::string& object,
                                       const v1::Limits& limits, const RequestSink& sink) {
  Packer packer(object, limits, sink);
  for (const Kind kind : {Kind::kTriangles, Kind::kSegments, Kind::kPoints}) {
    Piece piece(kind, limits);
    if (!piece.HasRoom(3)) {
      return absl::ResourceExhaustedError(
          "the server's limits leave no room for a triangle in an entity");
    }
    for (const Part& part : model.parts) {
      if (part.kind != kind) continue;
      const absl::Status status = packer.Add(part, &piece);
      if (!status.ok()) return status;
    }
    const absl::Status status = packer.Flush(&piece);
    if (!status.ok()) return status;
  }
  return packer.Finish();
}

v1::StreamRequest InstanceRequest(const std::string& layer, const std::string& id,
                                  const std::string& object, const std::string& label,
                                  const gpu::Affine& transform) {
  v1::StreamRequest request;
  v1::Upsert* upsert = request.mutable_upsert();
  upsert->set_layer(layer);
  upsert->set_id(id);
  upsert->mutable_entity()->mutable_primitive()->mutable_instance()->set_object(object);
  upsert->mutable_entity()->set_label(label);
  SetAffine(transform, upsert->mutable_entity()->mutable_transform());
  return request;
}

v1::StreamRequest TransformRequest(const std::string& layer, const std::string& id,
                                   const gpu::Affine& transform) {
  v1::StreamRequest request;
  request.mutable_set_transform()->set_layer(layer);
  request.mutable_set_transform()->set_id(id);
  SetAffine(transform, request.mutable_set_transform()->mutable_transform());
  return request;
}

}  // namespace voxeld::voxelctl
