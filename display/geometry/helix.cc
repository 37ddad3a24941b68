#include "display/geometry/helix.h"

namespace voxeld::display {

PixelRow HelixRowU(const Helix& helix) {
  return {helix.width_px, helix.pitch_u_mm, 0, helix.mirror_u};
}

PixelRow HelixRowV(const Helix& helix) {
  return {helix.height_px, helix.pitch_v_mm, 0, helix.mirror_v};
}

Turn HelixTurn(const Helix& helix, int32_t step) {
  const Turn turned =
      TurnFromRatio(static_cast<uint32_t>(step), static_cast<uint32_t>(helix.slices_per_turn));
  const Turn phase = TurnFromFraction(helix.phase_turns);
  return helix.clockwise ? phase - turned : phase + turned;
}

double BladeShare(const Helix& helix, Turn turn, Turn begin) {
  const auto blades = static_cast<uint32_t>(helix.blades);
  for (uint32_t blade = 0; blade < blades; ++blade) {
    const Turn from = begin + TurnFromRatio(blade, blades);
    const Turn along = helix.left_handed ? from - turn : turn - from;
    const double share = along / 4294967296.0 / helix.span_turns;
    if (share < 1) return share;
  }
  return -1;
}

}  // namespace voxeld::display
