// Encodes operations as bytes of v1.StreamRequest. Payloads are the last field of each message that
// has them, so that large ones are never moved.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cpp/src/operation.h"
#include "client/cpp/src/wire.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

// Entities are combined into one message until it has this many bytes; a larger entity is sent
// alone.
inline constexpr size_t kBatchBytes = 192 << 10;

// Encodes a shape as a v1.Primitive. Views are copied; what the arrays own is shared. Errors:
// InvalidArgument if an array's size does not fit, with its name, its size, and what is expected.
absl::StatusOr<Rope> EncodePrimitive(const Shape& shape, Color color,
                                     const std::optional<ColorScale>& scale = std::nullopt);
absl::StatusOr<DefineOperation> EncodeDefinition(std::string object,
                                                 const std::vector<Part>& parts);

// Encodes a request without its sequence, which AddSequence prepends.
Rope EncodeOperation(const Operation& operation);
Rope EncodeFrameBegin(std::string_view layer);
Rope EncodeFrameEnd(std::string_view layer);

// Combines upserts, in their order, into batches. A batch holds at most one upsert per entity, so
// that (sequence, layer, id) identifies it.
class Batcher {
 public:
  struct Message {
    Rope bytes;
    size_t upserts = 0;
  };
  explicit Batcher(size_t most_bytes = kBatchBytes) : most_bytes_(most_bytes) {}
  void Add(const UpsertOperation& upsert);
  // Returns all messages and empties the batcher.
  std::vector<Message> Take();

 private:
  void Flush();
  const size_t most_bytes_;
  Rope open_;
  std::unordered_set<size_t> entities_;  // entities in `open_`, by their hashes
  size_t upserts_ = 0;                   // upserts in `open_`
  std::vector<Message> messages_;
};

struct CommitRecord {
  uint64_t frame_id = 0;
  int64_t send_time_ns = 0;
  int64_t present_at_ns = 0;
  bool must_show = false;
  bool durable = false;
  uint64_t client_drops = 0;
};
Rope EncodeCommit(const CommitRecord& commit);
Rope EncodePing(int64_t client_time_ns);

void AddSequence(uint64_t sequence, Rope* request);

}  // namespace voxeld::client
