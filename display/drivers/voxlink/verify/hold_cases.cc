// §5.5: ABORT, SHOW, DROP.
#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;

void ExpectNotShown(Session& session, sync::TimeNs duration, const char* what) {
  session.Pause(duration);
  const std::optional<Event> shown =
      session.Find([](const Event& event) { return event.type() == EventType::kShown; });
  if (shown && session.ok()) session.check().Fail(what, Describe(*shown));
}

void Abort(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  session.Picture(1, 0);
  session.Plain(PacketType::kAbort, 1);
  session.ExpectAborted(1, Reason::kByHost);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("filling", uint64_t{0}, status.filling);
  session.End(1);
  session.ExpectAborted(1);
  session.Whole(2);
  session.ExpectComplete(2);
  session.ExpectNoErrors();
}

void AbortComplete(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectComplete(1);
  session.Mark();
  session.Plain(PacketType::kAbort, 1);
  session.RoundTrip();
  const std::optional<Event> aborted = session.Find([](const Event& event) {
    return event.type() == EventType::kAborted && VolumeOf(event) == 1;
  });
  if (aborted && session.ok()) {
    probe.check().Fail("ABORT of the last complete volume does nothing", Describe(*aborted));
  }
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("last_complete", uint64_t{1}, status.last_complete);
}

void Hold(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1, false);
  session.ExpectComplete(1);
  ExpectNotShown(session, 3 * session.period(), "a volume that is held is not shown before SHOW");
  session.Show(1, 0);
  session.ExpectShown(1);
  session.ExpectNoErrors();
}

// Starts a session with volume 1 held; returns the next SWEEP event.
Event HoldUntilASweep(Session& session) {
  session.Start();
  session.Whole(1, false);
  session.ExpectComplete(1);
  session.Mark();
  return session.Await("SWEEP", 2 * session.period() + sync::kSecond,
                       [](const Event& event) { return event.type() == EventType::kSweep; });
}

void ShowAt(Probe& probe) {
  Session session(probe);
  const Event sweep = HoldUntilASweep(session);
  // Far enough ahead for SHOW to arrive in time.
  const auto ahead = static_cast<uint64_t>(500 * sync::kMillisecond / session.period() + 3);
  const uint64_t wanted = sweep.As<SweepEvent>().sweep + ahead;
  if (!session.ok()) return;
  session.Show(1, wanted);
  session.Settle();
  const Event shown =
      session.Await(absl::StrCat("SHOWN in sweep ", wanted),
                    static_cast<sync::TimeNs>(ahead + 2) * session.period() + sync::kSecond,
                    [](const Event& event) { return event.type() == EventType::kShown; });
  if (session.ok()) {
    probe.check().Equal("sweep in which the volume was shown", wanted,
                        shown.As<ShownEvent>().sweep);
  }
}

// Sends orders that must come ahead of time: one that does not is refused, and nothing changes; one
// that does is accepted, and the volume is shown at the sweep that the newest order names.
void ShowAhead(Probe& probe) {
  Session session(probe);
  if (session.ok() && !session.Has(kFeatureShowAhead)) {
    return probe.check().NotApplicable("the device does not take SHOW ahead (feature bit 4)");
  }
  const Event sweep = HoldUntilASweep(session);
  if (!session.ok()) return;
  const auto ahead = static_cast<uint32_t>(500 * sync::kMillisecond / session.period() + 3);
  const uint64_t now = sweep.As<SweepEvent>().sweep;
  const auto order = [&](uint64_t at, uint32_t least, bool taken) {
    session.ShowAhead(1, at, least);
    session.Settle();
    const Event ordered =
        session.Await("ORDERED", session.period() + sync::kSecond, [&](const Event& event) {
          return event.type() == EventType::kOrdered && event.As<OrderedEvent>().sweep == at;
        });
    if (!session.ok()) return;
    probe.check().Equal("volume in ORDERED", uint64_t{1}, ordered.As<OrderedEvent>().volume);
    probe.check().Equal("taken, in ORDERED", taken, (ordered.header.flags & kOrderTaken) != 0);
  };
  order(now + ahead, 4 * ahead, false);
  ExpectNotShown(session, 2 * session.period(), "a volume is not shown by an order that came late");
  order(now + 3 * ahead, 2, true);
  order(now + 4 * ahead, 2, true);
  const Event shown = session.Await(
      "SHOWN", static_cast<sync::TimeNs>(5 * ahead) * session.period() + sync::kSecond,
      [](const Event& event) { return event.type() == EventType::kShown; });
  if (session.ok()) {
    probe.check().Equal("sweep in which the volume was shown", now + 4 * ahead,
                        shown.As<ShownEvent>().sweep);
  }
}

