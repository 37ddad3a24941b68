#include "tools/lights/intake.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "display/drivers/network/packets.h"

namespace voxeld::lights {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using Bytes = std::vector<uint8_t>;

constexpr sync::TimeNs kMs = sync::kMillisecond;

Bytes Bytes3(size_t lights, uint8_t value) { return Bytes(lights * 3, value); }

// Packets as this project's drivers send them: they are read here by code that shares nothing with
// the drivers.
class Sender {
 public:
  explicit Sender(display::network::StreamOptions options, int32_t pixels = 170)
      : writer_(std::move(options), pixels) {}
  Bytes Pixels(int32_t slice, const Bytes& rgb, bool last = false) {
    return Plain(writer_.Pixels(slice, rgb, last));
  }
  Bytes Sync() { return Plain(writer_.Sync()); }
  Bytes End(int32_t slice, const Bytes& rgb) { return Plain(writer_.End(slice, rgb)); }

 private:
  static Bytes Plain(const std::vector<std::byte>& bytes) {
    Bytes out(bytes.size());
    std::memcpy(out.data(), bytes.data(), bytes.size());
    return out;
  }
  display::network::PacketWriter writer_;
};

display::network::StreamOptions E131Stream(uint8_t priority, uint8_t id, int32_t sync = 0) {
  display::network::StreamOptions options;
  options.protocol = Protocol::kE131;
  options.priority = priority;
  options.sync_universe = sync;
  options.cid[0] = id;
  return options;
}

void ExpectSound(const IntakeTally& in, const Intake& intake) {
  EXPECT_EQ(in.messages, in.set + in.shows + in.ended + in.other + in.outside + in.outranked +
                             in.stale + in.malformed);
  EXPECT_EQ(in.pictures, in.taken + in.superseded + (intake.waiting() ? 1 : 0));
}

OpcReader::Message Opc(uint8_t channel, const Bytes& data, uint8_t command = 0) {
  return {channel, command, data};
}

TEST(Intake, AnOpcMessageIsAPicture) {
  Intake intake({.protocol = Protocol::kOpc, .lights = 2});
  EXPECT_FALSE(intake.Take().has_value());
  intake.AddMessage(Opc(0, {1, 2, 3}), 0);
  EXPECT_THAT(*intake.Take(), ElementsAre(1, 2, 3, 0, 0, 0));
  EXPECT_FALSE(intake.Take().has_value());
  // With more lights than exist, the rest is ignored. With two messages, the second is shown.
  intake.AddMessage(Opc(0, {9, 9, 9, 9, 9, 9, 9, 9, 9}), 0);
  intake.AddMessage(Opc(0, {4, 5, 6, 7, 8, 9}), 0);
  EXPECT_THAT(*intake.Take(), ElementsAre(4, 5, 6, 7, 8, 9));
  EXPECT_EQ(intake.tally().superseded, 1u);
  intake.AddMessage(Opc(0, {}), 0);
  EXPECT_EQ(intake.tally().outside, 1u);
  intake.AddMessage(Opc(0, {0, 1, 0, 2}, 255), 0);  // system exclusive
  EXPECT_EQ(intake.tally().other, 1u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, OpcChannelsAreParts) {
  Intake intake({.protocol = Protocol::kOpc, .lights = 4, .a_channel = 2, .gather_ns = 4 * kMs});
  intake.AddMessage(Opc(1, Bytes3(2, 10)), 0);
  EXPECT_EQ(intake.due(), 4 * kMs);
  intake.AddMessage(Opc(2, Bytes3(5, 20)), 1 * kMs);  // three lights too many
  intake.Tick(3 * kMs);
  EXPECT_FALSE(intake.waiting());
  intake.Tick(4 * kMs);
  EXPECT_THAT(*intake.Take(), ElementsAre(10, 10, 10, 10, 10, 10, 20, 20, 20, 20, 20, 20));
  // If a part is received again, it ends the previous picture and is not included in it.
  intake.AddMessage(Opc(1, Bytes3(2, 30)), 5 * kMs);
  intake.AddMessage(Opc(1, Bytes3(2, 40)), 6 * kMs);
  EXPECT_EQ((*intake.Take())[0], 30);
  intake.AddMessage(Opc(3, Bytes3(2, 50)), 7 * kMs);
  EXPECT_EQ(intake.tally().outside, 1u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, DdpShowsWhatIsPushed) {
  display::network::StreamOptions stream;  // DDP
  Sender sender(stream, 100);
  Intake intake({.protocol = Protocol::kDdp, .lights = 200});
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(100, 1)), 0).ok());
  EXPECT_FALSE(intake.waiting());
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(1, Bytes3(100, 2), true), 0).ok());
  const auto picture = intake.Take();
  ASSERT_TRUE(picture.has_value());
  EXPECT_THAT(picture->first(300), Each(1));
  EXPECT_THAT(picture->subspan(300), Each(2));
  // Without a push, it is shown after a while.
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(100, 3)), 10 * kMs).ok());
  intake.Tick(intake.due());
  EXPECT_TRUE(intake.waiting());
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, CountsWhatIsLostByItsNumbers) {
  display::network::StreamOptions stream;
  Sender ddp(stream, 1);
  Intake intake({.protocol = Protocol::kDdp, .lights = 1});
  for (int i = 0; i < 100; ++i) {
    const Bytes packet = ddp.Pixels(0, Bytes3(1, 1), true);
    if (i % 10 == 5) continue;
    ASSERT_TRUE(intake.AddDatagram(packet, 0).ok());
  }
  EXPECT_EQ(intake.tally().lost, 10u);
  EXPECT_EQ(intake.tally().set, 90u);

  stream.protocol = Protocol::kArtNet;
  stream.first_universe = 0;
  Sender artnet(stream, 170);
  Intake universe({.protocol = Protocol::kArtNet, .lights = 170, .first_universe = 0});
  for (int i = 0; i < 600; ++i) {
    const Bytes packet = artnet.Pixels(0, Bytes3(170, 1));
    if (i % 100 == 50) continue;
    ASSERT_TRUE(universe.AddDatagram(packet, i * kMs).ok());
  }
  EXPECT_EQ(universe.tally().lost, 6u);
  ExpectSound(universe.tally(), universe);
}

