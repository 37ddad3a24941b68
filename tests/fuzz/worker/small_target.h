// Displays according to a script.
#pragma once

#include <optional>
#include <vector>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "gpu/engine.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {

// Returns a display whose tables are computed quickly.
inline gpu::Target SmallTarget(Script& script) {
  gpu::Target target;
  display::PlanarStack stack{.width_px = 4, .height_px = 4};
  stack.positions_mm = {0, 1, 2, 3};
  target.geometry.shape = stack;
  const uint8_t shape = script.Byte() % 8;
  if (shape == 1) {
    target.geometry.shape = display::Rotor{
        .slices_per_turn = 4, .width_px = 4, .height_px = 4, .panels = {display::Rotor::Panel{}}};
  } else if (shape == 2) {
    target.geometry.shape = display::Helix{
        .slices_per_turn = 4, .width_px = 4, .height_px = 4, .height_mm = 4, .radius_mm = 2};
  } else if (shape == 3) {
    target.geometry.shape = display::Lattice{
        .width_px = 4,
        .points_mm = {display::Vec3{0, 0, 0}, std::nullopt, display::Vec3{1, 1, 1}, std::nullopt}};
  } else if (shape == 4) {
    target.geometry.correction.emplace().displacement =
        display::DisplacementGrid{.nx = 2,
                                  .ny = 2,
                                  .nz = 2,
                                  .low_mm = {0, 0, 0},
                                  .high_mm = {4, 4, 4},
                                  .at_mm = std::vector<display::Vec3>(8)};
  }
  target.geometry.grid = {.nx = 4, .ny = 4, .nz = 4, .pitch_mm = {1, 1, 1}, .origin_mm = {}};
  target.layout = {.slices = 4, .width = 4, .height = 4, .sub_frames = 1 + script.Byte() % 2};
  if (shape == 3) target.layout.slices = target.layout.height = 1;
  target.layout.format = static_cast<display::PixelFormat>(script.Byte() % 5);
  target.tone.lut.fill(display::Tone::Linear());
  return target;
}

}  // namespace voxeld::fuzz
