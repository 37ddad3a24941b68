#include "tools/recording/foxglove_scene.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "scene_update.pb.h"

namespace voxeld::recording {
namespace {

static_assert(std::endian::native == std::endian::little, "payloads are little-endian");

constexpr int kAround = 16, kAlong = 8;  // facets
constexpr int kMostDepth = 8;
constexpr double kPointArm = 0.005;

using Map = std::array<double, 12>;
constexpr Map kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

Map MapOf(const v1::Affine& in) {
  Map out = kIdentity;
  if (in.m_size() == 12) std::copy(in.m().begin(), in.m().end(), out.begin());
  return out;
}

// Returns the map that applies b first and then a.
Map Compose(const Map& a, const Map& b) {
  Map out;
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 4; ++c) {
      out[4 * r + c] = c == 3 ? a[4 * r + 3] : 0;
      for (size_t k = 0; k < 3; ++k) out[4 * r + c] += a[4 * r + k] * b[4 * k + c];
    }
  }
  return out;
}

class Drawing {
 public:
  Drawing(const SceneMirror& mirror, uint64_t owner, foxglove::SceneEntity* out)
      : mirror_(mirror), owner_(owner), out_(out) {}

  void Draw(const v1::Primitive& in, const Map& map, uint32_t tint, int depth) {
    const uint32_t color = Tinted(in.has_color() ? in.color().rgb() : 0xFFFFFF, tint);
    switch (in.kind_case()) {
      case v1::Primitive::kPoints:
        return DrawPoints(in.points().vertices(), map, color, tint);
      case v1::Primitive::kSegments:
        return DrawSegments(in.segments(), map, color, tint);
      case v1::Primitive::kMesh:
        return DrawMesh(in.mesh().vertices(), map, color, tint);
      case v1::Primitive::kBox:
        return DrawBox(in.box(), map, color);
      case v1::Primitive::kSphere:
        return DrawSphere(in.sphere(), map, color);
      case v1::Primitive::kCylinder:
        return DrawCylinder(in.cylinder(), map, color);
      case v1::Primitive::kText:
        return Say(in.text().text(), in.text().height(), map, in.text().position(), color);
      case v1::Primitive::kInstance: {
        const v1::Object* object = mirror_.FindObject(owner_, in.instance().object());
        if (object == nullptr || depth >= kMostDepth) return;
        const uint32_t own =
            in.instance().has_tint() ? Tinted(in.instance().tint().rgb(), tint) : tint;
        for (const v1::Object::Part& part : object->parts()) {
          Draw(part.primitive(), Compose(map, MapOf(part.transform())), own, depth + 1);
        }
        return;
      }
      default: {
        const auto* field = v1::Primitive::descriptor()->FindFieldByNumber(in.kind_case());
        return Say(field == nullptr ? "" : field->name(), 0.1, map, {}, color);
      }
    }
  }

 private:
  static uint32_t Tinted(uint32_t color, uint32_t tint) {
    uint32_t out = 0;
    for (const int shift : {0, 8, 16}) {
      out |= ((color >> shift & 0xff) * (tint >> shift & 0xff) + 127) / 255 << shift;
    }
    return out;
  }
  static void SetColor(uint32_t color, foxglove::Color* out) {
    out->set_r((color >> 16 & 0xff) / 255.0);
    out->set_g((color >> 8 & 0xff) / 255.0);
    out->set_b((color & 0xff) / 255.0);
    out->set_a(1);
  }
  static void SetIdentity(foxglove::Pose* out) {
    out->mutable_position();
    out->mutable_orientation()->set_w(1);
  }
  static void SetPoint(const Map& m, double x, double y, double z, foxglove::Point3* out) {
    out->set_x(m[0] * x + m[1] * y + m[2] * z + m[3]);
    out->set_y(m[4] * x + m[5] * y + m[6] * z + m[7]);
    out->set_z(m[8] * x + m[9] * y + m[10] * z + m[11]);
  }

