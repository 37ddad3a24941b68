// The display that needs no hardware: the voxlink driver, connected inside this process to a device
// model of voxlink. It uses the same driver and the same wire bytes as a real display.
#pragma once

#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/conformance/suite.h"
#include "display/drivers/driver_context.h"
#include "display/drivers/options.h"
#include "display/sync/clock.h"

namespace voxeld::display {
class InProcessTransport;
namespace emulator {
class FaultInjector;
class VoxlinkDevice;
}  // namespace emulator
}  // namespace voxeld::display

namespace voxeld::display::simulated {

// README.md lists the options.
absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context);

// Returns voxlink's conformance suite with the emulated device, to run it without hardware.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

// A display with its parts, which `display` owns. Access the device and the faults only within
// transport->WithDevice.
struct Parts {
  std::unique_ptr<Display> display;
  InProcessTransport* transport = nullptr;
  emulator::FaultInjector* faults = nullptr;
  emulator::VoxlinkDevice* device = nullptr;
};
// With `own_thread` false, nothing happens except when transport->Pump is called.
absl::StatusOr<Parts> CreateParts(const DisplayOptions& options, sync::Clock& clock,
                                  bool own_thread);

}  // namespace voxeld::display::simulated
