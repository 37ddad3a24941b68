// Makes an emulated voxlink device from options.
#pragma once

#include "absl/status/statusor.h"
#include "display/api/display.h"
#include "display/drivers/options.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"

namespace voxeld::display::simulated {

struct EmulatedDevice {
  DisplayInfo info;  // of the display that it emulates
  emulator::VoxlinkDeviceConfig config;
  emulator::FaultPlan plan;
};

// Reads the options in README.md. Errors: InvalidArgument with what is wrong and what is expected.
absl::StatusOr<EmulatedDevice> ReadEmulatedDevice(const DisplayOptions& options);

}  // namespace voxeld::display::simulated
