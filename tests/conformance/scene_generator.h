// Random scenes, targets and changes, derived from a seed.
#pragma once

#include <cstdint>
#include <random>

#include "gpu/engine.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu::conformance {

// Returns VOXELD_SEED, or `fallback`. Every random test prints the seed that it used.
uint64_t SeedOr(uint64_t fallback);

// Returns VOXELD_DELTAS, or 1000: how many frames are drawn after changes. For tools that slow a
// GPU down a hundredfold.
int DeltasWanted();

class SceneGenerator {
 public:
  explicit SceneGenerator(uint64_t seed) : engine_(seed) {}

  // Returns a small display of any kind, with any format, sampling, dither and number of
  // sub-frames, and any view.
  Target RandomTarget();

  // Returns layers, geometries (some shared) and drawables of every kind, for a grid of about
  // `size` voxels.
  SceneModel RandomScene(int size);

  // Makes one change to `scene`, and writes it to `delta` as well.
  void Change(SceneModel& scene, int size, DeltaBuffer& delta);

  int64_t Int(int64_t low, int64_t high);
  double Real(double low, double high);
  bool Chance(double probability);
  uint32_t RandomColor();

 private:
  display::PlanarStack RandomStack();
  display::Rotor RandomRotor();
  display::Helix RandomHelix();
  display::Correction RandomCorrection(const display::Geometry& geometry);
  display::Lattice RandomLattice();
  display::VoxelGrid RandomGrid(const display::Geometry& geometry);
  LayerRecord RandomLayer(uint64_t id);
  ClipPlane RandomPlane(int size);
  ClipCylinder RandomCylinder(int size);
  void RandomClip(LayerRecord& layer, int size);
  void RandomMask(LayerRecord& layer, const SceneModel& scene);
  ModelGeometry RandomGeometry(uint64_t id, int size);
  DrawableRecord RandomDrawable(uint64_t id, const SceneModel& scene, int size);
  Affine RandomTransform(int size);
  void AddVertices(ModelGeometry& g, uint32_t count, int size);
  void AddControlPoints(ModelGeometry& g, int size);
  void AddTexture(ModelGeometry& g);
  void AddTetrahedra(ModelGeometry& g, int size);
  double RandomCoordinate(int size);
  uint64_t RandomId(const auto& map);

  std::mt19937_64 engine_;
  uint64_t next_id_ = 1;
};

}  // namespace voxeld::gpu::conformance
