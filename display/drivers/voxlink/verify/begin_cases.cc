// §5.2: VOLUME_BEGIN.
#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;

std::vector<std::byte> Bitmap(const Session& session, const std::vector<uint32_t>& pictures) {
  std::vector<std::byte> bits((session.pictures() + 7) / 8);
  for (const uint32_t p : pictures) bits[p / 8] |= static_cast<std::byte>(1u << p % 8);
  return bits;
}

// Sends a complete volume with `number`.
void Complete(Session& session, uint64_t number) {
  session.Whole(number);
  session.ExpectComplete(number);
}

void Delta(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 1);
  session.ExpectShown(1);
  const std::vector<uint32_t> some = {session.pictures() / 2, session.pictures() - 1};
  uint64_t volume = 2;
  for (; volume < 5; ++volume) {
    session.Begin(volume, volume - 1, Bitmap(session, some));
    for (const uint32_t p : some) session.Picture(volume, p);
    session.End(volume);
    session.ExpectComplete(volume);
    session.ExpectShown(volume);
  }
  session.ExpectNoErrors();
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("last_complete", volume - 1, status.last_complete);
}

void EmptyDelta(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 1);
  session.Begin(7, 1, Bitmap(session, {}));
  session.End(7);
  session.ExpectComplete(7);
  session.ExpectNoErrors();
}

void DeltaMissing(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 1);
  const uint32_t picture = session.pictures() / 2;
  session.Begin(2, 1, Bitmap(session, {picture}));
  session.End(2);
  const std::vector<PictureRun> missing = session.ExpectMissing(2);
  if (session.ok()) {
    probe.check().Expect(missing == std::vector<PictureRun>{{picture, 1}},
                         absl::StrCat("the announced picture ", picture, " is missing, alone"),
                         absl::StrCat(missing.size(), " runs, the first from ", missing[0].first));
  }
  session.Picture(2, picture);
  session.End(2);
  session.ExpectComplete(2);
}

void WrongBase(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 1);
  Complete(session, 2);
  session.Mark();
  for (const uint64_t base : {uint64_t{1}, uint64_t{77}, ~uint64_t{0}}) {
    const uint64_t volume = base == 1 ? 3 : base == 77 ? 4 : 5;
    session.Begin(volume, base, Bitmap(session, {0}));
    session.ExpectAborted(volume, Reason::kBadBase);
    session.Picture(volume, 0);  // ignored without an event
    session.End(volume);
    session.ExpectAborted(volume, Reason::kBadBase);
  }
  session.ExpectNoErrors();
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("last_complete", uint64_t{2}, status.last_complete);
  Complete(session, 6);
}

void NoBaseYet(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(2, 1, Bitmap(session, {0}));
  session.ExpectAborted(2, Reason::kBadBase);
}

void NumbersAscend(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 10);
  for (const uint64_t volume : {uint64_t{9}, uint64_t{1}}) {
    session.Begin(volume);
    session.ExpectAborted(volume);
  }
  const Status status = session.GetStatus();
  if (session.ok()) {
    probe.check().Equal("filling", uint64_t{0}, status.filling);
    probe.check().Equal("last_complete", uint64_t{10}, status.last_complete);
  }
  Complete(session, 11);
}

void BeginAgain(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  session.Picture(1, 0);
  session.Settle();
  session.Mark();
  session.Begin(1);
  session.End(1);
  const std::vector<PictureRun> missing = session.ExpectMissing(1);
  if (session.ok()) {
    probe.check().Expect(missing == std::vector<PictureRun>{{0, session.pictures()}},
                         "all pictures are missing after the volume is begun again",
                         absl::StrCat(missing.size(), " runs, the first of ", missing[0].count));
  }
  for (uint32_t p = 0; session.ok() && p < session.pictures(); ++p) session.Picture(1, p);
  session.End(1);
  session.ExpectComplete(1);
}

void Supersedes(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  session.Picture(1, 0);
  session.Begin(2);
  session.ExpectAborted(1, Reason::kSuperseded);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("filling", uint64_t{2}, status.filling);
}

void Misfit(Probe& probe) {
  Session session(probe);
  session.Start();
  Complete(session, 1);
  uint64_t volume = 2;
  const auto refused = [&](uint64_t base, uint32_t pictures, std::span<const std::byte> bitmap) {
    std::vector<std::byte> packet;
    session.writer().Begin(packet, volume, base, pictures, bitmap);
    session.Raw(packet);
    session.ExpectAborted(volume, Reason::kMalformed);
    ++volume;
  };
  const uint32_t right = session.pictures();
  refused(0, right + 1, {});
  refused(0, 0, {});
  refused(0, right, std::vector<std::byte>(1));
  std::vector<std::byte> bits = Bitmap(session, {0});
  bits.push_back(std::byte{0});
  refused(1, right, bits);
  if (right % 8 != 0) {
    bits.pop_back();
    bits.back() |= std::byte{0x80};
    refused(1, right, bits);
  }
  session.Whole(volume);
  session.ExpectComplete(volume);
}

}  // namespace

void AddBeginCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "5.2", run});
  };
  add("begin.delta", "volumes that carry what changed are complete and shown", &Delta);
  add("begin.empty_delta", "a volume that equals its base", &EmptyDelta);
  add("begin.delta_missing", "of a delta only what was announced is missing", &DeltaMissing);
  add("begin.wrong_base", "a base that is not the last complete volume is refused", &WrongBase);
  add("begin.no_base", "the first volume of a session has no base", &NoBaseYet);
  add("begin.ascending", "a volume's number is above all before", &NumbersAscend);
  add("begin.again", "the volume being filled may be begun again", &BeginAgain);
  add("begin.supersedes", "BEGIN of another volume ends the one being filled", &Supersedes);
  add("begin.misfit", "pictures and bitmap must fit the mode", &Misfit);
}

}  // namespace voxeld::display::voxlink
