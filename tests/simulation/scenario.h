// The scenario of a seed: displays and their devices, limits, and the events, as plain data.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/scene/operation.h"
#include "tests/daemon/core/model/actions.h"
#include "tests/simulation/world.h"

namespace voxeld::simulation {

struct Scenario {
  uint32_t seed = 0;
  daemon::Limits limits;
  std::vector<SeatOptions> seats;
  bool device_faults = false, transport_faults = false, engine_faults = false, jumps = false;
  bool lies = false;         // devices report what is not true
  bool memory_ends = false;  // now and then clients run out of memory
  bool settles = true;       // ends when everything is shown and every client has left; otherwise
                             // it stops in the middle
  std::vector<daemon::model::Action> actions;
};

Scenario MakeScenario(uint32_t seed);

// Returns a fault on a device's cable that happens soon.
display::emulator::Fault RandomFault(Chance& chance);

// Points, lines, boxes and balls on grids of about 8 voxels a side, under a view in voxels.
const daemon::model::Palette& SmallPalette();

}  // namespace voxeld::simulation
