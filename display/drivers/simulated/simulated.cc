#include "display/drivers/simulated/simulated.h"

#include <utility>

#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/usb/in_process.h"

namespace voxeld::display::simulated {

absl::StatusOr<Parts> CreateParts(const DisplayOptions& options, sync::Clock& clock,
                                  bool own_thread) {
  absl::StatusOr<EmulatedDevice> emulated = ReadEmulatedDevice(options);
  if (!emulated.ok()) return emulated.status();

  Parts parts;
  auto device = std::make_unique<emulator::VoxlinkDevice>(emulated->config, clock);
  parts.device = device.get();
  auto faults = std::make_unique<emulator::FaultInjector>(std::move(device), emulated->plan, clock);
  parts.faults = faults.get();
  InProcessTransport::Options carrier;
  carrier.own_thread = own_thread;
  carrier.identity.serial = emulated->config.serial;
  auto transport = std::make_unique<InProcessTransport>(std::move(faults), clock, carrier);
  parts.transport = transport.get();
  parts.display = std::make_unique<voxlink::VoxlinkDisplay>(std::move(emulated->info),
                                                            std::move(transport), clock);
  return parts;
}

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  absl::StatusOr<Parts> parts = CreateParts(options, context.clock, true);
  if (!parts.ok()) return parts.status();
  return std::move(parts->display);
}

}  // namespace voxeld::display::simulated
