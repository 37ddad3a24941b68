#include "client/cpp/src/wire.h"

#include <bit>
#include <cstring>
#include <utility>

namespace voxeld::client {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie");

enum WireType : uint8_t { kVarint = 0, kFixed64 = 1, kLength = 2, kFixed32 = 5 };

void AppendTag(int field, WireType type, std::string* out) {
  AppendVarint(static_cast<uint64_t>(field) << 3 | type, out);
}

template <typename T>
void AppendRaw(T value, std::string* out) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof bytes);
}

}  // namespace

void Rope::Append(std::string_view text) {
  size_ += text.size();
  if (tail_.empty()) {
    head_.append(text);
  } else if (tail_.back().owner == nullptr) {
    tail_.back().text.append(text);
  } else {
    tail_.push_back({.text = std::string(text), .owner = nullptr, .shared = {}});
  }
}

void Rope::Append(const Rope& rope) {
  Append(rope.head_);
  for (const Chunk& chunk : rope.tail_) {
    if (chunk.owner == nullptr) {
      Append(chunk.text);
    } else {
      AppendShared(chunk.owner, chunk.shared);
    }
  }
}

void Rope::AppendShared(std::shared_ptr<const void> owner, std::string_view bytes) {
  size_ += bytes.size();
  tail_.push_back({.text = {}, .owner = std::move(owner), .shared = bytes});
}

void Rope::Prepend(std::string_view text) {
  size_ += text.size();
  head_.insert(0, text);
}

std::string Rope::Flat() const {
  std::string flat;
  flat.reserve(size_);
  flat += head_;
  for (const Chunk& chunk : tail_) flat += chunk.bytes();
  return flat;
}

void AppendVarint(uint64_t value, std::string* out) {
  for (; value >= 0x80; value >>= 7) out->push_back(static_cast<char>(value | 0x80));
  out->push_back(static_cast<char>(value));
}

void AppendUnsigned(int field, uint64_t value, std::string* out) {
  if (value != 0) AppendPresentUnsigned(field, value, out);
}

void AppendSigned(int field, int64_t value, std::string* out) {
  AppendUnsigned(field, static_cast<uint64_t>(value), out);
}

void AppendPresentUnsigned(int field, uint64_t value, std::string* out) {
  AppendTag(field, kVarint, out);
  AppendVarint(value, out);
}

void AppendPresentZigzag(int field, int32_t value, std::string* out) {
  const uint32_t bits = static_cast<uint32_t>(value);
  AppendPresentUnsigned(field, (bits << 1) ^ (value < 0 ? UINT32_MAX : 0), out);
}

void AppendDouble(int field, double value, std::string* out) {
  if (std::bit_cast<uint64_t>(value) == 0) return;
  AppendTag(field, kFixed64, out);
  AppendRaw(value, out);
}

void AppendFloat(int field, float value, std::string* out) {
  if (std::bit_cast<uint32_t>(value) == 0) return;
  AppendTag(field, kFixed32, out);
  AppendRaw(value, out);
}

void AppendFixed32(int field, uint32_t value, std::string* out) {
  if (value == 0) return;
  AppendTag(field, kFixed32, out);
  AppendRaw(value, out);
}

void AppendBytes(int field, std::string_view value, std::string* out) {
  if (!value.empty()) AppendPresentBytes(field, value, out);
}

void AppendPresentBytes(int field, std::string_view value, std::string* out) {
  AppendTag(field, kLength, out);
  AppendVarint(value.size(), out);
  out->append(value);
}

Rope Wrap(std::string_view before, int field, Rope inner) {
  std::string head(before);
  AppendTag(field, kLength, &head);
  AppendVarint(inner.size(), &head);
  inner.Prepend(head);
  return inner;
}

}  // namespace voxeld::client
