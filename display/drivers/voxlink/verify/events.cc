// How a Session handles received events.
#include <map>

#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {
namespace {

using sync::kSecond;

constexpr size_t kMostInMessage = 8;

bool IsAnswerToEnd(const Event& event, uint64_t volume) {
  switch (event.type()) {
    case EventType::kComplete:
    case EventType::kAborted:
      return VolumeOf(event) == volume;
    case EventType::kMissing:
      return VolumeOf(event) == volume && (event.header.flags & kMissingLast) != 0;
    default:
      return false;
  }
}

std::string EventName(EventType type) {
  static constexpr const char* kNames[] = {"",        "READY",   "CREDIT", "SWEEP",   "COMPLETE",
                                           "MISSING", "ABORTED", "SHOWN",  "DROPPED", "UNDERRUN",
                                           "HEALTH",  "ERROR",   "LIGHT"};
  const auto index = static_cast<size_t>(type);
  return index > 0 && index < std::size(kNames) ? kNames[index]
                                                : absl::StrCat("event type ", index);
}

}  // namespace

uint64_t VolumeOf(const Event& event) {
  switch (event.type()) {
    case EventType::kComplete:
    case EventType::kMissing:
    case EventType::kAborted:
    case EventType::kShown:
    case EventType::kDropped:
      return event.As<CompleteEvent>().volume;  // at the same offset in each of them
    case EventType::kError:
      return event.As<ErrorEvent>().volume;
    default:
      return 0;
  }
}

std::string Describe(const Event& event) {
  std::string text = EventName(event.type());
  switch (event.type()) {
    case EventType::kAborted:
    case EventType::kDropped: {
      const auto body = event.As<VolumeEvent>();
      absl::StrAppend(&text, " of volume ", body.volume, ", reason ", body.reason);
      break;
    }
    case EventType::kError: {
      const auto body = event.As<ErrorEvent>();
      absl::StrAppend(&text, " ", body.code, " (", ErrorCodeName(static_cast<ErrorCode>(body.code)),
                      "), volume ", body.volume, ", detail ", body.detail);
      break;
    }
    case EventType::kOrdered:
      absl::StrAppend(&text, " volume ", event.As<OrderedEvent>().volume, ", sweep ",
                      event.As<OrderedEvent>().sweep);
      break;
    case EventType::kLight:
      absl::StrAppend(&text, event.As<LightEvent>().lit != 0 ? " on" : " off", ", cause ",
                      event.As<LightEvent>().reason);
      break;
    default:
      if (VolumeOf(event) != 0) absl::StrAppend(&text, " of volume ", VolumeOf(event));
      break;
  }
  return text;
}

std::string Session::Recent() const {
  std::map<EventType, size_t> routine;
  std::vector<std::string> told;
  for (size_t i = mark_; i < log_.size(); ++i) {
    const EventType type = log_[i].type();
    if (type == EventType::kSweep || type == EventType::kCredit || type == EventType::kHealth ||
        type == EventType::kUnderrun) {
      ++routine[type];
    } else if (!log_[i].awaited) {
      told.push_back(Describe(log_[i]));
    }
  }
  std::string text;
  const size_t first = told.size() > kMostInMessage ? told.size() - kMostInMessage : 0;
  if (first > 0) absl::StrAppend(&text, first, " more; ");
  for (size_t i = first; i < told.size(); ++i) absl::StrAppend(&text, told[i], "; ");
  for (const auto& [type, count] : routine) {
    absl::StrAppend(&text, count, " ", EventName(type), "; ");
  }
  if (text.empty()) return "no event";
  text.resize(text.size() - 2);
  return text;
}

Event Session::AnswerToEnd(uint64_t volume, EventType type, const std::string& expected) {
  Event answer = Await(expected, kEventLimit,
                       [volume](const Event& event) { return IsAnswerToEnd(event, volume); });
  if (ok() && answer.type() != type) check().Fail(expected, Describe(answer));
  return answer;
}

