#include "display/drivers/fadecandy/verify/suite.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "display/drivers/fadecandy/lut.h"
#include "display/drivers/fadecandy/packets.h"
#include "display/drivers/fadecandy/protocol.h"

namespace voxeld::display::fadecandy {
namespace {

using conformance::Answer;
using conformance::Hex;
using conformance::Probe;
using sync::kMillisecond;
using sync::kSecond;

constexpr uint16_t kMostDescriptor = 255;
constexpr int kFrames = 50;

Answer Descriptor(Probe& probe, uint16_t value, uint16_t length = kMostDescriptor) {
  return probe.In(
      {.request_type = 0x80, .request = 0x06, .value = value, .index = 0, .length = length});
}

Answer Ask(Probe& probe, uint8_t request, uint16_t index, uint16_t length, uint16_t value = 0) {
  return probe.In({.request_type = kRequestIn,
                   .request = request,
                   .value = value,
                   .index = index,
                   .length = length});
}

std::string Seen(const Answer& answer) { return answer.ok() ? Hex(answer.data) : Describe(answer); }

void Send(Probe& probe, const std::string& what, const TransferBytes& bytes) {
  if (!probe.check().ok()) return;
  const Answer answer = probe.Bulk(kBulkOut, bytes);
  probe.check().Expect(answer.status == TransferStatus::kOk && answer.actual == bytes.size(),
                       absl::StrCat(what, " is taken: ", bytes.size(), " bytes"), Describe(answer));
}

uint32_t Counter(Probe& probe, uint16_t index) {
  if (!probe.check().ok()) return 0;
  const Answer answer = Ask(probe, kGetCounter, index, 4);
  if (!answer.ok() || answer.data.size() != 4) {
    probe.check().Fail(absl::StrCat("counter ", index, " of 4 bytes"), Describe(answer), "7");
    return 0;
  }
  uint32_t count = 0;
  for (size_t i = 4; i-- > 0;) count = count << 8 | std::to_integer<uint32_t>(answer.data[i]);
  return count;
}

TransferBytes Frame(uint8_t level, size_t begin = 0, size_t end = kFramePackets) {
  TransferBytes out;
  AppendFrame(out, std::vector<std::byte>(kFrameBytes, std::byte{level}), begin, end);
  return out;
}

// A frame is counted at the refresh for which it waits.
void ExpectFrames(Probe& probe, uint32_t before, uint32_t frames) {
  uint32_t got = 0;
  for (int i = 0; probe.check().ok() && i < 100; ++i) {
    got = Counter(probe, kFrameCounter) - before;
    if (got >= frames) break;
    probe.Pause(10 * kMillisecond);
  }
  probe.Pause(20 * kMillisecond);  // and no more frames
  got = Counter(probe, kFrameCounter) - before;
  if (probe.check().ok()) {
    probe.check().Equal("frames that the board counts:", frames, got);
  }
}

// The next frame must be accepted and counted.
void MustWork(Probe& probe) {
  const uint32_t before = Counter(probe, kFrameCounter);
  Send(probe, "a frame", Frame(0));
  ExpectFrames(probe, before, 1);
}

// ---- §1 USB

void DeviceDescriptor(Probe& probe) {
  const Answer answer = Descriptor(probe, 0x0100, 18);
  if (!answer.ok() || answer.data.size() != 18) {
    return probe.check().Fail("a device descriptor of 18 bytes", Seen(answer));
  }
  probe.check().Equal("vendor, product and release", std::string("50 1D 7A 60 08 01"),
                      Hex(std::span(answer.data).subspan(8, 6)));
  probe.check().Equal("strings of maker, product and serial number", std::string("01 02 03"),
                      Hex(std::span(answer.data).subspan(14, 3)));
}

void Configuration(Probe& probe) {
  static constexpr uint8_t kWant[] = {
      0x09, 0x02, 0x2B, 0x00, 0x02, 0x01, 0x00, 0x80, 0x32, 0x09, 0x04, 0x00, 0x00, 0x01, 0xFF,
      0x00, 0x00, 0x00, 0x07, 0x05, 0x01, 0x02, 0x40, 0x00, 0x00, 0x09, 0x04, 0x01, 0x00, 0x00,
      0xFE, 0x01, 0x01, 0x04, 0x09, 0x21, 0x0D, 0x10, 0x27, 0x00, 0x04, 0x01, 0x01};
  const Answer answer = Descriptor(probe, 0x0200);
  probe.check().Equal("the configuration descriptor", Hex(std::as_bytes(std::span(kWant))),
                      Seen(answer));
}

void Strings(Probe& probe) {
  const auto text = [&](uint16_t index) {
    const Answer answer = Descriptor(probe, static_cast<uint16_t>(0x0300 | index));
    std::string ascii;
    for (size_t i = 2; answer.ok() && i + 1 < answer.data.size(); i += 2) {
      ascii += static_cast<char>(answer.data[i]);
    }
    return answer.ok() ? ascii : Describe(answer);
  };
  probe.check().Equal("string 1:", std::string("scanlime"), text(1));
  probe.check().Equal("string 2:", std::string("Fadecandy"), text(2));
  probe.check().Equal("string 4:", std::string("Fadecandy Bootloader"), text(4));
  const Answer serial = Descriptor(probe, 0x0303);
  probe.check().Expect(serial.ok() && serial.data.size() > 2, "string 3, the serial number",
                       Seen(serial));
}

// ---- §2 to §5 packets

void Video(Probe& probe) {
  const uint32_t before = Counter(probe, kFrameCounter);
  Send(probe, "a frame in one transfer", Frame(1));
  for (size_t i = 0; i < kFramePackets; ++i) {
    Send(probe, absl::StrCat("video packet ", i), Frame(0, i, i + 1));
  }
  ExpectFrames(probe, before, 2);
}

void Unfinished(Probe& probe) {
  const uint32_t before = Counter(probe, kFrameCounter);
  Send(probe, "a frame but for its last packet", Frame(1, 0, kLastPacket));
  Send(probe, "the same again", Frame(0, 0, kLastPacket));
  probe.Pause(50 * kMillisecond);
  ExpectFrames(probe, before, 0);
  Send(probe, "the last packet", Frame(0, kLastPacket, kFramePackets));
  ExpectFrames(probe, before, 1);
}

void ColourTable(Probe& probe) {
  TransferBytes table;
  AppendLut(table, MakeLut({}, 0.5));
  for (int i = 0; i < 3; ++i) Send(probe, "a colour table", table);
  MustWork(probe);
}

void Flags(Probe& probe) {
  for (uint8_t flags = 0; flags < 16; ++flags) {
    TransferBytes packet;
    AppendConfig(packet, flags);
    Send(probe, absl::StrCat("a configuration ", int{flags}), packet);
  }
  MustWork(probe);
}

void Ignored(Probe& probe) {
  const uint32_t before = Counter(probe, kFrameCounter);
  TransferBytes packets;
  for (const uint8_t control : {0xC0, 0xF8, 0x19, 0x1F, 0x5F}) {
    packets.push_back(std::byte{control});
    packets.resize(packets.size() + kPacketBytes - 1);
  }
  Send(probe, "packets of type 3 and of indices above 24", packets);
  probe.Pause(50 * kMillisecond);
  ExpectFrames(probe, before, 0);
  MustWork(probe);
}

void ShortPacket(Probe& probe) {
  for (const size_t size : {size_t{1}, size_t{63}, size_t{65}}) {
    // 0xC0: type 3, however a board interprets a short packet.
    const std::vector<std::byte> bytes(size, std::byte{0xC0});
    const Answer answer = probe.Bulk(kBulkOut, bytes);
    probe.check().Expect(answer.ok(), absl::StrCat("a transfer of ", size, " bytes ends"),
                         Describe(answer));
  }
  MustWork(probe);
}

// ---- §6 flow control

void Paced(Probe& probe) {
  const uint32_t frames = Counter(probe, kFrameCounter);
  const uint32_t refreshes = Counter(probe, kRefreshCounter);
  for (int i = 0; probe.check().ok() && i < kFrames; ++i) Send(probe, "a frame", Frame(0));
  const uint32_t passed = Counter(probe, kRefreshCounter) - refreshes;
  // The last frame, and the one before, may still wait.
  probe.check().Expect(
      passed + 2 >= kFrames,
      absl::StrCat("a refresh for each frame: ", kFrames - 2, " or more for ", kFrames, " frames"),
      absl::StrCat(passed));
  ExpectFrames(probe, frames, kFrames);
}

void TablesDoNotWait(Probe& probe) {
  const uint32_t refreshes = Counter(probe, kRefreshCounter);
  TransferBytes tables;
  constexpr uint32_t kTables = 40;
  for (uint32_t i = 0; i < kTables; ++i) AppendLut(tables, Lut{});
  const sync::TimeNs begin = probe.Now();
  Send(probe, "40 colour tables", tables);
  const sync::TimeNs took = probe.Now() - begin;
  const uint32_t passed = Counter(probe, kRefreshCounter) - refreshes;
  // 64,000 bytes take 53 ms at full speed: some 20 refreshes. If each waited for one, there would
  // be 40.
  probe.check().Expect(passed < kTables * 3 / 4,
                       "fewer refreshes than three for each four colour tables",
                       absl::StrCat(passed, " refreshes, ", took / kMillisecond, " ms"));
}

// ---- §7 requests

void Counters(Probe& probe) {
  const uint32_t before = Counter(probe, kRefreshCounter);
  const sync::TimeNs begin = probe.Now();
  probe.Pause(kSecond);
  const uint32_t after = Counter(probe, kRefreshCounter);
  const sync::TimeNs passed = probe.Now() - begin;
  if (!probe.check().ok()) return;
  const int64_t rate = int64_t{after - before} * kSecond / std::max<sync::TimeNs>(passed, 1);
  probe.check().Expect(rate >= 100 && rate <= 1000, "some 400 refreshes a second: 100 to 1000",
                       absl::StrCat(rate));
}

void MsDescriptors(Probe& probe) {
  const Answer os = Descriptor(probe, 0x03EE);
  probe.check().Expect(os.ok() && os.data.size() == 18 && os.data[16] == std::byte{kMsVendorCode},
                       "string 0xEE of 18 bytes with vendor code 7E", Seen(os));
  const Answer id = Ask(probe, kMsVendorCode, kMsCompatibleId, kMostDescriptor);
  probe.check().Expect(id.ok() && id.data.size() >= 40, "a compatible id of 40 bytes or more",
                       Seen(id));
  if (!probe.check().ok()) return;
  probe.check().Equal("the compatible id", std::string("57 49 4E 55 53 42"),
                      Hex(std::span(id.data).subspan(18, 6)));
  const Answer properties = Ask(probe, kMsVendorCode, kMsProperties, kMostDescriptor);
  probe.check().Expect(properties.ok() && properties.data.size() > 10, "extended properties",
                       Seen(properties));
}

void UnknownRequests(Probe& probe) {
  const auto stalls = [&](const std::string& what, const Answer& answer) {
    probe.check().Expect(answer.status == TransferStatus::kStall, absl::StrCat(what, " is stalled"),
                         Describe(answer));
    Counter(probe, kFrameCounter);
  };
  stalls("request 0x02", Ask(probe, 0x02, 0, 4));
  stalls("request 0xFF", Ask(probe, 0xFF, 0, 4));
  stalls("a counter of index 2", Ask(probe, kGetCounter, 2, 4));
  stalls("string 9", Descriptor(probe, 0x0309));
  stalls("a Microsoft descriptor of index 9", Ask(probe, kMsVendorCode, 9, 64));
  stalls("an OUT request", probe.Out({.request_type = 0x40, .request = 0x05}));
}

void Halt(Probe& probe) {
  const Answer set = probe.Out(
      {.request_type = 0x02, .request = 0x03, .value = 0, .index = kBulkOut, .length = 0});
  probe.check().Expect(set.ok(), "SET_FEATURE(ENDPOINT_HALT) is done", Describe(set));
  if (!probe.check().ok()) return;
  const Answer refused = probe.Bulk(kBulkOut, Frame(0), false, kSecond);
  probe.check().Expect(refused.status == TransferStatus::kStall,
                       "a transfer on a halted endpoint is stalled", Describe(refused));
  const Answer cleared = probe.ClearHalt(kBulkOut);
  probe.check().Expect(cleared.ok(), "the halt is cleared", Describe(cleared));
  MustWork(probe);
}

void Reset(Probe& probe) {
  Send(probe, "a frame but for its last packet", Frame(1, 0, kLastPacket));
  const Answer reset = probe.Reset();
  probe.check().Expect(reset.ok(), "the board comes back from a reset of its port",
                       Describe(reset));
  MustWork(probe);
}

// Sends two black frames, so that no fade holds an earlier one, and a table of darkness.
absl::Status Rest(Probe& probe) {
  probe.ClearHalt(kBulkOut);
  TransferBytes bytes;
  AppendConfig(bytes, 0);
  AppendLut(bytes, Lut{});
  bytes.Append(Frame(0));
  bytes.Append(Frame(0));
  const Answer answer = probe.Bulk(kBulkOut, bytes);
  // The second frame, and the table, wait for a refresh.
  probe.Pause(20 * kMillisecond);
  if (answer.ok()) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("black frames: ", Describe(answer)));
}

}  // namespace

