// §4: requests, capabilities, mode, status.
#include <algorithm>
#include <bit>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Answer;
using conformance::Hex;
using conformance::Probe;

std::string ModeText(const Mode& mode) {
  return absl::StrCat("format ", int{mode.format}, ", ", int{mode.sub_frames}, " sub-frames, rate ",
                      mode.rate_mhz);
}

void UnknownRequests(Probe& probe) {
  Session session(probe);
  for (const uint8_t request : {0x00, 0x0A, 0x7F, 0xFF}) {
    for (const uint8_t type : {kRequestIn, kRequestOut}) {
      const bool in = type == kRequestIn;
      session.MustStall(
          absl::StrCat(in ? "IN" : "OUT", " request ", int{request}),
          {.request_type = type, .request = request, .length = static_cast<uint16_t>(in ? 16 : 0)});
    }
  }
}

// OUT requests must not be readable, and IN requests not writable.
void WrongDirections(Probe& probe) {
  Session session(probe);
  for (const Request request : {Request::kSetMode, Request::kStart, Request::kStop,
                                Request::kSetBrightness, Request::kSetBlank}) {
    session.MustStall(absl::StrCat("reading request ", static_cast<int>(request)),
                      Session::Setup(request, 0, 16, true));
  }
  for (const Request request :
       {Request::kGetCapabilities, Request::kGetStatus, Request::kGetMode}) {
    session.MustStall(absl::StrCat("writing request ", static_cast<int>(request)),
                      Session::Setup(request, 0, 0, false));
  }
}

void WrongValues(Probe& probe) {
  Session session(probe);
  const auto out = [&](const char* what, Request request, uint16_t value, uint16_t index,
                       std::span<const std::byte> data = {}) {
    UsbSetup setup = Session::Setup(request, value, static_cast<uint16_t>(data.size()), false);
    setup.index = index;
    session.MustStall(what, setup, data);
  };
  const auto in = [&](const char* what, Request request, uint16_t value, uint16_t index) {
    UsbSetup setup = Session::Setup(request, value, sizeof(Status), true);
    setup.index = index;
    session.MustStall(what, setup);
  };
  const std::vector<std::byte> mode = BytesOf(session.SmallestMode());
  out("SET_BLANK with value 2", Request::kSetBlank, 2, 0);
  out("START with value 1", Request::kStart, 1, 0);
  out("STOP with value 1", Request::kStop, 1, 0);
  out("SET_MODE with value 1", Request::kSetMode, 1, 0, mode);
  out("SET_POWER_LIMIT with value 1", Request::kSetPowerLimit, 1, 0, BytesOf(uint32_t{0}));
  out("START with index 1", Request::kStart, 0, 1);
  in("GET_STATUS with value 1", Request::kGetStatus, 1, 0);
  in("GET_MODE with value 1", Request::kGetMode, 1, 0);
  in("GET_STATUS with index 1", Request::kGetStatus, 0, 1);
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("running after nothing but refused requests", 0, int{status.running});
  probe.check().Equal("flags after nothing but refused requests", 0, int{status.flags});
}

void WrongLengths(Probe& probe) {
  Session session(probe);
  const std::vector<std::byte> mode = BytesOf(session.SmallestMode());
  const auto out = [&](const char* what, Request request, size_t length) {
    std::vector<std::byte> data = mode;
    data.resize(length);
    session.MustStall(what, Session::Setup(request, 0, static_cast<uint16_t>(length), false), data);
  };
  out("SET_MODE of 15 bytes", Request::kSetMode, 15);
  out("SET_MODE of 17 bytes", Request::kSetMode, 17);
  out("SET_MODE without bytes", Request::kSetMode, 0);
  out("SET_POWER_LIMIT of 3 bytes", Request::kSetPowerLimit, 3);
  out("SET_POWER_LIMIT of 5 bytes", Request::kSetPowerLimit, 5);
  out("START with a byte", Request::kStart, 1);
  out("STOP with a byte", Request::kStop, 1);
  out("SET_BLANK with a byte", Request::kSetBlank, 1);
  out("SET_BRIGHTNESS with 2 bytes", Request::kSetBrightness, 2);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("running", 0, int{status.running});
}

// ---- capabilities

