#include "display/drivers/simulated/simulated.h"

#include <utility>

#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/voxlink/verify/suite.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/usb/in_process.h"

namespace voxeld::display::simulated {

namespace {

struct Cable {
  std::unique_ptr<InProcessTransport> transport;
  emulator::FaultInjector* faults = nullptr;
  emulator::VoxlinkDevice* device = nullptr;
};

Cable MakeCable(const EmulatedDevice& emulated, sync::Clock& clock, bool own_thread) {
  Cable cable;
  auto device = std::make_unique<emulator::VoxlinkDevice>(emulated.config, clock);
  cable.device = device.get();
  auto faults = std::make_unique<emulator::FaultInjector>(std::move(device), emulated.plan, clock);
  cable.faults = faults.get();
  InProcessTransport::Options carrier;
  carrier.own_thread = own_thread;
  carrier.identity.serial = emulated.config.serial;
  cable.transport = std::make_unique<InProcessTransport>(std::move(faults), clock, carrier);
  return cable;
}

}  // namespace

absl::StatusOr<Parts> CreateParts(const DisplayOptions& options, sync::Clock& clock,
                                  bool own_thread) {
  absl::StatusOr<EmulatedDevice> emulated = ReadEmulatedDevice(options);
  if (!emulated.ok()) return emulated.status();
  Cable cable = MakeCable(*emulated, clock, own_thread);
  Parts parts;
  parts.transport = cable.transport.get();
  parts.faults = cable.faults;
  parts.device = cable.device;
  parts.display = std::make_unique<voxlink::VoxlinkDisplay>(std::move(emulated->info),
                                                            std::move(cable.transport), clock);
  return parts;
}

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  absl::StatusOr<Parts> parts = CreateParts(options, context.clock, true);
  if (!parts.ok()) return parts.status();
  return std::move(parts->display);
}

absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& context) {
  absl::StatusOr<EmulatedDevice> emulated = ReadEmulatedDevice(options);
  if (!emulated.ok()) return emulated.status();
  Cable cable = MakeCable(*emulated, context.clock, true);
  const voxlink::Configured configured{emulated->info.geometry, emulated->info.layout};
  std::vector<conformance::Subject> subjects;
  subjects.push_back({options.name, std::move(cable.transport), voxlink::MakeSuite(&configured)});
  return subjects;
}

}  // namespace voxeld::display::simulated
