#include "tools/markers/markers.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "common/json/json_depth.h"

namespace voxeld::markers {
namespace {

using client::Affine;
using client::Color;
using client::Vec3;

uint8_t Byte(double value) {
  return static_cast<uint8_t>(
      std::lround(std::clamp(std::isnan(value) ? 0 : value, 0.0, 1.0) * 255));
}

Color ColorOf(const foxglove::Color& in) {
  return {Byte(in.r() * in.a()), Byte(in.g() * in.a()), Byte(in.b() * in.a())};
}

Affine PoseOf(const foxglove::Pose& pose) {
  double x = pose.orientation().x(), y = pose.orientation().y(), z = pose.orientation().z(),
         w = pose.orientation().w();
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  if (length > 0) {
    x /= length, y /= length, z /= length, w /= length;
  } else {
    w = 1;  // it was not given
  }
  const foxglove::Vector3& p = pose.position();
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), p.x(),
           2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), p.y(),
           2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), p.z()}};
}

std::vector<float> PositionsOf(const google::protobuf::RepeatedPtrField<foxglove::Point3>& points) {
  std::vector<float> out;
  out.reserve(static_cast<size_t>(points.size()) * 3);
  for (const foxglove::Point3& p : points) {
    for (const double value : {p.x(), p.y(), p.z()}) out.push_back(static_cast<float>(value));
  }
  return out;
}

// Returns one colour per point, or none: then one colour is used for all.
std::vector<uint8_t> ColorsOf(const google::protobuf::RepeatedPtrField<foxglove::Color>& colors,
                              int points) {
  std::vector<uint8_t> out;
  if (colors.empty() || colors.size() != points) return out;
  for (const foxglove::Color& in : colors) {
    const Color color = ColorOf(in);
    out.insert(out.end(), {color.r, color.g, color.b});
  }
  return out;
}

// Returns whether there are colours but not one per point, which is an error of the sender.
bool HasOddColors(const auto& primitive) {
  return !primitive.colors().empty() && primitive.colors_size() != primitive.points_size();
}

client::Vertices VerticesOf(const auto& primitive) {
  client::Vertices vertices;
  vertices.positions = PositionsOf(primitive.points());
  vertices.colors = ColorsOf(primitive.colors(), primitive.points_size());
  vertices.indices = std::vector<uint32_t>(primitive.indices().begin(), primitive.indices().end());
  return vertices;
}

class Maker {
 public:
  explicit Maker(const foxglove::SceneEntity& entity) {
    if (entity.has_lifetime()) {
      constexpr int64_t kMostSeconds = int64_t{1} << 32;
      lifetime_ =
          std::chrono::seconds(std::clamp<int64_t>(entity.lifetime().seconds(), 0, kMostSeconds)) +
          std::chrono::nanoseconds(std::clamp(entity.lifetime().nanos(), 0, 999'999'999));
    }
    for (const auto& arrow : entity.arrows()) Arrow(arrow);
    for (const auto& cube : entity.cubes()) Cube(cube);
    for (const auto& sphere : entity.spheres()) Sphere(sphere);
    for (const auto& cylinder : entity.cylinders()) Cylinder(cylinder);
    for (const auto& line : entity.lines()) Line(line);
    for (const auto& triangles : entity.triangles()) Triangles(triangles);
    for (const auto& text : entity.texts()) Text(text);
    if (entity.models_size() > 0) left_out_.emplace_back("models");
    const auto is_odd = [](const auto& primitive) { return HasOddColors(primitive); };
    if (std::any_of(entity.lines().begin(), entity.lines().end(), is_odd) ||
        std::any_of(entity.triangles().begin(), entity.triangles().end(), is_odd)) {
      left_out_.emplace_back("colors that are not as many as their points");
    }
  }

  Pieces Take() { return {std::move(pieces_), absl::StrJoin(left_out_, ", ")}; }

 private:
  void Add(client::Shape shape, const Affine& transform, const foxglove::Color& color) {
    Piece piece{std::move(shape), {}};
    piece.look.color = ColorOf(color);
    piece.look.transform = transform;
    piece.look.lifetime = lifetime_;
    pieces_.push_back(std::move(piece));
  }

