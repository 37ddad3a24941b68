#include "daemon/pipeline/test_pattern.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/pipeline/slice_numbers.h"
#include "display/geometry/corrector.h"
#include "gpu/delta.h"

namespace voxeld::daemon {
namespace {

constexpr uint64_t kFirstPatternNumber = uint64_t{1} << 63;

// How far the corners lie from the grid's edge, in voxels: in the edge voxels, but in a rotor or a helix on the
// box that stands in the cylinder that its panels or blades sweep.
double CornerInset(const display::Geometry& geometry, double cells, double pitch_mm) {
  constexpr double kEdge = 0.5;
  double radius_mm = 0;
  if (const auto* rotor = std::get_if<display::Rotor>(&geometry.shape)) {
    for (const display::Rotor::Panel& panel : rotor->panels) {
      radius_mm = std::max(radius_mm, rotor->width_px * panel.pitch_u_mm / 2);
    }
  } else if (const auto* helix = std::get_if<display::Helix>(&geometry.shape)) {
    radius_mm = std::min({helix->radius_mm, helix->width_px * helix->pitch_u_mm / 2,
                          helix->height_px * helix->pitch_v_mm / 2});
  } else {
    return kEdge;
  }
  constexpr double kHalfDiagonal = 0.70710678;
  return std::max(kEdge, cells / 2 - radius_mm * kHalfDiagonal / pitch_mm + 1);
}

// The middles of the voxels that hold a lattice's lights, by pixel; nothing for other geometries.
std::vector<std::optional<display::Vec3>> LightsOf(const display::Geometry& geometry) {
  const auto* lattice = std::get_if<display::Lattice>(&geometry.shape);
  if (lattice == nullptr) return {};
  const display::VoxelGrid& grid = geometry.grid;
  std::vector<std::optional<display::Vec3>> lights = lattice->points_mm;
  const display::Corrector corrector(geometry.correction);
  for (std::optional<display::Vec3>& light : lights) {
    if (!light.has_value()) continue;
    light = corrector.ToTrue(*light);
    light = {std::floor((light->x - grid.origin_mm.x) / grid.pitch_mm.x) + 0.5,
             std::floor((light->y - grid.origin_mm.y) / grid.pitch_mm.y) + 0.5,
             std::floor((light->z - grid.origin_mm.z) / grid.pitch_mm.z) + 0.5};
    const bool inside = light->x > 0 && light->x < grid.nx && light->y > 0 && light->y < grid.ny &&
                        light->z > 0 && light->z < grid.nz;
    if (!inside) light.reset();
  }
  return lights;
}

// A geometry under construction.
struct Shape {
  GeometryData data;
  std::vector<float> positions;
  std::vector<uint32_t> colors;
  bool any = false;

  void Extend(double x, double y, double z) {
    const double p[3] = {x, y, z};
    for (int axis = 0; axis < 3; ++axis) {
      data.min[axis] = any ? std::min(data.min[axis], p[axis]) : p[axis];
      data.max[axis] = any ? std::max(data.max[axis], p[axis]) : p[axis];
    }
    any = true;
  }

  void Vertex(double x, double y, double z, uint32_t color) {
    positions.insert(positions.end(), {float(x), float(y), float(z)});
    colors.push_back(color);
    ++data.record.vertex_count;
    data.record.color_mode = gpu::ColorMode::kPerVertex;
    Extend(x, y, z);
  }
};

class Pattern {
 public:
  // No two patterns share a number.
  Pattern(TestPattern pattern, const display::Geometry& geometry)
      : nx_(geometry.grid.nx),
        ny_(geometry.grid.ny),
        nz_(geometry.grid.nz),
        inset_x_(CornerInset(geometry, nx_, geometry.grid.pitch_mm.x)),
        inset_y_(CornerInset(geometry, ny_, geometry.grid.pitch_mm.y)),
        lights_(LightsOf(geometry)),
        lights_a_slice_(
            lights_.empty() ? 1 : size_t(std::get<display::Lattice>(geometry.shape).width_px)),
        first_number_(kFirstPatternNumber + (uint64_t(pattern) << 32)) {}

  void Axes() {
    const double x = nx_ / 2, y = ny_ / 2, z = nz_ / 2;
    Shape axes;
    axes.data.record.kind = gpu::PrimitiveKind::kSegments;
    Segment(axes, {x, y, z}, {nx_ - 0.5, y, z}, 0xFF0000);
    Segment(axes, {x, y, z}, {x, ny_ - 0.5, z}, 0x00FF00);
    Segment(axes, {x, y, z}, {x, y, nz_ - 0.5}, 0x0000FF);
    axes.data.record.thickness = 2;
    Add("axes", std::move(axes), 0);
  }

