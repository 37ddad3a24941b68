// Every built-in surface that is drawn by the general method equals its own implicit form, an
// expression that is parsed like a client's. They may differ only where kError decides whether a
// voxel is within the shell, or which of two neighbours on either side is nearer; and, for rims
// that are closed curves, where kRimError does.
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "gpu/implicit/parse.h"
#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/prism.h"
#include "gpu/primitives/torus.h"
#include "tests/conformance/placed.h"

namespace voxeld::gpu::conformance {
namespace implicit_forms_test {

constexpr int32_t kSize = 48;
// In voxels: a dozen roundings of 2⁻²⁴ (docs/expressions.md) of numbers below 100. Places are
// snapped to 2⁻⁸ voxel (gpu/primitives/solid.h), so the origin is a multiple of that.
constexpr double kError = 1e-4;
// In voxels: the accuracy that gpu/primitives/polygon.h states for a polygon's rim.
constexpr double kRimError = 0.02;

// Builds an expression in the form in which it is written, so that one function gives both text and
// numbers.
struct Words {
  std::string text;
  Words(std::string words) : text(std::move(words)) {}                // NOLINT
  Words(double number) : text(absl::StrFormat("(%.17g)", number)) {}  // NOLINT
  friend Words operator+(const Words& a, const Words& b) { return Join(a, "+", b); }
  friend Words operator-(const Words& a, const Words& b) { return Join(a, "-", b); }
  friend Words operator*(const Words& a, const Words& b) { return Join(a, "*", b); }
  friend Words operator/(const Words& a, const Words& b) { return Join(a, "/", b); }
  static Words Join(const Words& a, const char* sign, const Words& b) {
    return absl::StrCat("(", a.text, " ", sign, " ", b.text, ")");
  }
};
double Abs(double a) { return std::fabs(a); }
Words Abs(const Words& a) { return absl::StrCat("abs(", a.text, ")"); }
double Max(double a, double b) { return std::max(a, b); }
Words Max(const Words& a, const Words& b) {
  return absl::StrCat("max(", a.text, ", ", b.text, ")");
}
double Min(double a, double b) { return std::min(a, b); }
Words Min(const Words& a, const Words& b) {
  return absl::StrCat("min(", a.text, ", ", b.text, ")");
}
double Norm(double a, double b) { return std::hypot(a, b); }
Words Norm(const Words& a, const Words& b) {
  return absl::StrCat("length(", a.text, ", ", b.text, ")");
}
double Norm(double a, double b, double c) { return std::sqrt(a * a + b * b + c * c); }
Words Norm(const Words& a, const Words& b, const Words& c) {
  return absl::StrCat("length(", a.text, ", ", b.text, ", ", c.text, ")");
}

struct Form {
  std::string name;
  std::function<FieldShape(Graph&)> make;
  std::string text;
  std::function<double(const Vector&)> surface, bound;
  bool solid;
  double bound_error = kError;
};

template <typename Shape, typename Surface>
Form Solid(std::string name, const Shape& shape, Surface p) {
  return {std::move(name),
          [shape](Graph& g) { return shape.Make(g); },
          p(Words("x"), Words("y"), Words("z")).text + " = 0",
          [p](const Vector& v) { return p(v.x, v.y, v.z); },
          [](const Vector&) { return -1.0; },
          true};
}
template <typename Shape, typename Surface, typename Bound>
Form Flat(std::string name, const Shape& shape, Surface p, Bound bound) {
  Form form = Solid(std::move(name), shape, p);
  form.text += " where " + bound(Words("x"), Words("y"), Words("z")).text + " <= 0";
  form.bound = [bound](const Vector& v) { return bound(v.x, v.y, v.z); };
  form.solid = false;
  return form;
}
// The expression for the two squares, one within the other, that HollowSquare makes.
template <typename Surface>
Form Hollow(std::string name, bool solid, std::function<FieldShape(Graph&)> make, Surface p) {
  struct None {
    FieldShape Make(Graph&) const { return {}; }
  };
  Form form = Flat(std::move(name), None(), p,
                   [](auto x, auto y, auto) { return Abs(Max(Abs(x), Abs(y)) - 11.0) - 4.0; });
  form.make = std::move(make);
  form.solid = solid;
  form.bound_error = kRimError;
  return form;
}
// A shape of two closed curves: squares of 15 and 7 from middle to side; z is a quarter of x.
template <typename Shape>
FieldShape HollowSquare(Graph& g, Shape shape) {
  std::vector<Vector> points;
  for (const double size : {15.0, 7.0}) {
    for (const auto& [x, y] :
         std::vector<std::pair<double, double>>{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
      points.push_back({x * size, y * size, 0.25 * x * size});
    }
  }
  const std::vector<uint32_t> ends = {4, 8};
  shape.points = points;
  shape.ends = ends;
  return shape.Make(g);
}

std::vector<Form> Forms() {
  const double root = std::sqrt(436.0);  // of 20² + 6²
  return {
      Solid("ellipsoid", Ellipsoid{{0.5, -1, 2}, {18, 12, 8}},
            [](auto x, auto y, auto z) {
              return Norm((x - 0.5) / 18.0, (y + 1.0) / 12.0, (z - 2.0) / 8.0) - 1.0;
            }),
      Solid("torus", Torus{{1, -2, 0.5}, 13, 5},
            [](auto x, auto y, auto z) {
              return Norm(Norm(x - 1.0, y + 2.0) - 13.0, z - 0.5) - 5.0;
            }),
      Solid("cylinder", Cone{{1, 2, -9}, {1, 2, 13}, 8, 8},
            [](auto x, auto y, auto z) {
              return Max(Norm(x - 1.0, y - 2.0) - 8.0, Abs(z - 2.0) - 11.0);
            }),
      // A right-angled triangle with sides 10, 24 and 26, rotated about its axis.
      Solid("cone", Cone{{1, 2, -9}, {1, 2, 15}, 10, 0},
            [](auto x, auto y, auto z) {
              const auto across = Norm(x - 1.0, y - 2.0);
              return Max(Max((24.0 * across + 10.0 * (z - 15.0)) / 26.0, across - 10.0),
                         Abs(z - 3.0) - 12.0);
            }),
      // Along (3, 4, 12), which is 13 long; its radius decreases by 5 in 12.
      Solid("slanting cone", Cone{{-1.5, -2, -6}, {1.5, 2, 6}, 12, 12 - 65.0 / 12},
            [](auto x, auto y, auto z) {
              const auto along = (3.0 * x + 4.0 * y + 12.0 * z) / 13.0;
              const auto across =
                  Norm(x - along * (3 / 13.0), y - along * (4 / 13.0), z - along * (12 / 13.0));
              return Max(
                  Max((12.0 * across + 5.0 * (along + 6.5)) / 13.0 - 144 / 13.0, across - 12.0),
                  Abs(along) - 6.5);
            }),
      // Balls at both ends, and the body between them.
      Solid("capsule", Cone{{0, 0, -8}, {0, 0, 10}, 9, 9, true},
            [](auto x, auto y, auto z) {
              const auto balls = Min(Norm(x, y, z + 8.0), Norm(x, y, z - 10.0)) - 9.0;
              return Min(balls, Max(Norm(x, y) - 9.0, Abs(z - 1.0) - 9.0));
            }),
      // The normal of its side is (24, 7) / 25.
      Solid("capsule with two radii", Cone{{0, 0, -12}, {0, 0, 13}, 12, 5, true},
            [](auto x, auto y, auto z) {
              const auto across = Norm(x, y), foot = z + 12.0 - across * (7 / 24.0);
              return Min(Min(Norm(x, y, z + 12.0) - 12.0, Norm(x, y, z - 13.0) - 5.0),
                         Max((24.0 * across + 7.0 * (z + 12.0)) / 25.0 - 12.0,
                             Max(0.0 - foot, foot - 25.0)));
            }),
      Solid("parallelepiped", Parallelepiped{{1, 0, -1}, {{24, 0, 0}, {6, 20, 0}, {0, 0, 16}}},
            [=](auto x, auto y, auto z) {
              return Max(
                  Max(Abs((x - 1.0) * (20 / root) - y * (6 / root)) - 240 / root, Abs(y) - 10.0),
                  Abs(z + 1.0) - 8.0);
            }),
      // A head of 12 by 9, into which the shaft reaches half-way.
      Solid("arrow", Arrow{{0, 0, -16}, {0, 0, 16}, 4, 12, 9},
            [](auto x, auto y, auto z) {
              const auto across = Norm(x, y);
              const auto head =
                  Max(Max(0.8 * across + 0.6 * (z - 16.0), across - 9.0), Abs(z - 10.0) - 6.0);
              return Min(head, Max(across - 4.0, Abs(z + 3.0) - 13.0));
            }),
      Flat(
          "disc", Disc{{1, 2, 3}, {0, 3, 4}, 14, 0},
          [](auto, auto y, auto z) { return 0.6 * (y - 2.0) + 0.8 * (z - 3.0); },
          [](auto x, auto y, auto z) {
            return Norm(x - 1.0, 0.8 * (y - 2.0) - 0.6 * (z - 3.0)) - 14.0;
          }),
      Flat(
          "ring", Disc{{1, 2, 3}, {0, 3, 4}, 14, 5},
          [](auto, auto y, auto z) { return 0.6 * (y - 2.0) + 0.8 * (z - 3.0); },
          [](auto x, auto y, auto z) {
            return Abs(Norm(x - 1.0, 0.8 * (y - 2.0) - 0.6 * (z - 3.0)) - 9.5) - 4.5;
          }),
      Flat(
          "patch", Patch{{-12, -10, -4}, {24, 0, 0}, {0, 16, 12}},
          [](auto, auto y, auto z) { return 0.8 * (z + 4.0) - 0.6 * (y + 10.0); },
          [](auto x, auto y, auto z) {
            return Max(Abs(x) - 12.0, Abs(0.8 * (y + 10.0) + 0.6 * (z + 4.0) - 10.0) - 10.0);
          }),
      Hollow(
          "polygon", false, [](Graph& g) { return HollowSquare(g, Polygon{}); },
          [=](auto x, auto, auto z) { return (z - 0.25 * x) * (4 / std::sqrt(17.0)); }),
      Hollow(
          "prism", true,
          [](Graph& g) { return HollowSquare(g, Prism{.points = {}, .ends = {}, .depth = 9}); },
          [](auto, auto, auto z) { return Abs(z + 4.5) - 4.5; }),
  };
}

// Decides whether a voxel is lit; nullopt where kError decides.
class Rule {
 public:
  Rule(const Form& form, const Placement& placed, const GeometryRecord& look)
      : form_(form), placed_(placed), look_(look) {
    for (int32_t z = 0; z < kSize; ++z) {
      for (int32_t y = 0; y < kSize; ++y) {
        for (int32_t x = 0; x < kSize; ++x) values_.push_back(form.surface(placed.Back(x, y, z)));
      }
    }
  }
  std::optional<bool> Wants(const Drawn& drawn, int32_t x, int32_t y, int32_t z) const {
    const double bound = form_.bound(placed_.Back(x, y, z)) * placed_.scale;
    if (bound > form_.bound_error) return false;
    const std::optional<bool> of_surface = OfSurface(drawn, x, y, z);
    return bound > -form_.bound_error && of_surface != false ? std::nullopt : of_surface;
  }

 private:
  std::optional<bool> OfSurface(const Drawn& drawn, int32_t x, int32_t y, int32_t z) const {
    const double p = values_[drawn.Index(x, y, z)], error = kError * SlopeAt(x, y, z);
    if (look_.fill == Fill::kSolid)
      return std::fabs(p) < error ? std::nullopt : std::optional(p < 0);
    if (std::fabs(p) < error) return std::nullopt;
    const double reach = look_.thickness / 2.0 * SlopeAt(x, y, z);
    if (std::fabs(p) < reach - error) return true;
    bool doubtful = std::fabs(p) <= reach + error, lit = false;
    const bool cover = look_.rule == SurfaceRule::kCover;
    drawn.ForEachNeighbour(x, y, z, cover, [&](int32_t u, int32_t v, int32_t w) {
      const double other = values_[drawn.Index(u, v, w)];
      const bool differ = (other > 0) != (p > 0);
      if (std::fabs(other) < error ||
          (differ && std::fabs(std::fabs(other) - std::fabs(p)) < 2 * error)) {
        doubtful = true;
      } else if (differ && std::fabs(p) < std::fabs(other)) {
        lit = true;
      }
    });
    return !lit && doubtful ? std::nullopt : std::optional(lit);
  }
  double SlopeAt(int32_t x, int32_t y, int32_t z) const {
    constexpr double kAside = 1e-5;
    double square = 0;
    for (int a = 0; a < 3; ++a) {
      const Vector d = {a == 0 ? kAside : 0, a == 1 ? kAside : 0, a == 2 ? kAside : 0};
      const Vector at = {x + 0.5, y + 0.5, z + 0.5};
      const double change =
          form_.surface(placed_.Back(at + d)) - form_.surface(placed_.Back(at - d));
      square += change * change;
    }
    return std::sqrt(square) / (2 * kAside);
  }

  const Form& form_;
  const Placement& placed_;
  const GeometryRecord look_;
  std::vector<double> values_;
};

class ImplicitForms : public PlacedShapes {
 protected:
  ImplicitForms() : PlacedShapes(kSize) {}

  void ExpectLike(const Form& form, const GeometryRecord& look) {
    Placement placed = Placed(1.1, 0.95, kSize / 2, 0);
    for (int a = 0; a < 3; ++a) placed.map.m[a * 4 + 3] += (77 + 31 * a) / 256.0;
    Graph own, written;
    const FieldShape shape = form.make(own);
    const auto parsed = implicit::ParseShape(form.text, {}, {}, written);
    ASSERT_TRUE(parsed.ok()) << form.text << ": " << parsed.status();
    FieldShape as_text;
    as_text.surface = parsed->surface;
    as_text.bound = parsed->bound;
    const Drawn drawn[2] = {Draw(FieldGeometry(own, shape, look), placed.map),
                            Draw(FieldGeometry(written, as_text, look), placed.map)};
    const Rule rule(form, placed, look);
    uint64_t lit = 0, doubtful = 0, wrong[2] = {};
    drawn[0].ForEach(
        [&](int32_t x, int32_t y, int32_t z) {
          lit += drawn[0].Lit(x, y, z);
          const std::optional<bool> want = rule.Wants(drawn[0], x, y, z);
          doubtful += !want.has_value();
          for (int which = 0; which < 2; ++which)
            wrong[which] += want.has_value() && *want != drawn[which].Lit(x, y, z);
        },
        1);
    EXPECT_GT(lit, 300u);
    EXPECT_LT(doubtful, lit / 20);
    EXPECT_EQ(wrong[0], 0u) << "the shape";
    EXPECT_EQ(wrong[1], 0u) << "the expression";
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, ImplicitForms, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(ImplicitForms, AreTheSolids) {
  for (const Form& form : Forms()) {
    if (!form.solid) continue;
    SCOPED_TRACE(form.name);
    ExpectLike(form, {.fill = Fill::kSolid});
  }
}

TEST_P(ImplicitForms, AreTheSurfaces) {
  for (const Form& form : Forms()) {
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      for (const float thickness : {0.0F, 2.5F}) {
        SCOPED_TRACE(absl::StrCat(form.name, ", rule ", rule == SurfaceRule::kCover, ", thickness ",
                                  thickness));
        ExpectLike(form, {.rule = rule, .thickness = thickness});
      }
    }
  }
}

}  // namespace implicit_forms_test
}  // namespace voxeld::gpu::conformance
