// DDP, E1.31 and Art-Net: a sequence of datagrams over time.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/lights/tally.h"
#include "tests/fuzz/script.h"
#include "tools/lights/datagram.h"

namespace voxeld::fuzz {
namespace {

using lights::Datagram;
using lights::Protocol;

void CheckDatagram(Protocol protocol, const Datagram& read, std::span<const uint8_t> packet) {
  EXPECT_THAT_HOLDS(read.priority <= 200);
  EXPECT_THAT_HOLDS(read.universe >= 0 && read.universe < 65536);
  if (!read.values.empty()) {
    EXPECT_THAT_HOLDS(read.values.data() >= packet.data() &&
                          read.values.data() + read.values.size() <= packet.data() + packet.size(),
                      "values lie outside the packet");
    EXPECT_THAT_HOLDS(protocol == Protocol::kDdp || read.values.size() <= 512);
  }
  uint32_t sum = 0;
  for (const uint8_t value : read.values) sum += value;
  (void)sum;
}

void Run(Script script) {
  constexpr Protocol kProtocols[] = {Protocol::kDdp, Protocol::kE131, Protocol::kArtNet};
  lights::IntakeOptions options;
  options.protocol = kProtocols[script.Below(3)];
  constexpr size_t kLights[] = {0, 1, 170, 171, 340, 1000};
  options.lights = kLights[script.Below(6)];
  options.first_universe = script.Byte() % 4;
  lights::Intake intake(options);
  sync::TimeNs now = sync::kSecond;
  while (!script.done()) {
    const uint8_t what = script.Byte();
    if (what < 0x20) {
      now += script.Byte() * 20 * sync::kMillisecond;
      intake.Tick(now);
    } else if (what < 0x30) {
      TakePicture(intake, options.lights);
    } else {
      const std::string text = script.Text();
      // It has exactly that size, so that reading beyond it is detected.
      const std::vector<uint8_t> packet(text.begin(), text.end());
      const lights::IntakeTally before = intake.tally();
      const absl::StatusOr<Datagram> read = lights::ReadDatagram(options.protocol, packet);
      const absl::StatusOr<Datagram> added = intake.AddDatagram(packet, now);
      EXPECT_THAT_HOLDS(read.ok() == added.ok());
      CountExchange(ExchangeKind::kDatagram, read.ok());
      if (read.ok()) {
        CheckDatagram(options.protocol, *read, packet);
        if (read->kind == Datagram::Kind::kAsk) {
          const auto reply = lights::ArtPollReply({127, 0, 0, 1}, 6454, options.first_universe, 9);
          EXPECT_THAT_HOLDS(lights::ReadDatagram(Protocol::kArtNet, reply).ok());
        }
      } else {
        ExpectSays(read.status());
        EXPECT_THAT_HOLDS(read.status() == added.status());
      }
      const lights::IntakeTally& after = intake.tally();
      EXPECT_THAT_HOLDS(after.messages == before.messages + 1);
      EXPECT_THAT_HOLDS(after.malformed == before.malformed + (read.ok() ? 0 : 1));
      EXPECT_THAT_HOLDS(after.bytes == before.bytes + packet.size());
      if (!read.ok()) EXPECT_THAT_HOLDS(after.pictures == before.pictures);
    }
    CheckTally(intake);
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
