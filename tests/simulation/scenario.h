// What a seed stands for: displays and their devices, limits, and what happens, as plain data.
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
  bool lies = false;         // devices tell what is not so
  bool memory_ends = false;  // now and then there is none for clients
  bool settles = true;       // ends when all is shown and everybody has left; else in the middle
  std::vector<daemon::model::Action> actions;
};

Scenario MakeScenario(uint32_t seed);

// A fault on a device's cable, soon.
display::emulator::Fault RandomFault(Chance& chance);

// Points, lines, boxes and balls on grids of about 8 voxels a side, under a view in voxels.
const daemon::model::Palette& SmallPalette();

}  // namespace voxeld::simulation
