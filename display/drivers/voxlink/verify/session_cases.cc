// §4.5: START and STOP.
#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;
using sync::kMillisecond;

void ReadyFirst(Probe& probe) {
  Session session(probe);
  session.Start();
  if (!session.ok() || session.log().empty()) return;
  const Event& first = session.log().front();
  const auto ready = first.As<ReadyEvent>();
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  probe.check().Equal("type of the first event", 1, int{first.header.type});
  probe.check().Equal("number of the first event", 0u, first.header.sequence);
  probe.check().Equal("credit_limit of READY", uint64_t{buffer}, first.header.credit_limit);
  probe.check().Equal("receive_buffer of READY", buffer, ready.receive_buffer);
  probe.check().Equal("version of READY", session.capabilities().fixed.version, ready.version);
}

void StartWithoutMode(Probe& probe) {
  Session session(probe);
  session.Do(Request::kStart);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("running", 1, int{status.running});
  session.Do(Request::kStop);
}

void StartBeginsAnew(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(5);
  session.ExpectComplete(5);
  session.ExpectShown(5);
  session.Restart();
  session.SetKeepalive(false);
  if (session.ok() && !session.log().empty()) {
    probe.check().Equal("number of the first event", 0u, session.log().front().header.sequence);
  }
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("running", 1, int{status.running});
  probe.check().Equal("bytes_received", uint64_t{0}, status.bytes_received);
  probe.check().Equal("shown", uint64_t{0}, status.shown);
  probe.check().Equal("last_complete", uint64_t{0}, status.last_complete);
  probe.check().Equal("underruns", 0u, status.underruns);
  // Numbers and sequences restart, and no volume is remembered.
  session.SetKeepalive(true);
  session.Begin(1, 5, std::vector<std::byte>((session.pictures() + 7) / 8));
  session.ExpectAborted(1, Reason::kBadBase);
  session.Whole(2);
  session.ExpectComplete(2);
  session.ExpectNoErrors();
}

void StopIsDark(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.SetListening(false);
  session.Do(Request::kStop);
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Equal("running after STOP", 0, int{status.running});
  probe.check().Equal("shown after STOP", uint64_t{0}, status.shown);
  probe.check().Equal("last_complete after STOP", uint64_t{0}, status.last_complete);
  probe.check().Equal("filling after STOP", uint64_t{0}, status.filling);
  session.Do(Request::kStop);  // a repetition changes nothing
}

void NoEventsOutside(Probe& probe) {
  Session session(probe);
  session.Start();
  session.SetKeepalive(false);
  session.Do(Request::kStop);
  session.Pause(50 * kMillisecond);  // let events in flight arrive
  session.Mark();
  session.Pause(300 * kMillisecond);
  if (!session.ok()) return;
  const size_t count = session.log().size();
  const std::optional<Event> any = session.Find([](const Event&) { return true; });
  probe.check().Expect(!any, "no event outside a session",
                       absl::StrCat(any ? Describe(*any) : "", ", of ", count, " in all"));
}

void BytesOutsideAreThrownAway(Probe& probe) {
  Session outside(probe);
  for (int i = 0; i < 20; ++i) outside.Plain(PacketType::kKeepalive, 0);
  outside.Raw(std::vector<std::byte>(33, std::byte{0x56}));
  outside.Flush();
  Session session(probe);
  session.Start();
  session.SetKeepalive(false);
  Status status = session.GetStatus();
  if (session.ok()) {
    probe.check().Equal("bytes_received after START", uint64_t{0}, status.bytes_received);
  }
  session.ExpectNoErrors();
}

}  // namespace

void AddSessionCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "4.5", run});
  };
  add("session.ready", "READY is the first event, with number, version and credit", &ReadyFirst);
  add("session.without_mode", "START without SET_MODE begins a session", &StartWithoutMode);
  add("session.start_again", "START in a session begins anew", &StartBeginsAnew);
  add("session.stop", "STOP ends it: dark, no volume remembered", &StopIsDark);
  add("session.no_events_outside", "no events outside a session", &NoEventsOutside);
  add("session.bytes_outside", "bytes outside a session are thrown away",
      &BytesOutsideAreThrownAway);
}

}  // namespace voxeld::display::voxlink
