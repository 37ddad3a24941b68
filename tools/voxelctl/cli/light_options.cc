#include "tools/voxelctl/cli/light_options.h"

#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tools/voxelctl/cli/argument_checks.h"

namespace voxeld::voxelctl {
namespace {

namespace network = display::network;
using network::Protocol;

constexpr int kMostAlong = 4096;  // maximum lights of a box along an axis

const Choices<Protocol> kProtocols = {{"opc", Protocol::kOpc},
                                      {"ddp", Protocol::kDdp},
                                      {"e131", Protocol::kE131},
                                      {"artnet", Protocol::kArtNet}};

// Adds a number with its range; its help text includes the range and the default.
void AddPlainNumber(CLI::App* command, const char* name, double* value, double least, double most,
                    const char* about, const char* unit) {
  WantNumber(command->add_option(name, *value, about)->type_name(unit), least, most);
}

int32_t Whole(const char* option, double value) {
  const auto whole = static_cast<int32_t>(value);
  if (whole != value) throw UsageError{absl::StrCat(option, " wants a whole number")};
  return whole;
}

std::array<int, 3> ParseSize(const std::string& text) {
  std::array<int, 3> size{};
  const std::vector<std::string> parts = absl::StrSplit(text, 'x');
  bool good = parts.size() == size.size();
  for (size_t i = 0; good && i < size.size(); ++i) {
    good = absl::SimpleAtoi(parts[i], &size[i]) && size[i] >= 1 && size[i] <= kMostAlong;
  }
  if (!good) {
    throw UsageError{absl::StrCat("--size ", EscapeForTerminal(text),
                                  " is no box of lights, such as 16x16x16; each may be 1 to ",
                                  kMostAlong)};
  }
  return size;
}

}  // namespace

void LightArguments::Add(CLI::App* command) {
  command->add_option("--size", size_, "A box of lights, x fastest, then y, then z")
      ->type_name("WxHxD");
  command->add_option("--layout", options_.layout, "Where they are, as Open Pixel Control has it")
      ->type_name("FILE.json");
  command->add_option("--display", options_.display, "In whose volume; else the first display's")
      ->type_name("NAME");
  command->add_option("--layer", options_.layer, "The layer that they are put into")
      ->type_name("NAME")
      ->capture_default_str();
}

LightsOptions LightArguments::Read() const {
  LightsOptions options = options_;
  if (!size_.empty() && !options.layout.empty()) {
    throw UsageError{"--size and --layout do not go together"};
  }
  if (!size_.empty()) options.size = ParseSize(size_);
  if (options.layer.empty()) throw UsageError{"--layer wants a name"};
  return options;
}

void InputArguments::Add(CLI::App* command) {
  command->add_option("PROTOCOL", protocol_, "opc, ddp, e131 or artnet")
      ->type_name("opc|ddp|e131|artnet");
  command
      ->add_option("--listen", options_.listen,
                   "Where it comes in, by number; without it this machine's loopback and the "
                   "protocol's port. 0.0.0.0:PORT: from everywhere")
      ->type_name("HOST:PORT");
  lights_.Add(command);
  AddPlainNumber(command, "--universe", &universe_, 0, network::e131::kMostUniverse,
                 "e131, artnet: the universe of the first lights; without it 1 and 0", "N");
  AddPlainNumber(
      command, "--universe-channels", &universe_channels_, 1, 512,
      "e131, artnet: channels of a universe that are used; without it 510, which are 170 "
      "whole lights; 512 for senders that fill universes, as xLights does",
      "N");
  AddPlainNumber(command, "--per-channel", &a_channel_, 0, 21845,
                 "opc: lights of a channel, 1's first; without it channel 1 has them all", "N");
  AddPlainNumber(
      command, "--gather", &options_.gather_ms, 0, 1000,
      "Milliseconds that parts of a picture wait for the rest, where nothing says that it is "
      "whole; without it 4",
      "MS");
  command->add_flag("--multicast", options_.multicast, "e131: join its universes' groups");
}

InputOptions InputArguments::Read() const {
  if (protocol_.empty()) throw UsageError{"input wants a PROTOCOL: opc, ddp, e131 or artnet"};
  InputOptions options = options_;
  options.protocol = Choose("PROTOCOL", protocol_, kProtocols);
  options.lights = lights_.Read();
  const bool universes =
      options.protocol == Protocol::kE131 || options.protocol == Protocol::kArtNet;
  if (universe_ >= 0 && !universes) throw UsageError{"--universe is for e131 and artnet"};
  options.first_universe = universe_ >= 0                          ? Whole("--universe", universe_)
                           : options.protocol == Protocol::kArtNet ? 0
                                                                   : 1;
  if (universe_channels_ > 0 && !universes)
    throw UsageError{"--universe-channels is for e131 and artnet"};
  if (universe_channels_ > 0)
    options.universe_channels = Whole("--universe-channels", universe_channels_);
  const int32_t least = options.protocol == Protocol::kE131 ? 1 : 0;
  const int32_t most = options.protocol == Protocol::kArtNet ? network::artnet::kMostUniverse
                                                             : network::e131::kMostUniverse;
  if (options.first_universe < least || options.first_universe > most) {
    throw UsageError{absl::StrCat("--universe ", options.first_universe, "; ", protocol_, " has ",
                                  least, " to ", most)};
  }
  if (a_channel_ != 0 && options.protocol != Protocol::kOpc) {
    throw UsageError{"--per-channel is for opc"};
  }
  options.a_channel = Whole("--per-channel", a_channel_);
  if (options.multicast && options.protocol != Protocol::kE131) {
    throw UsageError{"--multicast is for e131"};
  }
  if (options.listen.empty()) {
    const uint16_t port = options.protocol == Protocol::kDdp      ? network::ddp::kPort
                          : options.protocol == Protocol::kE131   ? network::e131::kPort
                          : options.protocol == Protocol::kArtNet ? network::artnet::kPort
                                                                  : network::opc::kPort;
    options.listen = absl::StrCat(options.multicast ? "0.0.0.0:" : "127.0.0.1:", port);
  }
  return options;
}

void PipeArguments::Add(CLI::App* command) {
  lights_.Add(command);
  AddPlainNumber(command, "--fps", &options_.fps, 0, 1000,
                 "Pictures a second; without it, and with 0, as they come", "N");
  command->add_flag("--keep", options_.keep, "Leave the last picture up");
}

PipeOptions PipeArguments::Read() const {
  PipeOptions options = options_;
  options.lights = lights_.Read();
  return options;
}

}  // namespace voxeld::voxelctl
