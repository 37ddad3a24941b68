// Memory for what assembly derives anew in each frame.
#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <type_traits>

namespace voxeld::gpu {

// Bytes as the system gives them: at cache lines, and large blocks in large pages where it has them, since rows of
// thousands of tiles are written in turns. Throws std::bad_alloc.
struct PageFree {
  void operator()(void* memory) const;
};
using PageMemory = std::unique_ptr<void, PageFree>;
PageMemory AllocatePages(size_t bytes);

// An array that grows without a look at what is in it.
template <typename T>
class Buffer {
  static_assert(std::is_trivially_copyable_v<T> && alignof(T) <= 64);

 public:
  // Room for `more` behind the first `size`, which stay.
  void Reserve(size_t size, size_t more) {
    if (size + more > capacity_) Grow(size, more);
  }
  // Room for `size`, with nothing kept; what is far too much is given back.
  void Make(size_t size) {
    if (size <= capacity_ && capacity_ / 4 <= size + kSmall) return;
    memory_.reset();
    capacity_ = 0;
    if (size > 0) Grow(0, size);
  }
  T* data() { return static_cast<T*>(memory_.get()); }
  const T* data() const { return static_cast<const T*>(memory_.get()); }
  size_t capacity_bytes() const { return capacity_ * sizeof(T); }

 private:
  static constexpr size_t kSmall = 1024;

  void Grow(size_t size, size_t more) {
    const size_t capacity = size + more + size / 2;
    PageMemory next = AllocatePages(capacity * sizeof(T));
    if (size > 0) std::memcpy(next.get(), memory_.get(), size * sizeof(T));
    memory_ = std::move(next);
    capacity_ = capacity;
  }

  PageMemory memory_;
  size_t capacity_ = 0;
};

}  // namespace voxeld::gpu
