// What every allocation of the process comes by: operator new, and libraries in C, of which some abort when they get nothing.
// The C library's own allocator does the work; what it has no memory for is tried again as long as the reserve helps.
// The program defines the names that it would otherwise take from the C library, as that allows, under which its own are found
// as __libc_….
//
// Linked into programs alone, never into a library: where a sanitizer has its own allocator, and beside another C library,
// there is nothing here.
#include <malloc.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

#include "daemon/process/memory_reserve.h"

#if defined(__GLIBC__) && !defined(VOXELD_SANITIZED)

// NOLINTBEGIN(bugprone-reserved-identifier): the C library's own names.
extern "C" {
void* __libc_malloc(size_t bytes);
void* __libc_calloc(size_t count, size_t bytes);
void* __libc_realloc(void* memory, size_t bytes);
void* __libc_memalign(size_t alignment, size_t bytes);
}
// NOLINTEND(bugprone-reserved-identifier)

namespace {

using voxeld::daemon::MemoryReserve;

// After the first attempt. ENOMEM where there is none in the end.
template <typename Allocate>
[[gnu::noinline]] void* TryAgain(size_t bytes, Allocate allocate) noexcept {
  // More than there can be: nothing would help.
  if (bytes > PTRDIFF_MAX) return nullptr;
  for (unsigned attempt = 0; MemoryReserve::OfProcess().Help(bytes, attempt); ++attempt) {
    void* const memory = allocate();
    if (memory != nullptr) return memory;
  }
  errno = ENOMEM;
  return nullptr;
}

template <typename Allocate>
[[gnu::always_inline]] inline void* Try(size_t bytes, Allocate allocate) noexcept {
  void* const memory = allocate();
  return memory != nullptr ? memory : TryAgain(bytes, allocate);
}

bool IsPowerOfTwo(size_t number) { return number != 0 && (number & (number - 1)) == 0; }

}  // namespace

extern "C" {

__attribute__((visibility("default"))) void* malloc(size_t bytes) {
  return Try(bytes, [=] { return __libc_malloc(bytes); });
}

__attribute__((visibility("default"))) void* calloc(size_t count, size_t bytes) {
  size_t all = 0;
  if (__builtin_mul_overflow(count, bytes, &all)) all = SIZE_MAX;
  return Try(all, [=] { return __libc_calloc(count, bytes); });
}

__attribute__((visibility("default"))) void* realloc(void* memory, size_t bytes) {
  // That frees it, and answers nothing.
  if (memory != nullptr && bytes == 0) return __libc_realloc(memory, 0);
  return Try(bytes, [=] { return __libc_realloc(memory, bytes); });
}

__attribute__((visibility("default"))) void* memalign(size_t alignment, size_t bytes) {
  return Try(bytes, [=] { return __libc_memalign(alignment, bytes); });
}

__attribute__((visibility("default"))) void* aligned_alloc(size_t alignment, size_t bytes) {
  if (!IsPowerOfTwo(alignment)) {
    errno = EINVAL;
    return nullptr;
  }
  return memalign(alignment, bytes);
}

__attribute__((visibility("default"))) int posix_memalign(void** memory, size_t alignment,
                                                          size_t bytes) {
  if (!IsPowerOfTwo(alignment) || alignment % sizeof(void*) != 0) return EINVAL;
  void* const found = memalign(alignment, bytes);
  if (found == nullptr) return ENOMEM;
  *memory = found;
  return 0;
}

}  // extern "C"

// Who asks so copes; the C++ library's own would ask the handler first (EndWhenMemoryEnds).
void* operator new(size_t bytes, const std::nothrow_t&) noexcept { return malloc(bytes); }
void* operator new[](size_t bytes, const std::nothrow_t&) noexcept { return malloc(bytes); }
void* operator new(size_t bytes, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return memalign(static_cast<size_t>(alignment), bytes);
}
void* operator new[](size_t bytes, std::align_val_t alignment, const std::nothrow_t&) noexcept {
  return memalign(static_cast<size_t>(alignment), bytes);
}

__attribute__((constructor(101))) static void BeforeAllElse() {
  voxeld::daemon::EndWhenMemoryEnds();
}

#endif
