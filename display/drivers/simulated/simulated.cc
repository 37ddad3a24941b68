#include "display/drivers/simulated/simulated.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/voxlink/voxlink_display.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/voxlink_device.h"
#include "display/usb/in_process.h"

namespace voxeld::display::simulated {

absl::StatusOr<Parts> CreateParts(const DisplayOptions& options, sync::Clock& clock,
                                  bool own_thread) {
  OptionReader reader(options);
  emulator::VoxlinkDeviceConfig config;
  config.bytes_per_second =
      static_cast<uint64_t>(reader.Integer("pacing", 0, 0, int64_t{100} << 30));
  config.receive_buffer =
      static_cast<uint32_t>(reader.Integer("receive_buffer", 4 << 20, 64 << 10, 1 << 30));
  config.max_payload = static_cast<uint32_t>(reader.Integer("max_payload", 65536, 1024, 1 << 24));
  config.watchdog = reader.Flag("watchdog", true);
  config.serial = reader.Text("serial", options.name);
  absl::StatusOr<emulator::FaultPlan> plan = emulator::ParseFaultPlan(reader.Text("faults", ""));
  absl::StatusOr<DisplayInfo> info = ReadDisplayInfo(options, reader);
  if (!info.ok()) return info.status();
  if (!plan.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("display \"", options.name, "\": faults: ", plan.status().message()));
  }
  if (config.receive_buffer / 4 < config.max_payload + sizeof(voxlink::PacketHeader)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "display \"", options.name, "\": receive_buffer is ", config.receive_buffer,
        "; it must hold 4 packets of max_payload (", config.max_payload, ") and their headers"));
  }
  config.geometry = info->geometry;
  config.volumes_per_second = info->volumes_per_second;

  Parts parts;
  auto device = std::make_unique<emulator::VoxlinkDevice>(config, clock);
  parts.device = device.get();
  auto faults =
      std::make_unique<emulator::FaultInjector>(std::move(device), *std::move(plan), clock);
  parts.faults = faults.get();
  InProcessTransport::Options carrier;
  carrier.own_thread = own_thread;
  carrier.identity.serial = config.serial;
  auto transport = std::make_unique<InProcessTransport>(std::move(faults), clock, carrier);
  parts.transport = transport.get();
  parts.display =
      std::make_unique<voxlink::VoxlinkDisplay>(*std::move(info), std::move(transport), clock);
  return parts;
}

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  absl::StatusOr<Parts> parts = CreateParts(options, context.clock, true);
  if (!parts.ok()) return parts.status();
  return std::move(parts->display);
}

}  // namespace voxeld::display::simulated
