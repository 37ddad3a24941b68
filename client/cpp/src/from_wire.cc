#include "client/cpp/src/from_wire.h"

#include "absl/strings/str_cat.h"

namespace voxeld::client {
namespace {

std::string_view Why(v1::NotShown::Why why) {
  switch (why) {
    case v1::NotShown::ABSENT:
      return "absent";
    case v1::NotShown::REMOVED:
      return "removed";
    case v1::NotShown::BLANKED:
      return "blanked";
    case v1::NotShown::HIDDEN:
      return "hidden";
    default:
      return "not known";
  }
}

}  // namespace

Stages FromWire(const v1::Stages& s) {
  return {.sent_ns = s.sent_ns(),
          .received_ns = s.received_ns(),
          .decoded_ns = s.decoded_ns(),
          .applied_ns = s.applied_ns(),
          .drawing_ns = s.drawing_ns(),
          .assembled_ns = s.assembled_ns(),
          .sliced_ns = s.sliced_ns(),
          .transferred_ns = s.transferred_ns(),
          .shown_ns = s.shown_ns()};
}

Issue FromWire(const v1::Issue& issue) {
  // The numbers are the same; those of a newer server are unknown here.
  const int reason = issue.reason();
  return {.frame = 0,
          .sequence = issue.sequence(),
          .layer = issue.layer(),
          .id = issue.id(),
          .field = issue.field(),
          .reason = reason >= 0 && reason <= static_cast<int>(Reason::kTimedOut)
                        ? static_cast<Reason>(reason)
                        : Reason::kUnspecified,
          .message = issue.message(),
          .applied = issue.applied()};
}

Outcome FromWire(const v1::Outcome& outcome) {
  Outcome out;
  out.display = outcome.display();
  switch (outcome.what_case()) {
    case v1::Outcome::kPresented:
      out.kind = Outcome::Kind::kPresented;
      out.volume = outcome.presented().volume();
      out.time_ns = outcome.presented().time_ns();
      out.measured = outcome.presented().evidence() == v1::EVIDENCE_DEVICE;
      out.last_byte_ns = outcome.presented().last_byte_ns();
      out.stages = FromWire(outcome.presented().stages());
      break;
    case v1::Outcome::kUnchanged:
      out.kind = Outcome::Kind::kUnchanged;
      out.volume = outcome.unchanged().volume();
      break;
    case v1::Outcome::kSuperseded:
      out.kind = Outcome::Kind::kSuperseded;
      out.by_frame = outcome.superseded().by_frame_id();
      break;
    case v1::Outcome::kLost:
      out.kind = Outcome::Kind::kLost;
      out.reason = outcome.lost().reason();
      break;
    case v1::Outcome::kNotShown:
      out.kind = Outcome::Kind::kNotShown;
      out.reason = Why(outcome.not_shown().why());
      break;
    case v1::Outcome::WHAT_NOT_SET:
      out.kind = Outcome::Kind::kNotShown;
      out.reason = "the server did not say";
      break;
  }
  return out;
}

ServerInfo FromWire(const v1::Opened& opened) {
  const v1::Limits& limits = opened.limits();
  return {.session = opened.session(),
          .owner = opened.owner(),
          .version = opened.server_version(),
          .owner_token = opened.owner_token(),
          .displays = {opened.displays().begin(), opened.displays().end()},
          .limits = {.max_message_bytes = limits.max_message_bytes(),
                     .max_vertices_per_entity = limits.max_vertices_per_entity(),
                     .max_indices_per_entity = limits.max_indices_per_entity(),
                     .max_operations_per_commit = limits.max_operations_per_commit(),
                     .max_uncommitted_bytes = limits.max_uncommitted_bytes(),
                     .max_parts_per_object = limits.max_parts_per_object(),
                     .max_timed_commits = limits.max_timed_commits(),
                     .max_present_at_horizon_ns = limits.max_present_at_horizon_ns(),
                     .max_asset_bytes = limits.max_asset_bytes()}};
}

std::string_view ReasonName(Reason reason) {
  static constexpr std::string_view kNames[] = {
      "REASON_UNSPECIFIED",    "REASON_INVALID_VALUE",
      "REASON_SIZE_MISMATCH",  "REASON_INDEX_OUT_OF_RANGE",
      "REASON_QUOTA_EXCEEDED", "REASON_NOT_FOUND",
      "REASON_ALREADY_EXISTS", "REASON_IN_USE",
      "REASON_CYCLE",          "REASON_SINGULAR_TRANSFORM",
      "REASON_OUT_OF_RANGE",   "REASON_STALE_SEQUENCE",
      "REASON_OUT_OF_ORDER",   "REASON_PERMISSION_DENIED",
      "REASON_UNIMPLEMENTED",  "REASON_TIMED_OUT"};
  return kNames[static_cast<size_t>(reason)];
}

std::string DescribeIssue(const Issue& issue) {
  std::string text = issue.layer;
  if (!issue.id.empty()) absl::StrAppend(&text, "/", issue.id);
  if (!issue.field.empty()) absl::StrAppend(&text, text.empty() ? "" : ", ", issue.field);
  if (!text.empty()) text += ": ";
  return text + issue.message;
}

}  // namespace voxeld::client
