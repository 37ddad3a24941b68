// §5.4: VOLUME_END, and how volumes are shown.
#include <algorithm>

#include "display/drivers/voxlink/verify/cases.h"
#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using conformance::Probe;
using sync::kMillisecond;

constexpr size_t kMostBytes = size_t{64} << 20;  // of a volume, in modes larger than the smallest

void Whole(Probe& probe) {
  Session session(probe);
  session.Start();
  for (uint64_t volume = 1; session.ok() && volume <= 3; ++volume) {
    session.Whole(volume);
    const Event complete = session.ExpectComplete(volume);
    const auto shown = session.ExpectShown(volume).As<ShownEvent>();
    if (!session.ok()) return;
    // Shown from the next sweep on; COMPLETE may have waited a little for the bus.
    const auto end = static_cast<int64_t>(complete.header.time_ns);
    const auto start = static_cast<int64_t>(shown.start_ns);
    const int64_t slack = session.period() / 10 + 10 * kMillisecond;
    probe.check().Expect(
        start >= end - slack && start <= end + session.period() + slack,
        absl::StrCat("volume ", volume, " shown in the sweep after COMPLETE, within ",
                     session.period() / kMillisecond, " ms"),
        absl::StrCat("after ", (start - end) / kMillisecond, " ms"));
    const Status status = session.GetStatus();
    if (!session.ok()) return;
    probe.check().Equal("shown", volume, status.shown);
    probe.check().Equal("last_complete", volume, status.last_complete);
    probe.check().Equal("shown_sweep", shown.sweep, status.shown_sweep);
    probe.check().Equal("shown_start_ns", shown.start_ns, status.shown_start_ns);
    probe.check().Equal("filling", uint64_t{0}, status.filling);
  }
  session.Mark();
  session.Pause(2 * session.period());
  if (session.ok()) {
    probe.check().Equal("SHOWN once more of the same volume:", size_t{0},
                        session.Count(EventType::kShown));
  }
  session.ExpectNoErrors();
}

void EveryFormat(Probe& probe) {
  const uint8_t formats = [&] {
    Session session(probe);
    return session.capabilities().fixed.formats;
  }();
  for (uint8_t format = 0; probe.check().ok() && format < kPixelFormats; ++format) {
    if ((formats >> format & 1) == 0) continue;
    Session session(probe);
    session.Start({.format = format, .sub_frames = 1});
    session.Whole(1);
    session.ExpectComplete(1);
    session.ExpectShown(1);
    session.ExpectNoErrors();
    session.SetListening(false);
    session.Do(Request::kStop);
  }
}

void SubFrames(Probe& probe) {
  Session session(probe);
  Mode mode = session.SmallestMode();
  const uint8_t most = session.capabilities().fixed.max_sub_frames;
  if (session.ok() && most < 2) return probe.check().NotApplicable("max_sub_frames is 1");
  mode.sub_frames = most;
  while (mode.sub_frames > 2 && session.LayoutOf(mode).bytes() > kMostBytes) --mode.sub_frames;
  session.Start(mode);
  session.Whole(1);
  session.ExpectComplete(1);
  session.ExpectShown(1);
  session.ExpectNoErrors();
}

void Missing(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Begin(1);
  const uint32_t all = session.pictures();
  // Runs at both ends and in the middle; at most 24, so that none is joined.
  std::vector<PictureRun> runs;
  for (uint32_t p = 0; p < all && runs.size() < 24;) {
    const uint32_t count = std::min(1 + probe.Random(2), all - p);
    runs.push_back({p, count});
    p += count + 1 + probe.Random(std::max(all / 8, 1u));
  }
  if (runs.size() > 1 && runs.back().first + runs.back().count < all - 1) {
    runs.push_back({all - 1, 1});
  }
  const auto left_out = [&](uint32_t p) {
    return std::any_of(runs.begin(), runs.end(), [&](const PictureRun& run) {
      return p >= run.first && p < run.first + run.count;
    });
  };
  for (uint32_t p = 0; session.ok() && p < all; ++p) {
    if (!left_out(p)) session.Picture(1, p);
  }
  session.End(1);
  const std::vector<PictureRun> told = session.ExpectMissing(1);
  if (!session.ok()) return;
  const auto text = [](const std::vector<PictureRun>& list) {
    std::string out;
    for (const PictureRun& run : list) absl::StrAppend(&out, " ", run.first, "+", run.count);
    return out;
  };
  probe.check().Equal("missing, as picture+count:", text(runs), text(told));
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("filling", uint64_t{1}, status.filling);
  for (uint32_t p = 0; session.ok() && p < all; ++p) {
    if (left_out(p)) session.Picture(1, p);
  }
  session.End(1);
  session.ExpectComplete(1);
  session.ExpectShown(1);
  session.ExpectNoErrors();
}

