// The devices that the emulator plays, each behind its fault plan, and the commands that a running
// one accepts.
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
  // Returns what it received and shows, as one line of JSON.
  std::function<std::string()> status;
};

// Makes a device from "voxlink[,key=value…]" (the simulated driver's options; docs:
// display/drivers/simulated/README.md) or
// "fadecandy[,serial=TEXT,refresh=TIMES_A_SECOND,faults=PLAN]". `clock` must outlive the result.
// Errors: InvalidArgument with the reason.
absl::StatusOr<Emulated> MakeEmulated(std::string_view spec, sync::Clock& clock);

// Executes one line of the control socket. Returns: the answer, without its newline:
//   fault WHAT[:AMOUNT]@WHEN[/in]   adds a fault, counted from now      ok
//   clear                           removes all faults and lies         ok
//   hostile SEED                    damages answers and reports         ok
//   unplug, plug                    the cable                           ok
//   status                                                              JSON
// Errors are answered with "error: …".
std::string Control(Emulated& device, std::string_view line);

}  // namespace voxeld::emulator