  void Corners() {
    Shape edges, balls;
    edges.data.record.kind = gpu::PrimitiveKind::kSegments;
    balls.data.record.kind = gpu::PrimitiveKind::kPoints;
    balls.data.record.thickness = float(std::max(1.0, std::min({nx_, ny_, nz_}) / 8));
    static constexpr uint32_t kColors[8] = {0xFFFFFF, 0xFF0000, 0x00FF00, 0xFFFF00,
                                            0x0000FF, 0xFF00FF, 0x00FFFF, 0xFF8000};
    std::array<display::Vec3, 8> corners;
    for (int corner = 0; corner < 8; ++corner) corners[size_t(corner)] = Corner(corner);
    for (size_t corner = 0; corner < 8; ++corner) {
      const display::Vec3 at = corners[corner];
      balls.Vertex(at.x, at.y, at.z, kColors[corner]);
      for (const size_t axis : {1u, 2u, 4u}) {
        if ((corner & axis) == 0) Segment(edges, at, corners[corner | axis], 0x808080);
      }
    }
    Add("edges", std::move(edges), 0);
    Add("corners", std::move(balls), 1);
  }

  void Grid() {
    Shape dots;
    dots.data.record.kind = gpu::PrimitiveKind::kPoints;
    if (!lights_.empty()) {
      for (size_t pixel = 0; pixel < lights_.size(); ++pixel) {
        const std::optional<display::Vec3>& at = lights_[pixel];
        if (pixel % lights_a_slice_ % 8 != 0 || !at.has_value()) continue;
        dots.Vertex(at->x, at->y, at->z, 0xFFFFFF);
      }
      return Add("dots", std::move(dots), 0);
    }
    for (double z = Phase(nz_); z < nz_; z += 8) {
      for (double y = Phase(ny_); y < ny_; y += 8) {
        for (double x = Phase(nx_); x < nx_; x += 8) dots.Vertex(x, y, z, 0xFFFFFF);
      }
    }
    Add("dots", std::move(dots), 0);
  }

  void Ramp(bool whole) {
    // Boxes a voxel thick along x: one for each level,
    // or each voxel where there are fewer of those.
    const int steps = int(std::min(256.0, nx_));
    for (int i = 0; i < steps; ++i) {
      const double x0 = std::floor(nx_ * i / steps), x1 = std::floor(nx_ * (i + 1) / steps);
      const auto level = uint32_t(steps == 1 ? 255 : i * 255 / (steps - 1));
      const uint32_t grey = level << 16 | level << 8 | level;
      if (whole || !lights_.empty()) {
        Box(absl::StrCat("x", i), {x0, 0, 0}, {x1, ny_, nz_}, grey);
        continue;
      }
      const double y = std::floor(ny_ / 2), z = std::floor(nz_ / 2);
      Box(absl::StrCat("z", i), {x0, 0, z}, {x1, ny_, z + 1}, grey);
      Box(absl::StrCat("y", i), {x0, y, 0}, {x1, y + 1, nz_}, grey);
    }
  }

  void Bars() {
    constexpr uint32_t kBars[8] = {0xFFFFFF, 0xFFFF00, 0x00FFFF, 0x00FF00,
                                   0xFF00FF, 0xFF0000, 0x0000FF, 0};
    for (int i = 0; i < 8; ++i) {
      const double x0 = std::floor(nx_ * i / 8), x1 = std::floor(nx_ * (i + 1) / 8);
      if (x1 > x0) Box(absl::StrCat("bar", i), {x0, 0, 0}, {x1, ny_, nz_}, kBars[i]);
    }
  }

  void Slices(const display::Geometry& geometry) {
    Shape pixels;
    pixels.data.record.kind = gpu::PrimitiveKind::kPoints;
    for (const NumberedVoxel& voxel : SliceNumbers(geometry)) {
      pixels.Vertex(voxel.at.x, voxel.at.y, voxel.at.z, voxel.rgb);
    }
    Add("numbers", std::move(pixels), 0);
  }

  // Upright lines at a quarter, a half and three quarters of the way from the middle to each side: red along +x, green along
  // +y, white on the other two. What should be one and is drawn twice, or as an arc, tells of a panel that is not where it
  // is thought to be.
  void Posts() {
    Shape posts;
    posts.data.record.kind = gpu::PrimitiveKind::kSegments;
    const double x = nx_ / 2, y = ny_ / 2;
    for (const double share : {0.25, 0.5, 0.75}) {
      const auto post = [&](double px, double py, uint32_t color) {
        Segment(posts, {px, py, 0.5}, {px, py, nz_ - 0.5}, color);
      };
      post(x + share * x, y, 0xFF0000);
      post(x, y + share * y, 0x00FF00);
      post(x - share * x, y, 0xFFFFFF);
      post(x, y - share * y, 0xFFFFFF);
    }
    Add("posts", std::move(posts), 0);
  }

