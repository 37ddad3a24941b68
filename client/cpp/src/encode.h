// Operations as bytes of v1.StreamRequest. Payloads come last in whatever holds them, so that large
// ones are never moved about.
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

// Entities are gathered into one message until it has this many bytes; one that is larger goes alone.
inline constexpr size_t kBatchBytes = 192 << 10;

// InvalidArgument if an array's size does not fit: says which, its size, and what would be right.
// Views are copied; what the arrays own is shared.
absl::StatusOr<Rope> EncodePrimitive(const Shape& shape, Color color,
                                     const std::optional<ColorScale>& scale = std::nullopt);
absl::StatusOr<DefineOperation> EncodeDefinition(std::string object,
                                                 const std::vector<Part>& parts);

// A request without its sequence, which AddSequence puts in front.
Rope EncodeOperation(const Operation& operation);
Rope EncodeFrameBegin(std::string_view layer);
Rope EncodeFrameEnd(std::string_view layer);

// Upserts in their order, as batches. Of one entity there is one in each, so that (sequence, layer, id)
// names it.
class Batcher {
 public:
  struct Message {
    Rope bytes;
    size_t upserts = 0;
  };
  explicit Batcher(size_t most_bytes = kBatchBytes) : most_bytes_(most_bytes) {}
  void Add(const UpsertOperation& upsert);
  // All messages; it is empty again.
  std::vector<Message> Take();

 private:
  void Flush();
  const size_t most_bytes_;
  Rope open_;
  std::unordered_set<size_t> entities_;  // in `open_`, by their hashes
  size_t upserts_ = 0;                   // in `open_`
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
