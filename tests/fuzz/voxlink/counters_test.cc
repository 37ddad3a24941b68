// Tests counters that wrap while volumes are sent: numbers of packets and of events (32 bits), and
// the device's time (64). The device and the decoder get packets from shortly before the wrap on,
// the driver such events and times, and nothing is lost.

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "display/crc/crc32c.h"
#include "display/drivers/voxlink/decoder.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/voxlink_device.h"
#include "gtest/gtest.h"
#include "tests/display/drivers/firmware/firmware_device.h"
#include "tests/display/usb/transport_rig.h"
#include "tests/fuzz/script.h"
#include "tests/fuzz/voxlink/lying_device.h"

namespace voxeld::fuzz {
namespace {

using display::voxlink::PacketHeader;
using sync::kMillisecond;
using sync::kSecond;

constexpr uint32_t kPacketsBefore = 5;
constexpr sync::TimeNs kTimeBefore = 500 * kMillisecond;

std::unique_ptr<display::UsbDeviceModel> Emulated(sync::Clock& clock) {
  const display::DisplayInfo info = display::SmallDisplay();
  display::emulator::VoxlinkDeviceConfig config;
  config.geometry = info.geometry;
  config.volumes_per_second = info.volumes_per_second;
  return std::make_unique<display::emulator::VoxlinkDevice>(config, clock);
}

std::unique_ptr<display::UsbDeviceModel> Firmware(sync::Clock& clock) {
  const display::DisplayInfo info = display::SmallDisplay();
  const auto rate = static_cast<uint32_t>(info.volumes_per_second * 1000);
  const display::voxlink::DeviceCapabilities capabilities{
      .fixed = {.version = 0x0100,
                .formats = 0x1F,
                .max_sub_frames = 4,
                .features = 1u | 2u | 4u | 8u | 16u,
                .receive_buffer = 1 << 20,
                .max_payload = 4096,
                .volume_buffers = 3,
                .min_rate_mhz = rate / 4,
                .max_rate_mhz = rate,
                .nominal_rate_mhz = rate,
                .keepalive_ms = 100,
                .watchdog_ms = 250},
      .geometry = info.geometry};
  return std::make_unique<display::FirmwareDevice>(capabilities, display::UsbSpeed::kSuper, clock);
}

struct Case {
  const char* name;
  std::unique_ptr<display::UsbDeviceModel> (*device)(sync::Clock&);
};
class Counters : public testing::TestWithParam<Case> {};

TEST_P(Counters, NothingIsLostWhereTheyWrap) {
  sync::FakeClock clock;
  Script script(nullptr, 0);
  auto shifted = std::make_unique<LyingDevice>(
      GetParam().device(clock), clock, script,
      LyingDevice::Ways{.sequence_shift = 0u - kPacketsBefore,
                        .time_shift = 0u - static_cast<uint64_t>(kTimeBefore)});
  shifted->TellTheTruth();
  display::InProcessTransport::Options options;
  options.own_thread = false;
  auto transport =
      std::make_unique<display::InProcessTransport>(std::move(shifted), clock, options);
  display::InProcessTransport* const cable = transport.get();
  display::TransportRig rig(std::move(transport), clock, {[cable] { return cable->Pump(); }});
  rig.Start();
  display::FrameSource source(rig.display().info().layout, 1);
  // From here on sweeps are known; the first packet was one that the device had to take for a gap.
  rig.RunFor(100 * kMillisecond);
  for (uint64_t volume = 1; volume <= 100; ++volume) {
    rig.display().Submit(source.Next(0.5));
    const sync::TimeNs submitted = clock.Now();
    ASSERT_TRUE(rig.RunUntil([&] { return rig.recorder().Count(volume) == 1; }, kSecond)) << volume;
    const display::VolumeOutcome& outcome = *rig.recorder().Of(volume);
    EXPECT_EQ(outcome.kind, display::VolumeOutcome::Kind::kPresented) << volume;
    EXPECT_GE(outcome.time_ns, submitted - kMillisecond) << volume;
    EXPECT_LE(outcome.time_ns, submitted + kSecond) << volume;
  }
  ASSERT_GT(clock.Now(), kSecond + kTimeBefore);
  const display::DisplayStats& stats = rig.display().stats();
  EXPECT_EQ(stats.attaches, 1u);
  EXPECT_EQ(stats.transfers_failed, 0u);
  EXPECT_EQ(stats.slices_resent, 0u);
  EXPECT_EQ(stats.volumes_lost, 0u);
}

INSTANTIATE_TEST_SUITE_P(Devices, Counters,
                         testing::Values(Case{"Emulated", Emulated}, Case{"Firmware", Firmware}),
                         [](const auto& info) { return std::string(info.param.name); });

// Returns packets numbered from `first` on, for `count` volumes.
std::vector<std::byte> Volumes(const display::FrameLayout& layout, int count, uint32_t first) {
  display::voxlink::PacketWriter writer;
  const std::vector<std::byte> picture(layout.bytes_per_slice(), std::byte{7});
  std::vector<std::byte> all;
  for (int volume = 1; volume <= count; ++volume) {
    std::vector<std::vector<std::byte>> packets(layout.pictures() + 2);
    const auto number = static_cast<uint64_t>(volume);
    writer.Begin(packets.front(), number, 0, static_cast<uint32_t>(layout.pictures()), {});
    for (size_t slice = 0; slice < layout.pictures(); ++slice) {
      writer.Slice(packets[slice + 1], number, static_cast<uint32_t>(slice), 0, 0, picture);
    }
    writer.End(packets.back(), number, true);
    for (std::vector<std::byte>& packet : packets) {
      auto header = display::voxlink::Load<PacketHeader>(packet);
      header.sequence += first;
      header.header_crc = display::Crc32c(
          std::as_bytes(std::span(&header, 1)).first(display::voxlink::kHeaderCrcOffset));
      const auto bytes = std::as_bytes(std::span(&header, 1));
      std::copy(bytes.begin(), bytes.end(), packet.begin());
      all.insert(all.end(), packet.begin(), packet.end());
    }
  }
  return all;
}

TEST(DecoderCounters, ItReadsOnWhereNumbersWrap) {
  constexpr display::FrameLayout kLayout{.slices = 3, .width = 4, .height = 2, .sub_frames = 1};
  const size_t each = 5;  // packets in a volume
  for (uint32_t before = 0; before <= 2 * each; ++before) {
    display::voxlink::VoxlinkDecoder decoder(kLayout, 64);
    const absl::Status status =
        decoder.OnBytes(display::voxlink::kBulkOut, Volumes(kLayout, 3, 0u - before), 0);
    ASSERT_TRUE(status.ok()) << before << ": " << status;
    const auto volume = decoder.TakeVolume();
    ASSERT_TRUE(volume.has_value());
    EXPECT_EQ(volume->volume, 3u);
  }
  // A packet that is missing at the wrap is detected.
  std::vector<std::byte> bytes = Volumes(kLayout, 1, 0u - 2);
  const size_t slice = sizeof(PacketHeader) + kLayout.bytes_per_slice();
  const size_t begin = sizeof(PacketHeader) + sizeof(display::voxlink::BeginPayload) + slice;
  bytes.erase(bytes.begin() + static_cast<ptrdiff_t>(begin),
              bytes.begin() + static_cast<ptrdiff_t>(begin + slice));
  display::voxlink::VoxlinkDecoder decoder(kLayout, 64);
  EXPECT_FALSE(decoder.OnBytes(display::voxlink::kBulkOut, bytes, 0).ok());
}

}  // namespace
}  // namespace voxeld::fuzz
