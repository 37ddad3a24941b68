// A valid usbredir session with a few wrong bytes, many thousand times: whatever arrives, the
// session continues or ends with a status, and no more transfers wait than are allowed.
#include <algorithm>
#include <random>

#include "display/emulator/carriers/limits.h"
#include "display/emulator/carriers/usbredir.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/bench.h"
#include "tests/display/emulator/carriers/mutate.h"
#include "tests/display/emulator/carriers/peer.h"
#include "tests/display/emulator/carriers/usbredir_host.h"

namespace voxeld::display::emulator {
namespace {

constexpr int kMutations = 12'000;

// Returns what a host sends, as bytes on the wire.
Bytes ValidSession() {
  Bench bench;
  Peer peer;
  UsbredirHost host(peer);
  // The device's answers determine the form of what follows, so a session is recorded on the wire.
  Peer tapped;
  UsbredirSession session(tapped.TakeDeviceEnd(), bench.model());
  ByteStream wire(peer.TakeDeviceEnd());
  Bytes all;
  const auto pass = [&] {
    host.Write();
    Bytes some(65536);
    some.resize(wire.Receive(some));
    all.insert(all.end(), some.begin(), some.end());
    tapped.Send(some);
    EXPECT_TRUE(session.Receive().ok());
    wire.Send(tapped.Take());
    EXPECT_TRUE(host.Read());
  };
  pass();
  usb_redir_set_configuration_header configuration{1};
  usbredirparser_send_set_configuration(host.parser(), 1, &configuration);
  host.Control(2, 0x80, 6, 0x0100, 18);
  host.StartInterrupts(3, 0x82);
  host.Control(4, 0x41, 5, 0, 0);
  host.BulkOut(5, 0x01, Bytes(32, std::byte{0xA5}));
  usbredirparser_send_cancel_data_packet(host.parser(), 5);
  pass();
  EXPECT_EQ(host.controls.size(), 2u);
  usb_redir_set_alt_setting_header alternate{0, 0};
  usbredirparser_send_set_alt_setting(host.parser(), 6, &alternate);
  host.StopInterrupts(7, 0x82);
  usbredirparser_send_reset(host.parser());
  host.Control(8, 0xC1, 1, 0, 64);
  pass();
  EXPECT_EQ(host.controls.size(), 3u);
  return all;
}

TEST(UsbredirMutations, NoneHangsCrashesOrPilesUp) {
  const Bytes valid = ValidSession();
  ASSERT_GT(valid.size(), 200u);
  int ended = 0;
  for (uint32_t seed = 0; seed < kMutations; ++seed) {
    std::mt19937 random(seed);
    Bench bench;
    Peer peer;
    UsbredirSession session(peer.TakeDeviceEnd(), bench.model());
    absl::Status status;
    const Bytes mutated = Mutated(valid, random);
    for (size_t at = 0; at < mutated.size() && status.ok();) {
      const size_t piece = std::min<size_t>(1 + random() % 200, mutated.size() - at);
      ASSERT_EQ(peer.Send(std::span(mutated).subspan(at, piece)), piece);
      at += piece;
      status = session.Receive();
      if (random() % 4 == 0) {
        bench.Pass(sync::kMillisecond);
        session.ReadOn();
      }
      if (random() % 64 == 0) {
        bench.model().SetPlugged(!bench.model().plugged());
        session.SetPlugged(bench.model().plugged());
      }
      peer.Take();
    }
    if (!status.ok()) {
      ++ended;
      EXPECT_FALSE(status.message().empty());
    }
    EXPECT_LE(session.stream().waiting(), kMostWaiting);
  }
  EXPECT_GT(ended, kMutations / 50);
  EXPECT_LT(ended, kMutations);
}

TEST(UsbredirMutations, GarbageEndsASession) {
  for (uint32_t seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    Bench bench;
    Peer peer;
    UsbredirSession session(peer.TakeDeviceEnd(), bench.model());
    absl::Status status;
    for (int i = 0; i < 1000 && status.ok(); ++i) {
      Bytes garbage(256);
      for (std::byte& byte : garbage) byte = static_cast<std::byte>(random());
      peer.Send(garbage);
      status = session.Receive();
    }
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  }
}

}  // namespace
}  // namespace voxeld::display::emulator
