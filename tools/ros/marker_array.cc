#include "tools/ros/marker_array.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/markers/markers.h"

namespace voxeld::ros1 {
namespace {

constexpr std::array<absl::string_view, 12> kTypes = {
    "ARROW",     "CUBE",        "SPHERE", "CYLINDER",         "LINE_STRIP",    "LINE_LIST",
    "CUBE_LIST", "SPHERE_LIST", "POINTS", "TEXT_VIEW_FACING", "MESH_RESOURCE", "TRIANGLE_LIST"};

// Viewers draw arrows with this head if its size is not given.
constexpr double kHeadOfLength = 0.23, kHeadOfWidth = 2;

absl::string_view View(const auto& text) { return {text.data(), text.size()}; }

struct Vector {
  double x = 0, y = 0, z = 0;
};

struct Turn {
  double x = 0, y = 0, z = 0, w = 1;

  double length() const { return std::sqrt(x * x + y * y + z * z + w * w); }
  Turn Normal() const {
    const double l = length();
    return l > 0 ? Turn{x / l, y / l, z / l, w / l} : Turn();
  }
  // Returns the rotation that applies `other` first, then this one.
  Turn operator*(const Turn& o) const {
    return {w * o.x + x * o.w + y * o.z - z * o.y, w * o.y - x * o.z + y * o.w + z * o.x,
            w * o.z + x * o.y - y * o.x + z * o.w, w * o.w - x * o.x - y * o.y - z * o.z};
  }
  // The quaternion has length 1.
  Vector operator()(const Vector& v) const {
    const Vector c{y * v.z - z * v.y + w * v.x, z * v.x - x * v.z + w * v.y,
                   x * v.y - y * v.x + w * v.z};
    return {v.x + 2 * (y * c.z - z * c.y), v.y + 2 * (z * c.x - x * c.z),
            v.z + 2 * (x * c.y - y * c.x)};
  }
};

// Returns the shortest rotation that turns x to `to`, which may have any length except 0.
Turn FromXTo(const Vector& to) {
  const double length = std::hypot(to.x, to.y, to.z);
  const Turn turn{0, -to.z / length, to.y / length, 1 + to.x / length};
  return turn.length() > 1e-6 ? turn.Normal() : Turn{0, 0, 1, 0};
}

Vector PositionOf(const Marker& marker) {
  const auto& p = marker.pose.position;
  return {p.x, p.y, p.z};
}

Turn TurnOf(const Marker& marker) {
  const auto& q = marker.pose.orientation;
  return Turn{q.x, q.y, q.z, q.w}.Normal();
}

void Set(const Vector& from, auto* to) {
  to->set_x(from.x);
  to->set_y(from.y);
  to->set_z(from.z);
}

void SetPose(const Vector& position, const Turn& turn, foxglove::Pose* to) {
  Set(position, to->mutable_position());
  to->mutable_orientation()->set_x(turn.x);
  to->mutable_orientation()->set_y(turn.y);
  to->mutable_orientation()->set_z(turn.z);
  to->mutable_orientation()->set_w(turn.w);
}

void SetColor(const Color& from, foxglove::Color* to) {
  to->set_r(from.r);
  to->set_g(from.g);
  to->set_b(from.b);
  to->set_a(from.a);
}

// Returns the number of points per colour; 0 if the colours do not match the points.
size_t PointsAColor(const Marker& marker) {
  const size_t points = marker.points.size(), colors = marker.colors.size();
  if (colors == 0) return 0;
  if (colors == points) return 1;
  return marker.type == Marker::TRIANGLE_LIST && colors * 3 == points ? 3 : 0;
}

void SetColors(const Marker& marker, size_t copies, auto* to) {
  SetColor(marker.color, to->mutable_color());
  if (PointsAColor(marker) == 0) return;
  for (const Color& color : marker.colors) {
    for (size_t i = 0; i < copies; ++i) SetColor(color, to->add_colors());
  }
}

void FillArrow(const Marker& marker, foxglove::ArrowPrimitive* arrow) {
  SetColor(marker.color, arrow->mutable_color());
  if (marker.points.empty()) {
    SetPose(PositionOf(marker), TurnOf(marker), arrow->mutable_pose());
    arrow->set_head_length(marker.scale.x * kHeadOfLength);
    arrow->set_shaft_length(marker.scale.x - arrow->head_length());
    arrow->set_shaft_diameter(marker.scale.y);
    arrow->set_head_diameter(marker.scale.y * kHeadOfWidth);
    return;
  }
  const Vector from{marker.points[0].x, marker.points[0].y, marker.points[0].z};
  const Vector along{marker.points[1].x - from.x, marker.points[1].y - from.y,
                     marker.points[1].z - from.z};
  const double length = std::hypot(along.x, along.y, along.z);
  if (length == 0) return;
  const Turn turn = TurnOf(marker);
  const Vector start = turn(from), p = PositionOf(marker);
  SetPose({p.x + start.x, p.y + start.y, p.z + start.z}, turn * FromXTo(along),
          arrow->mutable_pose());
  const double head =
      marker.scale.z == 0 ? kHeadOfLength * length : std::clamp(marker.scale.z, 0.0, length);
  arrow->set_head_length(head);
  arrow->set_shaft_length(length - head);
  arrow->set_shaft_diameter(marker.scale.x);
  arrow->set_head_diameter(marker.scale.y);
}

void FillLine(const Marker& marker, foxglove::LinePrimitive* line) {
  SetPose(PositionOf(marker), TurnOf(marker), line->mutable_pose());
  line->set_type(marker.type == Marker::LINE_STRIP ? foxglove::LinePrimitive::LINE_STRIP
                                                   : foxglove::LinePrimitive::LINE_LIST);
  line->set_thickness(marker.scale.x);
  for (const Point& p : marker.points) Set({p.x, p.y, p.z}, line->add_points());
  SetColors(marker, 1, line);
  if (marker.type != Marker::POINTS) return;
  for (uint32_t i = 0; i < marker.points.size(); ++i) {
    line->add_indices(i);
    line->add_indices(i);
  }
}

void FillTriangles(const Marker& marker, foxglove::TriangleListPrimitive* triangles) {
  SetPose(PositionOf(marker), TurnOf(marker), triangles->mutable_pose());
  const auto& s = marker.scale;
  for (const Point& p : marker.points) {
    Set({p.x * s.x, p.y * s.y, p.z * s.z}, triangles->add_points());
  }
  SetColors(marker, PointsAColor(marker), triangles);
}

// Corner i of a cube has the lesser x, y or z if bit 0, 1 or 2 of i is not set.
void FillCubes(const Marker& marker, foxglove::TriangleListPrimitive* triangles) {
  constexpr std::array<std::array<uint32_t, 4>, 6> kFaces = {
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  SetPose(PositionOf(marker), TurnOf(marker), triangles->mutable_pose());
  const auto& s = marker.scale;
  for (const Point& p : marker.points) {
    const auto first = static_cast<uint32_t>(triangles->points_size());
    for (uint32_t i = 0; i < 8; ++i) {
      const auto half = [i](uint32_t bit, double size) {
        return (i & bit) != 0 ? size / 2 : -size / 2;
      };
      Set({p.x + half(1, s.x), p.y + half(2, s.y), p.z + half(4, s.z)}, triangles->add_points());
    }
    for (const auto& face : kFaces) {
      for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) triangles->add_indices(first + face[i]);
    }
  }
  SetColors(marker, 8, triangles);
}

void FillSpheres(const Marker& marker, foxglove::SceneEntity* entity) {
  const Turn turn = TurnOf(marker);
  const Vector at = PositionOf(marker);
  for (size_t i = 0; i < marker.points.size(); ++i) {
    const Vector p = turn({marker.points[i].x, marker.points[i].y, marker.points[i].z});
    foxglove::SpherePrimitive* sphere = entity->add_spheres();
    SetPose({at.x + p.x, at.y + p.y, at.z + p.z}, turn, sphere->mutable_pose());
    Set({marker.scale.x, marker.scale.y, marker.scale.z}, sphere->mutable_size());
    SetColor(PointsAColor(marker) == 0 ? marker.color : marker.colors[i], sphere->mutable_color());
  }
}

void Fill(const Marker& marker, foxglove::SceneEntity* entity) {
  const Vector scale{marker.scale.x, marker.scale.y, marker.scale.z};
  const auto place = [&](auto* primitive) {
    SetPose(PositionOf(marker), TurnOf(marker), primitive->mutable_pose());
    SetColor(marker.color, primitive->mutable_color());
    return primitive;
  };
  switch (marker.type) {
    case Marker::ARROW:
      return FillArrow(marker, entity->add_arrows());
    case Marker::CUBE:
      return Set(scale, place(entity->add_cubes())->mutable_size());
    case Marker::SPHERE:
      return Set(scale, place(entity->add_spheres())->mutable_size());
    case Marker::CYLINDER: {
      foxglove::CylinderPrimitive* cylinder = place(entity->add_cylinders());
      cylinder->set_bottom_scale(1);
      cylinder->set_top_scale(1);
      return Set(scale, cylinder->mutable_size());
    }
    case Marker::LINE_STRIP:
    case Marker::LINE_LIST:
    case Marker::POINTS:
      return FillLine(marker, entity->add_lines());
    case Marker::CUBE_LIST:
      return FillCubes(marker, entity->add_triangles());
    case Marker::SPHERE_LIST:
      return FillSpheres(marker, entity);
    case Marker::TRIANGLE_LIST:
      return FillTriangles(marker, entity->add_triangles());
    case Marker::TEXT_VIEW_FACING: {
      foxglove::TextPrimitive* text = place(entity->add_texts());
      text->set_billboard(true);
      text->set_font_size(scale.z);
      text->set_text(std::string(View(marker.text)));
      return;
    }
    case Marker::MESH_RESOURCE:
      place(entity->add_models())->set_url(std::string(View(marker.mesh_resource)));
      return;
    default:
      return;
  }
}

bool Finite(const auto&... numbers) { return (std::isfinite(numbers) && ...); }

bool AllFinite(const Marker& marker) {
  const auto& p = marker.pose.position;
  const auto& q = marker.pose.orientation;
  const auto& s = marker.scale;
  const auto color = [](const Color& c) { return Finite(c.r, c.g, c.b, c.a); };
  return Finite(p.x, p.y, p.z, q.x, q.y, q.z, q.w, s.x, s.y, s.z) && color(marker.color) &&
         std::all_of(marker.points.begin(), marker.points.end(),
                     [](const Point& at) { return Finite(at.x, at.y, at.z); }) &&
         std::all_of(marker.colors.begin(), marker.colors.end(), color);
}

// Returns an empty string if nothing is wrong.
std::string WhatIsWrong(const Marker& marker) {
  if (marker.type < 0 || marker.type >= static_cast<int>(kTypes.size())) {
    return absl::StrCat("has type ", marker.type, "; 0 to ", kTypes.size() - 1, " are known");
  }
  if (!AllFinite(marker)) return "has a number that is not finite";
  const auto& q = marker.pose.orientation;
  const double length = Turn{q.x, q.y, q.z, q.w}.length();
  if (length != 0 && std::abs(length - 1) > 0.1) {
    return absl::StrCat("has an orientation of length ", length, "; a quaternion's is 1");
  }
  const size_t points = marker.points.size();
  if (marker.type == Marker::ARROW && points != 0 && points != 2) {
    return absl::StrCat("has ", points, " points; an arrow has 2, or none");
  }
  if (marker.type == Marker::LINE_LIST && points % 2 != 0) {
    return absl::StrCat("has ", points, " points, which is no multiple of 2");
  }
  if (marker.type == Marker::TRIANGLE_LIST && points % 3 != 0) {
    return absl::StrCat("has ", points, " points, which is no multiple of 3");
  }
  if ((marker.type == Marker::CUBE_LIST || marker.type == Marker::SPHERE_LIST) &&
      points >= markers::kMostPieces) {
    return absl::StrCat("has ", points, " points; fewer than ", markers::kMostPieces, " are taken");
  }
  if (marker.lifetime.sec < 0 || marker.lifetime.nsec < 0) {
    return absl::StrCat("has a lifetime of ", marker.lifetime.sec, " s");
  }
  if (!IsUtf8(View(marker.text)) || !IsUtf8(View(marker.mesh_resource))) {
    return "has a text that is not UTF-8";
  }
  return "";
}

absl::Status Wrong(const Marker& marker, absl::string_view what) {
  const bool known = marker.type >= 0 && marker.type < static_cast<int>(kTypes.size());
  return absl::InvalidArgumentError(
      absl::StrCat("marker ", EntityId(marker),
                   known ? absl::StrCat(" (", kTypes[marker.type], ") ") : " ", what));
}

}  // namespace

std::string EntityId(const Marker& marker) { return absl::StrCat(View(marker.ns), "/", marker.id); }

absl::StatusOr<foxglove::SceneEntity> EntityOf(const Marker& marker) {
  if (const std::string wrong = WhatIsWrong(marker); !wrong.empty()) return Wrong(marker, wrong);
  foxglove::SceneEntity entity;
  entity.set_id(EntityId(marker));
  if (marker.lifetime.sec != 0 || marker.lifetime.nsec != 0) {
    entity.mutable_lifetime()->set_seconds(marker.lifetime.sec);
    entity.mutable_lifetime()->set_nanos(marker.lifetime.nsec);
  }
  Fill(marker, &entity);
  return entity;
}

void PendingMarkers::AddMalformed(std::string why) {
  ++malformed_;
  malformed_last_ = std::move(why);
}

void PendingMarkers::Add(const Marker& marker) {
  if (!IsUtf8(View(marker.ns))) {
    return AddMalformed(std::string(Wrong(marker, "has a namespace that is not UTF-8").message()));
  }
  switch (marker.action) {
    case Marker::ADD: {
      absl::StatusOr<foxglove::SceneEntity> entity = EntityOf(marker);
      if (!entity.ok()) {
        AddMalformed(std::string(entity.status().message()));
        return Delete(EntityId(marker));
      }
      if (!marker.colors.empty() && PointsAColor(marker) == 0) {
        left_out_.insert("colors that are not one for each point");
      }
      return Put(*std::move(entity));
    }
    case Marker::DELETE:
      return Delete(EntityId(marker));
    case Marker::DELETEALL:
      entities_.clear();
      deletions_.clear();
      pieces_ = 0;
      bytes_ = 0;
      all_deleted_ = true;
      return;
    default:
      return AddMalformed(std::string(
          Wrong(marker, absl::StrCat("has action ", marker.action, "; 0, 2 and 3 are known"))
              .message()));
  }
}

void PendingMarkers::Drop(const std::string& id) {
  const auto at = entities_.find(id);
  if (at == entities_.end()) return;
  pieces_ -= markers::CountPieces(at->second.entity);
  bytes_ -= at->second.bytes;
  entities_.erase(at);
}

void PendingMarkers::Put(foxglove::SceneEntity entity) {
  const std::string id = entity.id();
  Drop(id);
  const int64_t pieces = markers::CountPieces(entity);
  const size_t bytes = entity.SpaceUsedLong();
  if (pieces_ + pieces > markers::kMostPieces || bytes_ + bytes > kMostBytes) {
    left_out_.insert("markers beyond what one update may have");
    return Delete(id);  // the previous state no longer applies
  }
  pieces_ += pieces;
  bytes_ += bytes;
  deletions_.erase(id);
  entities_.emplace(id, Waiting{std::move(entity), bytes});
}

void PendingMarkers::Delete(const std::string& id) {
  Drop(id);
  if (all_deleted_) return;
  if (deletions_.size() >= size_t{markers::kMostPieces}) {
    left_out_.insert("deletions beyond what one update may have");
    return;
  }
  deletions_.insert(id);
}

bool PendingMarkers::empty() const {
  return entities_.empty() && deletions_.empty() && !all_deleted_ && malformed_ == 0 &&
         left_out_.empty();
}

PendingMarkers::Taken PendingMarkers::Take() {
  Taken taken;
  if (all_deleted_) {
    taken.update.add_deletions()->set_type(foxglove::SceneEntityDeletion::ALL);
  }
  for (const std::string& id : deletions_) taken.update.add_deletions()->set_id(id);
  for (auto& [id, waiting] : entities_) {
    *taken.update.add_entities() = std::move(waiting.entity);
  }
  taken.malformed = malformed_;
  taken.malformed_last = std::move(malformed_last_);
  taken.left_out = std::move(left_out_);
  *this = PendingMarkers();
  return taken;
}

}  // namespace voxeld::ros1
