// An emulated voxlink device, from options.
#pragma once

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"

namespace voxeld::display::simulated {

struct EmulatedDevice {
  DisplayInfo info;  // of the display that it is
  emulator::VoxlinkDeviceConfig config;
  emulator::FaultPlan plan;
};

// The options of README.md. InvalidArgument with what is wrong and what would be right.
absl::StatusOr<EmulatedDevice> ReadEmulatedDevice(const DisplayOptions& options);

}  // namespace voxeld::display::simulated
