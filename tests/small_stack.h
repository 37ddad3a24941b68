// Runs code on a thread with a small stack, to show that no input makes it recurse further.
#pragma once

#include <gtest/gtest.h>
#include <pthread.h>

#include <cstddef>
#include <functional>

namespace voxeld {

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define VOXELD_LARGE_FRAMES
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__OPTIMIZE__)
#define VOXELD_LARGE_FRAMES
#endif

// Frames are several times as large under a sanitizer and where nothing is optimised.
#ifdef VOXELD_LARGE_FRAMES
inline constexpr size_t kSmallStack = size_t{512} << 10;
#else
inline constexpr size_t kSmallStack = size_t{64} << 10;
#endif

// Runs `work` and waits for it. A stack overflow terminates the process by SIGSEGV at the thread's guard page.
inline void OnSmallStack(std::function<void()> work, size_t stack_bytes = kSmallStack) {
  pthread_attr_t attributes;
  ASSERT_EQ(pthread_attr_init(&attributes), 0);
  ASSERT_EQ(pthread_attr_setstacksize(&attributes, stack_bytes), 0);
  pthread_t thread;
  const int started = pthread_create(
      &thread, &attributes,
      [](void* argument) -> void* {
        (*static_cast<std::function<void()>*>(argument))();
        return nullptr;
      },
      &work);
  pthread_attr_destroy(&attributes);
  ASSERT_EQ(started, 0);
  ASSERT_EQ(pthread_join(thread, nullptr), 0);
}

}  // namespace voxeld
