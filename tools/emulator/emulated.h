// The devices that the emulator plays, each behind its fault plan, and what can be asked of one while
// it runs.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "display/drivers/options.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/hostile_device.h"
#include "display/sync/clock.h"

namespace voxeld::emulator {

struct Emulated {
  std::unique_ptr<display::UsbDeviceModel> model;       // with its faults
  display::emulator::FaultInjector* faults = nullptr;   // within model
  display::emulator::HostileDevice* hostile = nullptr;  // within faults
  // What it saw and shows, as one line of JSON.
  std::function<std::string()> status;
};

// "voxlink[,key=value…]" (the simulated driver's options; docs: display/drivers/simulated/README.md),
// "fadecandy[,serial=TEXT,refresh=TIMES_A_SECOND,faults=PLAN]". InvalidArgument with what is wrong. `clock` outlives what comes back.
absl::StatusOr<Emulated> MakeEmulated(std::string_view spec, sync::Clock& clock);

// One line of the control socket, and the answer to it, without its newline:
//   fault WHAT[:AMOUNT]@WHEN[/in]   a fault more, counted from now      ok
//   clear                           no fault and no lie any more        ok
//   hostile SEED                    answers and reports are damaged     ok
//   unplug, plug                    the cable                           ok
//   status                                                              JSON
// What is wrong is answered "error: …".
std::string Control(Emulated& device, std::string_view line);

}  // namespace voxeld::emulator
