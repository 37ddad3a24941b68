#include "tools/voxelctl/scene/pack.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/pictures/picture.h"
#include "tools/voxelctl/scene/paint.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kPieceBytes = 512 << 10;
// Approximate size of a part that draws another object.
constexpr uint64_t kInstanceBytes = 32;
constexpr uint64_t kPlaceBytes = 2 * sizeof(float);  // of a vertex's texture coordinates
constexpr uint64_t kVertexBytes = 3 * sizeof(float) + 3;
constexpr uint32_t kMostPictureSide = 4096;        // that every server accepts
constexpr uint64_t kMostTexturedBytes = 16 << 20;  // of a piece with a picture
constexpr uint64_t kMostPictureBytes = 4 << 20;    // that is sent with each piece
constexpr uint32_t kU16Vertices = 65536;           // that 16-bit indices can address
constexpr uint32_t kNone = UINT32_MAX;

// 0 means that the server gave no limit.
uint64_t AtMost(uint64_t wanted, uint64_t limit) {
  return limit == 0 ? wanted : std::min(wanted, limit);
}

// The maximum for the bulk of a message; 0 if the server gave no limit.
uint64_t MessageBytes(const client::Limits& limits) {
  return limits.max_message_bytes > 2 * kMessageOverhead
             ? limits.max_message_bytes - kMessageOverhead
             : limits.max_message_bytes;
}

// Collects elements of one kind until a piece is full.
class Piece {
 public:
  Piece(Kind kind, const client::Limits& limits)
      : kind_(kind),
        most_message_bytes_(AtMost(kMostTexturedBytes, MessageBytes(limits))),
        most_bytes_(AtMost(kPieceBytes, most_message_bytes_)),
        most_vertices_(AtMost(kU16Vertices, limits.max_vertices_per_entity)),
        most_indices_(AtMost(UINT32_MAX, limits.max_indices_per_entity)) {}

  Kind kind() const { return kind_; }
  // Sets properties of the whole piece; a piece is flushed before these change. `picture` is null,
  // or outlives the piece.
  void SetLook(double thickness, const std::string* picture) {
    thickness_ = thickness;
    picture_ = picture;
  }
  bool HasLook(double thickness, const std::string* picture) const {
    return thickness_ == thickness && picture_ == picture;
  }
  bool empty() const { return count_ == 0; }
  uint64_t vertices() const { return count_; }
  uint64_t indices() const { return index_count_; }

  // Returns whether an element of up to `corners` new vertices still fits.
  bool HasRoom(uint32_t corners) const {
    return count_ + corners <= most_vertices_ && index_count_ + corners <= most_indices_ &&
           bytes() + corners * (kVertexBytes + kPlaceBytes + sizeof(uint16_t)) <= MostBytes();
  }

  void AddPlace(const std::array<float, 2>& place) {
    places_.insert(places_.end(), place.begin(), place.end());
  }

