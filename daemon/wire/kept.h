// What is kept over the daemon's end, as bytes (state.proto), and back. Reentrant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/core/state_sink.h"
#include "daemon/scene/operation.h"
#include "daemon/scene/snapshot.h"

namespace voxeld::gpu {
class BulkPool;
}
namespace voxeld::text {
class Fonts;
}

namespace voxeld::daemon::wire {

// Both clocks at one moment: lifetimes count by the monotonic one, and are kept by the other.
struct TwoClocks {
  sync::TimeNs monotonic_ns = 0;
  int64_t unix_ns = 0;
};

std::string EncodeKept(const OwnerRecord& owner);
std::string EncodeKept(const OwnedName& key, const Layer& layer);
std::string EncodeKept(const Object& object);
// ResourceExhausted for contents that no row can hold (900 MiB).
absl::StatusOr<std::string> EncodeKept(const Entity& entity, const TwoClocks& now);

// Bytes that are none are DataLoss. `pool` and `fonts` as DecodeStreamRequest has them; what limits refuse
// is InvalidArgument.
absl::StatusOr<OwnerRecord> DecodeKeptOwner(std::string_view bytes);

struct KeptLayerRow {
  uint64_t number = 0;  // of its making
  std::string client_name;
  Operation operation;
};
absl::StatusOr<KeptLayerRow> DecodeKeptLayer(std::string_view bytes, const Limits& limits);

struct KeptObjectRow {
  Operation operation;
  std::vector<std::string> refers_to;  // objects
};
absl::StatusOr<KeptObjectRow> DecodeKeptObject(const std::string& name, std::string_view bytes,
                                               const Limits& limits, gpu::BulkPool* pool,
                                               text::Fonts* fonts);

// Nothing: its time is over.
absl::StatusOr<std::optional<Operation>> DecodeKeptEntity(
    const std::string& layer, const std::string& id, std::string_view bytes, const TwoClocks& now,
    const Limits& limits, gpu::BulkPool* pool, text::Fonts* fonts);

}  // namespace voxeld::daemon::wire
