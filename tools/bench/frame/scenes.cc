#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/geometry/footprint.h"
#include "tools/bench/frame/line_set.h"
#include "tools/bench/frame/profile_scenes.h"
#include "tools/bench/frame/shape_scenes.h"

namespace voxeld::bench::frame {
namespace {

using display::PixelFormat;

gpu::Target TargetOf(display::Geometry geometry, PixelFormat format) {
  gpu::Target target;
  target.layout.slices = display::SliceCount(geometry);
  std::visit(
      [&](const auto& shape) {
        target.layout.width = shape.width_px;
        target.layout.height = shape.height_px;
      },
      geometry.shape);
  target.layout.format = format;
  target.geometry = std::move(geometry);
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

}  // namespace

gpu::Target Stack(int32_t nx, int32_t ny, int32_t nz, PixelFormat format) {
  display::PlanarStack stack;
  stack.width_px = nx;
  stack.height_px = ny;
  for (int32_t s = 0; s < nz; ++s) stack.positions_mm.push_back(s - (nz - 1) * 0.5);
  display::Geometry geometry{stack, {}};
  geometry.grid = display::DefaultGrid(geometry);
  return TargetOf(std::move(geometry), format);
}

Scene OneLayer(std::string name, gpu::Target target) {
  Scene scene;
  scene.name = std::move(name);
  scene.target = std::move(target);
  scene.layers = {gpu::LayerRecord{.id = 1}};
  return scene;
}

namespace {

// Returns the display's voxels. If the scene `moves`, the last layer along x is left out, so that
// the contents can move into it.
Extent ExtentOf(const gpu::Target& target, bool moves) {
  const display::VoxelGrid& grid = target.geometry.grid;
  return {{0, 0, 0}, {grid.nx - (moves ? 1 : 0), grid.ny, grid.nz}};
}

uint64_t Share(double of, double share) {
  return static_cast<uint64_t>(std::max(1.0, std::round(of * share)));
}

Scene UniformLines(const std::string& name, gpu::Target target, uint64_t voxels, uint64_t seed) {
  Scene scene = OneLayer(name, std::move(target));
  const Extent extent = ExtentOf(scene.target, true);
  LineSet lines(seed);
  while (lines.voxels() < voxels) lines.AddUniform(extent);
  scene.voxels = scene.scene_voxels = lines.voxels();
  scene.contents.push_back(lines.Take());
  return scene;
}

Scene ShortLines(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("short", Stack(512, 512, 256, PixelFormat::kBitPlanes));
  const Extent extent = ExtentOf(scene.target, true);
  LineSet lines(seed);
  while (lines.lines() < count) lines.AddOfLength(extent, 20);
  scene.voxels = scene.scene_voxels = lines.voxels();
  scene.contents.push_back(lines.Take());
  return scene;
}

// Makes a scene whose lines are all replaced in each frame.
Scene Replaced(const std::string& name, gpu::Target target, uint64_t count, int32_t voxels,
               uint64_t seed) {
  Scene scene = OneLayer(name, std::move(target));
  const Extent extent = ExtentOf(scene.target, false);
  LineSet lines(seed);
  for (std::vector<Content>& set : scene.changing) {
    while (lines.lines() < count) lines.AddOfLength(extent, voxels);
    scene.voxels = scene.scene_voxels = lines.voxels();
    set.push_back(lines.Take());
  }
  return scene;
}

constexpr int32_t kMovingVoxels = 20;

// Makes `count` lines of which those inside a box at the volume's corner change and stay in the
// box. Its side is the share `side` of the volume's; at most `most` lines change.
Scene MovingInBox(uint64_t count, double side, size_t most, const std::string& where,
                  uint64_t seed) {
  Scene scene = OneLayer("", Stack(512, 512, 256, PixelFormat::kBitPlanes));
  const Extent all = ExtentOf(scene.target, false);
  Extent box{{0, 0, 0}, {}};
  for (size_t a = 0; a < 3; ++a) {
    box.hi[a] = std::max(kMovingVoxels + 1, static_cast<int32_t>(std::lround(all.hi[a] * side)));
  }
  LineSet lines(seed);
  while (lines.lines() < count) lines.AddOfLength(all, kMovingVoxels);
  Content everywhere = lines.Take(), still, inside;
  const auto is_inside = [&](size_t vertex) {
    for (size_t a = 0; a < 3; ++a) {
      if (everywhere.positions[vertex * 3 + a] >= static_cast<float>(box.hi[a])) return false;
    }
    return true;
  };
  still.record = inside.record = everywhere.record;
  for (size_t vertex = 0; vertex < everywhere.colors.size(); vertex += 2) {
    const bool moves =
        inside.colors.size() / 2 < most && is_inside(vertex) && is_inside(vertex + 1);
    Content& to = moves ? inside : still;
    for (size_t v = vertex; v < vertex + 2; ++v) {
      to.colors.push_back(everywhere.colors[v]);
      for (size_t a = 0; a < 3; ++a) to.positions.push_back(everywhere.positions[v * 3 + a]);
    }
  }
  const size_t changed = inside.colors.size() / 2;
  while (lines.lines() < changed) lines.AddOfLength(box, kMovingVoxels);
  if (!still.colors.empty()) scene.contents.push_back(std::move(still));
  scene.changing[0].push_back(std::move(inside));
  scene.changing[1].push_back(lines.Take());
  scene.name = absl::StrCat("moving, ", changed, " in ", where);
  scene.voxels = changed * kMovingVoxels;
  scene.scene_voxels = count * kMovingVoxels;
  return scene;
}

// Makes a sphere of 2 · `around` · (`bands` − 1) triangles.
Content UvSphere(double radius, double middle, int bands, int around) {
  Content mesh;
  mesh.record.kind = gpu::PrimitiveKind::kTriangles;
  mesh.record.color = 0x40C0FF;
  const auto vertex = [&](double polar, double turn) {
    for (const double p :
         {std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar)}) {
      mesh.positions.push_back(static_cast<float>(middle + radius * p));
    }
  };
  vertex(0, 0);
  for (int band = 1; band < bands; ++band) {
    for (int i = 0; i < around; ++i) {
      vertex(std::numbers::pi * band / bands, 2 * std::numbers::pi * i / around);
    }
  }
  vertex(std::numbers::pi, 0);
  const auto at = [&](int band, int i) {
    return static_cast<uint32_t>(1 + (band - 1) * around + i % around);
  };
  const uint32_t last = at(bands, 0);
  for (int i = 0; i < around; ++i) {
    mesh.indices.insert(mesh.indices.end(), {0, at(1, i), at(1, i + 1)});
    for (int band = 1; band + 1 < bands; ++band) {
      mesh.indices.insert(mesh.indices.end(), {at(band, i), at(band + 1, i), at(band + 1, i + 1)});
      mesh.indices.insert(mesh.indices.end(), {at(band, i), at(band + 1, i + 1), at(band, i + 1)});
    }
    mesh.indices.insert(mesh.indices.end(), {last, at(bands - 1, i + 1), at(bands - 1, i)});
  }
  return mesh;
}

// Makes a mesh of 101,120 triangles.
Scene Mesh(gpu::SurfaceRule rule, double share) {
  const bool thin = rule == gpu::SurfaceRule::kThin;
  Scene scene =
      OneLayer(thin ? "mesh, THIN" : "mesh, COVER", Stack(512, 512, 512, PixelFormat::kBitPlanes));
  Content sphere =
      UvSphere(250, 255.5, 159, static_cast<int>(std::max<uint64_t>(3, Share(320, share))));
  sphere.record.rule = rule;
  scene.contents.push_back(std::move(sphere));
  return scene;
}

// Makes the volume that the mesh encloses.
Scene FilledMesh(double share) {
  Scene scene = Mesh(gpu::SurfaceRule::kThin, share);
  scene.name = "mesh, filled";
  scene.contents[0].record.kind = gpu::PrimitiveKind::kFilled;
  return scene;
}

Scene Points(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("points", Stack(512, 512, 256, PixelFormat::kBitPlanes));
  const Extent extent = ExtentOf(scene.target, true);
  std::mt19937_64 random(seed);
  Content points;
  points.record.kind = gpu::PrimitiveKind::kPoints;
  points.record.color_mode = gpu::ColorMode::kPerVertex;
  for (uint64_t i = 0; i < count; ++i) {
    for (const int32_t size : extent.hi) {
      points.positions.push_back(
          static_cast<float>(random() % (static_cast<uint64_t>(size) * 256)) / 256);
    }
    points.colors.push_back(RandomColor(random));
  }
  scene.voxels = scene.scene_voxels = count;
  scene.contents.push_back(std::move(points));
  return scene;
}

Content Solid(gpu::PrimitiveKind kind, std::initializer_list<float> params, uint32_t color) {
  Content solid;
  solid.record.kind = kind;
  solid.record.fill = gpu::Fill::kSolid;
  solid.record.color = color;
  std::copy(params.begin(), params.end(), solid.record.params);
  return solid;
}

// Lines, points, triangles and solids in four layers of 256³ voxels: opaque, half opaque above it,
// added, erasing.
Scene Mixed(double share, uint64_t seed) {
  using gpu::PrimitiveKind;
  Scene scene = OneLayer("mixed", Stack(256, 256, 256, PixelFormat::kRgb888));
  scene.layers = {{.id = 1},
                  {.id = 2, .order = 1, .opacity = 128},
                  {.id = 3, .order = 2, .opacity = 200, .blend = gpu::BlendMode::kAdd},
                  {.id = 4, .order = 3, .opacity = 255, .blend = gpu::BlendMode::kErase}};
  const Extent extent = ExtentOf(scene.target, true);
  LineSet lines(seed);
  for (uint64_t i = 0; i < Share(50'000, share); ++i) lines.AddUniform(extent);
  scene.contents.push_back(lines.Take());
  Content points = std::move(Points(Share(500'000, share), seed).contents[0]);
  for (float& p : points.positions) p = std::min(p, 254.0F);
  points.layer = 3;
  scene.contents.push_back(std::move(points));
  Content sphere =
      UvSphere(100, 127, 64, static_cast<int>(std::max<uint64_t>(3, Share(128, share))));
  sphere.layer = 2;
  sphere.priority = 2;
  scene.contents.push_back(std::move(sphere));
  std::mt19937_64 random(seed);
  const auto at = [&](double lo, double hi) {
    return static_cast<float>(lo + (hi - lo) * static_cast<double>(random() >> 11) * 0x1p-53);
  };
  for (uint64_t i = 0; i < Share(200, share); ++i) {
    const float x = at(30, 225), y = at(30, 225), z = at(30, 225);
    const uint32_t color = RandomColor(random);
    Content solid;
    switch (i % 3) {
      case 0:
        solid = Solid(PrimitiveKind::kBox, {x, y, z, at(4, 30), at(4, 30), at(4, 30)}, color);
        break;
      case 1:
        solid = Solid(PrimitiveKind::kSphere, {x, y, z, at(2, 16)}, color);
        break;
      default:
        solid = Solid(PrimitiveKind::kCylinder, {x, y, z, at(2, 16), at(4, 30)}, color);
    }
    solid.layer = 1 + i % 4;
    solid.priority = static_cast<uint32_t>(i % 5);
    solid.erase = i % 10 == 9 ? 1 : 0;
    scene.contents.push_back(std::move(solid));
  }
  return scene;
}

gpu::Target LatticeTarget(int32_t n) {
  display::Lattice lattice;
  lattice.width_px = n;
  const auto middle = [n](int32_t i) { return i - (n - 1) * 0.5; };
  for (int32_t z = 0; z < n; ++z) {
    for (int32_t y = 0; y < n; ++y) {
      for (int32_t x = 0; x < n; ++x) {
        lattice.points_mm.push_back(display::Vec3{middle(x), middle(y), middle(z)});
      }
    }
  }
  display::Geometry geometry{lattice, {}};
  geometry.grid = display::DefaultGrid(geometry);
  return TargetOf(std::move(geometry), PixelFormat::kRgb888);
}

// Two panels of 128×64, 360 slices per turn, in 128×128×64 voxels that are all lit, also after they
// have moved. If the panels are tilted, footprints are stored per pixel.
Scene LitRotor(const char* name, float tilt_deg, uint64_t seed) {
  display::Rotor rotor;
  rotor.slices_per_turn = 360;
  rotor.width_px = 128;
  rotor.height_px = 64;
  rotor.panels.resize(2);
  rotor.panels[0].eccentricity_mm = 13.5;
  rotor.panels[1].eccentricity_mm = 0.375;
  for (display::Rotor::Panel& panel : rotor.panels) panel.tilt_deg = tilt_deg;
  Scene scene = OneLayer(
      name, TargetOf({rotor, {128, 128, 64, {1, 1, 1}, {-64, -64, -32}}}, PixelFormat::kRgb332));
  display::Tone::Curve curve;
  for (size_t c = 0; c < 256; ++c) {
    curve[c] =
        static_cast<uint16_t>(std::lround(65535 * std::pow(static_cast<double>(c) / 255, 2.2)));
  }
  scene.target.tone.SetCurve(curve);
  std::mt19937_64 random(seed);
  Content points;
  points.record.kind = gpu::PrimitiveKind::kPoints;
  points.record.color_mode = gpu::ColorMode::kPerVertex;
  for (int32_t z = 0; z < 64; ++z) {
    for (int32_t y = 0; y < 128; ++y) {
      for (int32_t x = -1; x < 128; ++x) {
        for (const int32_t p : {x, y, z}) points.positions.push_back(static_cast<float>(p) + 0.5F);
        points.colors.push_back(RandomColor(random));
      }
    }
  }
  scene.voxels = scene.scene_voxels = 128 * 128 * 64;
  scene.contents.push_back(std::move(points));
  scene.slicing_only = true;
  scene.traffic = Traffic::kVolumeAndPictures;
  return scene;
}

gpu::Target LargeStack() { return Stack(1024, 1024, 256, PixelFormat::kBitPlanes); }

// Rows whose changes, and with them the dirty region, lie in a part of the volume.
std::vector<MakeScene> MovingRows(uint64_t seed, double share) {
  const uint64_t count = Share(1'000'000, share);
  std::vector<MakeScene> rows = {[=] { return MovingInBox(count, 1.0 / 8, 1000, "a cube", seed); }};
  for (const int percent : {1, 5, 20, 50, 100}) {
    rows.push_back([=] {
      return MovingInBox(count, std::cbrt(percent / 100.0), count,
                         absl::StrCat(percent, " % of the volume"), seed);
    });
  }
  return rows;
}

struct Named {
  const char* name;
  std::vector<MakeScene> (*rows)(uint64_t seed, double share);
};

// Lines between random places: 1,100 voxels each on average, in 2048³.
Scene HugeLines(uint64_t count, uint64_t seed) {
  Scene scene = OneLayer("huge", Stack(2048, 2048, 2048, PixelFormat::kBitPlanes));
  const Extent extent = ExtentOf(scene.target, true);
  LineSet lines(seed);
  while (lines.lines() < count) lines.AddUniform(extent);
  scene.voxels = scene.scene_voxels = lines.voxels();
  scene.contents.push_back(lines.Take());
  return scene;
}

constexpr Named kScenes[] = {
    {"lines1g",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return UniformLines("lines1g", LargeStack(), Share(1e9, share), seed); }};
     }},
    {"huge",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return HugeLines(Share(1e6, share), seed); }};
     }},
    {"lines100m",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return UniformLines("lines100m", LargeStack(), Share(1e8, share), seed); }};
     }},
    {"lines30m",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] {
         Scene scene = UniformLines("lines30m", Stack(512, 512, 256, PixelFormat::kBitPlanes),
                                    Share(3e7, share), seed);
         scene.plain_peer = true;
         return scene;
       }};
     }},
    {"short",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return ShortLines(Share(1e7, share), seed); }};
     }},
    {"mesh",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       return {[=] { return Mesh(gpu::SurfaceRule::kThin, share); },
               [=] { return Mesh(gpu::SurfaceRule::kCover, share); }};
     }},
    {"filled",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       return {[=] { return FilledMesh(share); }};
     }},
    {"points",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return Points(Share(1e7, share), seed); }};
     }},
    {"cloud",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return CubePoints(Share(1e7, share), seed); }};
     }},
    {"spheres",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return InstancedSpheres(Share(1e5, share), seed); }};
     }},
    {"gyroid",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       return {[=] { return Gyroid(share); }};
     }},
    {"implicit",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       std::vector<MakeScene> rows;
       for (const int32_t n : {128, 256, 512, 1024}) {
         if (n * std::cbrt(share) < 120) break;
         rows.push_back([=] { return ImplicitSphere(n); });
       }
       return rows;
     }},
    {"volume",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       return {[=] { return SampledVolume(false, share); }};
     }},
    {"isosurface",
     [](uint64_t, double share) -> std::vector<MakeScene> {
       return {[=] { return SampledVolume(true, share); }};
     }},
    {"mixed",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return Mixed(share, seed); }};
     }},
    {"moving", MovingRows},
    {"vx1",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] {
         Scene scene = Replaced("vx1", Stack(912, 1140, 64, PixelFormat::kBitPlanes),
                                Share(20'000, share), 100, seed);
         scene.volumes_per_second = 15;
         return scene;
       }};
     }},
    {"rgb3",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return {[=] { return Replaced("rgb3", LatticeTarget(64), Share(10'000, share), 20, seed); }};
     }},
    {"rotor",
     [](uint64_t seed, double) -> std::vector<MakeScene> {
       return {[=] { return LitRotor("rotor", 0, seed); }};
     }},
    {"tilted",
     [](uint64_t seed, double) -> std::vector<MakeScene> {
       return {[=] { return LitRotor("tilted", 10, seed); }};
     }},
    {"profiles",
     [](uint64_t seed, double share) -> std::vector<MakeScene> {
       return ProfileScenes(seed, share);
     }},
};

}  // namespace

std::vector<std::string> SceneNames() {
  std::vector<std::string> names;
  for (const Named& scene : kScenes) names.emplace_back(scene.name);
  return names;
}

std::vector<MakeScene> ScenesOf(const std::string& name, uint64_t seed, double share) {
  for (const Named& scene : kScenes) {
    if (name == scene.name) return scene.rows(seed, share);
  }
  return {};
}

}  // namespace voxeld::bench::frame
