#include "tools/emulator/emulated.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "display/crc/crc32c.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/emulator/fadecandy_device.h"
#include "display/emulator/voxlink_device.h"

namespace voxeld::emulator {
namespace {

using display::emulator::FadecandyDevice;
using display::emulator::FaultInjector;
using display::emulator::VoxlinkDevice;

nlohmann::json VoxlinkStatus(const VoxlinkDevice& device) {
  const display::emulator::VoxlinkScreen& screen = device.screen();
  nlohmann::json json = {
      {"plugged", device.plugged()},
      {"plugs", device.plugs()},
      {"running", screen.running()},
      {"lit", screen.lit()},
      {"silence_ns", screen.silence()},
      {"bytes_received", device.bytes_received()},
      {"credit_excess", device.credit_excess()},
      {"errors", screen.errors()},
      {"underruns", screen.underruns()},
      {"brightness", device.brightness()},
      {"volumes_shown", screen.volumes_shown()},
      {"volume", screen.lit() ? screen.shown()->number : 0},
  };
  if (const std::optional<display::DecodedVolume> seen = device.Seen()) {
    const std::vector<uint8_t> light = seen->Rgb();
    json["light_crc32c"] =
        absl::StrFormat("%08x", display::Crc32c(std::as_bytes(std::span(light))));
  }
  return json;
}

nlohmann::json FadecandyStatus(const FadecandyDevice& device) {
  const std::span<const uint8_t> light = device.Output();
  return nlohmann::json{
      {"plugged", device.plugged()},
      {"plugs", device.plugs()},
      {"lit", std::any_of(light.begin(), light.end(), [](uint8_t value) { return value != 0; })},
      {"packets", device.packets()},
      {"short_packets", device.short_packets()},
      {"light_crc32c", absl::StrFormat("%08x", display::Crc32c(std::as_bytes(light)))},
  };
}

template <typename Device>
Emulated Wrapped(std::unique_ptr<Device> device, nlohmann::json (*status)(const Device&),
                 const display::emulator::FaultPlan& plan, sync::Clock& clock) {
  Emulated emulated;
  const Device* const inner = device.get();
  auto hostile = std::make_unique<display::emulator::HostileDevice>(std::move(device));
  emulated.hostile = hostile.get();
  auto faults = std::make_unique<FaultInjector>(std::move(hostile), plan, clock);
  emulated.faults = faults.get();
  emulated.status = [inner, status, faults = emulated.faults, hostile = emulated.hostile] {
    nlohmann::json json = status(*inner);
    json["faults_left"] = faults->faults_left();
    json["lies"] = hostile->lies();
    return json.dump();
  };
  emulated.model = std::move(faults);
  return emulated;
}

absl::StatusOr<Emulated> MakeVoxlink(const display::DisplayOptions& options, sync::Clock& clock) {
  absl::StatusOr<display::simulated::EmulatedDevice> read =
      display::simulated::ReadEmulatedDevice(options);
  if (!read.ok()) return read.status();
  return Wrapped(std::make_unique<VoxlinkDevice>(read->config, clock), &VoxlinkStatus, read->plan,
                 clock);
}

absl::StatusOr<Emulated> MakeFadecandy(const display::DisplayOptions& options, sync::Clock& clock) {
  display::OptionReader reader(options);
  display::emulator::FadecandyDeviceConfig config;
  config.serial = reader.Text("serial", config.serial);
  config.refresh_ns =
      static_cast<sync::TimeNs>(sync::kSecond / reader.Number("refresh", 400, 1, 1000));
  const absl::StatusOr<display::emulator::FaultPlan> plan =
      display::emulator::ParseFaultPlan(reader.Text("faults", ""));
  if (!plan.ok()) reader.Refuse("faults", std::string(plan.status().message()));
  if (absl::Status status = reader.Finish(); !status.ok()) return status;
  return Wrapped(std::make_unique<FadecandyDevice>(config, clock), &FadecandyStatus, *plan, clock);
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
  if (parts[0] == "voxlink") return MakeVoxlink(options, clock);
  if (parts[0] == "fadecandy") return MakeFadecandy(options, clock);
  return absl::InvalidArgumentError(
      absl::StrCat("there is no emulated \"", parts[0], "\"; there are fadecandy and voxlink"));
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
    device.hostile->SetSeed(std::nullopt);
    return "ok";
  }
  if (words.first == "hostile") {
    uint64_t seed = 0;
    if (!absl::SimpleAtoi(words.second, &seed)) {
      return absl::StrCat("error: \"", words.second, "\" is no seed; give a number from 0 on");
    }
    device.hostile->SetSeed(seed);
    return "ok";
  }
  if (words.first == "fault") {
    const absl::StatusOr<display::emulator::FaultPlan> plan =
        display::emulator::ParseFaultPlan(words.second);
    if (!plan.ok()) return absl::StrCat("error: ", plan.status().message());
    for (const display::emulator::Fault& fault : *plan) device.faults->Add(fault);
    return "ok";
  }
  return absl::StrCat("error: \"", words.first,
                      "\" is none of fault, clear, hostile, plug, unplug, status");
}

}  // namespace voxeld::emulator
