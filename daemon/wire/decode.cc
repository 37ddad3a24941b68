#include "daemon/wire/decode.h"

#include <google/protobuf/arena.h>
#include <google/protobuf/stubs/logging.h>

#include <algorithm>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/check.h"
#include "daemon/wire/element_count.h"
#include "daemon/wire/local_ranges.h"
#include "daemon/wire/operations.h"
#include "daemon/wire/slice_stream.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr size_t kClientNameBytes = 128;
constexpr uint64_t kAbsurd = 4;  // times what is allowed

absl::Status OpenError(const Fault& fault) {
  const std::string text = absl::StrCat(fault.field, " ", fault.message);
  return fault.reason == Reason::kUnimplemented ? absl::UnimplementedError(text)
                                                : absl::InvalidArgumentError(text);
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

MaybeFault CheckFlow(const FieldPath& path, const v1::Open& in) {
  switch (in.flow()) {
    case v1::FLOW_POLICY_UNSPECIFIED:
    case v1::FLOW_POLICY_RELIABLE:
      break;
    case v1::FLOW_POLICY_LATEST:
    case v1::FLOW_POLICY_DROP_OLDEST:
      return Unimplemented(FieldPath(path, "flow"),
                           "every frame waits its turn; use FLOW_POLICY_RELIABLE");
    default:
      return UnknownEnum(FieldPath(path, "flow"), in.flow(), "FLOW_POLICY_RELIABLE");
  }
  if (in.drop_oldest_frames() == 0) return {};
  return Fault{FieldPath(path, "drop_oldest_frames").ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", in.drop_oldest_frames(),
                            "; it goes with flow = FLOW_POLICY_DROP_OLDEST only")};
}