TEST(Intake, UniversesAreParts) {
  Sender sender(E131Stream(100, 1));
  Intake intake({.protocol = Protocol::kE131, .lights = 200});
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 1)), 0).ok());
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(1, Bytes3(170, 2)), 1 * kMs).ok());
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(2, Bytes3(170, 3)), 1 * kMs).ok());
  EXPECT_EQ(intake.tally().outside, 1u);
  // The first part of the next picture arrives before the end of the wait.
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 4)), 2 * kMs).ok());
  const auto picture = intake.Take();
  ASSERT_TRUE(picture.has_value());
  EXPECT_THAT(picture->first(510), Each(1));
  EXPECT_THAT(picture->subspan(510), Each(2));
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, WaitsForSynchronisationWhereThereIsOne) {
  Sender sender(E131Stream(100, 1, 7));
  Intake intake({.protocol = Protocol::kE131, .lights = 340});
  // Until the first has arrived, it does not wait for any.
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 1)), 100 * sync::kSecond).ok());
  EXPECT_EQ(intake.due(), 100 * sync::kSecond + 4 * kMs);
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 100 * sync::kSecond).ok());
  EXPECT_TRUE(intake.Take().has_value());
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(intake.AddDatagram(sender.Pixels(i, Bytes3(170, 2)), 101 * sync::kSecond).ok());
  }
  intake.Tick(101 * sync::kSecond + 100 * kMs);
  EXPECT_FALSE(intake.waiting());
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 101 * sync::kSecond + 200 * kMs).ok());
  EXPECT_THAT(*intake.Take(), Each(2));
  // When they stop arriving, pictures are shown without them.
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 3)), 102 * sync::kSecond).ok());
  intake.Tick(106 * sync::kSecond);
  EXPECT_TRUE(intake.waiting());
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, TheHighestPriorityHasAUniverse) {
  Sender low(E131Stream(90, 1)), high(E131Stream(110, 2));
  Intake intake({.protocol = Protocol::kE131, .lights = 170, .gather_ns = 0});
  const auto shown = [&](const Bytes& packet, sync::TimeNs now) {
    EXPECT_TRUE(intake.AddDatagram(packet, now).ok());
    intake.Tick(now);
    const auto picture = intake.Take();
    return picture ? (*picture)[0] : -1;
  };
  EXPECT_EQ(shown(low.Pixels(0, Bytes3(170, 1)), 0), 1);
  EXPECT_EQ(shown(high.Pixels(0, Bytes3(170, 2)), 1 * kMs), 2);
  EXPECT_EQ(shown(low.Pixels(0, Bytes3(170, 3)), 2 * kMs), -1);
  EXPECT_EQ(intake.tally().outranked, 1u);
  // The stream ends, or falls silent: the other one takes over.
  EXPECT_EQ(shown(high.End(0, Bytes3(170, 2)), 3 * kMs), -1);
  EXPECT_EQ(shown(low.Pixels(0, Bytes3(170, 4)), 4 * kMs), 4);
  EXPECT_EQ(shown(high.Pixels(0, Bytes3(170, 5)), 5 * kMs), 5);
  EXPECT_EQ(shown(low.Pixels(0, Bytes3(170, 6)), 6 * kMs), -1);
  EXPECT_EQ(shown(low.Pixels(0, Bytes3(170, 7)), 5 * kMs + Intake::kSourceLife + 1), 7);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, PassesOverWhatComesLate) {
  Sender sender(E131Stream(100, 1));
  Intake intake({.protocol = Protocol::kE131, .lights = 170});
  std::vector<Bytes> packets;
  for (int i = 0; i < 40; ++i) packets.push_back(sender.Pixels(0, Bytes3(170, uint8_t(i))));
  ASSERT_TRUE(intake.AddDatagram(packets[5], 0).ok());
  ASSERT_TRUE(intake.AddDatagram(packets[3], 0).ok());
  EXPECT_EQ(intake.tally().stale, 1u);
  ASSERT_TRUE(intake.AddDatagram(packets[30], 0).ok());
  EXPECT_EQ(intake.tally().lost, 24u);
  ASSERT_TRUE(intake.AddDatagram(packets[5], 0).ok());  // 25 behind: its sender was restarted
  EXPECT_EQ(intake.tally().stale, 1u);
  EXPECT_EQ(intake.tally().set, 3u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, OpcChannelsWithoutASizeAreWholePictures) {
  // A channel has as many lights as the display, so only the first channel has any.
  Intake intake({.protocol = Protocol::kOpc, .lights = 2});
  intake.AddMessage(Opc(1, Bytes3(2, 10)), 0);
  EXPECT_THAT(*intake.Take(), Each(10)) << "at once";
  EXPECT_EQ(intake.due(), sync::kNever);
  intake.AddMessage(Opc(2, Bytes3(2, 20)), 0);
  EXPECT_EQ(intake.tally().outside, 1u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, AWordToShowIsOfItsSynchronisationAlone) {
  Sender sender(E131Stream(100, 1, 7)), other(E131Stream(100, 2, 8));
  Intake intake({.protocol = Protocol::kE131, .lights = 170});
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 1)), 0).ok());
  ASSERT_TRUE(intake.AddDatagram(other.Sync(), 0).ok());
  EXPECT_FALSE(intake.waiting());
  EXPECT_EQ(intake.tally().other, 1u);
  EXPECT_EQ(intake.tally().shows, 0u);
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 0).ok());
  EXPECT_TRUE(intake.Take().has_value());
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 0).ok());
  EXPECT_FALSE(intake.waiting()) << "nothing has arrived since";
  EXPECT_EQ(intake.tally().shows, 2u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, ArtNetWaitsForSynchronisationOnceThereWasOne) {
  display::network::StreamOptions stream;
  stream.protocol = Protocol::kArtNet;
  stream.first_universe = 4;
  stream.sync_universe = 1;
  Sender sender(stream);
  Intake intake(
      {.protocol = Protocol::kArtNet, .lights = 170, .first_universe = 4, .gather_ns = 4 * kMs});
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 1)), 10 * sync::kSecond).ok());
  EXPECT_EQ(intake.due(), 10 * sync::kSecond + 4 * kMs);
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 10 * sync::kSecond).ok());
  EXPECT_THAT(*intake.Take(), Each(1));
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 2)), 11 * sync::kSecond).ok());
  EXPECT_EQ(intake.due(), 14 * sync::kSecond) << "as long as sync packets may be apart";
  ASSERT_TRUE(intake.AddDatagram(sender.Sync(), 12 * sync::kSecond).ok());
  EXPECT_THAT(*intake.Take(), Each(2));
  // Packets for universes before the first are ignored.
  stream.first_universe = 2;
  Sender below(stream);
  ASSERT_TRUE(intake.AddDatagram(below.Pixels(0, Bytes3(170, 3)), 12 * sync::kSecond).ok());
  EXPECT_EQ(intake.tally().outside, 1u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, ADdpPushByItselfShowsWhatCame) {
  Intake intake({.protocol = Protocol::kDdp, .lights = 1});
  const Bytes lights = {0x40, 0, 0x0B, 1, 0, 0, 0, 0, 0, 3, 7, 8, 9};
  const Bytes push = {0x41, 0, 0x0B, 1, 0, 0, 0, 0, 0, 0};
  ASSERT_TRUE(intake.AddDatagram(lights, 0).ok());
  EXPECT_FALSE(intake.waiting());
  ASSERT_TRUE(intake.AddDatagram(push, 0).ok());
  EXPECT_THAT(*intake.Take(), ElementsAre(7, 8, 9));
  // Beyond the last light, pushed: what came before it makes a picture; without that, there is no
  // picture.
  const Bytes beyond = {0x41, 0, 0x0B, 1, 0, 0, 0, 3, 0, 3, 1, 1, 1};
  ASSERT_TRUE(intake.AddDatagram(beyond, 0).ok());
  EXPECT_FALSE(intake.waiting());
  ASSERT_TRUE(intake.AddDatagram(lights, 0).ok());
  ASSERT_TRUE(intake.AddDatagram(beyond, 0).ok());
  EXPECT_TRUE(intake.waiting());
  EXPECT_EQ(intake.tally().outside, 2u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, AUniverseOfNoValuesSetsNothing) {
  Intake intake({.protocol = Protocol::kE131, .lights = 170});
  Sender sender(E131Stream(100, 1));
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, {}), 0).ok());
  EXPECT_EQ(intake.tally().outside, 1u);
  EXPECT_EQ(intake.due(), sync::kNever);
}

