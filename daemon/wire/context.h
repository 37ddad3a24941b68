// What every part of the decoder is given.
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
  gpu::BulkPool* pool = nullptr;  // where large arrays go; null: ordinary memory
  // What the bytes fields of Vertices name; null: they hold it themselves.
  const PayloadTable* payloads = nullptr;
  NamedRanges* ranges = nullptr;  // in place of payloads; null: they are refused
  text::Fonts* fonts = nullptr;   // null: text is refused
  // Of the request under way, what those primitives take that have become something else; null: nobody counts.
  uint64_t* decoded_bytes = nullptr;
  // What is taken otherwise than it was meant: an Issue each, of operations that are carried out; null: nobody hears.
  std::vector<Fault>* notes = nullptr;

  // Most parts ask for no more.
  operator const Limits&() const { return limits; }  // NOLINT(google-explicit-constructor)
};

}  // namespace voxeld::daemon::wire