// Orders a sweep that has passed: the volume is shown at the next one.
void ShowPast(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Pause(3 * session.period());
  session.Whole(1, false);
  session.ExpectComplete(1);
  session.Show(1, 1);
  const auto shown = session.ExpectShown(1).As<ShownEvent>();
  if (session.ok()) {
    probe.check().Expect(shown.sweep > 1, "the volume shown in a sweep after the first",
                         absl::StrCat("sweep ", shown.sweep));
  }
}

void Drop(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Whole(2, false);
  session.ExpectComplete(2);
  session.Mark();
  session.Plain(PacketType::kDrop, 2);
  session.ExpectDropped(2, Reason::kByHost);
  const Status status = session.GetStatus();
  if (session.ok()) {
    probe.check().Equal("last_complete", uint64_t{0}, status.last_complete);
    probe.check().Equal("shown", uint64_t{1}, status.shown);
  }
  uint64_t volume = 3;
  for (const uint64_t base : {uint64_t{2}, uint64_t{1}}) {
    session.Begin(volume, base, std::vector<std::byte>((session.pictures() + 7) / 8));
    session.ExpectAborted(volume++, Reason::kBadBase);
  }
  ExpectNotShown(session, 2 * session.period(), "a volume that was dropped is not shown");
  session.Whole(volume);
  session.ExpectComplete(volume);
  session.ExpectShown(volume);
}

void Replaced(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1, false);
  session.ExpectComplete(1);
  session.Whole(2, false);
  session.ExpectComplete(2);
  session.ExpectDropped(1, Reason::kSuperseded);
  session.Show(1, 0);
  session.ExpectDropped(1, Reason::kUnknownVolume);
  session.Show(2, 0);
  session.ExpectShown(2);
}

void NotWaiting(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Show(5, 0);
  session.ExpectDropped(5, Reason::kUnknownVolume);
  session.Plain(PacketType::kDrop, 6);
  session.ExpectDropped(6, Reason::kUnknownVolume);
  session.Whole(7);
  session.ExpectShown(7);
  session.Plain(PacketType::kDrop, 7);
  session.ExpectDropped(7, Reason::kUnknownVolume);
  const Status status = session.GetStatus();
  if (session.ok()) {
    probe.check().Equal("last_complete", uint64_t{7}, status.last_complete);
    probe.check().Equal("shown", uint64_t{7}, status.shown);
  }
}

}  // namespace

void AddHoldCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "5.5", run});
  };
  add("abort.filling", "ABORT ends the volume being filled", &Abort);
  add("abort.complete", "ABORT of the last complete volume does nothing", &AbortComplete);
  add("hold.show", "a held volume is shown at SHOW, not before", &Hold);
  add("hold.show_at", "a held volume is shown at the sweep named", &ShowAt);
  add("hold.ahead", "SHOW that must come ahead: taken in time only, and told", &ShowAhead);
  add("hold.show_past", "SHOW of a past sweep: the next one", &ShowPast);
  add("hold.drop", "DROP throws the waiting volume away, and the base with it", &Drop);
  add("hold.replaced", "a later complete volume replaces the one that waits", &Replaced);
  add("hold.not_waiting", "SHOW or DROP of a volume that does not wait: DROPPED", &NotWaiting);
}

}  // namespace voxeld::display::voxlink
