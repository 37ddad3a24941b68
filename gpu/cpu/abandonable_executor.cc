#include "gpu/cpu/abandonable_executor.h"

#include <stdexcept>
#include <utility>

namespace voxeld::gpu {
namespace {

class AbandonableExecutor final : public Executor {
 public:
  AbandonableExecutor(std::unique_ptr<Executor> executor,
                      std::shared_ptr<const std::atomic<bool>> abandoned)
      : executor_(std::move(executor)), abandoned_(std::move(abandoned)) {}

  int concurrency() const override { return executor_->concurrency(); }

  void For(size_t count, size_t grain, const Body& body) override {
    executor_->For(count, grain, [&](size_t index, int worker) {
      ThrowIfAbandoned();
      body(index, worker);
    });
  }

  void ThrowIfAbandoned() const override {
    if (abandoned_->load(std::memory_order_relaxed)) {
      throw std::runtime_error("the engine is being stopped");
    }
  }

 private:
  const std::unique_ptr<Executor> executor_;
  const std::shared_ptr<const std::atomic<bool>> abandoned_;
};

}  // namespace

std::unique_ptr<Executor> MakeAbandonableExecutor(
    std::unique_ptr<Executor> executor, std::shared_ptr<const std::atomic<bool>> abandoned) {
  return std::make_unique<AbandonableExecutor>(std::move(executor), std::move(abandoned));
}

}  // namespace voxeld::gpu
