#include "tools/voxelctl/demo/model_scenes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/demo/earthquakes.h"
#include "tools/voxelctl/demo/galaxy.h"
#include "tools/voxelctl/demo/motion.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/look.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kEarthTilt = 23.4;
constexpr int kLeastWithBorders = 100;  // a display with fewer voxels has no space for every border
constexpr uint64_t kGalaxySeed = 20;
constexpr Rgb kCoastColor = {70, 215, 190}, kDimCoastColor = {18, 75, 85};
constexpr Rgb kGraticuleColor = {8, 24, 60};

// Placed and coloured models, each an object, that move together.
class ModelScene final : public Scene {
 public:
  ModelScene(const SceneSettings& settings, std::vector<Model> models, const Motion& motion,
             VolumeLook look = {})
      : space_(settings.space),
        models_(std::move(models)),
        motion_(motion),
        look_(std::move(look)) {}

  absl::Status Begin(Stage& stage) override {
    for (size_t i = 0; i < models_.size(); ++i) {
      absl::Status status = stage.Define(absl::StrCat(i), models_[i], look_);
      if (!status.ok()) return status;
    }
    client::Frame frame = stage.layer().BeginFrame();
    for (size_t i = 0; i < models_.size(); ++i) {
      const std::string name = absl::StrCat(i);
      frame.Draw(name, client::Instance{stage.ObjectName(name)}, {.label = models_[i].format});
    }
    models_.clear();
    const absl::Status status = frame.End();
    return status.ok() ? Move(stage, 0) : status;
  }

  absl::Status Move(Stage& stage, double seconds) override {
    client::LayerLook look{.transform = PoseAt(motion_, space_, seconds)};
    if (const auto plane = CutAt(motion_, space_, seconds); plane) {
      look.clip = std::vector<client::ClipPart>{*plane};
    }
    return stage.layer().Set(look);
  }

 private:
  const DisplaySpace space_;
  std::vector<Model> models_;  // until they are sent
  const Motion motion_;
  const VolumeLook look_;
};

void Paint(const Rgb& color, Model* model) {
  for (Part& part : model->parts) part.colors.assign(part.positions.size(), color);
}

// Returns how far a model extends from the origin along each axis.
Point3 ReachOf(const Model& model) {
  Point3 reach;
  const auto add = [&](const Point3& p, double r) {
    reach.x = std::max(reach.x, std::abs(p.x) + r);
    reach.y = std::max(reach.y, std::abs(p.y) + r);
    reach.z = std::max(reach.z, std::abs(p.z) + r);
  };
  for (const Part& part : model.parts) {
    for (const Point3& p : part.positions) add(p, part.thickness / 2);
  }
  for (const SampledVolume& volume : model.volumes) {
    for (const Point3& p : volume.corners) add(p, 0);
  }
  return reach;
}

// Returns lines every 30 degrees on the unit sphere.
Model Graticule() {
  Model model;
  model.format = "graticule";
  model.globe = true;
  Part& part = model.parts.emplace_back();
  part.kind = Kind::kSegments;
  const auto add_line = [&](auto place, int steps) {
    const auto first = static_cast<uint32_t>(part.positions.size());
    for (int i = 0; i <= steps; ++i) part.positions.push_back(place(i));
    for (int i = 0; i < steps; ++i) {
      part.indices.push_back(first + static_cast<uint32_t>(i));
      part.indices.push_back(first + static_cast<uint32_t>(i) + 1);
    }
  };
  constexpr int kStep = 3;  // degrees
  for (int lat = -60; lat <= 60; lat += 30) {
    add_line(
        [&](int i) {
          return Hypocentre({i * double{kStep}, double(lat), 0, 0});
        },
        360 / kStep);
  }
  for (int lon = 0; lon < 360; lon += 30) {
    add_line(
        [&](int i) {
          return Hypocentre({double(lon), i * double{kStep} - 90, 0, 0});
        },
        180 / kStep);
  }
  Paint(kGraticuleColor, &model);
  return model;
}