void Pages(Probe& probe) {
  Session session(probe);
  const size_t total = session.CapabilityBytes().size();
  if (!session.ok()) return;
  probe.check().Equal("bytes of all pages",
                      size_t{Load<Capabilities>(session.CapabilityBytes()).total_length}, total);
  const size_t pages = (total + kCapabilitiesPage - 1) / kCapabilitiesPage;
  for (const size_t page : {pages, pages + 1, size_t{0xFFFF}}) {
    session.MustStall(absl::StrCat("page ", page, " of ", pages),
                      Session::Setup(Request::kGetCapabilities, static_cast<uint16_t>(page),
                                     kCapabilitiesPage, true));
  }
}

void PagesAgain(Probe& probe) {
  Session session(probe);
  const std::vector<std::byte> block = session.CapabilityBytes();
  for (const uint16_t length : {uint16_t{1}, uint16_t{64}, uint16_t{72}}) {
    if (!session.ok()) return;
    const Answer answer = session.Get(Request::kGetCapabilities, 0, length);
    probe.check().Expect(answer.ok() && answer.data.size() == length,
                         absl::StrCat(length, " bytes where ", length, " are asked for"),
                         Describe(answer));
    probe.check().Expect(answer.data.size() <= block.size() &&
                             std::equal(answer.data.begin(), answer.data.end(), block.begin()),
                         "the same bytes as in the whole page", Hex(answer.data));
  }
}

void Fields(Probe& probe) {
  Session session(probe);
  session.capabilities();
  if (!session.ok()) return;
  const Capabilities& fixed = session.capabilities().fixed;
  probe.check().Expect(fixed.min_rate_mhz >= 1, "min_rate 1 or more",
                       absl::StrCat(fixed.min_rate_mhz));
  const size_t pictures = size_t{fixed.slices} * fixed.max_sub_frames;
  probe.check().Expect(
      sizeof(BeginPayload) + (pictures + 7) / 8 <= fixed.max_payload,
      absl::StrCat("max_payload enough for a BEGIN with a bitmap of ", pictures, " pictures"),
      absl::StrCat(fixed.max_payload));
}

// ---- mode

void ModeRoundTrip(Probe& probe) {
  Session session(probe);
  const Capabilities fixed = session.capabilities().fixed;
  for (uint8_t format = 0; session.ok() && format < 8; ++format) {
    if ((fixed.formats >> format & 1) == 0) continue;
    for (const uint8_t subs : {uint8_t{1}, fixed.max_sub_frames}) {
      for (const uint32_t rate : {0u, fixed.min_rate_mhz, fixed.max_rate_mhz}) {
        Mode want{
            .format = format, .sub_frames = subs, .bits = 0, .reserved0 = 0, .rate_mhz = rate};
        session.Do(Request::kSetMode, 0, BytesOf(want));
        if (rate == 0) want.rate_mhz = fixed.nominal_rate_mhz;
        const Mode got = session.GetMode();
        if (session.ok()) probe.check().Equal("GET_MODE:", ModeText(want), ModeText(got));
      }
    }
  }
}

void ModeRefused(Probe& probe) {
  Session session(probe);
  const Capabilities fixed = session.capabilities().fixed;
  const Mode good = session.SmallestMode();
  session.Do(Request::kSetMode, 0, BytesOf(good));
  const Mode before = session.GetMode();
  std::vector<Mode> bad;
  const auto with = [&](auto change) {
    Mode mode = good;
    change(mode);
    bad.push_back(mode);
  };
  with([](Mode& m) { m.format = 8; });
  with([](Mode& m) { m.format = 255; });
  with([](Mode& m) { m.bits = 9; });
  with([](Mode& m) { m.sub_frames = 0; });
  if (fixed.max_sub_frames < 255) {
    with([&](Mode& m) { m.sub_frames = static_cast<uint8_t>(fixed.max_sub_frames + 1); });
  }
  with([&](Mode& m) { m.rate_mhz = fixed.max_rate_mhz + 1; });
  if (fixed.min_rate_mhz > 1) with([&](Mode& m) { m.rate_mhz = fixed.min_rate_mhz - 1; });
  for (uint8_t format = 0; format < 8; ++format) {
    if ((fixed.formats >> format & 1) == 0) with([&](Mode& m) { m.format = format; });
  }
  for (const Mode& mode : bad) {
    session.MustStall(absl::StrCat("SET_MODE of ", ModeText(mode)),
                      Session::Setup(Request::kSetMode, 0, sizeof(Mode), false), BytesOf(mode));
  }
  const Mode after = session.GetMode();
  if (session.ok()) probe.check().Equal("the mode before:", ModeText(before), ModeText(after));
}

void ModeReserved(Probe& probe) {
  Session session(probe);
  Mode mode = session.SmallestMode();
  mode.reserved0 = 0xFF;
  mode.reserved1[0] = mode.reserved1[1] = 0xFFFFFFFF;
  session.Do(Request::kSetMode, 0, BytesOf(mode));
}

