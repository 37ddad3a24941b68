// Finds, checks and counts the ranges that one request names in place of payloads.
#pragma once

#include <cstdint>

#include "daemon/wire/check.h"
#include "daemon/wire/memory_source.h"

namespace voxeld::v1 {
class MemoryRange;
class Primitive;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

struct DecodeContext;

// Naming a range costs the sender nothing, but its bytes are copied. One request may therefore name
// a limited number of bytes; ranges that are named twice count twice.
class NamedRanges {
 public:
  // `sources` must outlive this object.
  NamedRanges(const Sources& sources, const Limits& limits)
      : sources_(sources), limit_(limits.max_uncommitted_bytes) {}
  ~NamedRanges();
  NamedRanges(const NamedRanges&) = delete;
  NamedRanges& operator=(const NamedRanges&) = delete;

  // `path` is that of the MemoryRange. The caller has checked its size, or accepts any.
  MaybeFault Read(const FieldPath& path, const v1::MemoryRange& range, MappedRange* out);

  uint64_t bytes_read() const { return bytes_read_; }

 private:
  const Sources& sources_;
  const uint64_t limit_;
  uint64_t bytes_read_ = 0;
  uint64_t charged_ = 0;  // charged to the budget until the request is decoded
};

// Does the same with the context's ranges.
MaybeFault ReadRange(const FieldPath& path, const v1::MemoryRange& range,
                     const DecodeContext& context, MappedRange* out);

// Returns: whether ranges name something other than vertices (a texture's picture, samples,
// heights).
bool NamesMore(const v1::Primitive& in);

// Copies `in` and inserts the named bytes, so that a primitive that is kept as it was sent includes
// them.
MaybeFault PutInPlace(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      v1::Primitive* out);

}  // namespace voxeld::daemon::wire