  // Returns the numbers in single precision, in which the server sends them; nothing for any other
  // format.
  static std::vector<float> Floats(const v1::Vertices& in) {
    std::vector<float> out;
    if (in.position_type() > v1::ELEMENT_TYPE_F32 ||
        in.positions().size() != size_t{in.count()} * 12) {
      return out;
    }
    out.resize(size_t{3} * in.count());
    std::memcpy(out.data(), in.positions().data(), in.positions().size());
    return out;
  }
  static uint32_t ColorAt(const v1::Vertices& in, size_t i) {
    const auto byte = [&](size_t k) {
      return uint32_t{static_cast<uint8_t>(in.colors()[3 * i + k])};
    };
    return byte(0) << 16 | byte(1) << 8 | byte(2);
  }
  static bool HasColors(const v1::Vertices& in) {
    return in.colors().size() == size_t{3} * in.count() && in.colors_of() != v1::Vertices::ELEMENTS;
  }
  template <typename Primitive>
  static void SetVertices(const v1::Vertices& in, const Map& map, uint32_t color, uint32_t tint,
                          Primitive* out) {
    SetIdentity(out->mutable_pose());
    SetColor(color, out->mutable_color());
    const std::vector<float> at = Floats(in);
    for (size_t i = 0; i + 2 < at.size(); i += 3) {
      SetPoint(map, at[i], at[i + 1], at[i + 2], out->add_points());
      if (HasColors(in)) SetColor(Tinted(ColorAt(in, i / 3), tint), out->add_colors());
    }
    if (in.index_type() == v1::ELEMENT_TYPE_U32 &&
        in.indices().size() == size_t{4} * in.index_count()) {
      for (size_t i = 0; i < in.index_count(); ++i) {
        uint32_t index = 0;
        std::memcpy(&index, in.indices().data() + 4 * i, 4);
        out->add_indices(index);
      }
    }
  }

  void DrawPoints(const v1::Vertices& in, const Map& map, uint32_t color, uint32_t tint) {
    const std::vector<float> at = Floats(in);
    if (at.empty()) return;
    foxglove::LinePrimitive* lines = out_->add_lines();
    lines->set_type(foxglove::LinePrimitive::LINE_LIST);
    SetIdentity(lines->mutable_pose());
    SetColor(color, lines->mutable_color());
    lines->set_thickness(2);
    lines->set_scale_invariant(true);
    const size_t count = at.size() / 3;
    const size_t step = (count + kMostPoints - 1) / kMostPoints;
    for (size_t i = 0; i < count; i += step) {
      foxglove::Point3 place;
      SetPoint(map, at[3 * i], at[3 * i + 1], at[3 * i + 2], &place);
      for (const double arm : {-kPointArm, kPointArm}) {
        foxglove::Point3* end = lines->add_points();
        *end = place;
        end->set_z(place.z() + arm);
        if (HasColors(in)) SetColor(Tinted(ColorAt(in, i), tint), lines->add_colors());
      }
    }
  }

  void DrawSegments(const v1::Segments& in, const Map& map, uint32_t color, uint32_t tint) {
    foxglove::LinePrimitive* lines = out_->add_lines();
    lines->set_type(in.topology() == v1::Segments::STRIP  ? foxglove::LinePrimitive::LINE_STRIP
                    : in.topology() == v1::Segments::LOOP ? foxglove::LinePrimitive::LINE_LOOP
                                                          : foxglove::LinePrimitive::LINE_LIST);
    lines->set_thickness(2);
    lines->set_scale_invariant(true);
    SetVertices(in.vertices(), map, color, tint, lines);
  }

  void DrawMesh(const v1::Vertices& in, const Map& map, uint32_t color, uint32_t tint) {
    SetVertices(in, map, color, tint, out_->add_triangles());
  }

  // Draws a grid of places that is closed in one direction, as triangles.
  template <typename Place>
  void DrawGrid(int around, int along, const Map& map, uint32_t color, Place place) {
    foxglove::TriangleListPrimitive* triangles = out_->add_triangles();
    SetIdentity(triangles->mutable_pose());
    SetColor(color, triangles->mutable_color());
    for (int v = 0; v <= along; ++v) {
      for (int u = 0; u < around; ++u) {
        const std::array<double, 3> p = place(u, v);
        SetPoint(map, p[0], p[1], p[2], triangles->add_points());
      }
    }
    for (int v = 0; v < along; ++v) {
      for (int u = 0; u < around; ++u) {
        const auto at = [&](int du, int dv) {
          return static_cast<uint32_t>((v + dv) * around + (u + du) % around);
        };
        for (const uint32_t index : {at(0, 0), at(1, 0), at(1, 1), at(0, 0), at(1, 1), at(0, 1)}) {
          triangles->add_indices(index);
        }
      }
    }
  }

