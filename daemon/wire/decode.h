// Bytes of the wire into operations of the core: parsed, and checked in all
// that needs no knowledge of the scene. Apart from gRPC, so that it can be fuzzed,
// simulated and fed from a file. Reentrant.
//
// A fault refuses the smallest thing that it is in: one operation, or one entity of a Batch. It
// becomes an Issue with the path of the field, the value and what would be right. Only bytes that
// are no message at all end a stream.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/scene/operation.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::gpu {
class BulkPool;
}

namespace voxeld::v1 {
class ApplyUpdateRequest;
class Open;
class StreamRequest;
}  // namespace voxeld::v1

namespace voxeld::text {
class Fonts;
}

namespace voxeld::daemon::wire {

struct Decoded {
  absl::Status status;              // not OK: nothing else is set, and the stream cannot go on
  std::optional<OpenOptions> open;  // the message was an Open
  std::vector<Operation> operations;
  Refusals refused;
  std::optional<int64_t> ping_client_time_ns;  // the message was a Ping
  uint64_t sequence = 0;                       // of the last request
  uint64_t named_bytes = 0;  // copied from local memory and assets, beside the message's own bytes
};

// One StreamRequest. The large arrays of primitives go to `pool` (null: ordinary memory), copied
// once, from the slices. `previous_sequence` is that of the request before (0: none): a request without
// a number gets the next one, and one that does not ascend is refused.
//
// A Commit is passed on whatever is wrong with it, after an Issue, so that it is answered like
// every other: its receipt counts the refusal, or refuses it if the session is strict.
//
// `sources` are what its ranges name (none: they are refused); what they name has been copied when
// the call returns. All that one request names is at most max_uncommitted_bytes.
//
// Status: InvalidArgument (not a StreamRequest; an Open that cannot be taken),
// ResourceExhausted (greater than max_message_bytes),
// Unimplemented (an Open that asks for what this version has not).
Decoded DecodeStreamRequest(std::span<const std::string_view> slices, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool = nullptr,
                            const Sources& sources = {}, text::Fonts* fonts = nullptr);

// The same for a request that is parsed already.
Decoded DecodeStreamRequest(const v1::StreamRequest& request, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool = nullptr,
                            const Sources& sources = {}, text::Fonts* fonts = nullptr);

// An ApplyUpdateRequest: `open` is always set (KEEP unless it says otherwise), the operations end
// with a Commit of frame 0, and the fields of issues begin with "operations[i].". It has no local
// memory.
//
// Status: as above, and InvalidArgument for more than max_operations_per_commit operations.
Decoded DecodeUpdate(std::span<const std::string_view> slices, const Limits& limits,
                     gpu::BulkPool* pool = nullptr, const Sources& sources = {},
                     text::Fonts* fonts = nullptr);

// The same for a request that is parsed already.
Decoded DecodeUpdate(const v1::ApplyUpdateRequest& request, const Limits& limits,
                     gpu::BulkPool* pool = nullptr, const Sources& sources = {},
                     text::Fonts* fonts = nullptr);

absl::StatusOr<OpenOptions> DecodeOpen(const v1::Open& open, const Limits& limits);

}  // namespace voxeld::daemon::wire