  // Lying rectangles with their diagonals at the bottom, in the middle and at the top, their corners as those of the corners'
  // pattern. Straight lines that are not seen straight, and right angles that are not, tell of keystone.
  void Frames() {
    Shape frames;
    frames.data.record.kind = gpu::PrimitiveKind::kSegments;
    for (const double z : {0.5, std::floor(nz_ / 2) + 0.5, nz_ - 0.5}) {
      const display::Vec3 a{inset_x_, inset_y_, z}, b{nx_ - inset_x_, inset_y_, z};
      const display::Vec3 c{nx_ - inset_x_, ny_ - inset_y_, z}, d{inset_x_, ny_ - inset_y_, z};
      Segment(frames, a, b, 0xFFFFFF);
      Segment(frames, b, c, 0xFFFFFF);
      Segment(frames, c, d, 0xFFFFFF);
      Segment(frames, d, a, 0xFFFFFF);
      Segment(frames, a, c, 0x808080);
      Segment(frames, b, d, 0x808080);
    }
    Add("frames", std::move(frames), 0);
  }

  void White() { Box("white", {0, 0, 0}, {nx_, ny_, nz_}, 0xFFFFFF); }

  SnapshotPtr Finish(uint64_t number) {
    auto snapshot = std::make_shared<Snapshot>();
    layer_.number = first_number_;
    snapshot->number = number;
    snapshot->entities = layer_.entities.size();
    snapshot->layers.Put({0, "test pattern"}, std::make_shared<const Layer>(std::move(layer_)));
    return snapshot;
  }

 private:
  static double Phase(double cells) { return std::min(4.5, std::floor(cells / 2) + 0.5); }

  display::Vec3 Corner(int corner) const {
    const display::Vec3 at = {corner & 1 ? nx_ - inset_x_ : inset_x_,
                              corner & 2 ? ny_ - inset_y_ : inset_y_, corner & 4 ? nz_ - 0.5 : 0.5};
    display::Vec3 nearest = at;
    double least = std::numeric_limits<double>::max();
    for (const std::optional<display::Vec3>& light : lights_) {
      if (!light.has_value()) continue;
      const double dx = light->x - at.x, dy = light->y - at.y, dz = light->z - at.z;
      const double square = dx * dx + dy * dy + dz * dz;
      if (square < least) nearest = *light, least = square;
    }
    return nearest;
  }

  static void Segment(Shape& shape, display::Vec3 a, display::Vec3 b, uint32_t color) {
    shape.Vertex(a.x, a.y, a.z, color);
    shape.Vertex(b.x, b.y, b.z, color);
  }

  void Box(const std::string& id, display::Vec3 low, display::Vec3 high, uint32_t color) {
    Shape box;
    box.data.record.kind = gpu::PrimitiveKind::kBox;
    box.data.record.fill = gpu::Fill::kSolid;
    box.data.record.color = color;
    const double min[3] = {low.x, low.y, low.z}, max[3] = {high.x, high.y, high.z};
    for (int axis = 0; axis < 3; ++axis) {
      box.data.record.params[axis] = float((min[axis] + max[axis]) / 2);
      box.data.record.params[axis + 3] = float(max[axis] - min[axis]);
    }
    box.Extend(low.x, low.y, low.z);
    box.Extend(high.x, high.y, high.z);
    Add(id, std::move(box), 0);
  }

  void Add(const std::string& id, Shape shape, uint32_t priority) {
    shape.data.arrays =
        gpu::GeometryArrays::Of(shape.data.record, shape.positions, {}, shape.colors);
    auto entity = std::make_shared<Entity>();
    entity->number = first_number_ + layer_.entities.size();
    entity->data.content = std::make_shared<const GeometryData>(std::move(shape.data));
    entity->data.priority = priority;
    layer_.entities.Put(id, std::move(entity));
  }

  const double nx_, ny_, nz_;
  const double inset_x_, inset_y_;  // of the corners, voxels
  const std::vector<std::optional<display::Vec3>> lights_;
  const size_t lights_a_slice_;
  const uint64_t first_number_;
  Layer layer_;
};

}  // namespace

SnapshotPtr MakePattern(TestPattern pattern, const display::Geometry& geometry, uint64_t number) {
  Pattern made(pattern, geometry);
  switch (pattern) {
    case TestPattern::kNone:
      break;
    case TestPattern::kAxes:
      made.Axes();
      break;
    case TestPattern::kCorners:
      made.Corners();
      break;
    case TestPattern::kGrid:
      made.Grid();
      break;
    case TestPattern::kRamp:
      made.Ramp(false);
      break;
    case TestPattern::kWhite:
      made.White();
      break;
    case TestPattern::kBars:
      made.Bars();
      break;
    case TestPattern::kDensity:
      made.Ramp(true);
      break;
    case TestPattern::kSlices:
      made.Slices(geometry);
      break;
    case TestPattern::kPosts:
      made.Posts();
      break;
    case TestPattern::kFrames:
      made.Frames();
      break;
  }
  return made.Finish(number);
}

}  // namespace voxeld::daemon
