// Encodes arrays as bytes fields, or as ranges of assets in their place.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "client/cpp/src/wire.h"
#include "voxeld/drawing.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {

// Payloads smaller than this are copied into the message instead of being shared.
inline constexpr size_t kSharedBytes = 4096;

// Appends `values` as `field`, or as the MemoryRange `in_field` if they are an asset. Appends
// nothing for an empty array.
template <typename T>
void AppendPayload(int field, int in_field, const Array<T>& values, Rope* out) {
  if (values.empty()) return;
  if (values.asset().has_value()) {
    std::string range, tagged;
    AppendUnsigned(v1::MemoryRange::kSizeFieldNumber, values.asset()->size, &range);
    AppendBytes(v1::MemoryRange::kAssetFieldNumber, values.asset()->sha256, &range);
    AppendPresentBytes(in_field, range, &tagged);
    return out->Append(tagged);
  }
  const std::string_view bytes(reinterpret_cast<const char*>(values.view().data()),
                               values.view().size_bytes());
  std::string tag;
  AppendVarint(static_cast<uint64_t>(field) << 3 | 2, &tag);
  AppendVarint(bytes.size(), &tag);
  out->Append(tag);
  if (bytes.size() < kSharedBytes) {
    out->Append(bytes);
  } else if (values.owner() != nullptr) {
    out->AppendShared(values.owner(), bytes);
  } else {
    const auto copy = std::make_shared<const std::string>(bytes);
    out->AppendShared(copy, *copy);
  }
}

}  // namespace voxeld::client
