#include "tools/bench/frame/profile_scenes.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/options.h"
#include "display/profiles/profile.h"
#include "tools/bench/frame/line_set.h"
#include "tools/bench/frame/shape_scenes.h"

namespace voxeld::bench::frame {
namespace {

constexpr const char* kProfiles[] = {"vortex",    "perspecta", "vx1",       "vx2-xl",
                                     "depthcube", "helix",     "lattice-8", "lattice-20"};
constexpr double kBalls = 400, kLines = 20'000;

// Returns the display that a profile describes; its driver is not used.
absl::StatusOr<display::DisplayInfo> DisplayOf(const std::string& name) {
  absl::StatusOr<display::Profile> profile = display::LoadProfile(name);
  if (!profile.ok()) return profile.status();
  const display::DisplayOptions options{name, "simulated", std::move(profile->options)};
  display::OptionReader reader(options);
  return display::ReadDisplayInfo(options, reader);
}

absl::StatusOr<Scene> SceneOf(const std::string& name, uint64_t seed, double share) {
  const absl::StatusOr<display::DisplayInfo> display = DisplayOf(name);
  if (!display.ok()) return display.status();
  Scene scene = OneLayer(absl::StrCat("slicing, ", name),
                         {display->geometry, display->layout, display->tone, {}});
  scene.slicing_only = true;
  scene.traffic = Traffic::kVolumeAndPictures;
  scene.in_device = true;
  const display::VoxelGrid& grid = display->geometry.grid;
  std::mt19937_64 random(seed);
  const auto at = [&](double lo, double hi) {
    return static_cast<float>(lo + (hi - lo) * static_cast<double>(random() >> 11) * 0x1p-53);
  };
  const double most = std::max(1.0, std::min({grid.nx, grid.ny, grid.nz}) / 8.0);
  const auto balls = static_cast<int>(std::ceil(kBalls * share));
  for (int i = 0; i < balls; ++i) {
    Content ball;
    ball.record.kind = gpu::PrimitiveKind::kSphere;
    ball.record.fill = gpu::Fill::kSolid;
    ball.record.color = RandomColor(random);
    const float params[] = {at(0, grid.nx), at(0, grid.ny), at(0, grid.nz), at(1, most)};
    std::copy(std::begin(params), std::end(params), ball.record.params);
    scene.contents.push_back(std::move(ball));
  }
  LineSet lines(seed);
  const auto count = static_cast<uint64_t>(std::ceil(kLines * share));
  const Extent extent{{0, 0, 0}, {std::max(1, grid.nx - 1), grid.ny, grid.nz}};
  while (lines.lines() < count) lines.AddUniform(extent);
  scene.contents.push_back(lines.Take());
  return scene;
}

}  // namespace

std::vector<MakeScene> ProfileScenes(uint64_t seed, double share) {
  std::vector<MakeScene> rows;
  for (const char* name : kProfiles) {
    rows.emplace_back([=] { return SceneOf(name, seed, share); });
  }
  return rows;
}

}  // namespace voxeld::bench::frame
