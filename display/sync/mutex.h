// Mutex, lock and condition variable with clang's thread-safety annotations, built on the standard
// library's. std primitives are instrumented by every sanitizer; a prebuilt third-party mutex is
// not.
//
// Thread-safe by definition; none of these is copyable or movable.
#pragma once

#include <condition_variable>
#include <mutex>

#if defined(__clang__)
#define VOXELD_TSA(x) __attribute__((x))
#else
#define VOXELD_TSA(x)
#endif

#define VOXELD_CAPABILITY(x) VOXELD_TSA(capability(x))
#define VOXELD_SCOPED_CAPABILITY VOXELD_TSA(scoped_lockable)
#define VOXELD_GUARDED_BY(x) VOXELD_TSA(guarded_by(x))
#define VOXELD_REQUIRES(...) VOXELD_TSA(requires_capability(__VA_ARGS__))
#define VOXELD_EXCLUDES(...) VOXELD_TSA(locks_excluded(__VA_ARGS__))
#define VOXELD_ACQUIRE(...) VOXELD_TSA(acquire_capability(__VA_ARGS__))
#define VOXELD_RELEASE(...) VOXELD_TSA(release_capability(__VA_ARGS__))
#define VOXELD_NO_THREAD_SAFETY_ANALYSIS VOXELD_TSA(no_thread_safety_analysis)

namespace voxeld::sync {

class VOXELD_CAPABILITY("mutex") Mutex {
 public:
  Mutex() = default;
  Mutex(const Mutex&) = delete;
  Mutex& operator=(const Mutex&) = delete;

  void Lock() VOXELD_ACQUIRE() { mutex_.lock(); }
  void Unlock() VOXELD_RELEASE() { mutex_.unlock(); }

 private:
  friend class CondVar;
  std::mutex mutex_;
};

// Holds `mutex` for the lifetime of the object.
class VOXELD_SCOPED_CAPABILITY MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) VOXELD_ACQUIRE(mutex) : mutex_(mutex) { mutex_.Lock(); }
  ~MutexLock() VOXELD_RELEASE() { mutex_.Unlock(); }
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

 private:
  Mutex& mutex_;
};

// Every wait may wake spuriously: call it in a loop that checks the condition. Timed waits go
// through a Clock (clock.h), so that a test can control time.
class CondVar {
 public:
  CondVar() = default;
  CondVar(const CondVar&) = delete;
  CondVar& operator=(const CondVar&) = delete;

  void NotifyOne() { cv_.notify_one(); }
  void NotifyAll() { cv_.notify_all(); }

  // `mutex` must be held; it is released while waiting and held again on return.
  void Wait(Mutex& mutex) VOXELD_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    cv_.wait(lock);
    lock.release();
  }

 private:
  friend class SystemClock;

  template <typename TimePoint>
  void WaitUntil(Mutex& mutex, const TimePoint& deadline) VOXELD_REQUIRES(mutex) {
    std::unique_lock<std::mutex> lock(mutex.mutex_, std::adopt_lock);
    cv_.wait_until(lock, deadline);
    lock.release();
  }

  std::condition_variable cv_;
};

}  // namespace voxeld::sync
