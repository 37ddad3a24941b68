#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include "gpu/cpu/executor.h"

namespace voxeld::gpu {
namespace {

class TbbExecutor final : public Executor {
 public:
  explicit TbbExecutor(int threads) : arena_(threads) {}

  int concurrency() const override { return arena_.max_concurrency(); }

  void For(size_t count, size_t grain, const Body& body) override {
    if (count <= grain) {
      for (size_t i = 0; i < count; ++i) body(i, 0);
      return;
    }
    using Range = oneapi::tbb::blocked_range<size_t>;
    arena_.execute([&] {
      oneapi::tbb::parallel_for(Range(0, count, grain < 1 ? 1 : grain), [&](const Range& range) {
        const int worker = oneapi::tbb::this_task_arena::current_thread_index();
        for (size_t i = range.begin(); i != range.end(); ++i) body(i, worker);
      });
    });
  }

 private:
  oneapi::tbb::task_arena arena_;
};

}  // namespace

std::unique_ptr<Executor> MakeExecutor(int threads) {
  if (threads <= 1) return MakeSerialExecutor();
  // The scheduler runs at most one thread per core, however many are requested.
  if (threads > oneapi::tbb::info::default_concurrency()) return MakeThreadExecutor(threads);
  return std::make_unique<TbbExecutor>(threads);
}

}  // namespace voxeld::gpu