void ModeInSession(Probe& probe) {
  Session session(probe);
  session.Start();
  session.MustStall("SET_MODE in a session",
                    Session::Setup(Request::kSetMode, 0, sizeof(Mode), false),
                    BytesOf(session.SmallestMode()));
  session.RoundTrip();
}

void IsAsConfigured(Probe& probe, const Configured& configured) {
  Session session(probe);
  const DeviceCapabilities& device = session.capabilities();
  if (!session.ok()) return;
  const absl::Status status =
      CheckCapabilities(device, configured.geometry, configured.layout, configured.calibrated);
  probe.check().Expect(status.ok(), "a device that is what the display's options say",
                       std::string(status.message()));
}

// ---- status

void StatusIdle(Probe& probe) {
  Session session(probe);
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("running", 0, int{status.running});
  probe.check().Equal("flags", 0, int{status.flags});
  probe.check().Equal("filling", uint64_t{0}, status.filling);
  probe.check().Equal("last_complete", uint64_t{0}, status.last_complete);
  probe.check().Equal("shown", uint64_t{0}, status.shown);
}

void StatusInSession(Probe& probe) {
  Session session(probe);
  session.Start();
  session.SetKeepalive(false);
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("running", 1, int{status.running});
  probe.check().Equal("bytes_received", uint64_t{0}, status.bytes_received);
  probe.check().Equal("credit_limit", uint64_t{buffer}, status.credit_limit);
  session.Begin(1);
  session.Settle();
  status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("bytes_received", session.sent(), status.bytes_received);
  probe.check().Equal("filling", uint64_t{1}, status.filling);
  probe.check().Equal("last_complete", uint64_t{0}, status.last_complete);
  probe.check().Equal("shown", uint64_t{0}, status.shown);
}

void StatusClock(Probe& probe) {
  Session session(probe);
  session.Start();
  const sync::TimeNs begin = probe.Now();
  const Status first = session.GetStatus();
  const sync::TimeNs between = probe.Now();
  session.Pause(500 * sync::kMillisecond);
  const sync::TimeNs later = probe.Now();
  const Status second = session.GetStatus();
  if (!session.ok()) return;
  const auto passed = static_cast<int64_t>(second.time_ns - first.time_ns);
  // 1 %, plus the time that the requests took.
  const int64_t most = (probe.Now() - begin) * 101 / 100 + sync::kMillisecond;
  const int64_t least = (later - between) * 99 / 100 - sync::kMillisecond;
  probe.check().Expect(passed >= least && passed <= most,
                       absl::StrCat("time_ns counts nanoseconds: from ", least, " to ", most),
                       absl::StrCat(passed));
}

}  // namespace

void AddRequestCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, const char* section, auto run) {
    cases.push_back({id, title, section, run});
  };
  add("requests.unknown", "unknown requests stall, the next one works", "4", &UnknownRequests);
  add("requests.direction", "requests in the wrong direction stall", "4", &WrongDirections);
  add("requests.value", "wrong values and indices stall and change nothing", "4", &WrongValues);
  add("requests.length", "wrong lengths stall and change nothing", "4", &WrongLengths);
  add("capabilities.pages", "page by page as long as said; beyond the end stalls", "4", &Pages);
  add("capabilities.again", "the same bytes however many are asked for", "4", &PagesAgain);
  add("capabilities.fields", "every field is in its range, the shape is sound", "4.1", &Fields);
  add("mode.round_trip", "SET_MODE of all formats and rates; GET_MODE gives it", "4.3",
      &ModeRoundTrip);
  add("mode.refused", "modes that the device does not have stall", "4.3", &ModeRefused);
  add("mode.reserved", "reserved fields of a mode are ignored", "1", &ModeReserved);
  add("mode.in_session", "SET_MODE in a session stalls; the session goes on", "4", &ModeInSession);
  add("status.idle", "80 bytes; nothing is remembered outside a session", "4.4", &StatusIdle);
  add("status.session", "bytes, credit and volumes in a session", "4.4", &StatusInSession);
  add("status.clock", "time_ns counts nanoseconds", "6", &StatusClock);
}

conformance::Case ConfiguredCase(const Configured& configured) {
  return {"capabilities.configured", "the device is what the display's options say", "4.2",
          [configured](Probe& probe) { IsAsConfigured(probe, configured); }};
}

}  // namespace voxeld::display::voxlink
