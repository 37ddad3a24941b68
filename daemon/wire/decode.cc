#include "daemon/wire/decode.h"

#include <google/protobuf/arena.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/core/token.h"
#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "daemon/wire/element_count.h"
#include "daemon/wire/named_ranges.h"
#include "daemon/wire/operations.h"
#include "daemon/wire/skeleton.h"
#include "daemon/wire/slice_stream.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr size_t kClientNameBytes = 128;
constexpr uint64_t kAbsurd = 4;             // factor over the limit
constexpr uint64_t kLeastElementBytes = 2;  // its tag and its length
// Messages up to this size do not benefit from separating payloads, and this is roughly what they
// take when parsed.
constexpr uint64_t kSmallBytes = 2048;
constexpr size_t kArenaBytes = 4096;

absl::Status OpenError(const Fault& fault) {
  return absl::InvalidArgumentError(absl::StrCat(fault.field, " ", fault.message));
}

MaybeFault ToPolicy(const FieldPath& path, const v1::Open& in, const Limits& limits,
                    OpenOptions* out) {
  switch (in.on_disconnect()) {
    case v1::DISCONNECT_POLICY_UNSPECIFIED:
    case v1::DISCONNECT_POLICY_CLEAR:
      out->on_disconnect = DisconnectPolicy::kClear;
      break;
    case v1::DISCONNECT_POLICY_LINGER:
      out->on_disconnect = DisconnectPolicy::kLinger;
      break;
    case v1::DISCONNECT_POLICY_KEEP:
      out->on_disconnect = DisconnectPolicy::kKeep;
      break;
    default:
      return UnknownEnum(
          FieldPath(path, "on_disconnect"), in.on_disconnect(),
          "DISCONNECT_POLICY_CLEAR, DISCONNECT_POLICY_LINGER, DISCONNECT_POLICY_KEEP");
  }
  if (in.linger_ns() < 0 || in.linger_ns() > limits.max_linger_ns) {
    return Fault{
        FieldPath(path, "linger_ns").ToString(), Reason::kInvalidValue,
        absl::StrCat("is ", in.linger_ns(), "; give 0 to max_linger_ns, ", limits.max_linger_ns)};
  }
  if (in.linger_ns() != 0 && out->on_disconnect != DisconnectPolicy::kLinger) {
    return Fault{FieldPath(path, "linger_ns").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", in.linger_ns(),
                              "; it goes with on_disconnect = DISCONNECT_POLICY_LINGER only")};
  }
  out->linger_ns = in.linger_ns();
  return {};
}

MaybeFault ToFlow(const FieldPath& path, const v1::Open& in, const Limits& limits,
                  OpenOptions* out) {
  switch (in.flow()) {
    case v1::FLOW_POLICY_UNSPECIFIED:
    case v1::FLOW_POLICY_RELIABLE:
      out->flow = FlowPolicy::kReliable;
      break;
    case v1::FLOW_POLICY_LATEST:
      out->flow = FlowPolicy::kLatest;
      break;
    case v1::FLOW_POLICY_DROP_OLDEST:
      out->flow = FlowPolicy::kDropOldest;
      break;
    default:
      return UnknownEnum(FieldPath(path, "flow"), in.flow(),
                         "FLOW_POLICY_RELIABLE, FLOW_POLICY_LATEST, FLOW_POLICY_DROP_OLDEST");
  }
  const uint32_t frames = in.drop_oldest_frames();
  out->drop_oldest_frames = frames;
  if (out->flow != FlowPolicy::kDropOldest) {
    if (frames == 0) return {};
    return Fault{FieldPath(path, "drop_oldest_frames").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", frames, "; it goes with flow = FLOW_POLICY_DROP_OLDEST only")};
  }
  if (frames >= 1 && frames <= limits.max_drop_oldest_frames) return {};
  return Fault{FieldPath(path, "drop_oldest_frames").ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", frames, "; give 1 to max_drop_oldest_frames, ",
                            limits.max_drop_oldest_frames)};
}

MaybeFault CheckToken(const FieldPath& path, const std::string& token) {
  if (token.empty() || token.size() == kTokenBytes) return {};
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("has ", token.size(), " bytes; give the ", kTokenBytes,
                            " bytes of an Opened, or none")};
}

