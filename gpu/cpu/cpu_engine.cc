#include "gpu/cpu/cpu_engine.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/core_engine.h"
#include "gpu/cpu/abandonable_executor.h"
#include "gpu/cpu/cpu_core.h"

namespace voxeld::gpu {
namespace {

int ThreadCount(const EngineOptions& options) {
  if (options.threads > 0) return options.threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

EngineInfo InfoOf(int threads, std::string reason) {
  return {EngineKind::kCpu, absl::StrCat("CPU, ", threads, threads == 1 ? " thread" : " threads"),
          std::move(reason)};
}

}  // namespace

std::unique_ptr<Engine> CreateCpuEngine(const EngineOptions& options, std::string reason) {
  const int threads = ThreadCount(options);
  std::unique_ptr<Executor> executor = MakeExecutor(threads);
  if (options.abandoned != nullptr) {
    executor = MakeAbandonableExecutor(std::move(executor), options.abandoned);
  }
  return std::make_unique<CoreEngine<CpuCore>>(
      options, InfoOf(threads, std::move(reason)),
      std::make_unique<CpuCore>(
          std::move(executor), options.part,
          options.index_bytes != 0 ? options.index_bytes : options.cpu_index_bytes));
}

}  // namespace voxeld::gpu
