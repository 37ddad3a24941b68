// Requests whose bulk content lies in memory beside the stream (docs/local-socket.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "client/cpp/src/wire.h"

namespace voxeld::client {

// The payloads of entities and of objects' parts with vertices of less than this stay in the message.
inline constexpr size_t kMemoryBytes = 64 << 10;

struct InMemory {
  Rope request;  // with ranges of the memory in place of payloads
  Rope memory;   // what it is to hold; shares the payloads
};

// `request`: a v1.StreamRequest as it was encoded here. Nothing if there is no such payload in it.
std::optional<InMemory> MoveToMemory(const Rope& request, uint64_t memory_id);

}  // namespace voxeld::client