conformance::Suite MakeSuite() {
  return {.protocol = "Fadecandy",
          .page = "docs/protocols/fadecandy.md",
          .cases = {{"usb.device", "vendor, product, release, strings", "1", &DeviceDescriptor},
                    {"usb.configuration", "43 bytes, two interfaces", "1", &Configuration},
                    {"usb.strings", "maker, product, serial number, bootloader", "1", &Strings},
                    {"usb.halt", "0x01 halts, is cleared, and works", "1", &Halt},
                    {"usb.reset", "the board works after a bus reset", "1", &Reset},
                    {"packets.ignored", "type 3 and indices above 24 are ignored", "2", &Ignored},
                    {"packets.short", "packets of other than 64 bytes hold nothing up", "2",
                     &ShortPacket},
                    {"video.frame", "a frame in one transfer and in 25", "3", &Video},
                    {"video.final", "a frame is put to use at FINAL, not before", "3", &Unfinished},
                    {"table.taken", "colour tables are taken", "4", &ColourTable},
                    {"configuration.taken", "configurations are taken", "5", &Flags},
                    {"flow.refresh", "no more frames than refreshes are taken", "6", &Paced},
                    {"flow.tables", "colour tables wait for nothing", "6", &TablesDoNotWait},
                    {"requests.counters", "refreshes and frames are counted", "7", &Counters},
                    {"requests.microsoft", "Microsoft compatible id and properties", "7",
                     &MsDescriptors},
                    {"requests.unknown", "unknown requests stall, the next one works", "7",
                     &UnknownRequests}},
          .rest = &Rest};
}

}  // namespace voxeld::display::fadecandy