MaybeFault ToOpen(const FieldPath& path, const v1::Open& in, const Limits& limits,
                  OpenOptions* out) {
  if (auto fault = CheckLabel(FieldPath(path, "client_name"), in.client_name(), kClientNameBytes)) {
    return fault;
  }
  if (auto fault = ToPolicy(path, in, limits, out)) return fault;
  if (auto fault = CheckToken(FieldPath(path, "resume_token"), in.resume_token())) return fault;
  if (auto fault = CheckToken(FieldPath(path, "owner_token"), in.owner_token())) return fault;
  if (!in.resume_token().empty() && !in.owner_token().empty()) {
    return Fault{FieldPath(path, "owner_token").ToString(), Reason::kInvalidValue,
                 "is set beside resume_token, whose session has its owner; give one of them"};
  }
  if (auto fault = ToFlow(path, in, limits, out)) return fault;
  out->resume_token = in.resume_token();
  out->owner_token = in.owner_token();
  out->client_name = in.client_name();
  out->strict = in.strict();
  out->no_outcomes = in.no_outcomes();
  return {};
}

absl::Status TooManyOperations(uint64_t count, const Limits& limits) {
  return absl::InvalidArgumentError(
      absl::StrCat("operations has ", count, " elements; max_operations_per_commit allows ",
                   limits.max_operations_per_commit, ": send more updates that are smaller"));
}

struct ElementRow {
  const char* field;
  std::span<const int> path;
  uint64_t limit;
};

// Paths in an ApplyUpdateRequest; those in a StreamRequest omit the first field.
constexpr int kUpsertsPath[] = {v1::ApplyUpdateRequest::kOperationsFieldNumber,
                                v1::StreamRequest::kBatchFieldNumber,
                                v1::Batch::kUpsertsFieldNumber};
constexpr int kPartsPath[] = {
    v1::ApplyUpdateRequest::kOperationsFieldNumber, v1::StreamRequest::kDefineObjectFieldNumber,
    v1::DefineObject::kDefinitionFieldNumber, v1::Object::kPartsFieldNumber};

constexpr std::array<int, 4> ClipPath(int field) {
  return {v1::ApplyUpdateRequest::kOperationsFieldNumber, v1::StreamRequest::kLayerStateFieldNumber,
          v1::LayerState::kClipFieldNumber, field};
}
constexpr std::array<int, 4> kPlanesPath = ClipPath(v1::Clip::kPlanesFieldNumber);
constexpr std::array<int, 4> kBoxesPath = ClipPath(v1::Clip::kBoxesFieldNumber);
constexpr std::array<int, 4> kCylindersPath = ClipPath(v1::Clip::kCylindersFieldNumber);
constexpr uint64_t kMostPlanes = 1024;  // in one message; far beyond max_clip_planes

// Checks the numbers of elements before parsing. Slightly too many elements result in an Issue
// later. Far too many, which would be expensive to parse, end the stream or refuse the update.
absl::Status CheckElements(std::span<const std::string_view> slices, uint64_t size,
                           std::span<const ElementRow> rows) {
  for (const ElementRow& row : rows) {
    if (size / kLeastElementBytes / kAbsurd <= row.limit) continue;
    const uint64_t count = CountElements(slices, row.path);
    if (count / kAbsurd <= row.limit) continue;
    return absl::ResourceExhaustedError(
        absl::StrCat(row.field, " has ", count, " elements; ", row.limit, " are allowed"));
  }
  return absl::OkStatus();
}

absl::Status CheckUpdateElements(std::span<const std::string_view> slices, uint64_t size,
                                 const Limits& limits) {
  if (const uint64_t count = CountElements(slices, std::span(kUpsertsPath).first(1));
      count > limits.max_operations_per_commit) {
    return TooManyOperations(count, limits);
  }
  const uint64_t planes = std::max<uint64_t>(limits.max_operations_per_commit, kMostPlanes);
  // All operations together may contain as many entities as are allowed, or the parts of one
  // object.
  const ElementRow rows[] = {
      {"operations[].batch.upserts", kUpsertsPath, limits.max_operations_per_commit},
      {"operations[].define_object.definition.parts", kPartsPath,
       std::max(limits.max_operations_per_commit, limits.max_parts_per_object)},
      {"operations[].layer_state.clip.planes", kPlanesPath, planes},
      {"operations[].layer_state.clip.boxes", kBoxesPath, planes},
      {"operations[].layer_state.clip.cylinders", kCylindersPath, planes}};
  return CheckElements(slices, size, rows);
}