void ManyMissing(Probe& probe) {
  Session session(probe);
  Mode mode = session.SmallestMode();
  const Capabilities fixed = session.capabilities().fixed;
  if (!session.ok()) return;
  while (fixed.slices * mode.sub_frames < 128 && mode.sub_frames < fixed.max_sub_frames) {
    ++mode.sub_frames;
  }
  if (fixed.slices * mode.sub_frames < 128 || session.LayoutOf(mode).bytes() > kMostBytes) {
    return probe.check().NotApplicable(
        "48 runs need 128 pictures in a volume of at most 64 MiB, which the device does not have");
  }
  session.Start(mode);
  session.Begin(1);
  for (uint32_t p = 0; session.ok() && p < session.pictures(); p += 2) session.Picture(1, p);
  session.End(1);
  const std::vector<PictureRun> told = session.ExpectMissing(1);
  for (uint32_t p = 1; session.ok() && p < session.pictures(); p += 2) {
    const bool covered = std::any_of(told.begin(), told.end(), [&](const PictureRun& run) {
      return p >= run.first && p - run.first < run.count;
    });
    probe.check().Expect(covered, absl::StrCat("the list of missing pictures has ", p),
                         absl::StrCat(told.size(), " runs without it"));
  }
}

void IncompleteIsNotShown(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectShown(1);
  session.Begin(2);
  for (uint32_t p = 1; session.ok() && p < session.pictures(); ++p) session.Picture(2, p);
  session.End(2);
  session.ExpectMissing(2);
  session.Mark();
  session.Pause(3 * session.period());
  const std::optional<Event> shown =
      session.Find([](const Event& event) { return event.type() == EventType::kShown; });
  const Status status = session.GetStatus();
  if (!session.ok()) return;
  probe.check().Expect(!shown, "an incomplete volume is not shown", shown ? Describe(*shown) : "");
  probe.check().Equal("shown", uint64_t{1}, status.shown);
}

void EndRepeated(Probe& probe) {
  Session session(probe);
  session.Start();
  session.Whole(1);
  session.ExpectComplete(1);
  for (int i = 0; i < 2; ++i) {
    session.End(1);
    session.ExpectComplete(1);
  }
  session.ExpectShown(1);
  session.End(1);
  session.ExpectComplete(1);
  session.Begin(2);
  for (int i = 0; i < 2; ++i) {
    session.End(2);
    session.ExpectMissing(2);
  }
}

void EndUnknown(Probe& probe) {
  Session session(probe);
  session.Start();
  session.End(5);
  session.ExpectAborted(5, Reason::kUnknownVolume);
  session.Begin(1);
  session.End(2);
  session.ExpectAborted(2, Reason::kUnknownVolume);
  const Status status = session.GetStatus();
  if (session.ok()) probe.check().Equal("filling", uint64_t{1}, status.filling);
}

// Sends volumes as fast as the host can; each must be answered once.
void Burst(Probe& probe) {
  Session session(probe);
  session.Start();
  for (uint64_t volume = 1; session.ok() && volume <= 20; ++volume) session.End(volume + 100);
  for (uint64_t volume = 1; session.ok() && volume <= 20; ++volume) {
    session.ExpectAborted(volume + 100, Reason::kUnknownVolume);
  }
  session.ExpectNoErrors();
  if (session.ok()) {
    probe.check().Equal("ABORTED for 20 unknown volumes and one more:", size_t{21},
                        session.Count(EventType::kAborted));
  }
}

}  // namespace

void AddVolumeCases(Cases& cases) {
  const auto add = [&](const char* id, const char* title, auto run) {
    cases.push_back({id, title, "5.4", run});
  };
  add("volume.whole", "complete, then shown from the next sweep on, once", &Whole);
  add("volume.formats", "a volume in each pixel format", &EveryFormat);
  add("volume.sub_frames", "a volume of many sub-frames", &SubFrames);
  add("volume.missing", "exactly what is missing is listed, and taken again", &Missing);
  add("volume.many_missing", "a long list is made shorter and leaves nothing out", &ManyMissing);
  add("volume.incomplete", "a volume that is not complete is not shown", &IncompleteIsNotShown);
  add("end.repeated", "VOLUME_END may be repeated", &EndRepeated);
  add("end.unknown", "VOLUME_END of an unknown volume: ABORTED", &EndUnknown);
  add("end.burst", "each VOLUME_END has exactly one answer", &Burst);
}

}  // namespace voxeld::display::voxlink
