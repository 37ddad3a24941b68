// visualization_msgs as roscpp reads them.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <cstddef>
#include <memory>

namespace voxeld::ros1 {

// Generated messages require their allocator to have `rebind`, which C++20 removed from the
// standard one. It also limits the size of one array of a message, because lengths come from a
// publisher and are used before the rest is read.
template <typename T>
struct MessageAllocator : std::allocator<T> {
  static constexpr size_t kMostBytes = size_t{256} << 20;

  using value_type = T;
  template <typename U>
  struct rebind {
    using other = MessageAllocator<U>;
  };
  MessageAllocator() = default;
  template <typename U>
  MessageAllocator(const MessageAllocator<U>&) {}  // NOLINT: implicit, as an allocator's is
  size_t max_size() const { return kMostBytes / sizeof(T); }
};
template <>
struct MessageAllocator<void> {
  template <typename U>
  struct rebind {
    using other = MessageAllocator<U>;
  };
};

using Marker = visualization_msgs::Marker_<MessageAllocator<void>>;
using MarkerArray = visualization_msgs::MarkerArray_<MessageAllocator<void>>;
using Point = geometry_msgs::Point_<MessageAllocator<void>>;
using Color = std_msgs::ColorRGBA_<MessageAllocator<void>>;

}  // namespace voxeld::ros1