absl::Status CheckSize(std::span<const std::string_view> slices, const Limits& limits,
                       uint64_t* size) {
  *size = 0;
  for (const std::string_view slice : slices) *size += slice.size();
  if (*size <= limits.max_message_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      absl::StrCat("a message of ", *size, " bytes; max_message_bytes allows ",
                   limits.max_message_bytes, ": send more messages that are smaller"));
}

// A parsed message. Its payloads stay in the slices if that saves work.
template <typename Message>
class Parsed {
 public:
  absl::Status Parse(std::span<const std::string_view> slices, uint64_t size, Root root) {
    // The status contains everything; a client must not fill logs.
    const google::protobuf::LogSilencer silence;
    bare_ = size > kSmallBytes && MakeSkeleton(slices, root, &skeleton_);
    SliceStream stream(slices);
    if (bare_ ? message_->ParseFromString(skeleton_.bytes)
              : message_->ParseFromZeroCopyStream(&stream)) {
      return absl::OkStatus();
    }
    return absl::InvalidArgumentError(
        absl::StrCat("a message of ", size, " bytes is not a ", message_->GetTypeName(),
                     ": malformed protobuf, or text that is not UTF-8"));
  }

  const Message& message() const { return *message_; }
  const PayloadTable* payloads() const { return bare_ ? &skeleton_.payloads : nullptr; }

 private:
  static google::protobuf::ArenaOptions In(std::span<char> block) {
    google::protobuf::ArenaOptions options;
    options.initial_block = block.data();
    options.initial_block_size = block.size();
    return options;
  }

  alignas(std::max_align_t) char block_[kArenaBytes];  // uninitialised
  google::protobuf::Arena arena_{In(block_)};
  Message* const message_ = google::protobuf::Arena::CreateMessage<Message>(&arena_);
  Skeleton skeleton_;
  bool bare_ = false;  // payloads are separate
};

Decoded Failed(absl::Status status) {
  Decoded failed;
  failed.status = std::move(status);
  return failed;
}

// Numbers the request and decodes its operation. Requires: it is not an Open.
void Take(const FieldPath& path, const v1::StreamRequest& request, const DecodeContext& context,
          uint64_t previous_sequence, Decoded* out) {
  out->sequence = request.sequence() != 0 ? request.sequence() : previous_sequence + 1;
  if (out->sequence <= previous_sequence) {
    out->refused.Add({request.sequence(),
                      {},
                      {},
                      FieldPath(path, "sequence").ToString(),
                      Reason::kOutOfOrder,
                      absl::StrCat("sequence is ", request.sequence(), " after ", previous_sequence,
                                   "; numbers ascend, or are 0 to have the server count")},
                     context.limits.max_issues_per_commit);
    out->sequence = previous_sequence;
    if (request.op_case() != v1::StreamRequest::kCommit) return;
  }
  DecodeOperation(path, request, out->sequence, context, {&out->operations, &out->refused});
}

// `sources` supply the context's ranges.
Decoded Decode(const v1::StreamRequest& request, DecodeContext context, uint64_t previous_sequence,
               const Sources& sources) {
  Decoded out;
  if (request.op_case() == v1::StreamRequest::kOpen) {
    absl::StatusOr<OpenOptions> open = DecodeOpen(request.open(), context);
    if (!open.ok()) return Failed(open.status());
    out.open = *std::move(open);
    out.sequence = request.sequence() != 0 ? request.sequence() : previous_sequence + 1;
    return out;
  }
  if (request.op_case() == v1::StreamRequest::kPing) {
    out.ping_client_time_ns = request.ping().client_time_ns();
    out.sequence = std::max(request.sequence(), previous_sequence);
    return out;
  }
  NamedRanges ranges(sources, context.limits);
  context.ranges = &ranges;
  uint64_t decoded = 0;
  context.decoded_bytes = &decoded;
  Take(FieldPath(""), request, context, previous_sequence, &out);
  out.named_bytes = ranges.bytes_read();
  return out;
}

