// A hand-written encoder of protobuf's wire format: messages are ropes, whose large payloads are
// shared with their owners and never copied.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld::client {

// A sequence of byte chunks. Copies share the payloads.
class Rope {
 public:
  struct Chunk {
    std::string text;                   // if `owner` is null
    std::shared_ptr<const void> owner;  // owns what `shared` points to
    std::string_view shared;
    std::string_view bytes() const { return owner == nullptr ? std::string_view(text) : shared; }
  };

  Rope() = default;
  explicit Rope(std::string text) : head_(std::move(text)), size_(head_.size()) {}

  size_t size() const { return size_; }
  void Append(std::string_view text);
  void Append(const Rope& rope);
  void AppendShared(std::shared_ptr<const void> owner, std::string_view bytes);
  void Prepend(std::string_view text);

  // In order; the first may be empty.
  const std::string& head() const { return head_; }
  const std::vector<Chunk>& tail() const { return tail_; }
  std::string Flat() const;

 private:
  std::string head_;
  std::vector<Chunk> tail_;
  size_t size_ = 0;
};

// Each appends one field. Fields with their default value are left out, except by Present….
void AppendVarint(uint64_t value, std::string* out);
void AppendUnsigned(int field, uint64_t value, std::string* out);
void AppendSigned(int field, int64_t value, std::string* out);  // int64
void AppendPresentUnsigned(int field, uint64_t value, std::string* out);
void AppendPresentZigzag(int field, int32_t value, std::string* out);  // sint32
void AppendDouble(int field, double value, std::string* out);
void AppendFloat(int field, float value, std::string* out);
void AppendFixed32(int field, uint32_t value, std::string* out);
void AppendBytes(int field, std::string_view value, std::string* out);
// Appends the field even if it is empty: for oneofs and messages.
void AppendPresentBytes(int field, std::string_view value, std::string* out);

// Returns `before` followed by `inner` as the message field `field`.
Rope Wrap(std::string_view before, int field, Rope inner);

}  // namespace voxeld::client
