// Random valid primitives of every kind but Text, with every type of array.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/daemon/pictures/files.h"
#include "tests/daemon/wire/requests.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

class RandomPrimitives {
 public:
  explicit RandomPrimitives(std::mt19937& random) : random_(random) {}

  // Returns a primitive of up to `most` corners; kInstance refers to one of "o0" to "o4", if
  // instances are wanted.
  v1::Primitive Next(uint32_t most, bool instances) {
    v1::Primitive primitive;
    const uint32_t kind = random_() % (instances ? 8 : 7);
    if (kind < 7 && random_() % 2 == 0) primitive.mutable_color()->set_rgb(random_() & 0xFFFFFF);
    switch (kind) {
      case 0:
        *primitive.mutable_points()->mutable_vertices() = Corners(1 + random_() % most, false);
        primitive.mutable_points()->set_splat(
            Pick({v1::Points::SPLAT_UNSPECIFIED, v1::Points::BALL, v1::Points::SOFT,
                  v1::Points::CUBE, v1::Points::CELL}));
        if (primitive.points().splat() != v1::Points::CELL)
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
        const uint32_t corners = CornersOf(segments->vertices());
        const bool pairs = segments->topology() == v1::Segments::TOPOLOGY_UNSPECIFIED ||
                           segments->topology() == v1::Segments::LIST;
        const bool loop = segments->topology() == v1::Segments::LOOP;
        SetElementColors(pairs  ? corners / 2
                         : loop ? corners
                                : corners - 1,
                         segments->mutable_vertices());
        break;
      }
      case 2:
        *primitive.mutable_mesh()->mutable_vertices() = Corners(3 * (1 + random_() % most), true);
        if (random_() % 4 == 0) {
          SetTexture(primitive.mutable_mesh());
        } else {
          v1::Vertices* const vertices = primitive.mutable_mesh()->mutable_vertices();
          SetElementColors(CornersOf(*vertices) / 3, vertices);
        }
        SetShell(primitive.mutable_mesh());
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
        SetMeasured(&primitive);
        break;
      case 7:
        primitive.mutable_instance()->set_object(absl::StrCat("o", random_() % 5));
        if (random_() % 2 == 0)
          primitive.mutable_instance()->mutable_tint()->set_rgb(random_() & 0xFFFFFF);
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
  // Returns doubles that are not floats, and zeros of both signs.
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
  static uint32_t CornersOf(const v1::Vertices& in) {
    return in.index_count() != 0 ? in.index_count() : in.count();
  }
  void SetElementColors(uint32_t elements, v1::Vertices* out) {
    if (random_() % 4 != 0) return;
    out->set_colors_of(v1::Vertices::ELEMENTS);
    out->set_color_type(v1::ELEMENT_TYPE_RGB8);
    out->set_colors(Values<uint8_t>(size_t{3} * elements, [&] { return random_(); }));
  }
  template <typename T>
  void SetSurface(T* out) {
    out->set_fill(Pick({v1::FILL_UNSPECIFIED, v1::FILL_SURFACE, v1::FILL_SOLID}));
    out->set_rule(Rule());
  }

  std::string Picture() {
    const uint32_t width = 1 + random_() % 5, height = 1 + random_() % 5;
    std::vector<uint32_t> pixels(size_t{width} * height);
    for (uint32_t& pixel : pixels) pixel = random_();
    return pictures::PngOf(width, height, pixels, random_() % 2 == 0);
  }
  void SetTexture(v1::Mesh* out) {
    out->mutable_texture()->set_picture(Picture());
    out->mutable_texture()->set_coordinates(Values<float>(size_t{2} * out->vertices().count(), [&] {
      return std::uniform_real_distribution<>(-2, 3)(random_);
    }));
  }

  template <typename T>
  void SetShell(T* out) {
    out->set_rule(Rule());
    if (random_() % 2 == 0) out->mutable_shell()->set_value(static_cast<float>(random_() % 64) / 8);
  }
  void SetPoint(v1::Vec3* out) { SetVec3(out, Coordinate(), Coordinate(), Coordinate()); }

  // Makes a shape that is drawn by the general method.
  void SetMeasured(v1::Primitive* out) {
    switch (random_() % 16) {
      case 15:
        *out->mutable_curve()->mutable_vertices() = Corners(7, false);
        out->mutable_curve()->set_form(
            Pick({v1::Curve::FORM_UNSPECIFIED, v1::Curve::CATMULL_ROM, v1::Curve::B_SPLINE,
                  v1::Curve::BEZIER, v1::Curve::QUADRATIC}));
        return SetThickness(out->mutable_curve());
      case 14:
        SetPoint(out->mutable_arc()->mutable_center());
        out->mutable_arc()->set_radius(Length());
        out->mutable_arc()->set_start(random_() % 6);
        out->mutable_arc()->set_sweep(random_() % 6);
        return SetThickness(out->mutable_arc());
      case 13:
        SetVec3(out->mutable_ellipse()->mutable_axis_a(), 2, Length(), 0);
        SetVec3(out->mutable_ellipse()->mutable_axis_b(), -1, 0, 3);
        return SetThickness(out->mutable_ellipse());
      case 12:
        SetVec3(out->mutable_helix()->mutable_start(), 0, 1, 2);
        SetVec3(out->mutable_helix()->mutable_end(), 3, Length(), 2);
        out->mutable_helix()->set_radius(Length());
        out->mutable_helix()->set_turns(1 + random_() % 9);
        return SetThickness(out->mutable_helix());
      case 11:
        SetVec3(out->mutable_arrow()->mutable_start(), 0, 1, 2);
        SetVec3(out->mutable_arrow()->mutable_end(), 3, 5 + Length(), 2);
        return SetShell(out->mutable_arrow());
      case 10:
        if (random_() % 2 == 0) {
          SetGrid(out->mutable_volume()->mutable_grid());
          return;
        }
        SetIsosurface(out->mutable_isosurface());
        if (random_() % 2 == 0) SetScale(out->mutable_color_scale());
        return;
      case 9:
        *out->mutable_bezier_surface()->mutable_vertices() = Corners(16, false);
        out->mutable_bezier_surface()->set_fill(
            Pick({v1::FILL_UNSPECIFIED, v1::FILL_SURFACE, v1::FILL_LINES, v1::FILL_DOTS}));
        if (out->bezier_surface().fill() < v1::FILL_LINES) SetShell(out->mutable_bezier_surface());
        return;
      case 8: {
        v1::HeightMap* const map = out->mutable_height_map();
        SetVec3(map->mutable_edge_a(), 1, 0, 0.5);
        SetVec3(map->mutable_edge_b(), 0, 1, 0);
        map->set_columns(2 + random_() % 5);
        map->set_rows(2 + random_() % 5);
        const size_t samples = size_t{map->columns()} * map->rows();
        map->set_heights(Values<float>(samples, [&] { return Coordinate(); }));
        if (random_() % 2 == 0)
          map->set_colors(Values<uint8_t>(3 * samples, [&] { return random_(); }));
        if (random_() % 4 == 0) map->set_picture(Picture());
        return SetShell(map);
      }
      case 0:
        SetPoint(out->mutable_ellipsoid()->mutable_center());
        SetVec3(out->mutable_ellipsoid()->mutable_radii(), Length(), Length(), Length());
        if (random_() % 2 == 0) return SetShell(out->mutable_ellipsoid());
        out->mutable_ellipsoid()->set_fill(v1::FILL_SOLID);
        return out->mutable_ellipsoid()->set_rule(Rule());
      case 1:
        SetPoint(out->mutable_torus()->mutable_center());
        out->mutable_torus()->set_radius(Length());
        out->mutable_torus()->set_tube_radius(Length());
        return SetShell(out->mutable_torus());
      case 2:
        SetVec3(out->mutable_cone()->mutable_start(), 1, Length(), 2);
        SetVec3(out->mutable_cone()->mutable_end(), 3, -Length(), 2);
        out->mutable_cone()->set_start_radius(Length());
        out->mutable_cone()->set_end_radius(Length());
        return SetShell(out->mutable_cone());
      case 3:
        SetPoint(out->mutable_parallelepiped()->mutable_center());
        SetVec3(out->mutable_parallelepiped()->mutable_edge_a(), 1, 0.25, 0);
        SetVec3(out->mutable_parallelepiped()->mutable_edge_b(), 0, 2, 0.5);
        SetVec3(out->mutable_parallelepiped()->mutable_edge_c(), 0.125, 0, 1 + Length() / 1e4);
        return SetShell(out->mutable_parallelepiped());
      case 4:
        SetPoint(out->mutable_disc()->mutable_center());
        if (random_() % 2 == 0) SetVec3(out->mutable_disc()->mutable_normal(), 1, Length(), 3);
        out->mutable_disc()->set_radius(10 + Length());
        out->mutable_disc()->set_inner_radius(random_() % 10);
        return SetShell(out->mutable_disc());
      case 5:
        SetPoint(out->mutable_patch()->mutable_corner());
        SetVec3(out->mutable_patch()->mutable_edge_a(), 1, 0, 0.5);
        SetVec3(out->mutable_patch()->mutable_edge_b(), 0, 1 + Length() / 1e4, 0);
        return SetShell(out->mutable_patch());
      case 6:
        for (const double number : {0, 0, 1, 4, 0, 1, 4, 4, 1, 1, 1, 1, 2, 1, 1, 1, 2, 1}) {
          out->mutable_polygon()->add_points(number);
        }
        if (random_() % 2 == 0) {
          out->mutable_polygon()->add_ends(3);
          out->mutable_polygon()->add_ends(6);
        }
        return SetShell(out->mutable_polygon());
      default:
        return SetImplicit(out->mutable_implicit());
    }
  }

  void SetGrid(v1::Grid* grid) {
    SetPoint(grid->mutable_corner());
    SetVec3(grid->mutable_edge_a(), 1, 0, 0.5);
    SetVec3(grid->mutable_edge_b(), 0, 1 + Length() / 1e4, 0);
    SetVec3(grid->mutable_edge_c(), -0.25, 0, 2);
    grid->set_size_a(1 + random_() % 6);
    grid->set_size_b(1 + random_() % 6);
    grid->set_size_c(1 + random_() % 6);
    const size_t samples = size_t{grid->size_a()} * grid->size_b() * grid->size_c();
    grid->set_type(Pick({v1::ELEMENT_TYPE_F32, v1::ELEMENT_TYPE_U16, v1::ELEMENT_TYPE_U8}));
    const auto sample = [&] { return random_() % 256; };
    grid->set_samples(grid->type() == v1::ELEMENT_TYPE_F32   ? Values<float>(samples, sample)
                      : grid->type() == v1::ELEMENT_TYPE_U16 ? Values<uint16_t>(samples, sample)
                                                             : Values<uint8_t>(samples, sample));
  }
  void SetIsosurface(v1::Isosurface* out) {
    SetGrid(out->mutable_grid());
    out->set_level(random_() % 256);
    out->set_fill(Pick({v1::FILL_UNSPECIFIED, v1::FILL_SURFACE, v1::FILL_SOLID}));
    SetShell(out);
    if (out->fill() == v1::FILL_SOLID) out->clear_shell();
  }
  void SetScale(v1::ColorScale* out) {
    if (random_() % 2 == 0) {
      out->set_colormap("magma_r");
    } else {
      for (int i = 0; i < 3; ++i) out->add_colors(random_() & 0xFFFFFF);
    }
    SetVec3(out->mutable_along(), 1, 0, Length());
    out->set_low(-1);
    out->set_high(Length());
  }

  void SetImplicit(v1::Implicit* out) {
    const char* const surfaces[] = {"x^2+y^2-z = 0 where x^2+y^2 <= 1", "length(x, y, z) <= r",
                                    "smin(x, y, 0.5) - sin(z)*r", "not (x <= 1 and y > r)"};
    out->mutable_surface()->set_text(surfaces[random_() % 4]);
    out->set_parameter_names("r");
    out->add_parameter_values(Length());
    if (random_() % 2 == 0) out->mutable_bound()->set_text("z <= r or x > 2");
    if (random_() % 3 == 0) {
      v1::Expression::Tree* const tree = out->mutable_surface()->mutable_tree();
      for (const auto op : {v1::Expression::Tree::X, v1::Expression::Tree::PARAMETER,
                            v1::Expression::Tree::SUBTRACT, v1::Expression::Tree::CONSTANT,
                            v1::Expression::Tree::MAX}) {
        tree->add_ops(op);
      }
      tree->add_values(Coordinate());
      tree->set_names("r");
    }
    if (random_() % 2 == 0) {
      v1::Boundary* const boundary = out->mutable_boundary();
      boundary->set_form(Pick({v1::Boundary::FORM_UNSPECIFIED, v1::Boundary::POLYLINE,
                               v1::Boundary::CATMULL_ROM, v1::Boundary::B_SPLINE}));
      boundary->set_axis(Pick({v1::Boundary::AXIS_UNSPECIFIED, v1::Boundary::Z, v1::Boundary::X}));
      for (const double number : {-5, -4, 1, 4, -5, 2, 5, 5, 3, -4, 4, 4}) {
        boundary->add_points(number + Length() / 1e4);
      }
      if (random_() % 2 == 0) {
        for (const double number : {-1, -1, 0, 1, -1, 0, 0, 1, 0}) boundary->add_points(number);
        boundary->add_ends(4);
        boundary->add_ends(7);
      }
    }
    if (random_() % 2 == 0) {
      out->mutable_level()->set_text("z / r");
      out->set_colormap("viridis");
    }
    if (random_() % 2 == 0) {
      SetVec3(out->mutable_domain()->mutable_min(), -1, -2, -3);
      SetVec3(out->mutable_domain()->mutable_max(), 1, Length(), 3);
    }
    out->set_fill(Pick({v1::FILL_UNSPECIFIED, v1::FILL_SURFACE, v1::FILL_SOLID}));
    SetShell(out);
    if (out->fill() != v1::FILL_SURFACE) out->clear_shell();
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
