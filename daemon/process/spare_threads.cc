#include "daemon/process/spare_threads.h"

#include <dlfcn.h>
#include <pthread.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {
namespace {

using Start = void* (*)(void*);
using Create = int (*)(pthread_t*, const pthread_attr_t*, Start, void*);

Create System() {
  static const auto create = reinterpret_cast<Create>(dlsym(RTLD_NEXT, "pthread_create"));
  return create;
}

// One thread that waits. Of a process there is one pthread_create, hence one pool of them.
struct Spare {
  enum class State { kNone, kWaits, kHasWork, kEnds };
  State state = State::kNone;
  pthread_t thread = {};
  Start start = nullptr;
  void* argument = nullptr;
};

struct Pool {
  sync::Mutex mutex;
  sync::CondVar changed;
  std::array<Spare, SpareThreads::kMost> spares VOXELD_GUARDED_BY(mutex);
  int wanted VOXELD_GUARDED_BY(mutex) = 0;
  std::atomic<int> missing = 0;
  std::atomic<uint64_t> taken = 0;
  std::atomic<uint64_t> told = 0;  // of those
};

// Never destroyed: who ends last may still begin a thread.
Pool& ThePool() {
  static auto* const pool = new Pool;
  return *pool;
}

void* Wait(void* slot) {
  Pool& pool = ThePool();
  Start start = nullptr;
  void* argument = nullptr;
  {
    sync::MutexLock lock(pool.mutex);
    Spare& spare = pool.spares[reinterpret_cast<size_t>(slot)];
    while (spare.state == Spare::State::kWaits) pool.changed.Wait(pool.mutex);
    if (spare.state == Spare::State::kEnds) return nullptr;
    start = spare.start;
    argument = spare.argument;
    spare = {};
  }
  return start(argument);
}

// As pthread_create, of a thread that waits; false: there is none. Under a sanitizer nobody asks.
[[maybe_unused]] bool Take(pthread_t* thread, const pthread_attr_t* attributes, Start start,
                           void* argument) {
  Pool& pool = ThePool();
  int detached = PTHREAD_CREATE_JOINABLE;
  if (attributes != nullptr) pthread_attr_getdetachstate(attributes, &detached);
  sync::MutexLock lock(pool.mutex);
  const auto spare = std::find_if(pool.spares.begin(), pool.spares.end(), [](const Spare& each) {
    return each.state == Spare::State::kWaits;
  });
  if (spare == pool.spares.end()) return false;
  *thread = spare->thread;
  if (detached == PTHREAD_CREATE_DETACHED) pthread_detach(spare->thread);
  spare->start = start;
  spare->argument = argument;
  spare->state = Spare::State::kHasWork;
  ++pool.taken;
  ++pool.missing;
  pool.changed.NotifyAll();
  return true;
}

// Begins those that are missing; false: the system does not give them.
bool Fill(Pool& pool) VOXELD_REQUIRES(pool.mutex) {
  int waiting = 0;
  for (const Spare& each : pool.spares) waiting += each.state == Spare::State::kWaits;
  for (size_t i = 0; i < pool.spares.size() && waiting < pool.wanted; ++i) {
    Spare& spare = pool.spares[i];
    if (spare.state != Spare::State::kNone) continue;
    spare.state = Spare::State::kWaits;
    if (System()(&spare.thread, nullptr, Wait, reinterpret_cast<void*>(i)) != 0) {
      spare = {};
      break;
    }
    ++waiting;
  }
  pool.missing = pool.wanted - waiting;
  return waiting == pool.wanted;
}

}  // namespace

absl::Status SpareThreads::Begin(int count) {
  Pool& pool = ThePool();
  {
    sync::MutexLock lock(pool.mutex);
    pool.wanted = std::clamp(count, 1, kMost);
    if (Fill(pool)) return absl::OkStatus();
  }
  End();
  return absl::ResourceExhaustedError(absl::StrCat(
      "the system does not give the ", count,
      " threads that are kept for want; raise the limits of threads (ulimit -u, TasksMax=) or of "
      "memory (ulimit -v) that this process has"));
}

uint64_t SpareThreads::Refill() {
  Pool& pool = ThePool();
  sync::MutexLock lock(pool.mutex);
  if (pool.missing > 0) Fill(pool);
  const uint64_t taken = pool.taken;
  return taken - pool.told.exchange(taken);
}

void SpareThreads::End() {
  Pool& pool = ThePool();
  for (int i = 0; i < kMost; ++i) {
    pthread_t thread = {};
    {
      sync::MutexLock lock(pool.mutex);
      pool.wanted = 0;
      pool.missing = 0;
      Spare& spare = pool.spares[static_cast<size_t>(i)];
      if (spare.state != Spare::State::kWaits) continue;
      spare.state = Spare::State::kEnds;
      thread = spare.thread;
      pool.changed.NotifyAll();
    }
    pthread_join(thread, nullptr);
    sync::MutexLock lock(pool.mutex);
    pool.spares[static_cast<size_t>(i)] = {};
  }
}

int SpareThreads::waiting() {
  Pool& pool = ThePool();
  sync::MutexLock lock(pool.mutex);
  int waiting = 0;
  for (const Spare& each : pool.spares) waiting += each.state == Spare::State::kWaits;
  return waiting;
}

uint64_t SpareThreads::taken() { return ThePool().taken; }

}  // namespace voxeld::daemon

#ifdef VOXELD_OWN_PTHREAD_CREATE
// In the place of the C library's, for all of the process: a program's own symbols are found first.
extern "C" __attribute__((visibility("default"))) int pthread_create(
    pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
    void* argument) noexcept {
  using namespace voxeld::daemon;  // NOLINT(google-build-using-namespace)
  int error = System()(thread, attributes, start, argument);
  // Who asks may create many, one by another (oneTBB ends the process where it gets none): those in hand are for what lasts.
  if (error == EAGAIN) error = System()(thread, attributes, start, argument);
  return error == EAGAIN && Take(thread, attributes, start, argument) ? 0 : error;
}
#endif
