// §3: descriptors, halts, bus reset.
#include <algorithm>
#include <array>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Answer;
using conformance::Hex;
using conformance::Probe;

constexpr uint8_t kDeviceDescriptor = 1;
constexpr uint8_t kConfigurationDescriptor = 2;
constexpr uint8_t kInterfaceDescriptor = 4;
constexpr uint8_t kEndpointDescriptor = 5;
constexpr uint8_t kBosDescriptor = 15;
constexpr uint8_t kCompanionDescriptor = 48;
constexpr uint16_t kMostDescriptorBytes = 1024;

uint8_t U8(std::span<const std::byte> bytes, size_t at) {
  return at < bytes.size() ? std::to_integer<uint8_t>(bytes[at]) : 0;
}
uint16_t U16(std::span<const std::byte> bytes, size_t at) {
  return static_cast<uint16_t>(U8(bytes, at) | U8(bytes, at + 1) << 8);
}
uint32_t U32(std::span<const std::byte> bytes, size_t at) {
  return uint32_t{U16(bytes, at)} | uint32_t{U16(bytes, at + 2)} << 16;
}

std::vector<std::byte> Descriptor(Probe& probe, uint8_t type, uint16_t length, const char* name,
                                  size_t least) {
  const Answer answer = probe.In({.request_type = 0x80,
                                  .request = 0x06,
                                  .value = static_cast<uint16_t>(type << 8),
                                  .index = 0,
                                  .length = length});
  if (!answer.ok() || answer.data.size() < least || U8(answer.data, 1) != type) {
    probe.check().Fail(absl::StrCat(name, " descriptor of ", least, " bytes or more"),
                       answer.ok() ? Hex(answer.data) : Describe(answer));
  }
  return answer.data;
}

using Parts = std::vector<std::vector<std::byte>>;

// Returns the descriptors of the configuration, one by one.
Parts Configuration(Probe& probe) {
  const std::vector<std::byte> whole =
      Descriptor(probe, kConfigurationDescriptor, kMostDescriptorBytes, "a configuration", 9);
  if (!probe.check().ok()) return {};
  if (U16(whole, 2) != whole.size()) {
    probe.check().Fail(absl::StrCat("wTotalLength ", whole.size(), ", as many bytes as come"),
                       absl::StrCat(U16(whole, 2)));
  }
  Parts parts;
  for (std::span<const std::byte> rest = whole; !rest.empty();) {
    const size_t length = U8(rest, 0);
    if (length < 2 || length > rest.size()) {
      probe.check().Fail(
          "descriptors that end with the configuration",
          absl::StrCat("one of ", length, " bytes where ", rest.size(), " are left"));
      break;
    }
    parts.emplace_back(rest.begin(), rest.begin() + static_cast<ptrdiff_t>(length));
    rest = rest.subspan(length);
  }
  return parts;
}

Parts OfType(const Parts& parts, uint8_t type) {
  Parts found;
  std::copy_if(parts.begin(), parts.end(), std::back_inserter(found),
               [&](const auto& part) { return U8(part, 1) == type; });
  return found;
}

void Interface(Probe& probe) {
  const Parts parts = Configuration(probe);
  if (parts.empty()) return;
  probe.check().Equal("bNumInterfaces", 1, int{U8(parts[0], 4)});
  probe.check().Equal("bConfigurationValue", 1, int{U8(parts[0], 5)});
  const Parts interfaces = OfType(parts, kInterfaceDescriptor);
  probe.check().Equal("interface descriptors", size_t{1}, interfaces.size());
  if (interfaces.empty() || interfaces[0].size() < 9) return;
  const auto& i = interfaces[0];
  probe.check().Equal("bInterfaceNumber", 0, int{U8(i, 2)});
  probe.check().Equal("bAlternateSetting", 0, int{U8(i, 3)});
  probe.check().Equal("bNumEndpoints", 2, int{U8(i, 4)});
  const std::array<std::byte, 3> want = {std::byte{kInterfaceClass}, std::byte{kInterfaceSubclass},
                                         std::byte{kInterfaceProtocol}};
  probe.check().Equal("class, subclass, protocol", Hex(want), Hex(std::span(i).subspan(5, 3)));
}

void Endpoints(Probe& probe) {
  const Parts endpoints = OfType(Configuration(probe), kEndpointDescriptor);
  if (!probe.check().ok()) return;
  probe.check().Equal("endpoints", size_t{2}, endpoints.size());
  for (const auto& [address, type, name] :
       {std::tuple{kBulkOut, 2, "0x01"}, {kInterruptIn, 3, "0x82"}}) {
    const auto it = std::find_if(endpoints.begin(), endpoints.end(),
                                 [&, a = address](const auto& e) { return U8(e, 2) == a; });
    if (it == endpoints.end()) {
      return probe.check().Fail(absl::StrCat("an endpoint ", name), "none");
    }
    probe.check().Equal(absl::StrCat("transfer type of ", name), type, U8(*it, 3) & 3);
  }
}

