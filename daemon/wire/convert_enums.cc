// One table for each pair of enums, used in both directions.
#include <array>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "daemon/wire/convert.h"

namespace voxeld::daemon::wire {
namespace {

template <typename Ours, typename Theirs, size_t n>
using EnumTable = std::array<std::pair<Ours, Theirs>, n>;

constexpr EnumTable<Reason, v1::Reason, 16> kReasons = {{
    {Reason::kUnspecified, v1::REASON_UNSPECIFIED},
    {Reason::kInvalidValue, v1::REASON_INVALID_VALUE},
    {Reason::kSizeMismatch, v1::REASON_SIZE_MISMATCH},
    {Reason::kIndexOutOfRange, v1::REASON_INDEX_OUT_OF_RANGE},
    {Reason::kQuotaExceeded, v1::REASON_QUOTA_EXCEEDED},
    {Reason::kNotFound, v1::REASON_NOT_FOUND},
    {Reason::kAlreadyExists, v1::REASON_ALREADY_EXISTS},
    {Reason::kInUse, v1::REASON_IN_USE},
    {Reason::kCycle, v1::REASON_CYCLE},
    {Reason::kSingularTransform, v1::REASON_SINGULAR_TRANSFORM},
    {Reason::kOutOfRange, v1::REASON_OUT_OF_RANGE},
    {Reason::kStaleSequence, v1::REASON_STALE_SEQUENCE},
    {Reason::kOutOfOrder, v1::REASON_OUT_OF_ORDER},
    {Reason::kPermissionDenied, v1::REASON_PERMISSION_DENIED},
    {Reason::kUnimplemented, v1::REASON_UNIMPLEMENTED},
    {Reason::kTimedOut, v1::REASON_TIMED_OUT},
}};

constexpr EnumTable<gpu::BlendMode, v1::BlendMode, 3> kBlendModes = {{
    {gpu::BlendMode::kOver, v1::BLEND_MODE_OVER},
    {gpu::BlendMode::kAdd, v1::BLEND_MODE_ADD},
    {gpu::BlendMode::kErase, v1::BLEND_MODE_ERASE},
}};

constexpr EnumTable<display::Evidence, v1::Evidence, 2> kEvidence = {{
    {display::Evidence::kDevice, v1::EVIDENCE_DEVICE},
    {display::Evidence::kEstimated, v1::EVIDENCE_ESTIMATED},
}};

constexpr EnumTable<CommitOutcome::NotShown, v1::NotShown::Why, 4> kWhys = {{
    {CommitOutcome::NotShown::kAbsent, v1::NotShown::ABSENT},
    {CommitOutcome::NotShown::kRemoved, v1::NotShown::REMOVED},
    {CommitOutcome::NotShown::kBlanked, v1::NotShown::BLANKED},
    {CommitOutcome::NotShown::kHidden, v1::NotShown::HIDDEN},
}};

constexpr EnumTable<display::DisplayState, v1::DisplayState, 5> kStates = {{
    {display::DisplayState::kStopped, v1::DISPLAY_STATE_STOPPED},
    {display::DisplayState::kAttaching, v1::DISPLAY_STATE_ATTACHING},
    {display::DisplayState::kShowing, v1::DISPLAY_STATE_SHOWING},
    {display::DisplayState::kBlanked, v1::DISPLAY_STATE_BLANKED},
    {display::DisplayState::kLost, v1::DISPLAY_STATE_LOST},
}};

constexpr EnumTable<display::PixelFormat, v1::PixelFormat, 5> kFormats = {{
    {display::PixelFormat::kRgb888, v1::PIXEL_FORMAT_RGB888},
    {display::PixelFormat::kRgb332, v1::PIXEL_FORMAT_RGB332},
    {display::PixelFormat::kBitPlanes, v1::PIXEL_FORMAT_BIT_PLANES},
    {display::PixelFormat::kHub75, v1::PIXEL_FORMAT_HUB75},
    {display::PixelFormat::kPlanes24, v1::PIXEL_FORMAT_PLANES24},
}};

constexpr EnumTable<sync::SweepLock::State, v1::SweepLock, 3> kSweepLocks = {{
    {sync::SweepLock::State::kUnknown, v1::SWEEP_LOCK_UNKNOWN},
    {sync::SweepLock::State::kLocking, v1::SWEEP_LOCK_LOCKING},
    {sync::SweepLock::State::kLocked, v1::SWEEP_LOCK_LOCKED},
}};

constexpr EnumTable<TestPattern, v1::TestPattern, 11> kPatterns = {{
    {TestPattern::kNone, v1::TEST_PATTERN_NONE},
    {TestPattern::kAxes, v1::TEST_PATTERN_AXES},
    {TestPattern::kCorners, v1::TEST_PATTERN_CORNERS},
    {TestPattern::kGrid, v1::TEST_PATTERN_GRID},
    {TestPattern::kRamp, v1::TEST_PATTERN_RAMP},
    {TestPattern::kWhite, v1::TEST_PATTERN_WHITE},
    {TestPattern::kBars, v1::TEST_PATTERN_BARS},
    {TestPattern::kDensity, v1::TEST_PATTERN_DENSITY},
    {TestPattern::kSlices, v1::TEST_PATTERN_SLICES},
    {TestPattern::kPosts, v1::TEST_PATTERN_POSTS},
    {TestPattern::kFrames, v1::TEST_PATTERN_FRAMES},
}};

constexpr EnumTable<display::DecodedVolume::Source, v1::VolumeHeader::Source, 2> kSources = {{
    {display::DecodedVolume::Source::kDecodedFromSent, v1::VolumeHeader::DECODED_FROM_SENT},
    {display::DecodedVolume::Source::kReportedByDevice, v1::VolumeHeader::REPORTED_BY_DEVICE},
}};

// Requires: the table contains every value of `Ours`. Values that it lacks become the protocol's
// "unspecified".
template <typename Ours, typename Theirs, size_t n>
Theirs Forth(const EnumTable<Ours, Theirs, n>& table, Ours value) {
  for (const auto& [ours, theirs] : table) {
    if (ours == value) return theirs;
  }
  return Theirs{};
}

template <typename Ours, typename Theirs, size_t n>
absl::StatusOr<Ours> Back(const EnumTable<Ours, Theirs, n>& table, Theirs value, const char* what) {
  std::string known;
  for (const auto& [ours, theirs] : table) {
    if (theirs == value) return ours;
    absl::StrAppend(&known, known.empty() ? "" : ", ", static_cast<int>(theirs));
  }
  return absl::InvalidArgumentError(absl::StrCat(what, " has the unknown value ",
                                                 static_cast<int>(value), "; known are ", known));
}

}  // namespace

v1::Reason ToWire(Reason reason) { return Forth(kReasons, reason); }
v1::BlendMode ToWire(gpu::BlendMode blend) { return Forth(kBlendModes, blend); }
v1::Evidence ToWire(display::Evidence evidence) { return Forth(kEvidence, evidence); }
v1::NotShown::Why ToWire(CommitOutcome::NotShown why) { return Forth(kWhys, why); }
v1::DisplayState ToWire(display::DisplayState state) { return Forth(kStates, state); }
v1::SweepLock ToWire(sync::SweepLock::State state) { return Forth(kSweepLocks, state); }
v1::PixelFormat ToWire(display::PixelFormat format) { return Forth(kFormats, format); }
v1::TestPattern ToWire(TestPattern pattern) { return Forth(kPatterns, pattern); }
v1::VolumeHeader::Source ToWire(display::DecodedVolume::Source source) {
  return Forth(kSources, source);
}

absl::StatusOr<Reason> FromWire(v1::Reason reason) { return Back(kReasons, reason, "reason"); }
absl::StatusOr<gpu::BlendMode> FromWire(v1::BlendMode blend) {
  return Back(kBlendModes, blend, "blend");
}
absl::StatusOr<display::Evidence> FromWire(v1::Evidence evidence) {
  return Back(kEvidence, evidence, "evidence");
}
absl::StatusOr<CommitOutcome::NotShown> FromWire(v1::NotShown::Why why) {
  return Back(kWhys, why, "why");
}
absl::StatusOr<display::DisplayState> FromWire(v1::DisplayState state) {
  return Back(kStates, state, "state");
}
absl::StatusOr<display::PixelFormat> FromWire(v1::PixelFormat format) {
  return Back(kFormats, format, "format");
}
absl::StatusOr<TestPattern> FromWire(v1::TestPattern pattern) {
  return Back(kPatterns, pattern, "test_pattern");
}
absl::StatusOr<display::DecodedVolume::Source> FromWire(v1::VolumeHeader::Source source) {
  return Back(kSources, source, "source");
}

}  // namespace voxeld::daemon::wire