  void DrawBox(const v1::Box& in, const Map& map, uint32_t color) {
    // The lower and upper faces are rings that close at their own centres.
    DrawGrid(4, 3, map, color, [&](int u, int v) {
      const double rim = v == 0 || v == 3 ? 0 : 0.5;
      const double x = u == 0 || u == 3 ? -rim : rim, y = u < 2 ? -rim : rim;
      const double z = v < 2 ? -0.5 : 0.5;
      return std::array<double, 3>{in.center().x() + x * in.size().x(),
                                   in.center().y() + y * in.size().y(),
                                   in.center().z() + z * in.size().z()};
    });
  }

  void DrawSphere(const v1::Sphere& in, const Map& map, uint32_t color) {
    DrawGrid(kAround, kAlong, map, color, [&](int u, int v) {
      const double a = 2 * std::numbers::pi * u / kAround, b = std::numbers::pi * v / kAlong;
      return std::array<double, 3>{in.center().x() + in.radius() * std::sin(b) * std::cos(a),
                                   in.center().y() + in.radius() * std::sin(b) * std::sin(a),
                                   in.center().z() - in.radius() * std::cos(b)};
    });
  }

  void DrawCylinder(const v1::Cylinder& in, const Map& map, uint32_t color) {
    DrawGrid(kAround, 3, map, color, [&](int u, int v) {
      const double a = 2 * std::numbers::pi * u / kAround;
      const double r = v == 0 || v == 3 ? 0 : in.radius();
      return std::array<double, 3>{in.center().x() + r * std::cos(a),
                                   in.center().y() + r * std::sin(a),
                                   in.center().z() + (v < 2 ? -0.5 : 0.5) * in.height()};
    });
  }

  void Say(const std::string& text, double size, const Map& map, const v1::Vec3& at,
           uint32_t color) {
    foxglove::TextPrimitive* out = out_->add_texts();
    foxglove::Point3 place;
    SetPoint(map, at.x(), at.y(), at.z(), &place);
    SetIdentity(out->mutable_pose());
    out->mutable_pose()->mutable_position()->set_x(place.x());
    out->mutable_pose()->mutable_position()->set_y(place.y());
    out->mutable_pose()->mutable_position()->set_z(place.z());
    out->set_billboard(true);
    out->set_font_size(size);
    out->set_text(text);
    SetColor(color, out->mutable_color());
  }

  const SceneMirror& mirror_;
  const uint64_t owner_;
  foxglove::SceneEntity* const out_;
};

std::string IdOf(const EntityName& name) {
  return absl::StrCat(name.layer.owner, "/", name.layer.layer, "/", name.id);
}

void SetTime(uint64_t time_ns, google::protobuf::Timestamp* out) {
  out->set_seconds(static_cast<int64_t>(time_ns / 1'000'000'000));
  out->set_nanos(static_cast<int32_t>(time_ns % 1'000'000'000));
}

}  // namespace

void MakeSceneUpdate(SceneMirror& mirror, uint64_t time_ns, foxglove::SceneUpdate* out) {
  out->Clear();
  const SceneMirror::Changes changes = mirror.TakeChanges();
  for (const EntityName& name : changes.gone) {
    foxglove::SceneEntityDeletion* deletion = out->add_deletions();
    SetTime(time_ns, deletion->mutable_timestamp());
    deletion->set_id(IdOf(name));
  }
  for (const EntityName& name : changes.changed) {
    const v1::WatchedEntity& entity = mirror.entities().at(name);
    foxglove::SceneEntity* to = out->add_entities();
    SetTime(time_ns, to->mutable_timestamp());
    to->set_frame_id("voxeld");
    to->set_id(IdOf(name));
    if (!entity.info().label().empty()) {
      foxglove::KeyValuePair* label = to->add_metadata();
      label->set_key("label");
      label->set_value(entity.info().label());
    }
    const Map map = Compose(MapOf(mirror.layers().at(name.layer).transform()),
                            MapOf(entity.info().transform()));
    Drawing(mirror, name.layer.owner, to).Draw(entity.primitive(), map, 0xFFFFFF, 0);
  }
}

}  // namespace voxeld::recording
