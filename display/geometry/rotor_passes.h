// Computes when a rotor's panel passes a place, and with which pixel.
#pragma once

#include <cstdint>

#include "display/geometry/angle.h"
#include "display/geometry/pixel_edges.h"
#include "display/geometry/rotor.h"
#include "display/geometry/turn_steps.h"

namespace voxeld::display {

// Calls each(step, u, weight) where a plane at distance `e` from the axis passes (x, y): where the
// place along u is ±√(ρ² − e²). `row` has the panel's pixels; all values are in one unit.
template <typename Each>
void ForEachPass(const Rotor& rotor, const Rotor::Panel& panel, const PixelEdges& row, Fixed x,
                 Fixed y, Fixed e, Sampling sampling, Each&& each) {
  const Fixed square = x * x + y * y - e * e;
  if (square < 0) return;
  const Fixed root = FloorSqrt(square);
  // Edges are integers, so comparing ⌊a⌋ gives the same result as comparing a.
  const auto u_plus = row.PixelAt(root);
  const auto u_minus = row.PixelAt(root * root == square ? -root : -root - 1);
  const auto steps = static_cast<uint32_t>(rotor.slices_per_turn);
  if (x == 0 && y == 0) {
    for (uint32_t step = 0; u_plus && step < steps; ++step) each(step, *u_plus, kFullWeight);
    return;
  }
  const auto pass = [&](int32_t u, Turn turn) {
    Turn since_start = turn - TurnFromFraction(panel.phase_turns);
    if (rotor.clockwise) since_start = Turn{0} - since_start;
    ForEachStepAt(since_start, steps, sampling,
                  [&](uint32_t step, uint16_t weight) { each(step, u, weight); });
  };
  if (u_plus) pass(*u_plus, TurnOf(x, y) - TurnOf(root, e));
  if (u_minus) pass(*u_minus, TurnOf(x, y) - TurnOf(-root, e));
}

}  // namespace voxeld::display
