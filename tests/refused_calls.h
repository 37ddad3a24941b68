// System calls that fail when a test says so: in a library of its own, which is found before the C
// library's and passes on all other calls.
#pragma once

namespace voxeld {

enum class SystemCall {
  kEpollControl,
  kEpollCreate,
  kEventfd,
  kGetrandom,
  kMemfdCreate,
  kPthreadCreate,
  kSendmsg,
  kSocketpair,
};

// ThreadSanitizer's own pthread_create finds the C library's, bypassing this one.
#if defined(__SANITIZE_THREAD__)
inline constexpr bool kRefusesThreads = false;
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
inline constexpr bool kRefusesThreads = false;
#else
inline constexpr bool kRefusesThreads = true;
#endif
#else
inline constexpr bool kRefusesThreads = true;
#endif

// Refuses calls as long as it lives: those of the thread that made it, with one object at a time
// for each call.
class RefusedCalls {
 public:
  // The next `times` calls fail with `error`; later ones, and all others, do not.
  RefusedCalls(SystemCall call, int error, int times = 1);
  ~RefusedCalls();
  RefusedCalls(const RefusedCalls&) = delete;
  RefusedCalls& operator=(const RefusedCalls&) = delete;

  int made() const { return made_; }  // calls since then, failed or not

 private:
  friend struct RefusedPlan;
  const SystemCall call_;
  const int error_;
  int left_, made_ = 0;
};

}  // namespace voxeld
