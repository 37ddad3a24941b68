#include "tools/emulator/emulated.h"

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "display/crc/crc32c.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/emulator/voxlink_device.h"

namespace voxeld::emulator {
namespace {

using display::emulator::FaultInjector;
using display::emulator::VoxlinkDevice;

std::string VoxlinkStatus(const VoxlinkDevice& device) {
  const display::emulator::VoxlinkScreen& screen = device.screen();
  nlohmann::json json = {
      {"plugged", device.plugged()},
      {"plugs", device.plugs()},
      {"running", screen.running()},
      {"lit", screen.lit()},
      {"bytes_received", device.bytes_received()},
      {"credit_excess", device.credit_excess()},
      {"errors", screen.errors()},
      {"underruns", screen.underruns()},
      {"brightness", device.brightness()},
      {"volume", screen.lit() ? screen.shown()->number : 0},
  };
  if (const std::optional<display::DecodedVolume> seen = device.Seen()) {
    const std::vector<uint8_t> light = seen->Rgb();
    json["light_crc32c"] =
        absl::StrFormat("%08x", display::Crc32c(std::as_bytes(std::span(light))));
  }
  return json.dump();
}

}  // namespace

absl::StatusOr<Emulated> MakeEmulated(std::string_view spec, sync::Clock& clock) {
  const std::vector<std::string> parts = absl::StrSplit(std::string(spec), ',');
  display::DisplayOptions options{.name = "emulated", .driver = parts[0], .options = {}};
  for (size_t i = 1; i < parts.size(); ++i) {
    const std::pair<std::string, std::string> option =
        absl::StrSplit(parts[i], absl::MaxSplits('=', 1));
    options.options[option.first] = option.second;
  }
  if (parts[0] != "voxlink") {
    return absl::InvalidArgumentError(
        absl::StrCat("there is no emulated \"", parts[0], "\"; there is voxlink"));
  }
  absl::StatusOr<display::simulated::EmulatedDevice> read =
      display::simulated::ReadEmulatedDevice(options);
  if (!read.ok()) return read.status();
  auto device = std::make_unique<VoxlinkDevice>(read->config, clock);
  const VoxlinkDevice* const inner = device.get();
  auto faults = std::make_unique<FaultInjector>(std::move(device), read->plan, clock);
  Emulated emulated;
  emulated.faults = faults.get();
  emulated.model = std::move(faults);
  emulated.status = [inner] { return VoxlinkStatus(*inner); };
  return emulated;
}

std::string Control(Emulated& device, std::string_view line) {
  const std::pair<std::string, std::string> words =
      absl::StrSplit(std::string(line), absl::MaxSplits(' ', 1));
  if (words.first == "status") return device.status();
  if (words.first == "unplug" || words.first == "plug") {
    device.model->SetPlugged(words.first == "plug");
    return "ok";
  }
  if (words.first == "clear") {
    device.faults->Clear();
    return "ok";
  }
  if (words.first == "fault") {
    const absl::StatusOr<display::emulator::FaultPlan> plan =
        display::emulator::ParseFaultPlan(words.second);
    if (!plan.ok()) return absl::StrCat("error: ", plan.status().message());
    for (const display::emulator::Fault& fault : *plan) device.faults->Add(fault);
    return "ok";
  }
  return absl::StrCat("error: \"", words.first, "\" is none of fault, clear, plug, unplug, status");
}

}  // namespace voxeld::emulator