Decoded Decode(const v1::ApplyUpdateRequest& request, DecodeContext context,
               const Sources& sources) {
  Decoded out;
  NamedRanges ranges(sources, context.limits);
  context.ranges = &ranges;
  uint64_t decoded = 0;
  context.decoded_bytes = &decoded;
  if (const auto count = static_cast<uint64_t>(request.operations_size());
      count > context.limits.max_operations_per_commit) {
    return Failed(TooManyOperations(count, context));
  }
  absl::StatusOr<OpenOptions> open = DecodeOpen(request.open(), context);
  if (!open.ok()) return Failed(open.status());
  if (request.open().on_disconnect() == v1::DISCONNECT_POLICY_UNSPECIFIED) {
    open->on_disconnect = DisconnectPolicy::kKeep;
  }
  if (!open->resume_token.empty()) {
    return Failed(absl::InvalidArgumentError(
        "open.resume_token is set; an update is a session of its own, which takes up no other: "
        "give owner_token to join an owner"));
  }
  open->no_outcomes = true;  // the response cannot contain them
  open->resumable = false;   // nor tokens
  for (int i = 0; i < request.operations_size(); ++i) {
    const v1::StreamRequest& operation = request.operations(i);
    const FieldPath path("operations", i);
    if (operation.has_open() || operation.has_commit() || operation.has_ping()) {
      const char* field = operation.has_open()     ? "open"
                          : operation.has_commit() ? "commit"
                                                   : "ping";
      return Failed(absl::InvalidArgumentError(
          absl::StrCat(FieldPath(path, field).ToString(),
                       " is set; an update is opened by its own field and committed by itself, and "
                       "has no clock to compare")));
    }
    Take(path, operation, context, out.sequence, &out);
  }
  out.open = *std::move(open);
  out.operations.push_back({++out.sequence, Commit{}});
  out.named_bytes = ranges.bytes_read();
  return out;
}

}  // namespace

absl::StatusOr<OpenOptions> DecodeOpen(const v1::Open& open, const Limits& limits) {
  OpenOptions options;
  if (auto fault = ToOpen(FieldPath("open"), open, limits, &options)) return OpenError(*fault);
  return options;
}

Decoded DecodeStreamRequest(const v1::StreamRequest& request, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool, const Sources& sources,
                            text::Fonts* fonts) {
  return Decode(request, {limits, pool, nullptr, nullptr, fonts}, previous_sequence, sources);
}

Decoded DecodeStreamRequest(std::span<const std::string_view> slices, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool, const Sources& sources,
                            text::Fonts* fonts) {
  uint64_t size = 0;
  if (absl::Status status = CheckSize(slices, limits, &size); !status.ok()) return Failed(status);
  const ElementRow rows[] = {
      {"batch.upserts", std::span(kUpsertsPath).subspan(1), limits.max_operations_per_commit},
      {"define_object.definition.parts", std::span(kPartsPath).subspan(1),
       limits.max_parts_per_object},
      {"layer_state.clip.planes", std::span(kPlanesPath).subspan(1), kMostPlanes},
      {"layer_state.clip.boxes", std::span(kBoxesPath).subspan(1), kMostPlanes},
      {"layer_state.clip.cylinders", std::span(kCylindersPath).subspan(1), kMostPlanes}};
  if (absl::Status status = CheckElements(slices, size, rows); !status.ok()) return Failed(status);
  Parsed<v1::StreamRequest> parsed;
  if (absl::Status status = parsed.Parse(slices, size, Root::kStreamRequest); !status.ok()) {
    return Failed(status);
  }
  return Decode(parsed.message(), {limits, pool, parsed.payloads(), nullptr, fonts},
                previous_sequence, sources);
}

Decoded DecodeUpdate(std::span<const std::string_view> slices, const Limits& limits,
                     gpu::BulkPool* pool, const Sources& sources, text::Fonts* fonts) {
  uint64_t size = 0;
  if (absl::Status status = CheckSize(slices, limits, &size); !status.ok()) return Failed(status);
  if (absl::Status status = CheckUpdateElements(slices, size, limits); !status.ok()) {
    return Failed(status);
  }
  Parsed<v1::ApplyUpdateRequest> parsed;
  if (absl::Status status = parsed.Parse(slices, size, Root::kApplyUpdateRequest); !status.ok()) {
    return Failed(status);
  }
  return Decode(parsed.message(), {limits, pool, parsed.payloads(), nullptr, fonts}, sources);
}

Decoded DecodeUpdate(const v1::ApplyUpdateRequest& request, const Limits& limits,
                     gpu::BulkPool* pool, const Sources& sources, text::Fonts* fonts) {
  return Decode(request, {limits, pool, nullptr, nullptr, fonts}, sources);
}

}  // namespace voxeld::daemon::wire
