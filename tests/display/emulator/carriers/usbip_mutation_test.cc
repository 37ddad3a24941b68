// A valid USB/IP session with a few wrong bytes, many thousand times: whatever arrives, the session
// continues or ends with a status, and no more transfers wait than are allowed.
#include <algorithm>
#include <random>
#include <string>

#include "display/emulator/carriers/limits.h"
#include "display/emulator/carriers/usbip.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/bench.h"
#include "tests/display/emulator/carriers/mutate.h"
#include "tests/display/emulator/carriers/peer.h"

namespace voxeld::display::emulator {
namespace usbip_mutation_test {

constexpr int kMutations = 12'000;

Bytes ValidSession() {
  const auto submit = [](const std::string& number, const std::string& direction,
                         const std::string& endpoint, const std::string& length,
                         const std::string& setup, const std::string& data) {
    return "00 00 00 01  00 00 00 " + number + "  00 01 00 02  00 00 00 " + direction +
           "  00 00 00 " + endpoint + "  00 00 00 00  00 00 00 " + length +
           "  00 00 00 00  ff ff ff ff  00 00 00 00  " + setup + " " + data + " ";
  };
  return Hex(submit("01", "01", "00", "12", "80 06 00 01 00 00 12 00", "") +
             submit("02", "00", "00", "00", "00 09 01 00 00 00 00 00", "") +
             submit("03", "01", "02", "40", "00*8", "") +
             submit("04", "00", "00", "00", "41 05 00 00 00 00 00 00", "") +
             submit("05", "01", "02", "40", "00*8", "") +
             submit("06", "00", "01", "20", "00*8", "a5*32") +
             "00 00 00 02  00 00 00 07  00 01 00 02  00*8  00 00 00 05  00*24 " +
             submit("08", "00", "00", "00", "02 01 00 00 01 00 00 00", "") +
             submit("09", "01", "00", "40", "c1 01 00 00 00 00 40 00", ""));
}

TEST(UsbipMutations, NoneHangsCrashesOrPilesUp) {
  const Bytes valid = ValidSession();
  int ended = 0;
  for (uint32_t seed = 0; seed < kMutations; ++seed) {
    std::mt19937 random(seed);
    Bench bench;
    Peer peer;
    UsbipSession session(peer.TakeDeviceEnd(), bench.model());
    absl::Status status;
    const Bytes mutated = Mutated(valid, random);
    for (size_t at = 0; at < mutated.size() && status.ok();) {
      const size_t piece = std::min<size_t>(1 + random() % 200, mutated.size() - at);
      ASSERT_EQ(peer.Send(std::span(mutated).subspan(at, piece)), piece);
      at += piece;
      status = session.Receive();
      if (random() % 4 == 0) bench.Pass(sync::kMillisecond);
      if (random() % 64 == 0) bench.model().SetPlugged(!bench.model().plugged());
      peer.Take();
    }
    if (!status.ok()) {
      ++ended;
      EXPECT_FALSE(status.message().empty());
    }
    EXPECT_LE(session.stream().waiting(), kMostWaiting);
  }
  // Some mutations violate the protocol, and some only have another meaning.
  EXPECT_GT(ended, kMutations / 20);
  EXPECT_LT(ended, kMutations);
}

TEST(UsbipMutations, GarbageEndsASession) {
  for (uint32_t seed = 0; seed < 500; ++seed) {
    std::mt19937 random(seed);
    Bench bench;
    Peer peer;
    UsbipSession session(peer.TakeDeviceEnd(), bench.model());
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

TEST(UsbipMutations, Handshakes) {
  const Bytes valid = Hex("01 11 80 03 00 00 00 00  31 2d 31 00*29");
  Bench bench;
  for (uint32_t seed = 0; seed < kMutations; ++seed) {
    std::mt19937 random(seed);
    Peer peer;
    const Bytes mutated = Mutated(valid, random);
    peer.Send(mutated);
    ByteStream end(peer.TakeDeviceEnd());
    const absl::StatusOr<bool> urbs = AnswerUsbipHandshake(end.fd(), bench.model(), 0);
    EXPECT_TRUE(urbs.ok() || !urbs.status().message().empty());
  }
}

}  // namespace usbip_mutation_test
}  // namespace voxeld::display::emulator
