#include "tests/conformance/scene_generator.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <variant>

#include "display/geometry/footprint.h"
#include "tests/conformance/program_generator.h"
#include "tests/conformance/samples_generator.h"

namespace voxeld::gpu::conformance {

uint64_t SeedOr(uint64_t fallback) {
  const char* seed = std::getenv("VOXELD_SEED");
  return seed == nullptr ? fallback : std::strtoull(seed, nullptr, 0);
}

int DeltasWanted() {
  const char* deltas = std::getenv("VOXELD_DELTAS");
  return deltas == nullptr ? 1000 : std::atoi(deltas);
}

int64_t SceneGenerator::Int(int64_t low, int64_t high) {
  return std::uniform_int_distribution<int64_t>(low, high)(engine_);
}
double SceneGenerator::Real(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(engine_);
}
bool SceneGenerator::Chance(double probability) { return Real(0, 1) < probability; }

uint64_t SceneGenerator::RandomId(const auto& map) {
  return std::next(map.begin(), Int(0, static_cast<int64_t>(map.size()) - 1))->first;
}

Target SceneGenerator::RandomTarget() {
  Target target;
  switch (Int(0, 3)) {
    case 3:
      target.geometry.shape = RandomHelix();
      break;
    case 0:
      target.geometry.shape = RandomStack();
      break;
    case 1:
      target.geometry.shape = RandomRotor();
      break;
    case 2:
      target.geometry.shape = RandomLattice();
      break;
  }
  if (Chance(0.25)) target.geometry.correction = RandomCorrection(target.geometry);
  target.geometry.grid = RandomGrid(target.geometry);
  target.layout.slices = display::SliceCount(target.geometry);
  std::visit(
      [&](const auto& shape) {
        target.layout.width = shape.width_px;
        target.layout.height = shape.height_px;
      },
      target.geometry.shape);
  const int32_t sub_frames[] = {1, 1, 2, 3, 8};
  target.layout.sub_frames = sub_frames[Int(0, 4)];
  target.layout.format = static_cast<display::PixelFormat>(Int(0, display::kPixelFormats - 1));
  if (target.layout.format == display::PixelFormat::kHub75 && target.layout.height % 2 != 0) {
    target.layout.format = display::PixelFormat::kBitPlanes;
  }
  const bool any_bits = target.layout.format != display::PixelFormat::kRgb332 &&
                        target.layout.format != display::PixelFormat::kPlanes24;
  if (any_bits && Chance(0.5)) target.layout.bits = static_cast<int32_t>(Int(1, 8));
  target.tone.dither = static_cast<display::Dither>(Int(0, 2));
  if (Chance(0.3)) target.tone.density = display::Density::kEven;
  target.tone.sampling = static_cast<display::Sampling>(Int(0, 1));
  const bool alike = Chance(0.5);  // whether all channels are alike
  display::Tone::Curve curve{};
  for (size_t c = 0; c < 3; ++c) {
    const double gamma = Real(0.5, 3), white = alike ? 1 : Real(0.2, 1);
    for (size_t i = 0; i < 256 && (c == 0 || !alike); ++i) {
      curve[i] = static_cast<uint16_t>(
          std::lround(65535 * white * std::pow(static_cast<double>(i) / 255, gamma)));
    }
    target.tone.lut[c] = curve;
  }
  if (Chance(0.3)) target.view = RandomTransform(20);
  return target;
}

uint32_t SceneGenerator::RandomColor() {
  const uint32_t special[] = {0x000000, 0xFFFFFF, 0xFF0000, 0x00FF00, 0x0000FF, 0x010101};
  return Chance(0.3) ? special[Int(0, 5)] : static_cast<uint32_t>(Int(0, 0xFFFFFF));
}

double SceneGenerator::RandomCoordinate(int size) {
  switch (Int(0, 7)) {
    case 0:
      return static_cast<double>(Int(-2, size + 2));  // a face
    case 1:
      return static_cast<double>(Int(-2, size + 2)) + 0.5;  // a centre
    case 2:
      return static_cast<double>(Int(0, size / 16)) * 16 + static_cast<double>(Int(-2, 2)) / 256;
    case 3:
      return Real(-3.0 * size, 4.0 * size);
    default:
      return Real(-0.2 * size, 1.2 * size);
  }
}

void SceneGenerator::AddVertices(ModelGeometry& g, uint32_t count, int size) {
  const bool far = Chance(0.08);
  const double spread = Chance(0.4) ? Real(0.1, 6) : 0;  // small items near one place
  double place[3];
  for (double& p : place) p = RandomCoordinate(size);
  for (uint32_t i = 0; i < count; ++i) {
    for (int a = 0; a < 3; ++a) {
      double c = spread > 0 ? place[a] + Real(-spread, spread) : RandomCoordinate(size);
      if (far && Chance(0.4)) c = Real(-1, 1) * std::ldexp(1.0, static_cast<int>(Int(8, 30)));
      if (i > 0 && Chance(0.15)) c = g.positions[(i - 1) * 3 + static_cast<uint32_t>(a)];
      g.positions.push_back(static_cast<float>(c));
    }
  }
  g.record.vertex_count = count;
}

void SceneGenerator::AddControlPoints(ModelGeometry& g, int size) {
  GeometryRecord& r = g.record;
  const uint32_t count = static_cast<uint32_t>(Int(0, 3));
  r.topology = static_cast<Topology>(Int(0, 1));
  const bool strip = r.topology == Topology::kStrip;
  if (r.kind == PrimitiveKind::kPatches) {
    // Near one another: distant ones make more triangles than the plain reference has time for.
    const double reach = Real(1, size);
    for (uint32_t i = 0; i < std::min(count, 2u) * 16 * 3; ++i) {
      g.positions.push_back(static_cast<float>(size / 2.0 + Real(-reach, reach)));
    }
    r.vertex_count = static_cast<uint32_t>(g.positions.size() / 3);
  } else {
    AddVertices(g, strip ? count * 3 + 1 : count * 4, size);
  }
  if (!Chance(0.5)) return;
  r.color_mode = ColorMode::kPerVertex;
  for (uint32_t i = 0; i < r.vertex_count; ++i) g.colors.push_back(RandomColor());
}

// Closed, and now and then one inside the other.
void SceneGenerator::AddTetrahedra(ModelGeometry& g, int size) {
  constexpr uint32_t kFaces[] = {0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0};
  const uint32_t count = static_cast<uint32_t>(Int(1, 3));
  AddVertices(g, 4 * count, size);
  for (uint32_t i = 0; i < count; ++i) {
    for (const uint32_t corner : kFaces) g.indices.push_back(i * 4 + corner);
  }
  g.record.index_count = static_cast<uint32_t>(g.indices.size());
}

ModelGeometry SceneGenerator::RandomGeometry(uint64_t id, int size) {
  ModelGeometry g;
  GeometryRecord& r = g.record;
  r.id = id;
  r.kind = static_cast<PrimitiveKind>(Int(1, 11));
  r.color = RandomColor();
  r.sampling = static_cast<LineSampling>(Int(0, 2));
  r.rule = static_cast<SurfaceRule>(Int(0, 1));
  r.fill = static_cast<Fill>(Int(0, 1));
  r.topology = static_cast<Topology>(Int(0, 2));
  r.thickness_unit = static_cast<ThicknessUnit>(Int(0, 1));
  if (Chance(0.25)) r.thickness = static_cast<float>(Real(0, 5));
  if (Chance(0.15)) r.drawn_by = DrawnBy::kCpu;
  r.splat = static_cast<Splat>(Int(0, 3));
  if (r.kind == PrimitiveKind::kBox || r.kind == PrimitiveKind::kSphere ||
      r.kind == PrimitiveKind::kCylinder) {
    for (int i = 0; i < 3; ++i) r.params[i] = static_cast<float>(RandomCoordinate(size));
    for (int i = 3; i < 6; ++i) {
      r.params[i] = static_cast<float>(Chance(0.2) ? Real(0, 1) : Real(0.5, size));
    }
    if (Chance(0.03)) r.params[3] = 0;
    return g;
  }
  if (r.kind == PrimitiveKind::kImplicit) {
    AddProgram(*this, size, g);
    return g;
  }
  if (r.kind == PrimitiveKind::kSamples) {
    AddSamples(*this, g);
    return g;
  }
  if (IsCurved(r.kind)) {
    AddControlPoints(g, size);
    return g;
  }
  const bool filled = r.kind == PrimitiveKind::kFilled;
  if (filled && Chance(0.7)) {
    AddTetrahedra(g, size);
    return g;
  }
  uint32_t corners = static_cast<uint32_t>(Int(0, 4));
  if (r.kind == PrimitiveKind::kTriangles || filled) corners *= 3;
  if (r.kind == PrimitiveKind::kSegments && r.topology == Topology::kList) corners *= 2;
  const bool indexed = corners > 0 && Chance(0.4);
  AddVertices(g, indexed ? static_cast<uint32_t>(Int(1, 8)) : corners, size);
  if (indexed) {
    r.index_count = corners;
    for (uint32_t i = 0; i < corners; ++i) {
      g.indices.push_back(static_cast<uint32_t>(Int(0, r.vertex_count - 1)));
    }
  }
  if (!filled && Chance(0.5)) {
    r.color_mode = ColorMode::kPerVertex;
    for (uint32_t i = 0; i < r.vertex_count; ++i) g.colors.push_back(RandomColor());
  }
  if (r.kind == PrimitiveKind::kTriangles && Chance(0.4)) AddTexture(g);
  return g;
}

// Adds any picture with any number of levels, at texture coordinates that are now and then any
// bits.
void SceneGenerator::AddTexture(ModelGeometry& g) {
  const int64_t most = Chance(0.2) ? 100 : 9;
  g.record.texture_width = static_cast<uint16_t>(Int(1, most));
  g.record.texture_height = static_cast<uint16_t>(Int(1, most));
  for (uint32_t i = 0; i < 2 * g.record.vertex_count; ++i) {
    float place = static_cast<float>(Real(-0.5, 1.5));
    if (Chance(0.3)) place = static_cast<float>(Int(-2, 3));
    if (Chance(0.03)) place = std::bit_cast<float>(static_cast<uint32_t>(Int(0, 0xFFFFFFFF)));
    g.colors.push_back(std::bit_cast<uint32_t>(place));
  }
  const size_t texels = ColorCount(g.record);
  while (g.colors.size() < texels) g.colors.push_back(RandomColor());
}

Affine SceneGenerator::RandomTransform(int size) {
  Affine t;
  switch (Int(0, 4)) {
    case 0:
      return t;
    case 1:  // a shift, by integers or not
      for (int row = 0; row < 3; ++row) {
        t.m[row * 4 + 3] = Chance(0.5) ? static_cast<double>(Int(-5, 5)) : Real(-5, 5);
      }
      return t;
    case 2: {  // a rotation about the middle, with a stretch
      const double angle = Real(0, 7), scale = Real(0.3, 2), middle = size / 2.0;
      const double c = std::cos(angle) * scale, s = std::sin(angle) * scale;
      t.m[0] = c, t.m[1] = -s, t.m[4] = s, t.m[5] = c, t.m[10] = Real(0.3, 2);
      t.m[3] = middle - (c - s) * middle;
      t.m[7] = middle - (c + s) * middle;
      return t;
    }
    default:
      for (double& m : t.m) m = Real(-1.5, 1.5);
      for (int row = 0; row < 3; ++row) t.m[row * 4 + 3] = Real(0, size);
      if (Chance(0.1)) t.m[0] = t.m[1] = t.m[2] = 0;  // flat: singular
      if (Chance(0.1)) t.m[0] *= 0.01, t.m[1] *= 0.01, t.m[2] *= 0.01;
      return t;
  }
}

// Returns a plane through some place of interest, in any direction and with a normal of any length.
ClipPlane SceneGenerator::RandomPlane(int size) {
  double n[3], at[3];
  for (double& p : at) p = RandomCoordinate(size);
  for (double& c : n) c = Chance(0.3) ? static_cast<double>(Int(-3, 3)) : Real(-1, 1);
  if (Chance(0.3)) n[Int(0, 2)] = n[Int(0, 2)] = 0;
  if (n[0] == 0 && n[1] == 0 && n[2] == 0) n[Int(0, 2)] = Chance(0.5) ? 1 : -1;
  if (Chance(0.2)) {
    const double length = std::ldexp(Real(1, 2), static_cast<int>(Int(-300, 300)));
    for (double& c : n) c *= length;
  }
  double d = -(n[0] * at[0] + n[1] * at[1] + n[2] * at[2]);
  if (Chance(0.05)) d = Real(-1, 1) * std::ldexp(1.0, static_cast<int>(Int(-100, 1000)));
  return {n[0], n[1], n[2], d};
}

// Returns a cylinder along any axis, circular or not.
ClipCylinder SceneGenerator::RandomCylinder(int size) {
  ClipCylinder cylinder;
  double* const m = cylinder.unit.m;
  do {
    for (int i = 0; i < 12; ++i) {
      m[i] = i % 4 == 3 ? RandomCoordinate(size) : Real(-1, 1) * size * (Chance(0.3) ? 1 : 0.5);
    }
    if (Chance(0.3)) m[1] = m[2] = m[4] = m[6] = m[8] = m[9] = 0;
  } while (std::fabs(Determinant(cylinder.unit)) < 0.02 * size * size * size);
  if (Chance(0.03)) m[0] = m[4] = m[8] = 0;
  return cylinder;
}

void SceneGenerator::RandomClip(LayerRecord& l, int size) {
  if (Chance(0.35)) {
    l.plane_count = static_cast<uint32_t>(Chance(0.8) ? Int(1, 2) : Int(1, kMaxClipPlanes));
    for (uint32_t i = 0; i < l.plane_count; ++i) l.planes[i] = RandomPlane(size);
  }
  if (Chance(0.25)) {
    l.cylinder_count = static_cast<uint32_t>(Chance(0.7) ? 1 : Int(2, kMaxClipCylinders));
    for (uint32_t i = 0; i < l.cylinder_count; ++i) l.cylinders[i] = RandomCylinder(size);
  }
  if (!Chance(0.25)) return;
  l.has_region = 1;
  for (int a = 0; a < 3; ++a) {
    double& min = l.region.min[a];
    double& max = l.region.max[a];
    min = RandomCoordinate(size);
    max = min + (Chance(0.5) ? static_cast<double>(Int(1, 2 * size)) : Real(0.01, 2 * size));
    if (Chance(0.2)) min = -0x1p100, max = Chance(0.5) ? 0x1p90 : max;
  }
}

LayerRecord SceneGenerator::RandomLayer(uint64_t id) {
  LayerRecord l;
  l.id = id;
  l.order = static_cast<int32_t>(Int(-1, 1));
  l.visible = Chance(0.85);
  l.opacity = Chance(0.5) ? 255 : static_cast<uint32_t>(Int(0, 255));
  l.blend = Chance(0.5) ? BlendMode::kOver : static_cast<BlendMode>(Int(0, 2));
  if (Chance(0.3)) l.transform = RandomTransform(20);
  RandomClip(l, 20);
  return l;
}

// Masks a layer by another of the scene, by itself, or by one that does not exist.
void SceneGenerator::RandomMask(LayerRecord& layer, const SceneModel& scene) {
  if (!Chance(0.25)) return;
  layer.has_mask = 1;
  layer.mask = Chance(0.1) ? next_id_ + 1000 : RandomId(scene.layers);
}

DrawableRecord SceneGenerator::RandomDrawable(uint64_t id, const SceneModel& scene, int size) {
  DrawableRecord d;
  d.id = id;
  d.geometry = RandomId(scene.geometries);
  d.layer = RandomId(scene.layers);
  d.priority = Chance(0.6) ? 5 : static_cast<uint32_t>(Int(0, 126));
  d.erase = Chance(0.15);
  if (Chance(0.2)) d.tint = RandomColor();
  if (Chance(0.6)) d.transform = RandomTransform(size);
  return d;
}

SceneModel SceneGenerator::RandomScene(int size) {
  SceneModel scene;
  for (int64_t n = Int(1, 4); n > 0; --n) {
    const uint64_t id = next_id_++;
    scene.layers[id] = RandomLayer(id);
  }
  for (auto& [id, layer] : scene.layers) RandomMask(layer, scene);
  for (int64_t n = Int(1, 10); n > 0; --n) {
    const uint64_t id = next_id_++;
    scene.geometries[id] = RandomGeometry(id, size);
  }
  for (int64_t n = Int(1, 14); n > 0; --n) {
    const uint64_t id = next_id_++;
    scene.drawables[id] = RandomDrawable(id, scene, size);
  }
  return scene;
}

void SceneGenerator::Change(SceneModel& scene, int size, DeltaBuffer& delta) {
  const auto put_drawable = [&](uint64_t id) {
    scene.drawables[id] = RandomDrawable(id, scene, size);
    delta.Put(scene.drawables[id]);
  };
  switch (Int(0, 6)) {
    case 0: {  // a new geometry, for a new drawable or an existing one
      const uint64_t id = next_id_++;
      scene.geometries[id] = RandomGeometry(id, size);
      delta.Put(scene.geometries[id]);
      put_drawable(scene.drawables.empty() || Chance(0.5) ? next_id_++ : RandomId(scene.drawables));
      break;
    }
    case 1:
      put_drawable(next_id_++);
      break;
    case 2:
      if (scene.drawables.empty()) return;
      put_drawable(RandomId(scene.drawables));
      break;
    case 3: {
      if (scene.drawables.size() < 3) return;
      const uint64_t id = RandomId(scene.drawables);
      scene.drawables.erase(id);
      delta.Drop(Op::kDropDrawable, id);
      break;
    }
    case 4: {
      const uint64_t id = Chance(0.2) ? next_id_++ : RandomId(scene.layers);
      if (scene.layers.contains(id) && Chance(0.4)) {  // where it is drawn alone
        scene.layers[id].plane_count = scene.layers[id].has_region = 0;
        scene.layers[id].cylinder_count = scene.layers[id].has_mask = 0;
        RandomClip(scene.layers[id], 20);
      } else {
        scene.layers[id] = RandomLayer(id);
      }
      RandomMask(scene.layers[id], scene);
      delta.Put(scene.layers[id]);
      break;
    }
    case 5: {  // drops an unused geometry
      const uint64_t id = RandomId(scene.geometries);
      const bool used = std::any_of(scene.drawables.begin(), scene.drawables.end(),
                                    [&](const auto& d) { return d.second.geometry == id; });
      if (used || scene.geometries.size() < 3) return;
      scene.geometries.erase(id);
      delta.Drop(Op::kDropGeometry, id);
      break;
    }
    case 6: {  // drops a layer with everything in it
      if (scene.layers.size() < 3) return;
      const uint64_t id = RandomId(scene.layers);
      scene.layers.erase(id);
      delta.Drop(Op::kDropLayer, id);
      std::erase_if(scene.drawables, [&](const auto& d) {
        if (d.second.layer != id) return false;
        delta.Drop(Op::kDropDrawable, d.first);
        return true;
      });
      break;
    }
  }
}

}  // namespace voxeld::gpu::conformance
