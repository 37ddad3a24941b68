// §6 and §7: events, and credit.
#include <algorithm>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;
using sync::kMillisecond;
using sync::kSecond;

constexpr uint64_t kLargestBuffer = uint64_t{64} << 20;

void Numbering(Probe& probe) {
  Session session(probe);
  session.Start();
  for (uint64_t i = 0; i < 40; ++i) session.End(100 + i);
  session.Settle();
  session.Pause(std::max<sync::TimeNs>(10 * session.period(), 100 * kMillisecond));
  session.RoundTrip();
  const std::vector<Event>& log = session.log();
  for (size_t i = 0; session.ok() && i < log.size(); ++i) {
    if (log[i].header.sequence == i) continue;
    probe.check().Fail("events numbered without gaps while they are read",
                       absl::StrCat(Describe(log[i]), " has number ", log[i].header.sequence,
                                    " and is number ", i));
  }
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  // Some events may be in flight.
  session.Pause(20 * kMillisecond);
  const uint32_t next = session.log().back().header.sequence + 1;
  probe.check().Expect(status.event_sequence <= next && status.event_sequence + 64 > next,
                       absl::StrCat("event_sequence of GET_STATUS near ", next),
                       absl::StrCat(status.event_sequence));
}

void Unread(Probe& probe) {
  Session session(probe);
  session.SetListening(false);
  session.Start();
  for (uint64_t i = 0; i < 500; ++i) session.End(100 + i);
  session.Settle();
  session.SetListening(true);
  // Each event takes an interval of the bus: read as long as they keep coming.
  const sync::TimeNs deadline = probe.Now() + 10 * kSecond;
  for (size_t before = 1, now = 0; session.ok() && now != before && probe.Now() < deadline;) {
    before = now;
    session.Pause(200 * kMillisecond);
    now = session.Count(EventType::kAborted);
  }
  session.RoundTrip();
  const std::vector<Event>& log = session.log();
  if (!session.ok()) return;
  // Discarded events must leave a gap before those that were kept.
  size_t aborted = 0;
  for (const Event& event : log) aborted += event.type() == EventType::kAborted ? 1 : 0;
  const uint32_t unused = log.back().header.sequence + 1 - static_cast<uint32_t>(log.size());
  probe.check().Expect(
      aborted + unused >= 501, "each of 501 answers is read, or leaves its number unused",
      absl::StrCat(aborted, " answers were read and ", unused, " numbers are unused"));
}

void Sweeps(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Mark();
  const sync::TimeNs watched =
      std::clamp<sync::TimeNs>(8 * session.period(), 500 * kMillisecond, 20 * kSecond);
  session.Pause(watched);
  session.RoundTrip();
  std::vector<SweepEvent> sweeps;
  std::vector<sync::TimeNs> told;
  for (const Event& event : session.log()) {
    if (event.type() != EventType::kSweep) continue;
    sweeps.push_back(event.As<SweepEvent>());
    told.push_back(static_cast<sync::TimeNs>(event.header.time_ns));
  }
  if (!session.ok()) return;
  const auto least = static_cast<size_t>(watched / std::max(session.period(), 8 * kMillisecond));
  probe.check().Expect(sweeps.size() + 1 >= least,
                       absl::StrCat("SWEEP each sweep, or every 8 ms: ", least, " or more in ",
                                    watched / kMillisecond, " ms"),
                       absl::StrCat(sweeps.size()));
  for (size_t i = 1; probe.check().ok() && i < sweeps.size(); ++i) {
    const SweepEvent& a = sweeps[i - 1];
    const SweepEvent& b = sweeps[i];
    probe.check().Expect(b.sweep > a.sweep, "sweep numbers ascend",
                         absl::StrCat(b.sweep, " after ", a.sweep));
    if (!probe.check().ok()) return;
    const auto want = static_cast<int64_t>(b.sweep - a.sweep) * session.period();
    const auto got = static_cast<int64_t>(b.start_ns - a.start_ns);
    // A motor is not exact: allow 10 %.
    probe.check().Expect(std::abs(got - want) <= want / 10,
                         absl::StrCat("sweep ", b.sweep, " begins ", want, " ns after sweep ",
                                      a.sweep, ", by the mode's rate, within 10 %"),
                         absl::StrCat(got, " ns"));
    probe.check().Expect(std::abs(int64_t{b.period_ns} - session.period()) <= session.period() / 10,
                         absl::StrCat("period_ns ", session.period(), ", within 10 %"),
                         absl::StrCat(b.period_ns));
    probe.check().Expect(static_cast<int64_t>(b.start_ns) <= told[i] + kMillisecond,
                         "SWEEP comes when its sweep has begun",
                         absl::StrCat("it begins at ", b.start_ns, " and was told at ", told[i]));
  }
  if (!sweeps.empty()) {
    probe.check().Expect(sweeps[0].sweep >= 1, "sweeps numbered from 1", "sweep 0");
    probe.check().Equal("volume shown, of the last SWEEP", uint64_t{1}, sweeps.back().shown);
  }
}

