// The bytes of a transfer, in memory that the kernel may be able to read in place.
#pragma once

#include <cstddef>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <new>
#include <span>
#include <utility>

namespace voxeld::display {

// Thread-safe.
class TransferMemory {
 public:
  virtual ~TransferMemory() = default;
  // Never returns null; throws std::bad_alloc.
  virtual void* Allocate(size_t bytes) = 0;
  virtual void Free(void* memory, size_t bytes) noexcept = 0;
};

// Grows like a vector. Moving it moves its memory, which is returned to its owner and keeps the
// owner alive; a copy uses ordinary memory. It is a range of bytes and converts to a span.
class TransferBytes {
 public:
  TransferBytes() = default;
  explicit TransferBytes(std::shared_ptr<TransferMemory> memory) : memory_(std::move(memory)) {}
  explicit TransferBytes(size_t size) { resize(size); }
  explicit TransferBytes(std::span<const std::byte> bytes) { Append(bytes); }
  TransferBytes(std::initializer_list<std::byte> bytes) { Append(std::span(bytes)); }
  TransferBytes(const TransferBytes& other) { Append(other); }
  TransferBytes(TransferBytes&& other) noexcept { swap(other); }
  TransferBytes& operator=(TransferBytes other) noexcept {
    swap(other);
    return *this;
  }
  ~TransferBytes() { Release(data_, capacity_); }

  void swap(TransferBytes& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  std::byte* data() { return data_; }
  const std::byte* data() const { return data_; }
  size_t size() const { return size_; }
  size_t capacity() const { return capacity_; }
  bool empty() const { return size_ == 0; }
  std::byte* begin() { return data_; }
  std::byte* end() { return data_ + size_; }
  const std::byte* begin() const { return data_; }
  const std::byte* end() const { return data_ + size_; }
  std::byte& operator[](size_t i) { return data_[i]; }
  const std::byte& operator[](size_t i) const { return data_[i]; }

  void clear() { size_ = 0; }
  void reserve(size_t capacity) {
    if (capacity <= capacity_) return;
    auto* const grown = static_cast<std::byte*>(memory_ != nullptr ? memory_->Allocate(capacity)
                                                                   : ::operator new(capacity));
    if (size_ > 0) std::memcpy(grown, data_, size_);
    Release(std::exchange(data_, grown), std::exchange(capacity_, capacity));
  }
  // New bytes are 0.
  void resize(size_t size) {
    Grow(size);
    if (size > size_) std::memset(data_ + size_, 0, size - size_);
    size_ = size;
  }
  // Requires: `bytes` lie elsewhere.
  void Append(std::span<const std::byte> bytes) {
    if (bytes.empty()) return;
    Grow(size_ + bytes.size());
    std::memcpy(data_ + size_, bytes.data(), bytes.size());
    size_ += bytes.size();
  }
  void push_back(std::byte byte) { Append(std::span(&byte, 1)); }

 private:
  void Grow(size_t size) {
    if (size > capacity_) reserve(size > 2 * capacity_ ? size : 2 * capacity_);
  }
  void Release(std::byte* data, size_t capacity) noexcept {
    if (data == nullptr) return;
    if (memory_ != nullptr) {
      memory_->Free(data, capacity);
    } else {
      ::operator delete(data);
    }
  }

  std::shared_ptr<TransferMemory> memory_;
  std::byte* data_ = nullptr;
  size_t size_ = 0, capacity_ = 0;
};

}  // namespace voxeld::display