TEST(Intake, SourcesOfAUniverseAreSixteenAtTheMost) {
  Intake intake({.protocol = Protocol::kE131, .lights = 170});
  for (uint8_t id = 1; id <= 17; ++id) {
    Sender sender(E131Stream(100, id));
    ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, id)), 0).ok());
  }
  EXPECT_EQ(intake.tally().set, 16u);
  EXPECT_EQ(intake.tally().outranked, 1u);
  // A known sender continues; another takes over when all have fallen silent.
  Sender first(E131Stream(100, 1));
  first.Pixels(0, Bytes3(170, 1));
  ASSERT_TRUE(intake.AddDatagram(first.Pixels(0, Bytes3(170, 1)), 1 * kMs).ok());
  EXPECT_EQ(intake.tally().set, 17u);
  Sender late(E131Stream(100, 17));
  ASSERT_TRUE(intake.AddDatagram(late.Pixels(0, Bytes3(170, 1)), Intake::kSourceLife + 1).ok());
  EXPECT_EQ(intake.tally().set, 18u);
  ExpectSound(intake.tally(), intake);
}

TEST(Intake, AccountsForWhateverComes) {
  std::mt19937 random(3);
  for (const Protocol protocol : {Protocol::kDdp, Protocol::kE131, Protocol::kArtNet}) {
    display::network::StreamOptions stream = E131Stream(100, 1);
    stream.protocol = protocol;
    Sender sender(stream, 100);
    Intake intake({.protocol = protocol, .lights = 250});
    for (int i = 0; i < 50'000; ++i) {
      Bytes packet = sender.Pixels(static_cast<int32_t>(random() % 4), Bytes3(100, 1), i % 4 == 0);
      if (random() % 3 == 0) packet[random() % packet.size()] = static_cast<uint8_t>(random());
      if (random() % 16 == 0) packet.resize(random() % packet.size());
      intake.AddDatagram(packet, i * kMs).status().IgnoreError();
      intake.Tick(i * kMs);
      if (random() % 5 == 0) intake.Take();
    }
    EXPECT_EQ(intake.tally().messages, 50'000u);
    EXPECT_GT(intake.tally().malformed, 0u);
    EXPECT_FALSE(intake.malformed().ok());
    ExpectSound(intake.tally(), intake);
  }
}

TEST(Intake, UniversesOf512ChannelsFollowOneAnother) {
  // xLights' default: light 170 has its first two values in the first universe and its third in the second.
  IntakeOptions options;
  options.protocol = Protocol::kE131;
  options.lights = 300;
  options.universe_channels = 512;
  EXPECT_EQ(UniversesOf(options), 2);
  Intake intake(options);
  const auto packet = [](uint8_t universe, const Bytes& values) {
    // E1.31's layers according to its table 4-1: sizes, vectors, the universe and the start code.
    Bytes out(126 + values.size());
    const size_t size = out.size();
    const auto flags = [&](size_t at) {
      out[at] = static_cast<uint8_t>(0x70 | (size - at) >> 8);
      out[at + 1] = static_cast<uint8_t>(size - at);
    };
    out[1] = 0x10;
    std::memcpy(&out[4], "ASC-E1.17\0\0", 12);
    flags(16);
    out[21] = 4;
    flags(38);
    out[43] = 2;
    out[108] = 100;
    out[114] = universe;
    flags(115);
    out[117] = 2;
    out[118] = 0xa1;
    out[122] = 1;
    out[123] = static_cast<uint8_t>((values.size() + 1) >> 8);
    out[124] = static_cast<uint8_t>(values.size() + 1);
    std::copy(values.begin(), values.end(), out.begin() + 126);
    return out;
  };
  Bytes first(512), second(388);
  for (size_t i = 0; i < first.size(); ++i) first[i] = static_cast<uint8_t>(i % 251);
  for (size_t i = 0; i < second.size(); ++i) second[i] = static_cast<uint8_t>((512 + i) % 251);
  ASSERT_TRUE(intake.AddDatagram(packet(1, first), 0).ok());
  ASSERT_TRUE(intake.AddDatagram(packet(2, second), 0).ok());
  intake.Tick(10 * kMs);
  const auto picture = intake.Take();
  ASSERT_TRUE(picture.has_value());
  for (size_t i = 0; i < 900; ++i) EXPECT_EQ((*picture)[i], i % 251) << i;
  EXPECT_EQ(intake.tally().unused, 0u);
  // With 170 lights in a universe, the last two values are reported unless they are 0.
  options.universe_channels = 510;
  Intake plain(options);
  ASSERT_TRUE(plain.AddDatagram(packet(1, first), 0).ok());
  EXPECT_EQ(plain.tally().unused, 1u);
  first[510] = first[511] = 0;
  ASSERT_TRUE(plain.AddDatagram(packet(1, first), 0).ok());
  EXPECT_EQ(plain.tally().unused, 1u);
}

TEST(Intake, ValuesBeyondTheLastLightOfAUniverseAreCountedUnlessTheyAreZeros) {
  IntakeOptions options;
  options.protocol = Protocol::kE131;
  options.lights = 100;
  Intake intake(options);
  Sender sender(E131Stream(100, 1));
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(100, 9)), 0).ok());
  EXPECT_EQ(intake.tally().beyond, 0u);
  Bytes filled = Bytes3(170, 0);
  std::fill_n(filled.begin(), 300, uint8_t{9});
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, filled), 0).ok());
  EXPECT_EQ(intake.tally().beyond, 0u);
  ASSERT_TRUE(intake.AddDatagram(sender.Pixels(0, Bytes3(170, 9)), 0).ok());
  EXPECT_EQ(intake.tally().beyond, 1u);
  EXPECT_EQ(intake.tally().unused, 0u);
}

TEST(Intake, OpcValuesThatAreNotUsedAreCounted) {
  IntakeOptions options;
  options.lights = 4;
  Intake intake(options);
  intake.AddMessage(Opc(0, Bytes(12, 1)), 0);
  EXPECT_EQ(intake.tally().split + intake.tally().beyond + intake.tally().unmapped, 0u);
  intake.AddMessage(Opc(0, Bytes(7, 1)), 0);  // two lights and a third of one
  EXPECT_EQ(intake.tally().split, 1u);
  intake.AddMessage(Opc(1, Bytes(15, 1)), 0);
  EXPECT_EQ(intake.tally().beyond, 1u);
  intake.AddMessage(Opc(2, Bytes(12, 1)), 0);
  EXPECT_EQ(intake.tally().unmapped, 1u);
  options.a_channel = 2;
  Intake apart(options);
  apart.AddMessage(Opc(2, Bytes(6, 1)), 0);
  EXPECT_EQ(apart.tally().unmapped + apart.tally().beyond, 0u);
  apart.AddMessage(Opc(2, Bytes(9, 1)), 0);  // a channel has two
  EXPECT_EQ(apart.tally().beyond, 1u);
}

}  // namespace
}  // namespace voxeld::lights
