#include "display/drivers/network/network.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <span>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/crc/crc32c.h"
#include "display/drivers/network/network_display.h"
#include "display/drivers/wiring/wiring.h"

namespace voxeld::display::network {
namespace {

constexpr double kMostVolumesPerSecond = 1000;

// E1.31 requires a permanent number per sender: derive it from the display's name and this
// machine's id, if it has one (machine-id(5)).
std::array<uint8_t, 16> CidOf(const std::string& name) {
  std::string machine;
  std::getline(std::ifstream("/etc/machine-id"), machine);
  std::array<uint8_t, 16> cid{};
  for (size_t word = 0; word < 4; ++word) {
    const std::string text = absl::StrCat("voxeld", word, machine, name);
    const uint32_t sum = Crc32c(std::as_bytes(std::span(text)));
    for (size_t i = 0; i < 4; ++i) cid[word * 4 + i] = static_cast<uint8_t>(sum >> (8 * i));
  }
  // Mark it as a UUID of version 4 (RFC 4122 §4.4).
  cid[6] = static_cast<uint8_t>((cid[6] & 0x0F) | 0x40);
  cid[8] = static_cast<uint8_t>((cid[8] & 0x3F) | 0x80);
  return cid;
}

StreamOptions ReadStream(OptionReader& reader, const std::string& name) {
  StreamOptions stream;
  stream.protocol =
      static_cast<Protocol>(reader.Choice("protocol", {"ddp", "e131", "artnet", "opc"}, 0));
  if (stream.protocol == Protocol::kE131) {
    stream.first_universe =
        static_cast<int32_t>(reader.Integer("universe", 1, 1, e131::kMostUniverse));
    stream.priority = static_cast<uint8_t>(reader.Integer("priority", 100, 0, 200));
    stream.sync_universe =
        static_cast<int32_t>(reader.Integer("sync_universe", 0, 0, e131::kMostUniverse));
    stream.source_name = name.substr(0, e131::kSourceNameBytes - 1);
    stream.cid = CidOf(name);
  } else if (stream.protocol == Protocol::kArtNet) {
    stream.first_universe =
        static_cast<int32_t>(reader.Integer("universe", 0, 0, artnet::kMostUniverse));
    stream.sync_universe = reader.Flag("sync", false) ? 1 : 0;
  } else if (stream.protocol == Protocol::kOpc) {
    stream.first_universe = static_cast<int32_t>(reader.Integer("channel", 1, 0, 255));
  }
  return stream;
}

uint16_t PortOf(Protocol protocol) {
  switch (protocol) {
    case Protocol::kDdp:
      return ddp::kPort;
    case Protocol::kE131:
      return e131::kPort;
    case Protocol::kArtNet:
      return artnet::kPort;
    case Protocol::kOpc:
      return opc::kPort;
  }
  return 0;
}

// Removes the slices, or in a single slice the pixels, after the last light.
void Trim(Lattice& lattice, int32_t a_slice) {
  const auto last = std::find_if(lattice.points_mm.rbegin(), lattice.points_mm.rend(),
                                 [](const auto& point) { return point.has_value(); });
  const auto used = static_cast<int32_t>(lattice.points_mm.rend() - last);
  lattice.width_px = std::clamp(used, 1, a_slice);
  const int32_t slices = std::max(1, (used + a_slice - 1) / a_slice);
  lattice.points_mm.resize(static_cast<size_t>(slices) * static_cast<size_t>(lattice.width_px));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> Create(const DisplayOptions& options,
                                                const DriverContext& context) {
  return CreateOver(options, context.clock, [](Protocol protocol, const Endpoint& to) {
    return protocol == Protocol::kOpc ? MakeTcpLink(to) : MakeUdpLink(to);
  });
}

absl::StatusOr<std::vector<conformance::Subject>> Verify(const DisplayOptions& options,
                                                         const DriverContext& /*context*/) {
  return absl::UnimplementedError(
      absl::StrCat("display \"", options.name,
                   "\": a controller on the network answers nothing that could be checked; "
                   "voxelctl watch shows what it is sent"));
}

absl::StatusOr<std::unique_ptr<Display>> CreateOver(const DisplayOptions& options,
                                                    sync::Clock& clock, const MakeLink& make_link) {
  OptionReader reader(options);
  NetworkDisplay::Settings settings;
  settings.stream = ReadStream(reader, options.name);
  const Protocol protocol = settings.stream.protocol;
  settings.order = ColorOrderOf(kColorOrders[reader.Choice("color_order", kColorOrders, 0)]);
  Endpoint to;
  if (absl::StatusOr<Endpoint> endpoint =
          ParseEndpoint(reader.Text("address", ""), PortOf(protocol));
      endpoint.ok()) {
    to = *endpoint;
  } else {
    reader.Refuse("address", std::string(endpoint.status().message()));
  }
  wiring::PixelNumbers numbers{.a_slice = MostPixels(protocol),
                               .slices = MostSlices(settings.stream),
                               .a_strip = 0,
                               .unit = protocol == Protocol::kDdp   ? "packet"
                                       : protocol == Protocol::kOpc ? "channel"
                                                                    : "universe"};
  numbers.a_strip =
      static_cast<int32_t>(reader.Integer("strip", numbers.count(), 1, numbers.count()));
  DisplayInfo info;
  info.name = options.name;
  info.driver = options.driver;
  info.volumes_per_second = reader.Number("rate", 40, 0.5, kMostVolumesPerSecond);
  info.tone = MakeTone(ReadTone(reader));
  absl::StatusOr<Lattice> lattice = wiring::ReadLattice(reader, numbers);
  if (absl::Status status = reader.Finish(); !status.ok()) return status;
  if (lattice.ok()) {
    Trim(*lattice, numbers.a_slice);
    info.layout = {.slices = static_cast<int32_t>(lattice->points_mm.size()) / lattice->width_px,
                   .width = lattice->width_px,
                   .height = 1};
  }
  if (absl::Status status = wiring::TakeLattice(info, std::move(lattice)); !status.ok()) {
    return status;
  }
  return std::make_unique<NetworkDisplay>(std::move(info), std::move(settings),
                                          make_link(protocol, to), clock);
}

}  // namespace voxeld::display::network
