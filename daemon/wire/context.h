// Inputs that all parts of the decoder share.
#pragma once

#include <vector>

#include "daemon/scene/operation.h"
#include "daemon/wire/check.h"
#include "daemon/wire/named_ranges.h"
#include "daemon/wire/payload.h"
#include "gpu/bulk/bulk_pool.h"

namespace voxeld::text {
class Fonts;
}

namespace voxeld::daemon::wire {

struct DecodeContext {
  const Limits& limits;
  gpu::BulkPool* pool = nullptr;  // memory for large arrays; null: the heap
  // Payloads to which bytes fields of Vertices refer; null: the fields contain the bytes.
  const PayloadTable* payloads = nullptr;
  NamedRanges* ranges = nullptr;  // ranges that replace payloads; null: refused
  text::Fonts* fonts = nullptr;   // null: text is refused
  // Sums the memory of the request's converted primitives; null: not counted.
  uint64_t* decoded_bytes = nullptr;
  // Collects an Issue for each operation that is applied differently than requested; null: not
  // collected.
  std::vector<Fault>* notes = nullptr;

  // Most parts need only the limits.
  operator const Limits&() const { return limits; }  // NOLINT(google-explicit-constructor)
};

}  // namespace voxeld::daemon::wire