MaybeFault ToOpen(const FieldPath& path, const v1::Open& in, const Limits& limits,
                  OpenOptions* out) {
  if (auto fault = CheckLabel(FieldPath(path, "client_name"), in.client_name(), kClientNameBytes)) {
    return fault;
  }
  if (auto fault = ToPolicy(path, in, limits, out)) return fault;
  if (!in.resume_token().empty()) {
    return Unimplemented(FieldPath(path, "resume_token"),
                         "every stream is a session of its own; leave it empty");
  }
  if (auto fault = CheckFlow(path, in)) return fault;
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

// Of an ApplyUpdateRequest; those of a StreamRequest leave out the first.
constexpr int kUpsertsPath[] = {v1::ApplyUpdateRequest::kOperationsFieldNumber,
                                v1::StreamRequest::kBatchFieldNumber,
                                v1::Batch::kUpsertsFieldNumber};
constexpr int kPartsPath[] = {
    v1::ApplyUpdateRequest::kOperationsFieldNumber, v1::StreamRequest::kDefineObjectFieldNumber,
    v1::DefineObject::kDefinitionFieldNumber, v1::Object::kPartsFieldNumber};

// Before anything is parsed. A little too many elements are an Issue, later; so many that to unfold
// them would be a burden end the stream, or refuse the update.
absl::Status CheckElements(std::span<const std::string_view> slices,
                           std::span<const ElementRow> rows) {
  for (const ElementRow& row : rows) {
    const uint64_t count = CountElements(slices, row.path);
    if (count / kAbsurd <= row.limit) continue;
    return absl::ResourceExhaustedError(
        absl::StrCat(row.field, " has ", count, " elements; ", row.limit, " are allowed"));
  }
  return absl::OkStatus();
}

absl::Status CheckUpdateElements(std::span<const std::string_view> slices, const Limits& limits) {
  if (const uint64_t count = CountElements(slices, std::span(kUpsertsPath).first(1));
      count > limits.max_operations_per_commit) {
    return TooManyOperations(count, limits);
  }
  // Together they may be as many as are allowed of entities, or of one object's parts.
  const ElementRow rows[] = {
      {"operations[].batch.upserts", kUpsertsPath, limits.max_operations_per_commit},
      {"operations[].define_object.definition.parts", kPartsPath,
       std::max(limits.max_operations_per_commit, limits.max_parts_per_object)}};
  return CheckElements(slices, rows);
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

absl::Status Parse(std::span<const std::string_view> slices, uint64_t size, const char* type,
                   google::protobuf::Message* out) {
  SliceStream stream(slices);
  // The status says it all; a client must not fill logs.
  const google::protobuf::LogSilencer silence;
  if (out->ParseFromZeroCopyStream(&stream)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("a message of ", size, " bytes is not a voxeld.v1.", type,
                   ": malformed protobuf, or text that is not UTF-8"));
}

Decoded Failed(absl::Status status) {
  Decoded failed;
  failed.status = std::move(status);
  return failed;
}

// Numbers the request and takes its operation. An Open has been dealt with.
void Take(const FieldPath& path, const v1::StreamRequest& request, const Limits& limits,
          uint64_t previous_sequence, LocalRanges& ranges, Decoded* out) {
  out->sequence = request.sequence() != 0 ? request.sequence() : previous_sequence + 1;
  if (out->sequence <= previous_sequence) {
    out->refused.Add({request.sequence(),
                      {},
                      {},
                      FieldPath(path, "sequence").ToString(),
                      Reason::kOutOfOrder,
                      absl::StrCat("sequence is ", request.sequence(), " after ", previous_sequence,
                                   "; numbers ascend, or are 0 to have the server count")},
                     limits.max_issues_per_commit);
    out->sequence = previous_sequence;
    if (request.op_case() != v1::StreamRequest::kCommit) return;
  }
  DecodeOperation(path, request, out->sequence, limits, {&out->operations, &out->refused}, ranges);
}

}  // namespace

absl::StatusOr<OpenOptions> DecodeOpen(const v1::Open& open, const Limits& limits) {
  OpenOptions options;
  if (auto fault = ToOpen(FieldPath("open"), open, limits, &options)) return OpenError(*fault);
  return options;
}

Decoded DecodeStreamRequest(const v1::StreamRequest& request, const Limits& limits,
                            uint64_t previous_sequence, const MemorySource* memory) {
  Decoded out;
  if (request.op_case() == v1::StreamRequest::kOpen) {
    absl::StatusOr<OpenOptions> open = DecodeOpen(request.open(), limits);
    if (!open.ok()) return Failed(open.status());
    out.open = *std::move(open);
    out.sequence = request.sequence() != 0 ? request.sequence() : previous_sequence + 1;
    return out;
  }
  LocalRanges ranges(memory, limits);
  Take(FieldPath(""), request, limits, previous_sequence, ranges, &out);
  out.local_bytes = ranges.bytes_read();
  return out;
}

Decoded DecodeStreamRequest(std::span<const std::string_view> slices, const Limits& limits,
                            uint64_t previous_sequence, const MemorySource* memory) {
  uint64_t size = 0;
  if (absl::Status status = CheckSize(slices, limits, &size); !status.ok()) return Failed(status);
  const ElementRow rows[] = {
      {"batch.upserts", std::span(kUpsertsPath).subspan(1), limits.max_operations_per_commit},
      {"define_object.definition.parts", std::span(kPartsPath).subspan(1),
       limits.max_parts_per_object}};
  if (absl::Status status = CheckElements(slices, rows); !status.ok()) return Failed(status);
  google::protobuf::Arena arena;
  auto* request = google::protobuf::Arena::CreateMessage<v1::StreamRequest>(&arena);
  if (absl::Status status = Parse(slices, size, "StreamRequest", request); !status.ok()) {
    return Failed(status);
  }
  return DecodeStreamRequest(*request, limits, previous_sequence, memory);
}

Decoded DecodeUpdate(std::span<const std::string_view> slices, const Limits& limits) {
  uint64_t size = 0;
  if (absl::Status status = CheckSize(slices, limits, &size); !status.ok()) return Failed(status);
  if (absl::Status status = CheckUpdateElements(slices, limits); !status.ok()) {
    return Failed(status);
  }
  google::protobuf::Arena arena;
  auto* request = google::protobuf::Arena::CreateMessage<v1::ApplyUpdateRequest>(&arena);
  if (absl::Status status = Parse(slices, size, "ApplyUpdateRequest", request); !status.ok()) {
    return Failed(status);
  }
  return DecodeUpdate(*request, limits);
}

Decoded DecodeUpdate(const v1::ApplyUpdateRequest& request, const Limits& limits) {
  Decoded out;
  if (const auto count = static_cast<uint64_t>(request.operations_size());
      count > limits.max_operations_per_commit) {
    return Failed(TooManyOperations(count, limits));
  }
  absl::StatusOr<OpenOptions> open = DecodeOpen(request.open(), limits);
  if (!open.ok()) return Failed(open.status());
  if (request.open().on_disconnect() == v1::DISCONNECT_POLICY_UNSPECIFIED) {
    open->on_disconnect = DisconnectPolicy::kKeep;
  }
  open->no_outcomes = true;  // the answer has no place for them
  LocalRanges no_ranges(nullptr, limits);
  for (int i = 0; i < request.operations_size(); ++i) {
    const v1::StreamRequest& operation = request.operations(i);
    const FieldPath path("operations", i);
    if (operation.has_open() || operation.has_commit()) {
      return Failed(absl::InvalidArgumentError(
          absl::StrCat(FieldPath(path, operation.has_open() ? "open" : "commit").ToString(),
                       " is set; an update is opened by its own field and committed by itself")));
    }
    Take(path, operation, limits, out.sequence, no_ranges, &out);
  }
  out.open = *std::move(open);
  out.operations.push_back({++out.sequence, Commit{}});
  return out;
}

}  // namespace voxeld::daemon::wire
