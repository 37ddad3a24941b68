// What one request names in place of payloads: found, checked, counted.
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

// A range costs its sender nothing, and what it names is copied: so there is a most that one
// request may name, whatever it names twice counted twice.
class NamedRanges {
 public:
  // `sources` outlive it.
  NamedRanges(const Sources& sources, const Limits& limits)
      : sources_(sources), limit_(limits.max_uncommitted_bytes) {}
  ~NamedRanges();
  NamedRanges(const NamedRanges&) = delete;
  NamedRanges& operator=(const NamedRanges&) = delete;

  // `path` is that of the MemoryRange. Its size has been compared with what is wanted, or is whatever there is.
  MaybeFault Read(const FieldPath& path, const v1::MemoryRange& range, MappedRange* out);

  uint64_t bytes_read() const { return bytes_read_; }

 private:
  const Sources& sources_;
  const uint64_t limit_;
  uint64_t bytes_read_ = 0;
  uint64_t charged_ = 0;  // of the budget, until the request is decoded
};

// The same, by what the decoder is given.
MaybeFault ReadRange(const FieldPath& path, const v1::MemoryRange& range,
                     const DecodeContext& context, MappedRange* out);

// Whether something beside its vertices (a texture's picture, samples, heights) is named by ranges.
bool NamesMore(const v1::Primitive& in);

// Puts what is named so in place, into a copy of `in`: so that whoever keeps it as it was sent keeps the bytes.
MaybeFault PutInPlace(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      v1::Primitive* out);

}  // namespace voxeld::daemon::wire
