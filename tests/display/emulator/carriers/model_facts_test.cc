#include "display/emulator/carriers/model_facts.h"

#include "display/emulator/fadecandy_device.h"
#include "display/sync/fake_clock.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/bench.h"

namespace voxeld::display::emulator {
namespace {

TEST(ModelFacts, OfVoxlink) {
  Bench bench;
  const ModelFacts facts = ReadFacts(bench.model());
  EXPECT_EQ(facts.vendor_id, 0x1209);
  EXPECT_EQ(facts.product_id, 0x0001);
  EXPECT_EQ(facts.bcd_device, 0x0100);
  EXPECT_EQ(facts.serial, "simulated");
  EXPECT_EQ(facts.device.size(), 18u);
  ASSERT_EQ(facts.interfaces.size(), 1u);
  EXPECT_EQ(facts.interfaces[0], (std::array<uint8_t, 3>{0xFF, 0x56, 0x01}));
  ASSERT_EQ(facts.endpoints.size(), 2u);
  EXPECT_EQ(facts.endpoints[0].address, 0x01);
  EXPECT_EQ(facts.endpoints[0].attributes, 2);
  EXPECT_EQ(facts.endpoints[0].packet, 1024);
  EXPECT_EQ(facts.endpoints[1].address, 0x82);
  EXPECT_EQ(facts.endpoints[1].attributes, 3);
  EXPECT_EQ(facts.endpoints[1].packet, 64);
  EXPECT_EQ(facts.endpoints[1].interval, 1);
}

TEST(ModelFacts, OfFadecandy) {
  sync::FakeClock clock;
  FadecandyDeviceConfig config;
  config.serial = "ABCD";
  FadecandyDevice device(config, clock);
  const ModelFacts facts = ReadFacts(device);
  EXPECT_EQ(facts.vendor_id, 0x1D50);
  EXPECT_EQ(facts.product_id, 0x607A);
  EXPECT_EQ(facts.serial, "ABCD");
  EXPECT_FALSE(facts.endpoints.empty());
}

TEST(ModelFacts, OfADeviceThatIsNotThereAreNone) {
  Bench bench;
  bench.model().SetPlugged(false);
  const ModelFacts facts = ReadFacts(bench.model());
  EXPECT_TRUE(facts.device.empty());
  EXPECT_TRUE(facts.endpoints.empty());
  EXPECT_EQ(facts.vendor_id, 0);
}

// A device that answers nothing for now is not waited for.
TEST(ModelFacts, OfADeviceThatKeepsSilentAreNone) {
  Bench bench;
  bench.injector().Add({.endpoint = 0, .what = Fault::What::kNak, .amount = sync::kSecond});
  EXPECT_TRUE(ReadFacts(bench.model()).device.empty());
  bench.Pass(2 * sync::kSecond);
  EXPECT_EQ(ReadFacts(bench.model()).device.size(), 18u);
}

TEST(ModelFacts, SetupsAreLittleEndian) {
  const UsbSetup setup = ParseSetup({0x80, 6, 0x02, 0x01, 0x04, 0x03, 0x06, 0x05});
  EXPECT_EQ(setup.request_type, 0x80);
  EXPECT_EQ(setup.request, 6);
  EXPECT_EQ(setup.value, 0x0102);
  EXPECT_EQ(setup.index, 0x0304);
  EXPECT_EQ(setup.length, 0x0506);
}

}  // namespace
}  // namespace voxeld::display::emulator
