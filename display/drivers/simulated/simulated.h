// The display that everybody has: the voxlink driver, with a device model of voxlink at the other
// end of a cable that lies inside this process. Same driver, same wire bytes as a real one.
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

// voxlink's conformance suite and the emulated device, in this process: to try it without a device.
absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context);

// A display with its insides, which belong to `display`. The device and the faults may be touched
// within transport->WithDevice only.
struct Parts {
  std::unique_ptr<Display> display;
  InProcessTransport* transport = nullptr;
  emulator::FaultInjector* faults = nullptr;
  emulator::VoxlinkDevice* device = nullptr;
};
// `own_thread` false: nothing happens but when transport->Pump is called.
absl::StatusOr<Parts> CreateParts(const DisplayOptions& options, sync::Clock& clock,
                                  bool own_thread);

}  // namespace voxeld::display::simulated
