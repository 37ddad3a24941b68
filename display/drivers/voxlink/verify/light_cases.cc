// §4 and §8: brightness, power limit, blank, watchdog.
#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;
using sync::kMillisecond;
using sync::kSecond;

constexpr sync::TimeNs kLook = 10 * kMillisecond;
// Tolerance for a device and this machine, added to 250 ms.
constexpr sync::TimeNs kSlack = 100 * kMillisecond;

// Expects LIGHT after the mark.
LightEvent ExpectLight(Session& session, uint32_t lit, uint32_t cause) {
  const Event event =
      session.Await(absl::StrCat("LIGHT ", lit != 0 ? "on" : "off", ", cause ", cause), kSecond,
                    [](const Event& e) { return e.type() == EventType::kLight; });
  const auto light = event.As<LightEvent>();
  if (session.ok() && (light.lit != lit || light.reason != cause)) {
    session.check().Fail(absl::StrCat("LIGHT ", lit != 0 ? "on" : "off", ", cause ", cause),
                         Describe(event));
  }
  return light;
}

void Flags(Session& session, const std::string& when, uint8_t flag, bool set) {
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  session.check().Equal(
      absl::StrCat("flag ", flag == kStatusBlanked ? "blanked" : "dark by the watchdog", " ", when,
                   ":"),
      set ? 1 : 0, (status.flags & flag) != 0 ? 1 : 0);
}

void Brightness(Probe& probe) {
  Session session(probe);
  if (session.ok() && !session.Has(kFeatureBrightness)) {
    return probe.check().NotApplicable("the device has no brightness (feature bit 1)");
  }
  for (const uint16_t value : {0, 1, 32768, 65535}) session.Do(Request::kSetBrightness, value);
  session.Start();
  for (const uint16_t value : {0, 65535}) session.Do(Request::kSetBrightness, value);
  session.RoundTrip();
}

