#include "display/drivers/simulated/emulated_device.h"

#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace voxeld::display::simulated {
namespace {

uint64_t ReadPacing(OptionReader& reader, UsbSpeed speed) {
  const std::string text = reader.Text("pacing", "0");
  if (text == "link") return BulkBytesPerSecond(speed);
  uint64_t bytes = 0;
  if (!absl::SimpleAtoi(text, &bytes) || bytes > uint64_t{100} << 30) {
    reader.Refuse("pacing", "bytes a second from 0 to 107374182400, or link");
  }
  return bytes;
}

}  // namespace

absl::StatusOr<EmulatedDevice> ReadEmulatedDevice(const DisplayOptions& options) {
  OptionReader reader(options);
  EmulatedDevice device;
  emulator::VoxlinkDeviceConfig& config = device.config;
  config.speed = static_cast<UsbSpeed>(
      reader.Choice("speed", {"full", "high", "super"}, static_cast<size_t>(UsbSpeed::kSuper)));
  config.bytes_per_second = ReadPacing(reader, config.speed);
  config.receive_buffer =
      static_cast<uint32_t>(reader.Integer("receive_buffer", 4 << 20, 64 << 10, 1 << 30));
  config.max_payload = static_cast<uint32_t>(reader.Integer("max_payload", 65536, 1024, 1 << 24));
  config.watchdog = reader.Flag("watchdog", true);
  config.brightness = reader.Flag("device_brightness", true);
  config.power_limit = reader.Flag("device_power_limit", true);
  // accepted and ignored: the device always is what the options say
  reader.Flag("calibrated", false);
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
  device.info = *std::move(info);
  device.plan = *std::move(plan);
  return device;
}

}  // namespace voxeld::display::simulated
