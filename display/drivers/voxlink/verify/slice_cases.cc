// §5.3: SLICE.
#include <algorithm>
#include <numeric>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;

// Sends all slice images but `but`.
void Others(Session& session, uint64_t volume, uint32_t but) {
  for (uint32_t p = 0; session.ok() && p < session.pictures(); ++p) {
    if (p != but) session.Picture(volume, p);
  }
}

void ExpectOnlyMissing(Session& session, uint64_t volume, uint32_t picture) {
  session.End(volume);
  const std::vector<PictureRun> missing = session.ExpectMissing(volume);
  if (!session.ok()) return;
  session.check().Expect(missing == std::vector<PictureRun>{{picture, 1}},
                         absl::StrCat("picture ", picture, " is missing, and no other"),
                         absl::StrCat(missing.size(), " runs, the first of ", missing[0].count,
                                      " from ", missing[0].first));
}

void AnyOrder(Probe& probe) {
  Session session(probe);
  session.Start();
  std::vector<uint32_t> order(session.pictures());
  std::iota(order.begin(), order.end(), 0u);
  for (size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[probe.Random(static_cast<uint32_t>(i))]);
  }
  const uint32_t most = session.capabilities().fixed.max_payload;
  session.Begin(1);
  for (const uint32_t picture : order) {
    if (!session.ok()) return;
    const std::vector<std::byte> bytes = session.PictureBytes(1, picture);
    for (size_t at = 0; session.ok() && at < bytes.size();) {
      const size_t size =
          std::min<size_t>({bytes.size() - at, most, bytes.size() / 4 + 1 + probe.Random(1024)});
      session.Fragment(1, picture, static_cast<uint32_t>(at), std::span(bytes).subspan(at, size));
      at += size;
    }
  }
  session.End(1);
  session.ExpectComplete(1);
  session.ExpectShown(1);
  session.ExpectNoErrors();
}

void FragmentAgain(Probe& probe) {
  Session session(probe);
  session.Start();
  const std::vector<std::byte> bytes = session.PictureBytes(1, 0);
  if (session.ok() && bytes.size() < 2) {
    return probe.check().NotApplicable("a picture of one byte has no fragments");
  }
  session.Begin(1);
  Others(session, 1, 0);
  if (!session.ok()) return;
  const size_t half = std::min<size_t>(bytes.size() / 2, session.capabilities().fixed.max_payload);
  session.Fragment(1, 0, 0, std::span(bytes).first(half));
  session.Picture(1, 0);  // from the start, completely
  session.Picture(1, 0);  // and again
  session.Fragment(1, 0, 0, std::span(bytes).first(half));
  ExpectOnlyMissing(session, 1, 0);
  session.Picture(1, 0);
  session.End(1);
  session.ExpectComplete(1);
  session.ExpectNoErrors();
}

void FragmentOrder(Probe& probe) {
  Session session(probe);
  session.Start();
  const std::vector<std::byte> bytes = session.PictureBytes(1, 0);
  if (session.ok() && bytes.size() < 3) {
    return probe.check().NotApplicable("a picture has too few bytes for fragments");
  }
  session.Begin(1);
  Others(session, 1, 0);
  if (!session.ok()) return;
  session.Fragment(1, 0, 0, std::span(bytes).first(1));
  session.Fragment(1, 0, 2, std::span(bytes).subspan(2, 1));  // byte 1 is left out
  session.ExpectError(ErrorCode::kBadOrder);
  // too late: it must restart at offset 0
  session.Fragment(1, 0, 1, std::span(bytes).subspan(1, 1));
  ExpectOnlyMissing(session, 1, 0);
  session.Picture(1, 0);
  session.End(1);
  session.ExpectComplete(1);
}

void Outside(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  if (!session.ok()) return;
  const FrameLayout& layout = session.layout();
  const auto size = static_cast<uint32_t>(layout.bytes_per_slice());
  const auto slices = static_cast<uint32_t>(layout.slices);
  const std::vector<std::byte> two(2, std::byte{1});
  struct Wrong {
    uint32_t slice;
    uint16_t sub_frame;
    uint32_t offset;
    size_t bytes;
  };
  for (const Wrong& wrong :
       {Wrong{slices, 0, 0, 1}, Wrong{~0u, 0, 0, 1},
        Wrong{0, static_cast<uint16_t>(layout.sub_frames), 0, 1}, Wrong{0, 0xFFFF, 0, 1},
        Wrong{0, 0, size, 1}, Wrong{0, 0, ~0u, 2}, Wrong{0, 0, size - 1, 2}, Wrong{0, 0, 0, 0}}) {
    session.Settle();
    session.Mark();
    std::vector<std::byte> packet;
    session.writer().Slice(packet, 1, wrong.slice, wrong.sub_frame, wrong.offset,
                           std::span(two).first(wrong.bytes));
    session.Raw(packet);
    session.ExpectError(ErrorCode::kBadPicture);
  }
  for (uint32_t p = 0; session.ok() && p < session.pictures(); ++p) session.Picture(1, p);
  session.End(1);
  session.ExpectComplete(1);
}

void NotAnnounced(Probe& probe) {
  Session session(probe);
  session.Start();
  if (session.ok() && session.pictures() < 2) {
    return probe.check().NotApplicable("a volume of one picture announces all or none");
  }
  session.Whole(1);
  session.ExpectComplete(1);
  std::vector<std::byte> bits((session.pictures() + 7) / 8);
  if (!bits.empty()) bits[0] = std::byte{1};
  session.Begin(2, 1, bits);
  session.Picture(2, 1);
  session.ExpectError(ErrorCode::kNotInBitmap);
  session.Picture(2, 0);
  session.End(2);
  session.ExpectComplete(2);
}

void NotFilling(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectComplete(1);
  session.Picture(1, 0);  // of the last complete volume: ignored without an event
  session.ExpectNoErrors();
  session.Mark();
  for (int i = 0; i < 3; ++i) session.Picture(3, 0);
  session.RoundTrip();
  session.ExpectError(ErrorCode::kNotFilling);
  size_t errors = session.Count(EventType::kError);
  if (session.ok()) probe.check().Equal("ERROR 4 for one volume:", size_t{1}, errors);
}

}  // namespace

void AddSliceCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "5.3", run});
  };
  add("slice.any_order", "pictures in any order, in fragments", &AnyOrder);
  add("slice.again", "a fragment at offset 0 begins the picture anew", &FragmentAgain);
  add("slice.fragment_order", "a gap between fragments: told, and the picture missing",
      &FragmentOrder);
  add("slice.outside", "slices, sub-frames, offsets and lengths outside are refused", &Outside);
  add("slice.not_announced", "a picture that BEGIN did not announce is refused", &NotAnnounced);
  add("slice.not_filling", "a volume that is not being filled: told once", &NotFilling);
}

}  // namespace voxeld::display::voxlink