void PacketSizes(Probe& probe) {
  const Parts parts = Configuration(probe);
  const auto device = Descriptor(probe, kDeviceDescriptor, 18, "a device", 18);
  if (!probe.check().ok()) return;
  const bool super = !OfType(parts, kCompanionDescriptor).empty();
  for (const auto& e : OfType(parts, kEndpointDescriptor)) {
    const int size = U16(e, 4) & 0x7FF;
    if (U8(e, 2) == kInterruptIn) probe.check().Equal("wMaxPacketSize of 0x82", 64, size);
    if (U8(e, 2) != kBulkOut) continue;
    probe.check().Expect(super ? size == 1024 : size == 64 || size == 512,
                         super ? "wMaxPacketSize of 0x01 1024 at super speed"
                               : "wMaxPacketSize of 0x01 64 or 512 below super speed",
                         absl::StrCat(size));
  }
  if (!super) return;
  probe.check().Equal("endpoint companions", size_t{2}, OfType(parts, kCompanionDescriptor).size());
  probe.check().Expect(U16(device, 2) >= 0x0300, "bcdUSB 0x0300 or more at super speed",
                       absl::StrCat("0x", absl::Hex(U16(device, 2), absl::kZeroPad4)));
}

void DescriptorLengths(Probe& probe) {
  const auto whole =
      Descriptor(probe, kConfigurationDescriptor, kMostDescriptorBytes, "a configuration", 9);
  const auto head = Descriptor(probe, kConfigurationDescriptor, 9, "a configuration", 9);
  probe.check().Equal("bytes of a configuration descriptor of which 9 are asked for", size_t{9},
                      head.size());
  probe.check().Expect(
      head.size() <= whole.size() && std::equal(head.begin(), head.end(), whole.begin()),
      "the same bytes however many are asked for", Hex(head));
}

void Bos(Probe& probe) {
  const auto device = Descriptor(probe, kDeviceDescriptor, 18, "a device", 18);
  const int usb = U16(device, 2);
  if (!probe.check().ok()) return;
  probe.check().Expect(usb == 0x0210 || usb >= 0x0300, "bcdUSB 0x0210, or 0x0300 and up",
                       absl::StrCat("0x", absl::Hex(usb, absl::kZeroPad4)));
  const auto bos = Descriptor(probe, kBosDescriptor, kMostDescriptorBytes, "a BOS", 5);
  if (!probe.check().ok()) return;
  static constexpr std::array<uint8_t, 28> kWant = {
      28,   0x10, 0x05, 0,    0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2,
      0x65, 0x9D, 0x9E, 0x64, 0x8A, 0x9F, 0x00, 0x00, 0x03, 0x06, 162,  0,    0x20, 0};
  for (std::span<const std::byte> rest = std::span(bos).subspan(5); rest.size() >= 3;) {
    const size_t length = U8(rest, 0);
    if (length < 3 || length > rest.size()) break;
    if (length == kWant.size() && U8(rest, 2) == 5) {
      return probe.check().Equal("the platform capability", Hex(std::as_bytes(std::span(kWant))),
                                 Hex(rest.first(length)));
    }
    rest = rest.subspan(length);
  }
  probe.check().Fail("a BOS with the Microsoft OS 2.0 platform capability", Hex(bos));
}

void MsDescriptors(Probe& probe) {
  const Answer answer = probe.In({.request_type = 0xC0,
                                  .request = kMsVendorCode,
                                  .value = 0,
                                  .index = kMsDescriptorIndex,
                                  .length = kMostDescriptorBytes});
  const std::vector<std::byte>& set = answer.data;
  if (!answer.ok() || set.size() != 162) {
    return probe.check().Fail("a descriptor set of 162 bytes", Describe(answer));
  }
  probe.check().Equal("the set's header: length", 10, int{U16(set, 0)});
  probe.check().Equal("the set's header: Windows version", 0x06030000u, U32(set, 4));
  probe.check().Equal("the set's header: length in all", 162, int{U16(set, 8)});
  probe.check().Equal("the compatible id", std::string("57 49 4E 55 53 42 00 00"),
                      Hex(std::span(set).subspan(14, 8)));
  probe.check().Equal("the registry property: length and type", std::string("84 00 04 00 07 00"),
                      Hex(std::span(set).subspan(30, 6)));
  probe.check().Expect(U8(set, 82) == '{' && U8(set, 82 + 2 * 37) == '}', "a GUID in braces",
                       Hex(std::span(set).subspan(82, 64)));
}

