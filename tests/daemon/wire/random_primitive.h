// Primitives of every kind, with every type of array, at random; good ones all.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

class RandomPrimitives {
 public:
  explicit RandomPrimitives(std::mt19937& random) : random_(random) {}

  // Up to `most` corners; kInstance refers to one of "o0" to "o4", where instances are wanted.
  v1::Primitive Next(uint32_t most, bool instances) {
    v1::Primitive primitive;
    const uint32_t kind = random_() % (instances ? 7 : 6);
    if (kind < 6 && random_() % 2 == 0) primitive.mutable_color()->set_rgb(random_() & 0xFFFFFF);
    switch (kind) {
      case 0:
        *primitive.mutable_points()->mutable_vertices() = Corners(1 + random_() % most, false);
        SetThickness(primitive.mutable_points());
        break;
      case 1: {
        v1::Segments* segments = primitive.mutable_segments();
        *segments->mutable_vertices() = Corners(2 * (1 + random_() % most), true);
        segments->set_topology(Pick({v1::Segments::TOPOLOGY_UNSPECIFIED, v1::Segments::LIST,
                                     v1::Segments::STRIP, v1::Segments::LOOP}));
        segments->set_sampling(Pick({v1::LINE_SAMPLING_UNSPECIFIED, v1::LINE_SAMPLING_THIN,
                                     v1::LINE_SAMPLING_EUCLIDEAN, v1::LINE_SAMPLING_COVER}));
        SetThickness(segments);
        break;
      }
      case 2:
        *primitive.mutable_mesh()->mutable_vertices() = Corners(3 * (1 + random_() % most), true);
        primitive.mutable_mesh()->set_rule(Rule());
        break;
      case 3:
        SetVec3(primitive.mutable_box()->mutable_center(), Coordinate(), Coordinate(),
                Coordinate());
        SetVec3(primitive.mutable_box()->mutable_size(), Length(), Length(), Length());
        SetSurface(primitive.mutable_box());
        break;
      case 4:
        SetVec3(primitive.mutable_sphere()->mutable_center(), Coordinate(), Coordinate(),
                Coordinate());
        primitive.mutable_sphere()->set_radius(Length());
        SetSurface(primitive.mutable_sphere());
        break;
      case 5:
        SetVec3(primitive.mutable_cylinder()->mutable_center(), Coordinate(), Coordinate(),
                Coordinate());
        primitive.mutable_cylinder()->set_radius(Length());
        primitive.mutable_cylinder()->set_height(Length());
        SetSurface(primitive.mutable_cylinder());
        break;
      case 6:
        primitive.mutable_instance()->set_object(absl::StrCat("o", random_() % 5));
        break;
    }
    return primitive;
  }

 private:
  template <typename T>
  T Pick(std::initializer_list<T> values) {
    return values.begin()[random_() % values.size()];
  }
  v1::SurfaceRule Rule() {
    return Pick({v1::SURFACE_RULE_UNSPECIFIED, v1::SURFACE_RULE_THIN, v1::SURFACE_RULE_COVER});
  }
  // Doubles that are no floats, and zeros of both signs.
  double Coordinate() {
    return random_() % 8 == 0 ? -0.0 : std::uniform_real_distribution<>(-1e5, 1e5)(random_);
  }
  double Length() { return std::uniform_real_distribution<>(1e-6, 1e4)(random_); }
  static void SetVec3(v1::Vec3* out, double x, double y, double z) {
    out->set_x(x);
    out->set_y(y);
    out->set_z(z);
  }
  template <typename T>
  void SetThickness(T* out) {
    if (random_() % 2 == 0) return;
    out->mutable_thickness()->set_value(static_cast<float>(random_() % 4096) / 7);
    out->mutable_thickness()->set_unit(
        Pick({v1::Thickness::UNIT_UNSPECIFIED, v1::Thickness::VOXELS, v1::Thickness::UNITS}));
  }
  template <typename T>
  void SetSurface(T* out) {
    out->set_fill(Pick({v1::FILL_UNSPECIFIED, v1::FILL_SURFACE, v1::FILL_SOLID}));
    out->set_rule(Rule());
  }

  template <typename T>
  std::string Values(size_t count, auto next) {
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(next());
    return Packed(values);
  }

  v1::Vertices Corners(uint32_t corners, bool with_indices) {
    v1::Vertices out;
    const bool indexed = with_indices && random_() % 2 == 0;
    const uint32_t count = indexed ? 1 + random_() % corners : corners;
    out.set_count(count);
    out.set_position_type(Pick({v1::ELEMENT_TYPE_UNSPECIFIED, v1::ELEMENT_TYPE_F32,
                                v1::ELEMENT_TYPE_I16, v1::ELEMENT_TYPE_I32}));
    const size_t values = size_t{3} * count;
    switch (out.position_type()) {
      case v1::ELEMENT_TYPE_I16:
        out.set_positions(Values<int16_t>(values, [&] { return random_(); }));
        break;
      case v1::ELEMENT_TYPE_I32:
        out.set_positions(Values<int32_t>(
            values, [&] { return static_cast<int32_t>(random_() % (1u << 25)) - (1 << 24); }));
        break;
      default:
        out.set_positions(Values<float>(values, [&] { return Coordinate(); }));
        break;
    }
    if (random_() % 2 == 0) {
      out.set_color_type(
          Pick({v1::ELEMENT_TYPE_UNSPECIFIED, v1::ELEMENT_TYPE_RGB8, v1::ELEMENT_TYPE_RGBX8}));
      const size_t bytes = out.color_type() == v1::ELEMENT_TYPE_RGBX8 ? 4 : 3;
      out.set_colors(Values<uint8_t>(bytes * count, [&] { return random_(); }));
    }
    if (indexed) {
      out.set_index_count(corners);
      out.set_index_type(
          Pick({v1::ELEMENT_TYPE_UNSPECIFIED, v1::ELEMENT_TYPE_U16, v1::ELEMENT_TYPE_U32}));
      const auto index = [&] { return random_() % count; };
      out.set_indices(out.index_type() == v1::ELEMENT_TYPE_U16 ? Values<uint16_t>(corners, index)
                                                               : Values<uint32_t>(corners, index));
    }
    return out;
  }

  std::mt19937& random_;
};

}  // namespace voxeld::daemon::wire
