#include "tools/voxelctl/render/render_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "display/geometry/corrector.h"
#include "display/geometry/flat_footprints.h"
#include "display/geometry/footprint.h"
#include "tools/voxelctl/render/canvas.h"

namespace voxeld::voxelctl {
namespace {

using display::Vec3;

constexpr int kSupersampling = 2;
constexpr double kFarBrightness = 0.22;  // at depth 1; 1 at depth 0
constexpr double kCellSize = 1.30;       // makes neighbouring cells touch
// Radius of a lattice's light, in the shortest side of its cell.
constexpr double kBallSize = 0.30;
constexpr double kLeastRadius = 1.1;  // of a splat, in elements
constexpr Light kOutline = {0.050f, 0.075f, 0.115f};
constexpr int kRingSteps = 96;

Vec3 Minus(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec3 Times(const Vec3& a, double f) { return {a.x * f, a.y * f, a.z * f}; }
Vec3 Plus(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
double Length2(const Vec3& a) { return a.x * a.x + a.y * a.y + a.z * a.z; }

struct Edge {
  Vec3 from, to;
};

std::vector<Edge> BoxOutline(const Vec3& low, const Vec3& high) {
  std::vector<Edge> edges;
  const auto corner = [&](int i) {
    return Vec3{i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z};
  };
  for (int i = 0; i < 8; ++i) {
    for (const int bit : {1, 2, 4}) {
      if ((i & bit) == 0) edges.push_back({corner(i), corner(i | bit)});
    }
  }
  return edges;
}

std::vector<Edge> CylinderOutline(double radius, double low, double high) {
  std::vector<Edge> edges;
  const auto at = [&](int i, double z) {
    const double a = i * 2 * std::numbers::pi / kRingSteps;
    return Vec3{radius * std::cos(a), radius * std::sin(a), z};
  };
  for (int i = 0; i < kRingSteps; ++i) {
    edges.push_back({at(i, low), at(i + 1, low)});
    edges.push_back({at(i, high), at(i + 1, high)});
    if (i % (kRingSteps / 8) == 0) edges.push_back({at(i, low), at(i, high)});
  }
  return edges;
}

std::vector<Edge> Outline(const display::Geometry& geometry) {
  const display::VoxelGrid& grid = geometry.grid;
  const Vec3 low = grid.origin_mm;
  const Vec3 high =
      Plus(low, {grid.nx * grid.pitch_mm.x, grid.ny * grid.pitch_mm.y, grid.nz * grid.pitch_mm.z});
  if (!std::holds_alternative<display::Rotor>(geometry.shape) &&
      !std::holds_alternative<display::Helix>(geometry.shape)) {
    return BoxOutline(low, high);
  }
  return CylinderOutline(std::min(high.x - low.x, high.y - low.y) / 2, low.z, high.z);
}

// Returns the slice whose light is beside that of `slice`; `slice` itself without one.
int32_t Neighbour(const display::Geometry& geometry, int32_t slice, int32_t slices) {
  if (const auto* rotor = std::get_if<display::Rotor>(&geometry.shape)) {
    return (slice + static_cast<int32_t>(rotor->panels.size())) % slices;
  }
  if (std::holds_alternative<display::Helix>(geometry.shape)) return (slice + 1) % slices;
  return slice + 1 < slices ? slice + 1 : std::max(slice - 1, 0);
}

class Painter {
 public:
  Painter(const Volume& volume, const Camera& camera, Canvas* canvas)
      : volume_(volume), camera_(camera), canvas_(canvas) {
    for (size_t i = 0; i < linear_.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      linear_[i] =
          static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
    }
  }

  // Lights of a lattice are points: each is a small ball, whatever is beside it.
  void PaintLights(const display::Lattice& lattice) {
    const double radius =
        kBallSize * std::min({lattice.cell_mm.x, lattice.cell_mm.y, lattice.cell_mm.z});
    const std::array<Vec3, 3> axes = {camera_.Rotate({radius, 0, 0}),
                                      camera_.Rotate({0, radius, 0}),
                                      camera_.Rotate({0, 0, radius})};
    const display::Corrector corrector(volume_.geometry.correction);
    for (int32_t slice = 0; slice < volume_.slices; ++slice) {
      for (int32_t u = 0; u < volume_.width; ++u) {
        const uint8_t* pixel = volume_.pixel(slice, u, 0);
        if ((pixel[0] | pixel[1] | pixel[2]) == 0) continue;
        const Vec3 at = display::PixelPosition(volume_.geometry, corrector, slice, u, 0);
        if (std::isnan(at.x)) continue;
        PaintCell(camera_.ToCamera(at), axes, pixel, 1);
      }
    }
  }

  // Paints pixels that are not in straight columns: each one separately, extended half-way to its
  // neighbours.
  void PaintPixels(int32_t slice) {
    const display::Geometry& geometry = volume_.geometry;
    const display::Corrector corrector(geometry.correction);
    const int32_t beside = Neighbour(geometry, slice, volume_.slices);
    const Vec3& pitch = geometry.grid.pitch_mm;
    const double widest = std::max({pitch.x, pitch.y, pitch.z}), far = 4 * widest * widest;
    const auto next = [](int32_t i, int32_t count) {
      return i + 1 < count ? i + 1 : std::max(i - 1, 0);
    };
    for (int32_t v = 0; v < volume_.height; ++v) {
      for (int32_t u = 0; u < volume_.width; ++u) {
        const uint8_t* pixel = volume_.pixel(slice, u, v);
        if ((pixel[0] | pixel[1] | pixel[2]) == 0) continue;
        const Vec3 at = display::PixelPosition(geometry, corrector, slice, u, v);
        if (std::isnan(at.x)) continue;
        const auto half_way = [&](int32_t s, int32_t i, int32_t j) {
          const Vec3 to = display::PixelPosition(geometry, corrector, s, i, j);
          return std::isnan(to.x) ? Vec3{} : Times(Minus(to, at), 0.5);
        };
        std::array<Vec3, 3> axes = {half_way(slice, next(u, volume_.width), v),
                                    half_way(slice, u, next(v, volume_.height)),
                                    half_way(beside, u, v)};
        // At the start of a blade the neighbours are far away.
        for (Vec3& axis : axes) {
          if (Length2(axis) > far) axis = {};
        }
        // Slices are dense near a rotor's axis, so each contributes less to the glow.
        const double crowding = std::sqrt(Length2(axes[2]) / std::max(Length2(axes[0]), 1e-18));
        const bool crowds =
            std::holds_alternative<display::Rotor>(geometry.shape) && beside != slice;
        const auto weight = static_cast<float>(crowds ? std::clamp(crowding, 0.05, 1.0) : 1);
        for (Vec3& axis : axes) axis = camera_.Rotate(Times(axis, kCellSize));
        PaintCell(camera_.ToCamera(at), axes, pixel, weight);
      }
    }
  }

  // Paints a column of pixels. Pixel (u, v) of a slice is at corner + v·step_v: the columns are
  // straight.
  void PaintColumn(int32_t slice, int32_t u) {
    const int32_t bottom = FirstLit(slice, u);
    if (bottom < 0) return;
    const display::Geometry& geometry = volume_.geometry;
    const Vec3 base = display::PixelPosition(geometry, slice, u, 0);
    const int32_t beside = Neighbour(geometry, slice, volume_.slices);
    // Half of the distances to the next pixel along u, along v, and to the next slice.
    std::array<Vec3, 3> axes = {};
    if (volume_.width > 1) {
      const int32_t next = u + 1 < volume_.width ? u + 1 : u - 1;
      axes[0] = Times(Minus(display::PixelPosition(geometry, slice, next, 0), base), 0.5);
    }
    Vec3 step_v;
    if (volume_.height > 1) step_v = Minus(display::PixelPosition(geometry, slice, u, 1), base);
    axes[1] = Times(step_v, 0.5);
    axes[2] = Times(Minus(display::PixelPosition(geometry, beside, u, 0), base), 0.5);
    // Slices are dense near a rotor's axis, so each contributes less to the glow.
    const double crowding = std::sqrt(Length2(axes[2]) / std::max(Length2(axes[0]), 1e-18));
    const auto weight = static_cast<float>(beside == slice ? 1 : std::clamp(crowding, 0.05, 1.0));
    // The surface shows one pixel, but an eye sees the light of all dense slices together, relative
    // to the sparsest.
    const bool turns = std::holds_alternative<display::Rotor>(geometry.shape) && beside != slice;
    const double sparse = turns ? SparsestStep(geometry, slice, beside) : 0;
    const double step = std::sqrt(Length2(axes[2]));
    const auto together =
        static_cast<float>(turns ? std::clamp(sparse / std::max(step, 1e-9), 1.0, 255.0) : 1);
    for (Vec3& axis : axes) axis = camera_.Rotate(Times(axis, kCellSize));
    for (int32_t v = bottom; v < volume_.height; ++v) {
      const uint8_t* pixel = volume_.pixel(slice, u, v);
      if ((pixel[0] | pixel[1] | pixel[2]) == 0) continue;
      PaintCell(camera_.ToCamera(Plus(base, Times(step_v, v))), axes, pixel, weight, together);
    }
  }

 private:
  // Returns half of the distance from a slice's first or last column to the next slice's, whichever
  // is greater.
  double SparsestStep(const display::Geometry& geometry, int32_t slice, int32_t beside) const {
    double most = 0;
    for (const int32_t u : {0, volume_.width - 1}) {
      const Vec3 way = Minus(display::PixelPosition(geometry, beside, u, 0),
                             display::PixelPosition(geometry, slice, u, 0));
      most = std::max(most, std::sqrt(Length2(way)) / 2);
    }
    return most;
  }

  int32_t FirstLit(int32_t slice, int32_t u) const {
    for (int32_t v = 0; v < volume_.height; ++v) {
      const uint8_t* pixel = volume_.pixel(slice, u, v);
      if ((pixel[0] | pixel[1] | pixel[2]) != 0) return v;
    }
    return -1;
  }

  void PaintCell(const Vec3& at, const std::array<Vec3, 3>& axes, const uint8_t* pixel,
                 float weight, float together = 1) {
    Ellipse shape{.x = camera_.ScreenX(at),
                  .y = camera_.ScreenY(at),
                  .xx = kLeastRadius * kLeastRadius,
                  .xy = 0,
                  .yy = kLeastRadius * kLeastRadius};
    const double scale = camera_.focal() / at.z;
    for (const Vec3& axis : axes) {
      const double dx = scale * (axis.x - at.x / at.z * axis.z);
      const double dy = -scale * (axis.y - at.y / at.z * axis.z);
      shape.xx += dx * dx;
      shape.xy += dx * dy;
      shape.yy += dy * dy;
    }
    const double depth = camera_.Depth(at);
    const auto cue = static_cast<float>(1 + (kFarBrightness - 1) * std::clamp(depth, 0.0, 1.0));
    // Limited to full brightness, with the same colour.
    const float most = std::max({pixel[0], pixel[1], pixel[2]});
    const float times = std::max(1.0f, std::min(together, 255 / most));
    const auto light = [&](int channel) {
      return linear_[static_cast<size_t>(std::lround(pixel[channel] * times))] * cue;
    };
    canvas_->Splat(shape, static_cast<float>(depth), {light(0), light(1), light(2)}, weight);
  }

  const Volume& volume_;
  const Camera& camera_;
  Canvas* canvas_;
  std::array<float, 256> linear_{};
};

void DrawOutline(const std::vector<Edge>& edges, const Camera& camera, Canvas* canvas) {
  for (const Edge& edge : edges) {
    const Vec3 a = camera.ToCamera(edge.from), b = camera.ToCamera(edge.to);
    const auto near =
        static_cast<float>(std::clamp(camera.Depth(a) / 2 + camera.Depth(b) / 2, 0.0, 1.0));
    const float cue = 1.25f - 0.85f * near;
    canvas->Line(camera.ScreenX(a), camera.ScreenY(a), static_cast<float>(camera.Depth(a)),
                 camera.ScreenX(b), camera.ScreenY(b), static_cast<float>(camera.Depth(b)),
                 kSupersampling * 1.1, {kOutline.r * cue, kOutline.g * cue, kOutline.b * cue});
  }
}

struct Stroke {
  double x0, y0, x1, y1;  // in units of the letter's height, y up, relative to its centre
};

// The letters x, y and z consist of straight lines, so no font is needed.
constexpr std::array<Stroke, 2> kX = {{{-0.35, -0.5, 0.35, 0.5}, {-0.35, 0.5, 0.35, -0.5}}};
constexpr std::array<Stroke, 3> kY = {{{-0.35, 0.5, 0, 0}, {0.35, 0.5, 0, 0}, {0, 0, 0, -0.5}}};
constexpr std::array<Stroke, 3> kZ = {
    {{-0.35, 0.5, 0.35, 0.5}, {0.35, 0.5, -0.35, -0.5}, {-0.35, -0.5, 0.35, -0.5}}};

// Draws the axes' directions in the lower left corner, without perspective.
void DrawAxes(const Camera& camera, int width, int height, Canvas* canvas) {
  struct Axis {
    Vec3 direction;
    Light light;
    std::span<const Stroke> letter;
  };
  const std::array<Axis, 3> axes = {{{{1, 0, 0}, {0.70f, 0.10f, 0.09f}, kX},
                                     {{0, 1, 0}, {0.10f, 0.52f, 0.12f}, kY},
                                     {{0, 0, 1}, {0.14f, 0.30f, 0.90f}, kZ}}};
  const double length = std::min(width, height) * 0.055;
  const double x0 = length * 1.7, y0 = height - length * 1.7;
  for (const Axis& axis : axes) {
    const Vec3 d = camera.Rotate(axis.direction);
    const double x1 = x0 + d.x * length, y1 = y0 - d.y * length;
    canvas->Line(x0, y0, 0, x1, y1, 0, kSupersampling * 1.6, axis.light);
    const double x2 = x0 + d.x * length * 1.28, y2 = y0 - d.y * length * 1.28;
    const double size = length * 0.26;
    for (const Stroke& s : axis.letter) {
      canvas->Line(x2 + s.x0 * size, y2 - s.y0 * size, 0, x2 + s.x1 * size, y2 - s.y1 * size, 0,
                   kSupersampling * 1.2, axis.light);
    }
  }
}

}  // namespace

absl::Status CheckVolume(const Volume& volume) {
  absl::Status status = display::ValidateGeometry(volume.geometry);
  if (!status.ok()) return status;
  const int32_t slices = display::SliceCount(volume.geometry);
  const auto [width, height] =
      std::visit([](const auto& shape) { return std::pair(shape.width_px, shape.height_px); },
                 volume.geometry.shape);
  if (volume.slices != slices || volume.width != width || volume.height != height) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the volume has ", volume.slices, " slices of ", volume.width, "x", volume.height,
        "; the display's geometry has ", slices, " of ", width, "x", height));
  }
  if (volume.rgb.size() != volume.slice_bytes() * static_cast<size_t>(slices)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the volume has ", volume.rgb.size(), " bytes; ",
                     volume.slice_bytes() * static_cast<size_t>(slices), " are expected"));
  }
  return absl::OkStatus();
}

Image RenderVolume(const Volume& volume, const RenderOptions& options) {
  const int width = options.width * kSupersampling, height = options.height * kSupersampling;
  const std::vector<Edge> outline = Outline(volume.geometry);
  std::vector<Vec3> corners;
  for (const Edge& edge : outline) corners.insert(corners.end(), {edge.from, edge.to});
  const Camera camera(options.angles, corners, width, height, options.around);
  Canvas canvas(width, height);
  Painter painter(volume, camera, &canvas);
  if (const auto* lattice = std::get_if<display::Lattice>(&volume.geometry.shape)) {
    painter.PaintLights(*lattice);
  } else if (display::IsFlat(volume.geometry)) {
    for (int32_t slice = 0; slice < volume.slices; ++slice) painter.PaintPixels(slice);
  } else {
    for (int32_t slice = 0; slice < volume.slices; ++slice) {
      for (int32_t u = 0; u < volume.width; ++u) painter.PaintColumn(slice, u);
    }
  }
  DrawOutline(outline, camera, &canvas);
  DrawAxes(camera, width, height, &canvas);
  return canvas.Develop(kSupersampling);
}

}  // namespace voxeld::voxelctl