void Halt(Probe& probe, uint8_t endpoint, const std::string& name) {
  Session session(probe);
  session.Start();
  session.Plain(PacketType::kKeepalive, 0);
  session.Settle();
  session.SetListening(false);
  if (!session.ok()) return;
  const Answer set = probe.Out(
      {.request_type = 0x02, .request = 0x03, .value = 0, .index = endpoint, .length = 0});
  probe.check().Expect(set.ok(), "SET_FEATURE(ENDPOINT_HALT) is done", Describe(set));
  const Answer told =
      probe.In({.request_type = 0x82, .request = 0x00, .value = 0, .index = endpoint, .length = 2});
  probe.check().Expect(told.ok() && U16(told.data, 0) == 1,
                       absl::StrCat("GET_STATUS of endpoint ", name, " says that it is halted"),
                       told.ok() ? Hex(told.data) : Describe(told));
  if (endpoint == kBulkOut) {
    const std::array<std::byte, 1> byte{};
    const Answer refused = probe.Bulk(kBulkOut, byte, false, sync::kSecond);
    probe.check().Expect(refused.status == TransferStatus::kStall,
                         "a transfer on a halted endpoint is stalled", Describe(refused));
  }
  const Answer cleared = probe.ClearHalt(endpoint);
  probe.check().Expect(cleared.ok(), "the halt is cleared", Describe(cleared));
  // The session continues where it was.
  session.SetListening(true);
  session.Mark();
  session.ExpectNoErrors();
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("bytes_received", session.sent(), status.bytes_received);
}

void ResetDevice(Session& session) {
  const Answer reset = session.probe().Reset();
  session.check().Expect(reset.ok(), "the device comes back from a reset of its port",
                         Describe(reset));
}

void ResetEndsSession(Probe& probe) {
  {
    Session session(probe);
    session.Start();
    session.Whole(1);
    session.ExpectShown(1);
    session.SetListening(false);
    ResetDevice(session);
    const Status status = session.GetStatus();
    if (!session.ok()) return;
    probe.check().Equal("running after a bus reset", 0, int{status.running});
    probe.check().Equal("shown after a bus reset", uint64_t{0}, status.shown);
    probe.check().Equal("last_complete after a bus reset", uint64_t{0}, status.last_complete);
  }
  Session session(probe);
  session.Start();
  session.Begin(2, 1, std::vector<std::byte>((session.pictures() + 7) / 8));
  session.ExpectAborted(2, Reason::kBadBase);
}

void ResetForgetsSettings(Probe& probe) {
  Session session(probe);
  const Capabilities fixed = session.capabilities().fixed;
  const Mode before{.format = session.SmallestMode().format,
                    .sub_frames = fixed.max_sub_frames,
                    .reserved0 = 0,
                    .rate_mhz = fixed.min_rate_mhz,
                    .reserved1 = {}};
  session.Do(Request::kSetMode, 0, BytesOf(before));
  session.Do(Request::kSetBlank, 1);
  if (!session.ok()) return;
  ResetDevice(session);
  const Mode mode = session.GetMode();
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("format after a bus reset", std::countr_zero(fixed.formats),
                      int{mode.format});
  probe.check().Equal("sub_frames after a bus reset", 1, int{mode.sub_frames});
  probe.check().Equal("rate after a bus reset", fixed.nominal_rate_mhz, mode.rate_mhz);
  probe.check().Equal("flags after a bus reset", 0, int{status.flags});
}

void ResetClearsHalts(Probe& probe) {
  Session session(probe);
  probe.Out({.request_type = 0x02, .request = 0x03, .value = 0, .index = kBulkOut, .length = 0});
  ResetDevice(session);
  session.Start();
  session.RoundTrip();
}

}  // namespace

void AddUsbCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, const char* section, auto run) {
    cases.push_back({id, title, section, run});
  };
  add("usb.interface", "one interface, FF 56 01, in configuration 1", "3.1", &Interface);
  add("usb.endpoints", "endpoints 0x01 bulk OUT and 0x82 interrupt IN", "3.1", &Endpoints);
  add("usb.packet_sizes", "packet sizes, and companions at super speed", "3.1", &PacketSizes);
  add("usb.descriptor_lengths", "no more of a descriptor than is asked for", "3.1",
      &DescriptorLengths);
  add("usb.bos", "BOS with the Microsoft OS 2.0 capability", "3.2", &Bos);
  add("usb.ms_descriptors", "Microsoft OS 2.0 descriptor set: WINUSB", "3.2", &MsDescriptors);
  add("usb.halt_bulk", "0x01 halts, is cleared, and the session goes on", "3.1",
      [](Probe& probe) { Halt(probe, kBulkOut, "0x01"); });
  add("usb.halt_interrupt", "0x82 halts, is cleared, and events go on", "3.1",
      [](Probe& probe) { Halt(probe, kInterruptIn, "0x82"); });
  add("usb.reset_ends_session", "a bus reset ends the session; no volume is remembered", "3.1",
      &ResetEndsSession);
  add("usb.reset_forgets_settings", "a bus reset brings back mode and blank", "4.3",
      &ResetForgetsSettings);
  add("usb.reset_clears_halts", "a bus reset clears halts", "3.1", &ResetClearsHalts);
}

}  // namespace voxeld::display::voxlink
