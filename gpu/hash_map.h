// Hash maps and sets of what may lack memory (want_of_memory.h): Abseil's are left in no order when an allocation of theirs throws,
// so that theirs never does: it ends the process.
#pragma once

#include <cstddef>
#include <memory>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/container/flat_hash_set.h"
#include "gpu/want_of_memory.h"

namespace voxeld::gpu {

template <typename T>
struct NeverThrowing {
  using value_type = T;

  NeverThrowing() = default;
  template <typename Other>  // implicit: allocators convert into one another
  // NOLINTNEXTLINE(google-explicit-constructor)
  NeverThrowing(const NeverThrowing<Other>&) {}

  T* allocate(size_t count) noexcept {
    const WantOfMemory::IsTheEnd here;
    return std::allocator<T>().allocate(count);
  }
  void deallocate(T* memory, size_t count) { std::allocator<T>().deallocate(memory, count); }
  bool operator==(const NeverThrowing&) const { return true; }
};

template <typename Key, typename Value>
using HashMap = absl::flat_hash_map<Key, Value, typename absl::flat_hash_map<Key, Value>::hasher,
                                    typename absl::flat_hash_map<Key, Value>::key_equal,
                                    NeverThrowing<std::pair<const Key, Value>>>;
template <typename Key>
using HashSet =
    absl::flat_hash_set<Key, typename absl::flat_hash_set<Key>::hasher,
                        typename absl::flat_hash_set<Key>::key_equal, NeverThrowing<Key>>;

}  // namespace voxeld::gpu
