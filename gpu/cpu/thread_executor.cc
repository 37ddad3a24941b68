#include <atomic>
#include <exception>
#include <thread>
#include <utility>
#include <vector>

#include "display/sync/mutex.h"
#include "gpu/cpu/executor.h"

namespace voxeld::gpu {
namespace {

class SerialExecutor final : public Executor {
 public:
  int concurrency() const override { return 1; }
  void For(size_t count, size_t, const Body& body) override {
    for (size_t i = 0; i < count; ++i) body(i, 0);
  }
};

class ThreadExecutor final : public Executor {
 public:
  explicit ThreadExecutor(int threads) {
    try {
      for (int worker = 1; worker < threads; ++worker) {
        threads_.emplace_back([this, worker] { Run(worker); });
      }
    } catch (...) {  // the threads that did start are waiting for work
      End();
      throw;
    }
  }
  ~ThreadExecutor() override { End(); }

  int concurrency() const override { return static_cast<int>(threads_.size()) + 1; }

  void For(size_t count, size_t grain, const Body& body) override {
    if (count <= grain || threads_.empty()) {
      for (size_t i = 0; i < count; ++i) body(i, 0);
      return;
    }
    {
      sync::MutexLock lock(mutex_);
      body_ = &body;
      count_ = count;
      grain_ = grain < 1 ? 1 : grain;
      next_ = 0;
      busy_ = threads_.size();
      thrown_ = nullptr;
      ++loop_;
    }
    begin_.NotifyAll();
    Work(body, count, grain_, 0);
    sync::MutexLock lock(mutex_);
    while (busy_ != 0) end_.Wait(mutex_);
    if (thrown_ != nullptr) std::rethrow_exception(std::exchange(thrown_, nullptr));
  }

 private:
  void End() {
    {
      sync::MutexLock lock(mutex_);
      stopping_ = true;
    }
    begin_.NotifyAll();
    for (std::thread& thread : threads_) thread.join();
  }

  void Work(const Body& body, size_t count, size_t grain, int worker) {
    try {
      for (size_t first = next_.fetch_add(grain); first < count; first = next_.fetch_add(grain)) {
        const size_t last = first + grain < count ? first + grain : count;
        for (size_t i = first; i < last; ++i) body(i, worker);
      }
    } catch (...) {
      next_ = count;  // stops the other workers
      sync::MutexLock lock(mutex_);
      if (thrown_ == nullptr) thrown_ = std::current_exception();
    }
  }

  void Run(int worker) {
    uint64_t seen = 0;
    for (;;) {
      const Body* body;
      size_t count, grain;
      {
        sync::MutexLock lock(mutex_);
        while (loop_ == seen && !stopping_) begin_.Wait(mutex_);
        if (stopping_) return;
        seen = loop_;
        body = body_;
        count = count_;
        grain = grain_;
      }
      Work(*body, count, grain, worker);
      sync::MutexLock lock(mutex_);
      if (--busy_ == 0) end_.NotifyOne();
    }
  }

  sync::Mutex mutex_;
  sync::CondVar begin_, end_;
  const Body* body_ VOXELD_GUARDED_BY(mutex_) = nullptr;
  size_t count_ VOXELD_GUARDED_BY(mutex_) = 0;
  size_t busy_ VOXELD_GUARDED_BY(mutex_) = 0;  // threads that have not finished this loop
  uint64_t loop_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool stopping_ VOXELD_GUARDED_BY(mutex_) = false;
  std::exception_ptr thrown_ VOXELD_GUARDED_BY(mutex_);  // the first exception of this loop
  size_t grain_ = 1;  // written under the lock between loops only
  std::atomic<size_t> next_{0};
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<Executor> MakeSerialExecutor() { return std::make_unique<SerialExecutor>(); }

std::unique_ptr<Executor> MakeThreadExecutor(int threads) {
  return std::make_unique<ThreadExecutor>(threads);
}

#ifndef VOXELD_GPU_TBB
std::unique_ptr<Executor> MakeExecutor(int threads) {
  return threads <= 1 ? MakeSerialExecutor() : MakeThreadExecutor(threads);
}
#endif

}  // namespace voxeld::gpu