// Reads coasts and borders, or only coasts from the file beside it if the display is coarse.
absl::StatusOr<Model> ReadAtlas(const SceneSettings& settings) {
  std::string path = settings.files[0];
  if (settings.least_side < kLeastWithBorders) {
    const std::filesystem::path coarse =
        std::filesystem::path(path).parent_path() / "land-110m.json";
    std::error_code error;
    if (std::filesystem::is_regular_file(coarse, error)) path = coarse.string();
  }
  return ImportFile(path, {.globe = true, .raw = {}});
}

std::unique_ptr<Scene> SpunModels(const SceneSettings& settings, std::vector<Model> models,
                                  const Motion& motion) {
  PlaceModels(models, settings.space, {.spin = true});
  ApplyLook(models, {});
  return std::make_unique<ModelScene>(settings, std::move(models), motion);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Scene>> MakeGlobe(const SceneSettings& settings) {
  absl::StatusOr<Model> atlas = ReadAtlas(settings);
  if (!atlas.ok()) return atlas.status();
  Paint(kCoastColor, &*atlas);
  std::vector<Model> models;
  models.push_back(*std::move(atlas));
  if (settings.least_side >= kLeastWithBorders) models.push_back(Graticule());
  return SpunModels(settings, std::move(models), {.turn_s = 16, .tilt_degrees = kEarthTilt});
}

absl::StatusOr<std::unique_ptr<Scene>> MakeEarthquakes(const SceneSettings& settings) {
  absl::StatusOr<Model> atlas = ReadAtlas(settings);
  if (!atlas.ok()) return atlas.status();
  Paint(kDimCoastColor, &*atlas);
  const absl::StatusOr<SourceFile> file = ReadSourceFile(settings.files[1]);
  if (!file.ok()) return file.status();
  const absl::StatusOr<std::vector<Earthquake>> quakes = ReadEarthquakes(*file);
  if (!quakes.ok()) return quakes.status();
  std::vector<Model> models;
  models.push_back(*std::move(atlas));
  models.push_back(EarthquakeModel(*quakes));
  return SpunModels(settings, std::move(models), {.turn_s = 16, .tilt_degrees = kEarthTilt});
}

absl::StatusOr<std::unique_ptr<Scene>> MakeHouse(const SceneSettings& settings) {
  absl::StatusOr<Model> house = ImportFile(settings.files[0], {});
  if (!house.ok()) return house.status();
  std::vector<Model> models;
  models.push_back(*std::move(house));
  PlaceModels(models, settings.space, {.spin = true});
  ApplyLook(models, {});
  const double reach = ReachOf(models[0]).y * 1.01;
  // The cut goes from the front to behind the middle.
  const Motion motion = {
      .turn_s = 24, .cut = Cut{.toward = {0, -1, 0}, .deepest = -0.25 * reach, .outermost = reach}};
  return std::make_unique<ModelScene>(settings, std::move(models), motion);
}

absl::StatusOr<std::unique_ptr<Scene>> MakeEngine(const SceneSettings& settings) {
  absl::StatusOr<Model> engine = ImportFile(settings.files[0], {});
  if (!engine.ok()) return engine.status();
  std::vector<Model> models;
  models.push_back(*std::move(engine));
  return SpunModels(settings, std::move(models), {.turn_s = 10});
}

absl::StatusOr<std::unique_ptr<Scene>> MakeBrain(const SceneSettings& settings) {
  absl::StatusOr<Model> brain = ImportFile(settings.files[0], {});
  if (!brain.ok()) return brain.status();
  if (brain->volumes.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(settings.files[0], " has no volume; NIfTI of a brain is expected"));
  }
  VolumeLook look{.colormap = "magma", .window = WindowOf(brain->volumes[0]), .level = {}};
  brain->volumes[0] = Cropped(brain->volumes[0], (*look.window)[0]);
  std::vector<Model> models;
  models.push_back(*std::move(brain));
  PlaceModels(models, settings.space, {.spin = true});
  // A brain is about ellipsoidal: the corners of its box, which are empty, may lie outside the
  // display.
  const Point3 reach = ReachOf(models[0]);
  const double radius = FitRadius(settings.space, 1e-9) / std::max(reach.x, reach.y);
  const double grow = std::min(
      radius, FitRadius({.half = {HUGE_VAL, HUGE_VAL, settings.space.half.z}}, 1) / reach.z);
  for (Point3& p : models[0].volumes[0].corners) p = {p.x * grow, p.y * grow, p.z * grow};
  const double top = reach.z * grow;
  const Motion motion = {
      .turn_s = 30,
      .cut =
          Cut{.toward = {0, 0, 1}, .deepest = -0.5 * top, .outermost = 1.01 * top, .period_s = 16}};
  return std::make_unique<ModelScene>(settings, std::move(models), motion, look);
}

