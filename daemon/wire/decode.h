// Decodes messages of the protocol into operations of the core. Parses them and checks everything
// that does not depend on the scene. Independent of gRPC, so that it can be fuzzed, simulated and
// used with files. Reentrant.
//
// A fault refuses the smallest unit that contains it: one operation, or one entity of a Batch. It
// becomes an Issue with the path of the field, the value and the remedy. A stream ends only if the
// bytes cannot be parsed.
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
  absl::Status status;              // not OK: nothing else is set, and the stream must end
  std::optional<OpenOptions> open;  // the message was an Open
  std::vector<Operation> operations;
  Refusals refused;
  std::optional<int64_t> ping_client_time_ns;  // the message was a Ping
  uint64_t sequence = 0;                       // of the last request
  uint64_t named_bytes = 0;  // copied from local memory and assets, beside the message itself
};

// Decodes one StreamRequest. The large arrays of primitives are copied once, from the slices to
// `pool` (null: the heap). `previous_sequence` is the number of the previous request (0: none). A
// request without a number gets the next one; a number that does not ascend is refused.
//
// A faulty Commit adds an Issue and is passed on, so that it is answered like any other: its
// receipt counts the refusal, or refuses it if the session is strict.
//
// `sources` supply the named ranges (null: these are refused), which have been copied when the call
// returns. The ranges of one request may have at most max_uncommitted_bytes together.
//
// Errors: InvalidArgument (not a StreamRequest; an invalid Open), ResourceExhausted (larger than
// max_message_bytes), Unimplemented (an Open that requests an unsupported feature).
Decoded DecodeStreamRequest(std::span<const std::string_view> slices, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool = nullptr,
                            const Sources& sources = {}, text::Fonts* fonts = nullptr);

// Does the same for a parsed request.
Decoded DecodeStreamRequest(const v1::StreamRequest& request, const Limits& limits,
                            uint64_t previous_sequence, gpu::BulkPool* pool = nullptr,
                            const Sources& sources = {}, text::Fonts* fonts = nullptr);

// Decodes an ApplyUpdateRequest. `open` is always set (KEEP by default). The operations end with a
// Commit whose commit id is 0. The fields of issues begin with "operations[i].". Local memory
// is not available.
//
// Errors: as above, and InvalidArgument for more than max_operations_per_commit operations.
Decoded DecodeUpdate(std::span<const std::string_view> slices, const Limits& limits,
                     gpu::BulkPool* pool = nullptr, const Sources& sources = {},
                     text::Fonts* fonts = nullptr);

// Does the same for a parsed request.
Decoded DecodeUpdate(const v1::ApplyUpdateRequest& request, const Limits& limits,
                     gpu::BulkPool* pool = nullptr, const Sources& sources = {},
                     text::Fonts* fonts = nullptr);

absl::StatusOr<OpenOptions> DecodeOpen(const v1::Open& open, const Limits& limits);

}  // namespace voxeld::daemon::wire
