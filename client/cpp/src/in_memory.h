// Moves bulk content of requests into memory beside the stream (docs/local-socket.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "client/cpp/src/wire.h"

namespace voxeld::client {

// Payloads smaller than this, of entities and of objects' parts with vertices, stay in the message.
inline constexpr size_t kMemoryBytes = 64 << 10;

struct InMemory {
  Rope request;  // the request, with ranges of the memory in place of payloads
  Rope memory;   // the memory's content; shares the payloads
};

// `request` is a v1.StreamRequest as encoded here. Returns nothing if it has no such payload.
std::optional<InMemory> MoveToMemory(const Rope& request, uint64_t memory_id);

}  // namespace voxeld::client