  uint32_t AddVertex(const Point3& p, const Rgb& c) {
    positions_.insert(positions_.end(),
                      {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    colors_.insert(colors_.end(), {c.r, c.g, c.b});
    return count_++;
  }

  void AddIndex(uint32_t index) {
    indices_.push_back(static_cast<uint16_t>(index));
    ++index_count_;
  }

  uint64_t bytes() const {
    return positions_.size() * sizeof(float) + colors_.size() + indices_.size() * sizeof(uint16_t) +
           places_.size() * sizeof(float) + (picture_ == nullptr ? 0 : picture_->size());
  }

  // Returns the piece as a shape and empties it.
  client::Shape Take() {
    client::Vertices vertices{.positions = std::exchange(positions_, {}),
                              .colors = std::exchange(colors_, {}),
                              .indices = {},
                              .short_indices = std::exchange(indices_, {})};
    count_ = index_count_ = 0;
    switch (kind_) {
      case Kind::kPoints:
        return client::Points{.vertices = std::move(vertices), .thickness = ToThickness()};
      case Kind::kSegments:
        return client::Segments{.vertices = std::move(vertices), .thickness = ToThickness()};
      case Kind::kTriangles:
        break;
    }
    client::Mesh mesh{.vertices = std::move(vertices)};
    if (picture_ != nullptr) {
      mesh.texture =
          client::Texture{.picture = std::vector<uint8_t>(picture_->begin(), picture_->end()),
                          .coordinates = std::exchange(places_, {})};
    }
    return mesh;
  }

 private:
  // A picture is sent with each piece, so there should be few pieces.
  uint64_t MostBytes() const { return picture_ == nullptr ? most_bytes_ : most_message_bytes_; }

  client::Thickness ToThickness() const {
    if (thickness_ == 0) return {};
    return {static_cast<float>(thickness_), client::Thickness::Unit::kUnits};
  }

  const Kind kind_;
  double thickness_ = 0;
  const std::string* picture_ = nullptr;
  const uint64_t most_message_bytes_, most_bytes_, most_vertices_, most_indices_;
  uint32_t count_ = 0, index_count_ = 0;
  std::vector<float> positions_;
  std::vector<uint8_t> colors_;
  std::vector<uint16_t> indices_;
  std::vector<float> places_;  // texture coordinates
};

class Packer {
 public:
  Packer(const std::string& object, const client::Limits& limits, const ObjectSink& sink)
      : object_(object), limits_(limits), sink_(sink) {}

  // `picture` is that of the part, or null.
  absl::Status Add(const Part& part, const std::string* picture, Piece* piece) {
    const size_t corners = part.kind == Kind::kPoints ? 1 : part.kind == Kind::kSegments ? 2 : 3;
    const size_t elements =
        part.kind == Kind::kPoints ? part.positions.size() : part.indices.size() / corners;
    if (!piece->HasLook(part.thickness, picture)) {
      if (absl::Status status = Flush(piece); !status.ok()) return status;
      piece->SetLook(part.thickness, picture);
    }
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
          if (picture != nullptr) piece->AddPlace(part.texture_coordinates[vertex]);
          used.push_back(vertex);
        }
        if (corners > 1) piece->AddIndex(in_piece[vertex]);
      }
    }
    return absl::OkStatus();
  }

  absl::Status AddVolume(const SampledVolume& volume, const VolumeLook& look,
                         const AssetSink& upload) {
    absl::StatusOr<PackedVolume> packed = PackVolume(volume, look, limits_, upload);
    if (!packed.ok()) return packed.status();
    sizes_.samples += packed->samples;
    if (sizes_.note.empty()) sizes_.note = packed->note;
    return DefinePiece(std::move(packed->part), packed->bytes);
  }

  // Keeps only the first note.
  void Note(absl::string_view note) {
    if (sizes_.note.empty()) sizes_.note = std::string(note);
  }

  absl::Status Flush(Piece* piece) {
    if (piece->empty()) return absl::OkStatus();
    sizes_.vertices += piece->vertices();
    sizes_.indices += piece->indices();
    const uint64_t bytes = piece->bytes();
    return DefinePiece({.shape = piece->Take(), .color = {}, .transform = {}}, bytes);
  }

  absl::StatusOr<PackedSizes> Finish() {
    const uint64_t bytes = root_.size() * (object_.size() + kInstanceBytes);
    const absl::Status status = Define(object_, std::move(root_), bytes);
    if (!status.ok()) return status;
    return sizes_;
  }

 private:
  absl::Status DefinePiece(client::Part part, uint64_t bytes) {
    const uint64_t most_parts = AtMost(UINT64_MAX, limits_.max_parts_per_object);
    if (root_.size() >= most_parts) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the model needs over ", most_parts,
                       " pieces, which is the server's max_parts_per_object"));
    }
    const std::string name = absl::StrCat(object_, "/", root_.size());
    std::vector<client::Part> definition;
    definition.push_back(std::move(part));
    root_.push_back({.shape = client::Instance{name}, .color = {}, .transform = {}});
    return Define(name, std::move(definition), bytes);
  }

  absl::Status Define(const std::string& name, std::vector<client::Part> parts, uint64_t bytes) {
    ++sizes_.objects;
    sizes_.bytes += bytes;
    return sink_(name, std::move(parts), bytes);
  }

  const std::string& object_;
  const client::Limits& limits_;
  const ObjectSink& sink_;
  std::vector<client::Part> root_;
  PackedSizes sizes_;
};

// Returns whether a part is sent to the server with its picture. Lines and points have none, and a
// message has space for only some pictures.
bool IsSentWithPicture(const Part& part, const Model& model, const client::Limits& limits) {
  if (part.picture == kNoPicture || part.kind != Kind::kTriangles) return false;
  const std::string& picture = model.pictures[part.picture];
  const absl::StatusOr<pictures::PictureFile> file = pictures::PictureFile::Open(picture);
  return file.ok() && std::max(file->size().width, file->size().height) <= kMostPictureSide &&
         picture.size() <= AtMost(kMostPictureBytes, MessageBytes(limits) / 2);
}

}  // namespace

absl::StatusOr<PackedSizes> PackObject(const Model& model, const std::string& object,
                                       const client::Limits& limits, const ObjectSink& sink,
                                       const VolumeLook& look, const AssetSink& upload) {
  Packer packer(object, limits, sink);
  for (const Kind kind : {Kind::kTriangles, Kind::kSegments, Kind::kPoints}) {
    Piece piece(kind, limits);
    if (!piece.HasRoom(3)) {
      return absl::ResourceExhaustedError(
          "the server's limits leave no room for a triangle in an entity");
    }
    for (const Part& part : model.parts) {
      if (part.kind != kind) continue;
      absl::Status status;
      if (IsSentWithPicture(part, model, limits)) {
        status = packer.Add(part, &model.pictures[part.picture], &piece);
      } else if (part.picture == kNoPicture) {
        status = packer.Add(part, nullptr, &piece);
      } else {
        absl::StatusOr<Part> painted = PaintVertices(part, model.pictures[part.picture]);
        packer.Note(painted.ok() ? "a picture is shown by its colours at the vertices alone"
                                 : painted.status().message());
        status = packer.Add(painted.ok() ? *painted : part, nullptr, &piece);
      }
      if (!status.ok()) return status;
    }
    const absl::Status status = packer.Flush(&piece);
    if (!status.ok()) return status;
  }
  for (const SampledVolume& volume : model.volumes) {
    const absl::Status status = packer.AddVolume(volume, look, upload);
    if (!status.ok()) return status;
  }
  return packer.Finish();
}

}  // namespace voxeld::voxelctl
