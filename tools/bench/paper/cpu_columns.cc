#include <algorithm>
#include <thread>

#include "gpu/cpu/executor.h"
#include "gpu/generate/cpu_kernel.h"
#include "gpu/generate/generator.h"
#include "tools/bench/paper/column.h"

namespace voxeld::bench::paper {
namespace {

using gpu::generate::BytesOf;
using gpu::generate::Generator;

// Below this size one thread writes.
constexpr uint64_t kSharedBytes = (128 << 10) * 12;

class CpuColumn final : public Column {
 public:
  explicit CpuColumn(int threads)
      : threads_(threads),
        generator_(gpu::generate::MakeCpuGenerator(threads)),
        executor_(gpu::MakeExecutor(threads)) {}

  std::string engine() const override { return "cpu"; }
  int threads() const override { return threads_; }
  bool host_copy() const override { return true; }
  std::string call() const override { return "the whole call, from segments to voxels"; }
  std::string ceiling() const override { return "streaming stores of the same bytes"; }

  absl::Status Take(const Workload& workload) override {
    workload_ = &workload;
    bytes_ = workload.voxels * BytesOf(workload.format.output);
    chunk_ =
        bytes_ > kMostAtOnce ? Generator::kChunkVoxels * BytesOf(workload.format.output) : bytes_;
    out_.assign(chunk_, std::byte{1});
    return absl::OkStatus();
  }
  absl::Status Call() override {
    const auto plan = generator_->Prepare(workload_->segments, workload_->format);
    if (!plan.ok()) return plan.status();
    if (chunk_ == bytes_)
      return generator_->Generate(workload_->segments, *plan, workload_->format, out_);
    return generator_->Stream(workload_->segments, *plan, workload_->format,
                              Generator::kChunkVoxels,
                              [](uint64_t, auto) { return absl::OkStatus(); });
  }
  absl::Status Ceiling() override {
    for (uint64_t done = 0; done < bytes_; done += chunk_) {
      const uint64_t here = std::min(chunk_, bytes_ - done);
      if (here < kSharedBytes) {  // as the generator does
        gpu::generate::StreamingFill(std::span(out_).first(here), 7);
        continue;
      }
      const uint64_t each = (here / static_cast<uint64_t>(threads_) + 63) / 64 * 64;
      executor_->For(static_cast<size_t>(threads_), 1, [&](size_t i, int) {
        const uint64_t begin = std::min(here, i * each), end = std::min(here, begin + each);
        gpu::generate::StreamingFill(std::span(out_).subspan(begin, end - begin), 7);
      });
    }
    return absl::OkStatus();
  }
  void Release() override { out_ = {}; }

 private:
  const int threads_;
  const std::unique_ptr<Generator> generator_;
  const std::unique_ptr<gpu::Executor> executor_;
  const Workload* workload_ = nullptr;
  uint64_t bytes_ = 0, chunk_ = 0;
  std::vector<std::byte> out_;
};

}  // namespace

std::vector<std::unique_ptr<Column>> CpuColumns() {
  std::vector<std::unique_ptr<Column>> columns;
  columns.push_back(std::make_unique<CpuColumn>(1));
  const int all = static_cast<int>(std::thread::hardware_concurrency());
  if (all > 1) columns.push_back(std::make_unique<CpuColumn>(all));
  return columns;
}

}  // namespace voxeld::bench::paper