void Shown(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  const auto shown = session.ExpectShown(1).As<ShownEvent>();
  const Event sweep = session.Await(
      absl::StrCat("SWEEP ", shown.sweep, " or later that shows volume 1"),
      2 * session.period() + kSecond, [&](const Event& event) {
        return event.type() == EventType::kSweep && event.As<SweepEvent>().sweep >= shown.sweep;
      });
  if (!session.ok()) return;
  const auto body = sweep.As<SweepEvent>();
  probe.check().Equal("volume shown, of that SWEEP", uint64_t{1}, body.shown);
  const auto later = static_cast<int64_t>(body.sweep - shown.sweep) * session.period();
  const auto start = static_cast<int64_t>(body.start_ns) - later;
  probe.check().Expect(
      std::abs(start - static_cast<int64_t>(shown.start_ns)) <= session.period() / 10,
      absl::StrCat("SHOWN at the start of a sweep, ", start, " ns"), absl::StrCat(shown.start_ns));
}

void Health(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Pause(3500 * kMillisecond);
  session.RoundTrip();
  const size_t count = session.Count(EventType::kHealth);
  if (session.ok()) {
    probe.check().Expect(count >= 2 && count <= 6, "HEALTH about once a second: 2 to 6 in 3.5 s",
                         absl::StrCat(count));
  }
}

void Underruns(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Mark();
  session.Begin(2);
  session.Settle();
  session.Pause(3 * session.period());
  const Event event =
      session.Await("UNDERRUN while a volume is being filled", 2 * session.period() + kSecond,
                    [](const Event& e) { return e.type() == EventType::kUnderrun; });
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Expect(event.As<UnderrunEvent>().total >= 1, "a total of 1 or more",
                       absl::StrCat(event.As<UnderrunEvent>().total));
  probe.check().Expect(
      status.underruns >= event.As<UnderrunEvent>().total,
      absl::StrCat("underruns of GET_STATUS ", event.As<UnderrunEvent>().total, " or more"),
      absl::StrCat(status.underruns));
}

// ---- credit

// Sends bytes of a volume that is never ended, until more than the receive buffer was sent.
void SendMoreThanTheBuffer(Session& session) {
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  session.Begin(1);
  for (uint32_t i = 0; session.ok() && session.sent() < uint64_t{buffer} * 3 / 2; ++i) {
    session.Picture(1, i % std::max(session.pictures(), 1u));  // sent as they fill a transfer
  }
  session.Flush();
}

void CreditIsTold(Probe& probe) {
  Session session(probe);
  session.Start();
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  if (session.ok() && buffer > kLargestBuffer) {
    return probe.check().NotApplicable(
        absl::StrCat("the receive buffer has ", buffer, " bytes; at most 64 MiB are filled"));
  }
  SendMoreThanTheBuffer(session);
  // Make no request that could report it instead.
  const uint64_t least = session.sent() + buffer - buffer / 4;
  session.Await(absl::StrCat("an event with credit_limit above ", least,
                             ": no more than a quarter of the buffer is untold"),
                5 * kSecond,
                [least](const Event& event) { return event.header.credit_limit > least; });
  session.ExpectNoErrors();
}

void CreditIsExact(Probe& probe) {
  Session session(probe);
  session.Start();
  session.SetKeepalive(false);
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  for (const size_t size : {size_t{1}, size_t{39}, size_t{40}, size_t{2000}}) {
    // Valid or not.
    session.Raw(std::vector<std::byte>(size, std::byte{0xA5}));
    session.RoundTrip();
    session.Settle();
    const Status status = session.GetStatus();
    if (!session.ok()) return;
    probe.check().Equal("bytes_received", session.sent(), status.bytes_received);
    probe.check().Equal("credit_limit", session.sent() + buffer, status.credit_limit);
  }
}

// Sends the whole credit at once, without waiting for any of it to be consumed.
void WholeCredit(Probe& probe) {
  Session session(probe);
  session.Start();
  const uint32_t buffer = session.capabilities().fixed.receive_buffer;
  if (session.ok() && buffer > kLargestBuffer) {
    return probe.check().NotApplicable(
        absl::StrCat("the receive buffer has ", buffer, " bytes; at most 64 MiB are filled"));
  }
  session.Begin(1);
  session.Flush();
  std::vector<std::byte> packets;
  while (session.ok() && session.sent() + packets.size() + sizeof(PacketHeader) <= buffer) {
    session.writer().Plain(packets, PacketType::kKeepalive, 0);
  }
  session.Raw(packets);
  session.ExpectNoErrors();
}

}  // namespace

void AddEventCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, const char* section, auto run) {
    cases.push_back({id, title, section, run});
  };
  add("events.numbering", "events are numbered without gaps", "6", &Numbering);
  add("events.unread", "unread events are kept, or leave a gap", "6", &Unread);
  add("events.sweeps", "SWEEP each sweep or every 8 ms, at the mode's rate", "6", &Sweeps);
  add("events.shown", "SHOWN at the start of the sweep that it names", "6", &Shown);
  add("events.health", "HEALTH about once a second", "6", &Health);
  add("events.underrun", "UNDERRUN while a volume is late", "6", &Underruns);
  add("credit.told", "credit is told by the quarter", "7", &CreditIsTold);
  add("credit.exact", "every byte counts, sound or not", "7", &CreditIsExact);
  add("credit.whole", "all credit may be used at once", "7", &WholeCredit);
}

}  // namespace voxeld::display::voxlink