  void Arrow(const foxglove::ArrowPrimitive& in) {
    const double length = in.shaft_length() + in.head_length();
    if (!(length > 0)) return;
    Add(client::Arrow{.start = {},
                      .end = {length, 0, 0},
                      .shaft_radius = in.shaft_diameter() / 2,
                      .head_length = in.head_length(),
                      .head_radius = in.head_diameter() / 2},
        PoseOf(in.pose()), in.color());
  }
  void Cube(const foxglove::CubePrimitive& in) {
    Add(client::Box{.size = {in.size().x(), in.size().y(), in.size().z()}}, PoseOf(in.pose()),
        in.color());
  }
  void Sphere(const foxglove::SpherePrimitive& in) {
    if (in.size().x() == in.size().y() && in.size().y() == in.size().z()) {
      return Add(client::Sphere{.radius = in.size().x() / 2}, PoseOf(in.pose()), in.color());
    }
    Add(client::Ellipsoid{.radii = {in.size().x() / 2, in.size().y() / 2, in.size().z() / 2}},
        PoseOf(in.pose()), in.color());
  }
  void Cylinder(const foxglove::CylinderPrimitive& in) {
    const Vec3 size{in.size().x(), in.size().y(), in.size().z()};
    if (!(size.x > 0 && size.y > 0 && size.z > 0)) return;
    Add(client::Cone{.start = {0, 0, -0.5},
                     .end = {0, 0, 0.5},
                     .start_radius = in.bottom_scale() / 2,
                     .end_radius = in.top_scale() / 2},
        PoseOf(in.pose()) * Affine::Scale(size), in.color());
  }
  void Line(const foxglove::LinePrimitive& in) {
    if (in.points().empty()) return;
    client::Segments segments;
    segments.vertices = VerticesOf(in);
    segments.topology =
        in.type() == foxglove::LinePrimitive::LINE_LOOP   ? client::Segments::Topology::kLoop
        : in.type() == foxglove::LinePrimitive::LINE_LIST ? client::Segments::Topology::kList
                                                          : client::Segments::Topology::kStrip;
    // The thickness is in a viewer's pixels, so the line is as thin as possible here.
    if (!in.scale_invariant()) {
      segments.thickness = {static_cast<float>(in.thickness()), client::Thickness::Unit::kUnits};
    }
    Add(std::move(segments), PoseOf(in.pose()), in.color());
  }
  void Triangles(const foxglove::TriangleListPrimitive& in) {
    if (in.points().empty()) return;
    client::Mesh mesh;
    mesh.vertices = VerticesOf(in);
    Add(std::move(mesh), PoseOf(in.pose()), in.color());
  }
  void Text(const foxglove::TextPrimitive& in) {
    if (in.text().empty()) return;
    client::Text text{.text = in.text(), .alignment = client::Text::Alignment::kCenter};
    if (!in.scale_invariant() && in.font_size() > 0) text.height = in.font_size();
    // A billboard is drawn upright, because there are viewers on all sides.
    if (in.billboard()) {
      const foxglove::Vector3& at = in.pose().position();
      text.facing = {0, -1, 0};
      text.up = Vec3{0, 0, 1};
      return Add(std::move(text), Affine::Translate({at.x(), at.y(), at.z()}), in.color());
    }
    Add(std::move(text), PoseOf(in.pose()), in.color());
  }

  std::chrono::nanoseconds lifetime_{0};
  std::vector<Piece> pieces_;
  std::vector<std::string> left_out_;
};

using Json = nlohmann::json;

// Such JSON encodes times as objects of seconds and nanoseconds; they become texts that protobuf
// can read.
void MendTimes(Json& value) {
  if (value.is_array()) {
    for (Json& one : value) MendTimes(one);
  }
  if (!value.is_object()) return;
  for (auto& [key, inside] : value.items()) {
    const bool is_time = key == "timestamp", is_duration = key == "lifetime";
    if (!(is_time || is_duration) || !inside.is_object()) {
      MendTimes(inside);
      continue;
    }
    const auto part = [&](const char* name) {
      const auto at = inside.find(name);
      return at != inside.end() && at->is_number_integer() ? at->get<int64_t>() : int64_t{0};
    };
    const int64_t seconds = part("sec"), nanos = part("nsec");
    if (is_duration) {
      inside = absl::StrCat(seconds, ".", absl::Dec(nanos, absl::kZeroPad9), "s");
    } else {
      inside = absl::FormatTime("%Y-%m-%dT%H:%M:%E9SZ",
                                absl::FromUnixSeconds(seconds) + absl::Nanoseconds(nanos),
                                absl::UTCTimeZone());
    }
  }
}

absl::Status CheckSize(const foxglove::SceneUpdate& update) {
  int64_t pieces = 0;
  for (const foxglove::SceneEntity& entity : update.entities()) pieces += CountPieces(entity);
  if (pieces <= kMostPieces) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      "an update has ", pieces, " entities and pieces of them; ", kMostPieces, " are the most"));
}

}  // namespace

int64_t CountPieces(const foxglove::SceneEntity& entity) {
  return int64_t{1} + entity.arrows_size() + entity.cubes_size() + entity.spheres_size() +
         entity.cylinders_size() + entity.lines_size() + entity.triangles_size() +
         entity.texts_size();
}

Pieces PiecesOf(const foxglove::SceneEntity& entity) { return Maker(entity).Take(); }

absl::StatusOr<foxglove::SceneUpdate> ParseSceneUpdate(std::string_view bytes, Encoding encoding) {
  foxglove::SceneUpdate update;
  if (encoding == Encoding::kProtobuf) {
    if (bytes.size() > INT32_MAX ||
        !update.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
      return absl::InvalidArgumentError(
          absl::StrCat("a message of ", bytes.size(), " bytes is no foxglove.SceneUpdate"));
    }
    if (absl::Status status = CheckSize(update); !status.ok()) return status;
    return update;
  }
  if (const int depth = JsonDepth(bytes); depth > kMaxJsonDepth) {
    return absl::InvalidArgumentError(
        absl::StrCat("a message of JSON is ", depth, " deep; ", kMaxJsonDepth, " is the most"));
  }
  Json json = Json::parse(bytes, nullptr, false);
  if (!json.is_object()) {
    return absl::InvalidArgumentError("a message is no JSON object, as a foxglove.SceneUpdate is");
  }
  MendTimes(json);
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  const auto parsed = google::protobuf::util::JsonStringToMessage(
      json.dump(-1, ' ', false, Json::error_handler_t::replace), &update, options);
  if (!parsed.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("a message is no foxglove.SceneUpdate: ", std::string(parsed.message())));
  }
  if (absl::Status status = CheckSize(update); !status.ok()) return status;
  return update;
}

}  // namespace voxeld::markers
