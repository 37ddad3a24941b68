// Operations as bytes of v1.StreamRequest. Payloads come last in whatever holds them, so that large
// ones are never moved about.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
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
absl::StatusOr<Rope> EncodePrimitive(const Shape& shape, Color color);
absl::StatusOr<DefineOperation> EncodeDefinition(std::string object,
                                                 const std::vector<Part>& parts);

// A request without its sequence, which AddSequence puts in front.
Rope EncodeOperation(const Operation& operation);
Rope EncodeFrameBegin(std::string_view layer);
Rope EncodeFrameEnd(std::string_view layer);

// Upserts in their order, as batches.
class Batcher {
 public:
  void Add(const UpsertOperation& upsert);
  // All messages; it is empty again.
  std::vector<Rope> Take();

 private:
  void Flush();
  Rope open_;
  std::vector<Rope> messages_;
};

struct CommitRecord {
  uint64_t frame_id = 0;
  int64_t send_time_ns = 0;
  int64_t present_at_ns = 0;
  bool must_show = false;
  uint64_t client_drops = 0;
};
Rope EncodeCommit(const CommitRecord& commit);
Rope EncodePing(int64_t client_time_ns);

void AddSequence(uint64_t sequence, Rope* request);

}  // namespace voxeld::client