Event Session::ExpectComplete(uint64_t volume) {
  return AnswerToEnd(volume, EventType::kComplete, absl::StrCat("COMPLETE of volume ", volume));
}

void Session::ExpectAborted(uint64_t volume) {
  AnswerToEnd(volume, EventType::kAborted, absl::StrCat("ABORTED of volume ", volume));
}

void Session::ExpectAborted(uint64_t volume, Reason reason) {
  const std::string expected = absl::StrCat("ABORTED of volume ", volume, ", reason ", reason);
  const Event answer = AnswerToEnd(volume, EventType::kAborted, expected);
  if (ok() && answer.As<VolumeEvent>().reason != static_cast<uint32_t>(reason)) {
    check().Fail(expected, Describe(answer));
  }
}

void Session::ExpectDropped(uint64_t volume, Reason reason) {
  const std::string expected = absl::StrCat("DROPPED of volume ", volume, ", reason ", reason);
  const Event answer = Await(expected, kEventLimit, [&](const Event& event) {
    return event.type() == EventType::kDropped && VolumeOf(event) == volume;
  });
  if (ok() && answer.As<VolumeEvent>().reason != static_cast<uint32_t>(reason)) {
    check().Fail(expected, Describe(answer));
  }
}

Event Session::ExpectShown(uint64_t volume) {
  const std::string expected = absl::StrCat("SHOWN of volume ", volume);
  Event answer = Await(expected, 2 * period_ + kEventLimit,
                       [](const Event& event) { return event.type() == EventType::kShown; });
  if (ok() && VolumeOf(answer) != volume) check().Fail(expected, Describe(answer));
  return answer;
}

std::vector<PictureRun> Session::ExpectMissing(uint64_t volume) {
  const size_t from = log_.size();
  AnswerToEnd(volume, EventType::kMissing,
              absl::StrCat("MISSING of volume ", volume, ", the last one"));
  std::vector<PictureRun> runs;
  size_t events = 0;
  for (size_t i = from; ok() && i < log_.size(); ++i) {
    if (log_[i].type() != EventType::kMissing || VolumeOf(log_[i]) != volume) continue;
    const auto body = log_[i].As<MissingEvent>();
    if (body.runs < 1 || body.runs > kRunsPerEvent || ++events > kMostMissingEvents) {
      check().Fail("MISSING has 1 to 3 runs, in at most 16 events",
                   absl::StrCat(body.runs, " runs in event ", events), "6");
      break;
    }
    for (uint32_t r = 0; r < body.runs; ++r) {
      const PictureRun& run = body.run[r];
      const uint32_t end = runs.empty() ? 0 : runs.back().first + runs.back().count;
      if (run.count == 0 || run.first < end || run.first >= pictures() ||
          run.count > pictures() - run.first) {
        check().Fail("runs of missing pictures ascend and lie in the volume",
                     absl::StrCat(run.count, " from picture ", run.first), "6");
      }
      runs.push_back(run);
    }
    if ((log_[i].header.flags & kMissingLast) != 0) break;
  }
  return runs;
}

ErrorEvent Session::ExpectError(ErrorCode code) {
  const auto number = static_cast<uint32_t>(code);
  const Event event =
      Await(absl::StrCat("ERROR ", number, " (", ErrorCodeName(code), ")"), kEventLimit,
            [number](const Event& e) {
              return e.type() == EventType::kError && e.As<ErrorEvent>().code == number;
            });
  return event.As<ErrorEvent>();
}

void Session::RoundTrip() {
  if (!ok()) return;
  constexpr uint64_t kNobodys = uint64_t{1} << 40;
  End(kNobodys);
  ExpectAborted(kNobodys, Reason::kUnknownVolume);
}

void Session::ExpectNoErrors() {
  RoundTrip();
  const std::optional<Event> error =
      Find([](const Event& event) { return event.type() == EventType::kError; });
  if (error && ok()) check().Fail("no ERROR", Describe(*error));
}

}  // namespace voxeld::display::voxlink