absl::StatusOr<std::unique_ptr<Scene>> MakeMolecule(const SceneSettings& settings) {
  absl::StatusOr<Model> molecule = ImportFile(settings.files[0], {});
  if (!molecule.ok()) return molecule.status();
  std::vector<Model> models;
  models.push_back(*std::move(molecule));
  return SpunModels(settings, std::move(models), {.turn_s = 14});
}

absl::StatusOr<std::unique_ptr<Scene>> MakeGalaxy(const SceneSettings& settings) {
  constexpr double kTilt = 22;
  const auto side = static_cast<uint32_t>(std::max(settings.least_side, 1));
  std::vector<Model> models;
  models.push_back(GalaxyModel(kGalaxySeed, std::clamp(side * side, 300u, 24000u)));
  // A tilted model is higher.
  const double sine = std::sin(kTilt * std::numbers::pi / 180),
               cosine = std::cos(kTilt * std::numbers::pi / 180);
  const double radius = FitRadius(settings.space, sine + kGalaxyHeight * cosine) /
                        std::max(1.0, cosine + kGalaxyHeight * sine);
  for (Point3& p : models[0].parts[0].positions) p = {p.x * radius, p.y * radius, p.z * radius};
  return std::make_unique<ModelScene>(settings, std::move(models),
                                      Motion{.turn_s = 18, .tilt_degrees = kTilt, .cut = {}});
}

SampledVolume Cropped(const SampledVolume& volume, double low) {
  std::array<uint32_t, 3> first = volume.size, end = {};
  size_t at = 0;
  for (uint32_t z = 0; z < volume.size[2]; ++z) {
    for (uint32_t y = 0; y < volume.size[1]; ++y) {
      for (uint32_t x = 0; x < volume.size[0]; ++x) {
        if (!(volume.samples[at++] > low)) continue;
        const std::array<uint32_t, 3> place = {x, y, z};
        for (size_t axis = 0; axis < 3; ++axis) {
          first[axis] = std::min(first[axis], place[axis]);
          end[axis] = std::max(end[axis], place[axis] + 1);
        }
      }
    }
  }
  if (end[0] == 0) return volume;
  SampledVolume out;
  out.window = volume.window;
  for (size_t axis = 0; axis < 3; ++axis) out.size[axis] = end[axis] - first[axis];
  out.samples.reserve(size_t{out.size[0]} * out.size[1] * out.size[2]);
  for (uint32_t z = first[2]; z < end[2]; ++z) {
    for (uint32_t y = first[1]; y < end[1]; ++y) {
      const float* const row = &volume.samples[(size_t{z} * volume.size[1] + y) * volume.size[0]];
      out.samples.insert(out.samples.end(), row + first[0], row + end[0]);
    }
  }
  for (size_t corner = 0; corner < 8; ++corner) {
    Point3 p = volume.corners[0];
    for (size_t axis = 0; axis < 3; ++axis) {
      const bool far = (corner >> axis & 1) != 0;
      const double share = static_cast<double>(far ? end[axis] : first[axis]) / volume.size[axis];
      const Point3 &from = volume.corners[0], &to = volume.corners[size_t{1} << axis];
      p = {p.x + (to.x - from.x) * share, p.y + (to.y - from.y) * share,
           p.z + (to.z - from.z) * share};
    }
    out.corners[corner] = p;
  }
  return out;
}

}  // namespace voxeld::voxelctl