void PowerLimit(Probe& probe) {
  Session session(probe);
  if (session.ok() && !session.Has(kFeaturePowerLimit)) {
    return probe.check().NotApplicable("the device has no power limit (feature bit 2)");
  }
  for (const uint32_t value : {1'000u, ~0u, 0u}) {
    session.Do(Request::kSetPowerLimit, 0, BytesOf(value));
  }
  session.Start();
  session.Do(Request::kSetPowerLimit, 0, BytesOf(uint32_t{0}));
  session.RoundTrip();
}

void Temperature(Probe& probe) {
  Session session(probe);
  const bool has = session.Has(kFeatureTemperature);
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  if (!has) return probe.check().NotApplicable("the device has no temperature (feature bit 3)");
  probe.check().Expect(status.temperature > -1000 && status.temperature < 2000,
                       "a temperature from -100 to 200 degrees C, in 0.1 degrees",
                       absl::StrCat(status.temperature));
}

void Blank(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Mark();
  session.Do(Request::kSetBlank, 1);
  ExpectLight(session, 0, 2);
  Flags(session, "after SET_BLANK 1", kStatusBlanked, true);
  // Volumes are still received and replace one another.
  session.Whole(2);
  session.ExpectComplete(2);
  const Event shown = session.ExpectShown(2);
  if (session.ok()) {
    probe.check().Equal("flag 0 (dark) of SHOWN while blanked:", 1,
                        shown.header.flags & kShownDark);
  }
  session.Do(Request::kSetBlank, 0);
  ExpectLight(session, 1, 4);
  Flags(session, "after SET_BLANK 0", kStatusBlanked, false);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("shown", uint64_t{2}, status.shown);
  session.Whole(3);
  const Event lit = session.ExpectShown(3);
  if (session.ok()) {
    probe.check().Equal("flag 0 (dark) of SHOWN in the light:", 0, lit.header.flags & kShownDark);
  }
}

void BlankOutlasts(Probe& probe) {
  Session session(probe);
  session.Do(Request::kSetBlank, 1);
  Flags(session, "outside a session", kStatusBlanked, true);
  session.Start();
  Flags(session, "after START", kStatusBlanked, true);
  session.Restart();
  Flags(session, "after another START", kStatusBlanked, true);
  session.SetListening(false);
  session.Do(Request::kStop);
  Flags(session, "after STOP", kStatusBlanked, true);
  session.Do(Request::kSetBlank, 0);
  Flags(session, "after SET_BLANK 0", kStatusBlanked, false);
}

// ---- watchdog

// Sends a valid packet; returns the time by which it was certainly received.
sync::TimeNs Speak(Session& session) {
  session.Plain(PacketType::kKeepalive, 0);
  session.Settle();
  return session.probe().Now();
}

void Watchdog(Probe& probe) {
  Session session(probe);
  if (session.capabilities().fixed.watchdog_ms == 0) {
    return probe.check().NotApplicable("the device says that it has no watchdog (feature bit 0)");
  }
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.SetKeepalive(false);
  session.Mark();
  const sync::TimeNs before = probe.Now();
  const sync::TimeNs heard = Speak(session);
  while (session.ok()) {
    const sync::TimeNs asked = probe.Now();
    const Status status = session.GetStatus();
    const sync::TimeNs answered = probe.Now();
    if (!session.ok()) return;
    if ((status.flags & kStatusWatchdogDark) != 0) {
      probe.check().Expect(answered - before >= kWatchdogNs,
                           "dark 250 ms after the last packet, and not before",
                           absl::StrCat("dark after ", (answered - before) / kMillisecond, " ms"));
      break;
    }
    if (asked - heard > kWatchdogNs + kSlack) {
      probe.check().Fail("dark 250 ms after the last packet",
                         absl::StrCat("still lit after ", (asked - heard) / kMillisecond, " ms"));
    }
    session.Pause(kLook);
  }
  ExpectLight(session, 0, 1);
  // The volume is kept, and is shown again with the next packet.
  session.Mark();
  Speak(session);
  ExpectLight(session, 1, 3);
  Flags(session, "after a packet", kStatusWatchdogDark, false);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("shown", uint64_t{1}, status.shown);
}

void KeptAlive(Probe& probe) {
  Session session(probe);
  if (session.capabilities().fixed.watchdog_ms == 0) {
    return probe.check().NotApplicable("the device says that it has no watchdog (feature bit 0)");
  }
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Mark();
  session.Pause(1200 * kMillisecond);  // sends a KEEPALIVE each 70 ms
  session.RoundTrip();
  const size_t lights = session.Count(EventType::kLight);
  if (session.ok()) {
    probe.check().Equal("LIGHT while the host sends KEEPALIVE:", size_t{0}, lights);
  }
  Flags(session, "while the host sends KEEPALIVE", kStatusWatchdogDark, false);
}

void NoWatchdog(Probe& probe) {
  Session session(probe);
  if (session.capabilities().fixed.watchdog_ms != 0) {
    return probe.check().NotApplicable("the device has a watchdog");
  }
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.SetKeepalive(false);
  session.Mark();
  session.Pause(600 * kMillisecond);
  Flags(session, "of a device without a watchdog", kStatusWatchdogDark, false);
  const size_t lights = session.Count(EventType::kLight);
  if (session.ok()) {
    probe.check().Equal("LIGHT of a device without a watchdog:", size_t{0}, lights);
  }
}

}  // namespace

void AddLightCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, const char* section, auto run) {
    cases.push_back({id, title, section, run});
  };
  add("light.brightness", "brightness may be set at any time", "4", &Brightness);
  add("light.power_limit", "the power limit may be set at any time", "4", &PowerLimit);
  add("light.temperature", "the temperature can be believed", "4.4", &Temperature);
  add("light.blank", "a blanked device is dark and takes volumes", "4", &Blank);
  add("light.blank_outlasts", "blank outlasts sessions", "4", &BlankOutlasts);
  add("watchdog.silence", "dark 250 ms after the last packet; light with the next", "8", &Watchdog);
  add("watchdog.keepalive", "KEEPALIVE keeps the light", "8", &KeptAlive);
  add("watchdog.none", "without a watchdog the light stays", "4.1", &NoWatchdog);
}

}  // namespace voxeld::display::voxlink
