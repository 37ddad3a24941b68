// Encodes persistent state as bytes (state.proto), and decodes it. Reentrant.
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

// Both clocks at one moment: lifetimes use the monotonic clock in memory and Unix time on disk.
struct TwoClocks {
  sync::TimeNs monotonic_ns = 0;
  int64_t unix_ns = 0;
};

std::string EncodeKept(const OwnerRecord& owner);
std::string EncodeKept(const OwnedName& key, const Layer& layer);
std::string EncodeKept(const Object& object);
// Errors: ResourceExhausted for content that does not fit into a row (900 MiB).
absl::StatusOr<std::string> EncodeKept(const Entity& entity, const TwoClocks& now);

// `pool` and `fonts` are as for DecodeStreamRequest. Errors: DataLoss for malformed bytes,
// InvalidArgument for content that the limits refuse.
absl::StatusOr<OwnerRecord> DecodeKeptOwner(std::string_view bytes);

struct KeptLayerRow {
  uint64_t number = 0;  // assigned on creation
  std::string client_name;
  Operation operation;
};
absl::StatusOr<KeptLayerRow> DecodeKeptLayer(std::string_view bytes, const Limits& limits);

struct KeptObjectRow {
  Operation operation;
  std::vector<std::string> refers_to;  // names of objects
};
absl::StatusOr<KeptObjectRow> DecodeKeptObject(const std::string& name, std::string_view bytes,
                                               const Limits& limits, gpu::BulkPool* pool,
                                               text::Fonts* fonts);

// Returns: nothing if the entity has expired.
absl::StatusOr<std::optional<Operation>> DecodeKeptEntity(
    const std::string& layer, const std::string& id, std::string_view bytes, const TwoClocks& now,
    const Limits& limits, gpu::BulkPool* pool, text::Fonts* fonts);

}  // namespace voxeld::daemon::wire
