// Calls that the system refuses when a test says so: in a library of its own, which is found before the C library's and passes on what
// is not refused.
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

// ThreadSanitizer's own pthread_create finds the C library's past this one.
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

// As long as it lives: of the thread that made it, and of each call one at a time.
class RefusedCalls {
 public:
  // The next `times` fail with `error`; those that come after them, and all others, do not.
  RefusedCalls(SystemCall call, int error, int times = 1);
  ~RefusedCalls();
  RefusedCalls(const RefusedCalls&) = delete;
  RefusedCalls& operator=(const RefusedCalls&) = delete;

  int made() const { return made_; }  // since, whatever came of them

 private:
  friend struct RefusedPlan;
  const SystemCall call_;
  const int error_;
  int left_, made_ = 0;
};

}  // namespace voxeld
